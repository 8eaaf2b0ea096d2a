//! What must hold for every grasp.

use nalgebra::{Rotation3, Vector6};

use super::*;

/// Tight, so that two roads to the same number can be compared.
fn tight() -> Settings {
    Settings { tolerance: 1e-8, ..Settings::default() }
}

/// Force-closed grasps, with their epsilon.
fn closed_grasps(seed: u64, wanted: usize) -> Vec<(Vec<Contact>, f64)> {
    let mut rng = rng(seed);
    let mut found = Vec::new();
    while found.len() < wanted {
        let contacts = random_grasp(&mut rng, 3 + found.len() % 3, 0.5);
        if let Closure::Force(quality) = measure(&contacts, 1.0, &tight()) {
            found.push((contacts, quality.epsilon_low));
        }
    }
    found
}

fn mapped(contacts: &[Contact], map: impl Fn(&Contact) -> Contact) -> Vec<Contact> {
    contacts.iter().map(map).collect()
}

fn with_friction(contact: &Contact, friction: f64) -> Contact {
    Contact::new(contact.point_in_object(), contact.inward_normal_in_object().into_inner(), friction).unwrap()
}

#[test]
fn scale_does_not_matter_when_the_torque_scale_goes_with_it() {
    for (contacts, expected) in closed_grasps(21, 20) {
        for scale in [1e-6, 0.05, 1e6] {
            let scaled = mapped(&contacts, |c| {
                let normal = c.inward_normal_in_object().into_inner();
                Contact::new(c.point_in_object() * scale, normal, c.friction()).unwrap()
            });
            let found = epsilon(&scaled, scale, &tight());
            assert!((found - expected).abs() < 2e-8 * expected, "scale {scale:e}: {found} for {expected}");
        }
    }
}

#[test]
fn exact_cones_turn_with_the_object() {
    let mut rng = rng(22);
    for (contacts, expected) in closed_grasps(22, 20) {
        let turn = Rotation3::new(Vector3::from_fn(|_, _| rng.random_range(-3.0..3.0)));
        let turned = mapped(&contacts, |c| {
            let normal = turn * c.inward_normal_in_object().into_inner();
            Contact::new(turn * c.point_in_object(), normal, c.friction()).unwrap()
        });
        let found = epsilon(&turned, 1.0, &tight());
        assert!((found - expected).abs() < 2e-8 * expected, "{found} for {expected}");
    }
}

#[test]
fn more_friction_more_torsion_and_more_contacts_never_hurt() {
    let mut rng = rng(23);
    for (contacts, before) in closed_grasps(23, 20) {
        let slack = 1.0 - 2e-8;
        let rougher = mapped(&contacts, |c| with_friction(c, c.friction() * 1.3));
        assert!(epsilon(&rougher, 1.0, &tight()) >= before * slack);
        let softer = mapped(&contacts, |c| c.with_torsion(0.1).unwrap());
        assert!(epsilon(&softer, 1.0, &tight()) >= before * slack);
        let mut more = contacts;
        more.push(random_contact(&mut rng, 0, 0.5));
        assert!(epsilon(&more, 1.0, &tight()) >= before * slack);
    }
}

#[test]
fn a_pyramid_inside_another_never_beats_it_nor_the_cone() {
    for (contacts, exact) in closed_grasps(24, 20) {
        let soft = mapped(&contacts, |c| c.with_torsion(0.2).unwrap());
        for contacts in [contacts, soft] {
            let of = |settings| epsilon(&contacts, 1.0, &Settings { tolerance: 1e-8, ..settings });
            let chain = [of(edges(4)), of(edges(8)), of(edges(16)), of(with_cone(ConeModel::Exact))];
            assert!(chain.windows(2).all(|w| w[0] <= w[1] * (1.0 + 2e-8) + 1e-11), "{chain:?} {exact}");
        }
    }
}

#[test]
fn the_bracket_holds_and_its_upper_end_is_a_reach() {
    for (contacts, exact) in closed_grasps(25, 30) {
        for tolerance in [1.0, 0.1, 1e-3, 1e-5] {
            let settings = Settings { tolerance, ..Settings::default() };
            let found = measure(&contacts, 1.0, &settings);
            let Closure::Force(quality) = found else { panic!("{found:?}") };
            let Quality { epsilon_low: low, epsilon_high: high, weakest_wrench, .. } = quality;
            assert!(0.0 < low && low <= exact * (1.0 + 1e-8) && exact <= high, "{low} {exact} {high}");
            assert!(high - low <= tolerance * high);
            let map = GraspMap::new(&contacts, &reference(1.0), settings.cone, settings.force_norm);
            let reach = map.reach(&weakest_wrench, settings.norm).unwrap();
            assert!((reach - high).abs() < 1e-14 && (weakest_wrench.norm() - 1.0).abs() < 1e-14);
        }
    }
}

#[test]
fn no_direction_reaches_less_than_epsilon() {
    let mut rng = rng(26);
    for (contacts, exact) in closed_grasps(26, 10) {
        let map = GraspMap::new(&contacts, &reference(1.0), ConeModel::Exact, ForceNorm::Normal);
        for _ in 0..10_000 {
            let u = Vector6::from_fn(|_, _| rng.random_range(-1.0..1.0_f64)).normalize();
            assert!(map.reach(&u, Norm::L1).unwrap() >= exact);
        }
    }
}

#[test]
fn every_refusal_comes_with_a_proof() {
    let mut rng = rng(27);
    let (mut refusals, mut workspace, reference) = (0, Workspace::new(), reference(1.0));
    let mut trial = 0_u32;
    while refusals < 2000 {
        trial += 1;
        let friction = rng.random_range(0.1..0.5);
        let contacts = random_grasp(&mut rng, 1 + (trial % 4) as usize, friction);
        let settings = [edges(4), edges(8), Settings::default()][(trial / 4 % 3) as usize];
        let norm = if trial.is_multiple_of(2) { Norm::L1 } else { Norm::LInf };
        let settings = Settings { norm, tolerance: 1e-2, ..settings };
        if let Closure::None(separation) = evaluate(&contacts, &reference, &settings, &mut workspace) {
            refusals += 1;
            assert!(separation.verify(&contacts, &reference, &settings), "trial {trial}: {separation:?}");
            // From the definition: force and torque of the worst corner of the cone, contact by contact.
            let (force, torque) =
                (separation.direction.fixed_rows::<3>(0), separation.direction.fixed_rows::<3>(3));
            for contact in &contacts {
                let g = force + torque.cross(&contact.point_in_object().coords);
                let n = contact.inward_normal_in_object();
                let along = n.dot(&g);
                let across = (g - n.into_inner() * along).norm();
                // A pyramid is inside the cone and holds the middle of it.
                let most = if settings.cone == ConeModel::Exact { contact.friction() * across } else { 0.0 };
                assert!(along + most < 1e-9, "trial {trial}: a contact reaches {}", along + most);
            }
        }
    }
}

#[test]
fn a_proof_for_another_grasp_is_refused() {
    let (contacts, _) = closed_grasps(28, 1).remove(0);
    let settings = Settings::default();
    let direction = Vector6::x();
    let forged = Separation { direction, margin: 0.1, reason: NoClosure::Separated, iterations: 1 };
    assert!(!forged.verify(&contacts, &reference(1.0), &settings));
    let nothing = Separation { direction: Vector6::zeros(), ..forged };
    assert!(!nothing.verify(&contacts, &reference(1.0), &settings));
}

#[test]
fn the_edge_convention_only_scales() {
    for (contacts, normal) in closed_grasps(29, 10) {
        let found = epsilon(&contacts, 1.0, &Settings { force_norm: ForceNorm::Edge, ..tight() });
        let expected = normal / 0.5_f64.hypot(1.0);
        assert!((found - expected).abs() < 2e-8 * expected, "{found} for {expected}");
    }
}

#[test]
fn a_floor_rejects_what_is_below_and_keeps_what_is_above() {
    let (mut workspace, reference, settings) = (Workspace::new(), reference(1.0), tight());
    for (contacts, exact) in closed_grasps(30, 30) {
        let whole = evaluate(&contacts, &reference, &settings, &mut workspace);
        let kept = evaluate_above(&contacts, &reference, &settings, exact * 0.999, &mut workspace);
        assert_eq!(kept, whole);
        let found = evaluate_above(&contacts, &reference, &settings, exact * 1.5, &mut workspace);
        let Closure::Below(rejected) = found else { panic!("{found:?}") };
        assert!(exact <= rejected.epsilon_high && rejected.epsilon_high < exact * 1.5);
        assert!(rejected.iterations <= whole.quality().unwrap().iterations);
    }
}

#[test]
fn a_threshold_is_answered_as_the_whole_measurement_answers_it() {
    let mut rng = rng(33);
    let (mut workspace, mut whole) = (Workspace::new(), Workspace::whole_polytope());
    let reference = reference(1.0);
    let (mut above, mut below, mut cheap, mut full) = (0, 0, 0, 0);
    for trial in 0..600 {
        let contacts = random_grasp(&mut rng, 3 + trial % 3, 0.6);
        let norm = if trial % 2 == 0 { Norm::L1 } else { Norm::LInf };
        let settings = [edges(8), tight()][trial / 2 % 2];
        let settings = Settings { norm, tolerance: 1e-6, ..settings };
        let measured = evaluate(&contacts, &reference, &settings, &mut whole);
        for share in [0.5, 0.97, 1.03, 2.0] {
            let exact = measured.quality().map_or(0.0, |q| q.epsilon_low);
            let threshold = if exact > 0.0 { exact * share } else { 0.05 };
            let found =
                evaluate_within(&contacts, &reference, &settings, &Limits::at(threshold), &mut workspace);
            match found {
                Closure::Above(q) => {
                    above += 1;
                    assert!(threshold <= q.epsilon_low && q.epsilon_low <= exact * (1.0 + 2e-6), "{q:?}");
                    assert!(exact <= q.epsilon_high, "{q:?} for {exact}");
                    cheap += q.iterations;
                    full += measured.quality().unwrap().iterations;
                }
                Closure::Below(q) => {
                    below += 1;
                    assert!(exact <= q.epsilon_high && q.epsilon_high < threshold, "{q:?} for {exact}");
                }
                Closure::None(proof) => {
                    assert!(exact == 0.0 && proof.verify(&contacts, &reference, &settings))
                }
                other => panic!("{other:?} for {exact}, threshold {threshold}"),
            }
        }
    }
    assert!(above > 200 && below > 200 && cheap < full, "{above} {below}, {cheap} queries for {full}");
    // Anything positive is enough: the question for closure alone.
    let contacts = tetrahedron(0.4);
    let limits = Limits { accept_above: Some(0.0), ..Limits::default() };
    let found = evaluate_within(&contacts, &reference, &tight(), &limits, &mut workspace);
    assert!(matches!(found, Closure::Above(q) if q.epsilon_low > 0.0), "{found:?}");
}

#[test]
fn a_used_workspace_changes_nothing() {
    let mut workspace = Workspace::new();
    for (contacts, _) in closed_grasps(31, 10) {
        for settings in [edges(5), tight(), Settings { norm: Norm::LInf, ..edges(8) }] {
            let reused = evaluate(&contacts, &reference(1.0), &settings, &mut workspace);
            assert_eq!(reused, measure(&contacts, 1.0, &settings));
        }
    }
}

/// Two soft fingers that face each other on the x axis, a unit apart from the centre of mass.
fn pinch(friction: f64, torsional_m: f64, max_force_n: f64) -> Vec<Contact> {
    let finger = |x: f64| {
        let hard = Contact::new(Point3::new(x, 0.0, 0.0), Vector3::x() * -x, friction).unwrap();
        hard.with_torsion(torsional_m).and_then(|c| c.with_max_force(max_force_n)).unwrap()
    };
    vec![finger(-1.0), finger(1.0)]
}

#[test]
fn two_soft_fingers_close_as_their_closed_form_says() {
    // Along u = (-d, a, 0; 0, 0, a) only the finger at -x has friction to give, 2 a friction - d, and the one at +x
    // pushes with d. The larger of both (L1) is least when they are equal; the sum of the positive ones (L-infinity),
    // when the first is 0. A wide torsional lever keeps the pure torque about x out of the minimum.
    // Any u turned about x does as well, so the minimum is a whole circle: three digits are cheap, six are not.
    for mu in [0.2_f64, 0.4, 0.8] {
        for (norm, force_n, expected) in [
            (Norm::L1, 1.0, mu / (2.0 + mu * mu).sqrt()),
            (Norm::LInf, 7.0, 7.0 * mu * (2.0 / (1.0 + 2.0 * mu * mu)).sqrt()),
        ] {
            let settings = Settings { norm, tolerance: 1e-3, ..Settings::default() };
            let found = measure(&pinch(mu, 2.0, force_n), 1.0, &settings);
            let Closure::Force(quality) = found else { panic!("{found:?}") };
            let bracket = quality.epsilon_low..=quality.epsilon_high * (1.0 + 1e-14);
            assert!(bracket.contains(&expected), "{norm:?}, friction {mu}: {expected}, {quality:?}");
        }
    }
}

#[test]
fn force_limits_bound_the_l_infinity_epsilon() {
    for (contacts, l1) in closed_grasps(32, 15) {
        let limited = |force_n: f64| mapped(&contacts, |c| c.with_max_force(force_n).unwrap());
        let settings = Settings { norm: Norm::LInf, tolerance: 1e-6, ..Settings::default() };
        let at_one = epsilon(&limited(1.0), 1.0, &settings);
        // Forces up to 1 each contain forces that sum to 1, and are contained in forces that sum to their number.
        let count = contacts.len() as f64;
        assert!(l1 * (1.0 - 1e-5) <= at_one && at_one <= count * l1 * (1.0 + 1e-5), "{l1} {at_one}");
        let at_ten = epsilon(&limited(10.0), 1.0, &settings);
        assert!((at_ten - 10.0 * at_one).abs() < 1e-5 * at_ten, "{at_one} {at_ten}");
    }
}
