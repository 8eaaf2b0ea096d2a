//! Grasps on the edge of what a grasp is.

use super::*;

fn reason(contacts: &[Contact], torque_scale_m: f64, settings: &Settings) -> NoClosure {
    let found = measure(contacts, torque_scale_m, settings);
    let Closure::None(separation) = found else { panic!("{found:?}") };
    assert!(separation.verify(contacts, &reference(torque_scale_m), settings), "{separation:?}");
    separation.reason
}

fn all_settings() -> Vec<Settings> {
    let mut all = Vec::new();
    for settings in [edges(3), edges(4), edges(8), Settings::default()] {
        for norm in [Norm::L1, Norm::LInf] {
            all.push(Settings { norm, tolerance: 1e-3, ..settings });
        }
    }
    all
}

fn contact(p: [f64; 3], n: [f64; 3], friction: f64) -> Contact {
    Contact::new(Point3::from(p), Vector3::from(n), friction).unwrap()
}

#[test]
fn too_few_contacts() {
    for settings in all_settings() {
        assert_eq!(reason(&[], 1.0, &settings), NoClosure::NoContacts);
        let one = [contact([-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], 0.4)];
        assert_eq!(reason(&one, 1.0, &settings), NoClosure::Separated);
        let soft = [one[0].with_torsion(0.1).unwrap()];
        assert_eq!(reason(&soft, 1.0, &settings), NoClosure::Separated);
    }
}

#[test]
fn two_hard_fingers_never_close_and_two_soft_ones_do() {
    let pinch =
        [contact([-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], 0.4), contact([1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], 0.4)];
    for settings in all_settings() {
        assert_eq!(reason(&pinch, 1.0, &settings), NoClosure::Flat, "{settings:?}");
        let soft = pinch.map(|c| c.with_torsion(0.05).unwrap());
        assert!(epsilon(&soft, 1.0, &settings) > 0.0, "{settings:?}");
    }
}

#[test]
fn hard_contacts_in_a_line() {
    // A rod from the inside of a tube: three collinear points cannot resist rotation about their line.
    let line = [
        contact([-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], 0.8),
        contact([0.3, 0.0, 0.0], [0.2, 1.0, 0.0], 0.8),
        contact([1.0, 0.0, 0.0], [-1.0, -0.1, 0.1], 0.8),
        contact([0.1, 0.0, 0.0], [0.0, -1.0, 0.3], 0.8),
    ];
    for settings in all_settings() {
        let found = measure(&line, 1.0, &settings);
        let Closure::None(separation) = found else { panic!("{settings:?}: {found:?}") };
        assert!(separation.verify(&line, &reference(1.0), &settings));
    }
}

#[test]
fn nearly_in_a_line_is_thin_but_not_wrong() {
    let mut rng = rng(41);
    for width in [1e-3, 1e-5, 1e-7, 1e-9, 1e-13] {
        for _ in 0..40 {
            let contacts: Vec<Contact> = (0..4)
                .map(|k| {
                    let y = Vector3::from_fn(|_, _| rng.random_range(-width..width));
                    let n = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
                    contact((Vector3::x() * (f64::from(k) - 1.5) + y).into(), n.into(), 0.8)
                })
                .collect();
            let exact = Settings { tolerance: 1e-4, ..Settings::default() };
            for settings in [exact, Settings { tolerance: 1e-4, ..edges(8) }] {
                match measure(&contacts, 1.0, &settings) {
                    // The reach along rotation about the line bounds epsilon, from above and by definition.
                    Closure::Force(q) | Closure::Below(q) | Closure::Above(q) | Closure::Unfinished(q) => {
                        assert!(
                            q.epsilon_low <= 4.0 * width && q.epsilon_low <= q.epsilon_high,
                            "{width:e} {q:?}"
                        );
                    }
                    Closure::None(s) => assert!(s.verify(&contacts, &reference(1.0), &settings)),
                }
            }
        }
    }
}

#[test]
fn contacts_on_one_face() {
    let face = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.5, 0.5]]
        .map(|[x, y]| contact([x, y, 0.0], [0.0, 0.0, 1.0], 0.4));
    for settings in all_settings() {
        assert_eq!(reason(&face, 1.0, &settings), NoClosure::Separated);
    }
}

#[test]
fn repeated_contacts_change_nothing() {
    for settings in all_settings() {
        let settings = Settings { norm: Norm::L1, tolerance: 1e-5, ..settings };
        let once = epsilon(&tetrahedron(0.4), 1.0, &settings);
        let thrice = [tetrahedron(0.4), tetrahedron(0.4), tetrahedron(0.4)].concat();
        let repeated = epsilon(&thrice, 1.0, &settings);
        assert!((once - repeated).abs() < 2e-5 * once, "{once} {repeated}");
    }
}

#[test]
fn without_friction_a_body_of_revolution_turns() {
    for settings in all_settings() {
        assert_eq!(reason(&tetrahedron(0.0), 1.0, &settings), NoClosure::Flat);
        let soft: Vec<_> = tetrahedron(0.0).iter().map(|c| c.with_torsion(0.1).unwrap()).collect();
        assert_eq!(reason(&soft, 1.0, &settings), NoClosure::Flat);
    }
}

#[test]
fn a_frictionless_fixture_needs_seven_contacts() {
    // Rotated pairs on the faces of a cube clamp it without friction; six of them, all but one, do not.
    let mut fixture = Vec::new();
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            for turn in [-0.5, 0.5] {
                let mut p = Vector3::ith(axis, side);
                p[(axis + 1) % 3] = side * turn;
                p[(axis + 2) % 3] = 0.1 * turn;
                fixture.push(Contact::new(Point3::from(p), Vector3::ith(axis, -side), 0.0).unwrap());
            }
        }
    }
    for settings in all_settings() {
        let clamped = epsilon(&fixture, 1.0, &settings);
        assert!(clamped > 0.01, "{clamped}");
        let six: Vec<_> = fixture.iter().step_by(2).copied().collect();
        assert!(matches!(measure(&six, 1.0, &settings), Closure::None(_)));
    }
}

#[test]
fn hardly_any_friction() {
    // Closed forms of the exact cone hold down to where rounding takes over.
    for friction in [1e-2, 1e-4, 1e-6, 1e-8] {
        let found = epsilon(&tetrahedron(friction), 1.0, &with_cone(ConeModel::Exact));
        let expected = friction / 2.0_f64.sqrt();
        assert!((found - expected).abs() < 1e-5 * expected + 1e-11, "friction {friction:e}: {found}");
    }
    let eight = [tetrahedron(1e-6), equator(4, 1e-6)].concat();
    assert!(measure(&eight, 1.0, &Settings::default()).quality().is_some());
    assert!(matches!(measure(&tetrahedron(1e-14), 1.0, &Settings::default()), Closure::None(_)));
}

#[test]
fn limits_of_the_settings_are_outcomes_too() {
    let contacts = tetrahedron(0.4);
    for max_iterations in [0, 1, 7, 8, 20] {
        let settings = Settings { max_iterations, ..Settings::default() };
        let found = measure(&contacts, 1.0, &settings);
        let Closure::Unfinished(quality) = found else { panic!("{max_iterations}: {found:?}") };
        let exact = 0.4 / 2.0_f64.sqrt();
        assert!(quality.epsilon_low <= exact && exact <= quality.epsilon_high, "{quality:?}");
        assert_eq!(quality.iterations, max_iterations.max(7));
    }
    for tolerance in [0.0, -1.0, f64::NAN] {
        let settings = Settings { tolerance, ..edges(8) };
        let found = measure(&contacts, 1.0, &settings);
        let Closure::Force(quality) = found else { panic!("{tolerance}: {found:?}") };
        assert!(quality.epsilon_high - quality.epsilon_low < 1e-11);
    }
}

#[test]
fn extreme_numbers_end_in_an_outcome() {
    let far = 1e9;
    let lengths = [0.0_f64, 1e-300, 1e-9, 1.0, far];
    for length in lengths {
        for (friction, scale) in [(0.0, 1e-9), (1e6, 1e-9), (0.4, far), (1e-300, 1.0)] {
            let contacts: Vec<Contact> = tetrahedron(friction)
                .iter()
                .map(|c| {
                    let p = c.point_in_object() * length.min(0.999 * far);
                    let n = c.inward_normal_in_object().into_inner();
                    Contact::new(p, n, friction).and_then(|c| c.with_torsion(length)).unwrap()
                })
                .collect();
            for settings in all_settings() {
                let settings = Settings { max_iterations: 60, ..settings };
                match measure(&contacts, scale, &settings) {
                    Closure::None(s) => assert!(s.verify(&contacts, &reference(scale), &settings)),
                    Closure::Force(q) | Closure::Below(q) | Closure::Above(q) | Closure::Unfinished(q) => {
                        assert!(q.epsilon_low.is_finite() && q.epsilon_low <= q.epsilon_high, "{q:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn references_that_are_none_are_refused() {
    use WrenchReferenceError as Error;
    for scale in [0.0, -1.0, 1e-10, 1e10, f64::NAN, f64::INFINITY] {
        assert!(matches!(WrenchReference::new(Point3::origin(), scale), Err(Error::TorqueScale(_))));
    }
    let nan = Point3::new(0.0, f64::NAN, 0.0);
    assert!(matches!(WrenchReference::new(nan, 1.0), Err(Error::CenterOfMass { .. })));
    assert!(WrenchReference::of_object(Point3::origin(), &[]).is_err());
    let cube = [Point3::new(1.0, 1.0, 1.0), Point3::new(-1.0, 1.0, 0.0)];
    let reference = WrenchReference::of_object(Point3::origin(), &cube).unwrap();
    assert!((reference.torque_scale_m() - 3.0_f64.sqrt()).abs() < 1e-15);
}
