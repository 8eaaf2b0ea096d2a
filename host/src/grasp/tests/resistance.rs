//! Resistance to a given wrench, against an interior point solver and closed forms.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettingsBuilder, DefaultSolver, IPSolver, NonnegativeConeT, SecondOrderConeT, SupportedConeT,
    ZeroConeT,
};
use nalgebra::{DMatrix, Matrix6x4, Vector6};

use super::*;

fn random_disturbance(rng: &mut ChaCha8Rng) -> Disturbance {
    let mut vector = || Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
    Disturbance::new(vector(), vector()).unwrap()
}

/// Rows of the wrench of a force at a contact, and of a unit moment about its normal, torques over `scale`.
fn grasp_matrix(contact: &Contact, scale: f64) -> Matrix6x4<f64> {
    let p = contact.point_in_object().coords / scale;
    let n = contact.inward_normal_in_object().into_inner();
    let column = |f: Vector3<f64>| {
        let t = p.cross(&f);
        Vector6::new(f.x, f.y, f.z, t.x, t.y, t.z)
    };
    let twist = Vector6::new(0.0, 0.0, 0.0, n.x, n.y, n.z) / scale;
    Matrix6x4::from_columns(&[column(Vector3::x()), column(Vector3::y()), column(Vector3::z()), twist])
}

/// The largest multiple of a disturbance that contact forces in exact cones balance, by a conic solver. The variables are
/// the multiple and, for each contact, normal force, two tangential forces and moment / torsional lever.
fn by_solver(contacts: &[Contact], scale: f64, norm: Norm, disturbance: &Disturbance) -> f64 {
    let count = contacts.len();
    let unknowns = 1 + 4 * count;
    let limits = if norm == Norm::L1 { 1 } else { count };
    let mut a = DMatrix::<f64>::zeros(6 + limits + 4 * count, unknowns);
    let mut b = vec![0.0; a.nrows()];
    let (f, t) = (disturbance.force_n(), disturbance.torque_nm() / scale);
    a.view_mut((0, 0), (6, 1)).copy_from(&Vector6::new(f.x, f.y, f.z, t.x, t.y, t.z));
    let mut cones: Vec<SupportedConeT<f64>> = vec![ZeroConeT(6), NonnegativeConeT(limits)];
    for (k, contact) in contacts.iter().enumerate() {
        let n = contact.inward_normal_in_object();
        // Any tangents will do for a round cone, so these are not those of the metric.
        let first = n.cross(&Vector3::new(0.3, -0.5, 0.8)).normalize();
        let second = n.cross(&first);
        let of_force = grasp_matrix(contact, scale);
        for (column, force) in [n.into_inner(), first, second].iter().enumerate() {
            let wrench = of_force.fixed_columns::<3>(0) * force;
            a.view_mut((0, 1 + 4 * k + column), (6, 1)).copy_from(&wrench);
        }
        let twist = of_force.column(3) * contact.torsional_m();
        a.view_mut((0, 4 + 4 * k), (6, 1)).copy_from(&twist);
        let limit = 6 + if norm == Norm::L1 { 0 } else { k };
        a[(limit, 1 + 4 * k)] = 1.0;
        b[limit] = if norm == Norm::L1 { 1.0 } else { contact.max_force_n() };
        let cone = 6 + limits + 4 * k;
        a[(cone, 1 + 4 * k)] = -contact.friction();
        for row in 1..4 {
            a[(cone + row, 1 + 4 * k + row)] = -1.0;
        }
        cones.push(SecondOrderConeT(4));
    }
    let rows: Vec<Vec<f64>> = a.row_iter().map(|row| row.iter().copied().collect()).collect();
    let mut objective = vec![0.0; unknowns];
    objective[0] = -1.0;
    solve(&objective, &rows, &b, &cones)
}

/// Checks forces and bounds from the definition, without the metric's own products.
fn check(contacts: &[Contact], scale: f64, settings: &Settings, disturbance: &Disturbance, found: &Balance) {
    let forces = found.contact_forces(contacts, &reference(scale), settings);
    let (f, t) = (disturbance.force_n(), disturbance.torque_nm() / scale);
    let target = Vector6::new(f.x, f.y, f.z, t.x, t.y, t.z);
    let mut left = target * found.factor_low;
    let mut total = 0.0;
    for (contact, force) in contacts.iter().zip(&forces) {
        let of_force = grasp_matrix(contact, scale);
        left += of_force.fixed_columns::<3>(0) * force.force_n + of_force.column(3) * force.torsion_nm;
        let n = contact.inward_normal_in_object();
        let normal = n.dot(&force.force_n);
        let tangential = (force.force_n - n.into_inner() * normal).norm();
        let torsion =
            if contact.torsional_m() > 0.0 { force.torsion_nm / contact.torsional_m() } else { 0.0 };
        assert!(
            normal >= 0.0 && tangential.hypot(torsion) <= contact.friction() * normal + 1e-12,
            "{force:?}"
        );
        assert!(settings.norm == Norm::L1 || normal <= contact.max_force_n() * (1.0 + 1e-12), "{force:?}");
        total += normal;
    }
    let size = if settings.norm == Norm::L1 { 1.0 } else { contacts.iter().map(Contact::max_force_n).sum() };
    assert!(left.norm() <= 1e-8 * size && (left.norm() - found.residual_n).abs() < 1e-9 * size, "{left}");
    assert!(settings.norm == Norm::LInf || total <= 1.0 + 1e-12, "{total}");
    // The dual: no unit normal force reaches farther along the limiting wrench than the bound.
    let u = found.limiting_wrench;
    let map = GraspMap::new(contacts, &reference(scale), settings.cone, settings.force_norm);
    let reach = map.reach(&u, settings.norm).unwrap().max(0.0);
    let along = -u.dot(&target);
    assert!((u.norm() - 1.0).abs() < 1e-12 && along > 0.0);
    assert!(reach <= found.factor_high * along * (1.0 + 1e-12), "{reach} {found:?}");
    assert!(found.factor_low <= found.factor_high);
}

#[test]
fn exact_cones_as_a_conic_solver_finds_them() {
    let mut rng = rng(71);
    let (mut balanced, mut none, mut workspace, mut queries) = (0, 0, Workspace::new(), 0);
    for trial in 0..400 {
        let mut contacts = random_grasp(&mut rng, 2 + trial % 4, 0.5);
        if trial % 3 == 0 {
            for contact in &mut contacts {
                *contact = contact.with_torsion(0.2).unwrap();
            }
        }
        for contact in &mut contacts {
            *contact = contact.with_max_force(rng.random_range(0.5..20.0)).unwrap();
        }
        let norm = if trial % 2 == 0 { Norm::L1 } else { Norm::LInf };
        let settings = Settings { norm, ..Settings::default() };
        let disturbance = random_disturbance(&mut rng);
        let expected = by_solver(&contacts, 1.0, norm, &disturbance);
        match resist(&contacts, &reference(1.0), &settings, &disturbance, &mut workspace) {
            Resistance::Balanced(found) => {
                balanced += 1;
                queries += found.iterations;
                check(&contacts, 1.0, &settings, &disturbance, &found);
                let slack = 1e-7 * expected.max(1e-2);
                assert!(found.factor_low <= expected + slack, "trial {trial}: {expected}, {found:?}");
                assert!(expected <= found.factor_high + slack, "trial {trial}: {expected}, {found:?}");
                assert!(found.factor_high - found.factor_low <= 1e-6 * found.factor_high, "{found:?}");
            }
            Resistance::None(proof) => {
                none += 1;
                assert!(expected < 1e-4, "trial {trial}: {expected}, {proof:?}");
                assert!(proof.verify(&contacts, &reference(1.0), &settings, &disturbance));
            }
            Resistance::Unfinished(found) => panic!("trial {trial}: {expected}, {found:?}"),
        }
    }
    assert!(balanced > 100 && none > 50, "{balanced} {none}");
    assert!(queries < 100 * balanced, "{} queries in the mean", queries / balanced);
}

/// The same for pyramids without torsion, as a linear program with a force along every edge.
fn by_linear_program(contacts: &[Contact], edge_count: u32, norm: Norm, disturbance: &Disturbance) -> f64 {
    let per_contact = edge_count as usize;
    let unknowns = 1 + per_contact * contacts.len();
    let limits = if norm == Norm::L1 { 1 } else { contacts.len() };
    let mut a = DMatrix::<f64>::zeros(6 + limits + unknowns, unknowns);
    let mut b = vec![0.0; a.nrows()];
    let (f, t) = (disturbance.force_n(), disturbance.torque_nm());
    a.view_mut((0, 0), (6, 1)).copy_from(&Vector6::new(f.x, f.y, f.z, t.x, t.y, t.z));
    for (k, contact) in contacts.iter().enumerate() {
        let n = contact.inward_normal_in_object();
        let axis = if n.x.abs() >= 0.9 { Vector3::y() } else { Vector3::x() };
        let first = n.cross(&axis).normalize();
        let limit = 6 + if norm == Norm::L1 { 0 } else { k };
        b[limit] = if norm == Norm::L1 { 1.0 } else { contact.max_force_n() };
        for edge in 0..per_contact {
            let (sin, cos) = (2.0 * PI * edge as f64 / f64::from(edge_count)).sin_cos();
            let force = n.into_inner() + (first * cos + n.cross(&first) * sin) * contact.friction();
            let wrench = grasp_matrix(contact, 1.0).fixed_columns::<3>(0) * force;
            let column = 1 + per_contact * k + edge;
            a.view_mut((0, column), (6, 1)).copy_from(&wrench);
            a[(limit, column)] = 1.0;
        }
    }
    for k in 0..unknowns {
        a[(6 + limits + k, k)] = -1.0;
    }
    let rows: Vec<Vec<f64>> = a.row_iter().map(|row| row.iter().copied().collect()).collect();
    let mut objective = vec![0.0; unknowns];
    objective[0] = -1.0;
    let cones = [ZeroConeT(6), NonnegativeConeT(limits + unknowns)];
    solve(&objective, &rows, &b, &cones)
}

fn solve(objective: &[f64], rows: &[Vec<f64>], b: &[f64], cones: &[SupportedConeT<f64>]) -> f64 {
    let settings = DefaultSettingsBuilder::default()
        .verbose(false)
        .tol_gap_abs(1e-10)
        .tol_gap_rel(1e-10)
        .tol_feas(1e-10)
        .build()
        .unwrap();
    let nothing = CscMatrix::zeros((objective.len(), objective.len()));
    let mut solver =
        DefaultSolver::new(&nothing, objective, &CscMatrix::from(rows), b, cones, settings).unwrap();
    solver.solve();
    solver.solution.x[0]
}

#[test]
fn pyramids_as_a_linear_program_finds_them() {
    let mut rng = rng(72);
    let mut workspace = Workspace::new();
    let mut balanced = 0;
    for trial in 0..300 {
        let norm = if trial % 2 == 0 { Norm::L1 } else { Norm::LInf };
        let edge_count = [4, 8, 5][trial / 2 % 3];
        let contacts = random_grasp(&mut rng, 2 + trial % 4, 0.7);
        let disturbance = random_disturbance(&mut rng);
        let settings = Settings { norm, tolerance: 0.0, ..edges(edge_count) };
        let expected = by_linear_program(&contacts, edge_count, norm, &disturbance);
        match resist(&contacts, &reference(1.0), &settings, &disturbance, &mut workspace) {
            Resistance::Balanced(found) => {
                balanced += 1;
                check(&contacts, 1.0, &settings, &disturbance, &found);
                for factor in [found.factor_low, found.factor_high] {
                    assert!((factor - expected).abs() < 1e-7 * expected.max(0.1), "{expected}, {found:?}");
                }
            }
            Resistance::None(proof) => {
                assert!(expected < 1e-6, "trial {trial}: {expected}, {proof:?}");
                assert!(proof.verify(&contacts, &reference(1.0), &settings, &disturbance));
            }
            Resistance::Unfinished(found) => panic!("trial {trial}: {expected}, {found:?}"),
        }
    }
    assert!(balanced > 80, "{balanced}");
}

fn balanced(contacts: &[Contact], settings: &Settings, force: [f64; 3], torque: [f64; 3]) -> Balance {
    let disturbance = Disturbance::new(force.into(), torque.into()).unwrap();
    let found = resist(contacts, &reference(1.0), settings, &disturbance, &mut Workspace::new());
    let Resistance::Balanced(balance) = found else { panic!("{found:?}") };
    check(contacts, 1.0, settings, &disturbance, &balance);
    balance
}

fn unbalanced(contacts: &[Contact], settings: &Settings, force: [f64; 3], torque: [f64; 3]) -> Unbalanced {
    let disturbance = Disturbance::new(force.into(), torque.into()).unwrap();
    let found = resist(contacts, &reference(1.0), settings, &disturbance, &mut Workspace::new());
    let Resistance::None(proof) = found else { panic!("{found:?}") };
    assert!(proof.verify(contacts, &reference(1.0), settings, &disturbance), "{proof:?}");
    proof
}

#[test]
fn a_pinch_carries_by_friction_what_its_closed_form_says() {
    // Hard fingers: a flat set of wrenches without closure. Both push with half the force and hold the weight by friction;
    // with limits of 5 N they hold 2 mu 5 N. A load along their line only has the finger behind it against it.
    let finger = |x: f64| {
        let contact = Contact::new(Point3::new(x, 0.0, 0.0), Vector3::x() * -x, 0.4).unwrap();
        contact.with_max_force(5.0).unwrap()
    };
    let pinch = [finger(-1.0), finger(1.0)];
    let tight = Settings { tolerance: 1e-7, ..Settings::default() };
    let limited = Settings { norm: Norm::LInf, ..tight };
    for (settings, weight, along) in [(tight, 0.4, 1.0), (limited, 4.0, 5.0)] {
        let found = balanced(&pinch, &settings, [0.0, 0.0, -1.0], [0.0; 3]);
        assert!((found.factor_low - weight).abs() < 2e-7 * weight, "{found:?}");
        let found = balanced(&pinch, &settings, [0.0, 0.0, -10.0], [0.0; 3]);
        assert!((found.factor_low - weight / 10.0).abs() < 2e-7 * weight, "{found:?}");
        let found = balanced(&pinch, &settings, [1.0, 0.0, 0.0], [0.0; 3]);
        assert!((found.factor_low - along).abs() < 2e-7 * along, "{found:?}");
        // A moment about z is a pair of opposite friction forces at a lever of 1 m.
        let found = balanced(&pinch, &settings, [0.0; 3], [0.0, 0.0, 1.0]);
        assert!((found.factor_low - weight).abs() < 2e-7 * weight, "{found:?}");
        // Nothing turns about the line of the fingers, whatever else there is.
        unbalanced(&pinch, &settings, [0.0; 3], [1.0, 0.0, 0.0]);
        unbalanced(&pinch, &settings, [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]);
    }
    // At an even torsional lever e both fingers together bear mu e of moment per newton.
    let soft = pinch.map(|c| c.with_torsion(0.1).unwrap());
    let found = balanced(&soft, &tight, [0.0; 3], [1.0, 0.0, 0.0]);
    assert!((found.factor_low - 0.04).abs() < 1e-8, "{found:?}");
}

#[test]
fn fingers_below_carry_and_do_not_hold_down() {
    let below = [[1.0, 0.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, -1.0]]
        .map(|p| Contact::new(Point3::from(p), Vector3::z(), 0.3).unwrap());
    let settings = Settings::default();
    assert!(matches!(measure(&below, 1.0, &settings), Closure::None(_)));
    let found = balanced(&below, &settings, [0.0, 0.0, -1.0], [0.0; 3]);
    assert!((found.factor_low - 1.0).abs() < 1e-6, "{found:?}");
    unbalanced(&below, &settings, [0.0, 0.0, 1.0], [0.0; 3]);
    unbalanced(&below, &settings, [1.0, 0.0, 0.0], [0.0; 3]);
    unbalanced(&[], &settings, [1.0, 0.0, 0.0], [0.0; 3]);
}

#[test]
fn the_weakest_wrench_is_resisted_by_epsilon_and_no_wrench_by_less() {
    let mut rng = rng(73);
    let mut workspace = Workspace::new();
    let mut compared = 0;
    let mut grasps: Vec<_> = (0..120).map(|trial| random_grasp(&mut rng, 3 + trial % 3, 0.6)).collect();
    // Symmetric ones, where many wrenches are equally far out.
    grasps.extend([tetrahedron(0.4), equator(3, 0.4), equator(4, 0.8), equator(5, 0.4)]);
    for contacts in grasps {
        for settings in [edges(8), Settings { norm: Norm::LInf, tolerance: 1e-4, ..Settings::default() }] {
            let scale = 0.5;
            let Closure::Force(quality) = measure(&contacts, scale, &settings) else { continue };
            let against = |u: &Vector6<f64>| {
                let force = -u.fixed_rows::<3>(0).into_owned();
                let torque = -u.fixed_rows::<3>(3) * scale;
                Disturbance::new(force, torque).unwrap()
            };
            let mut factor = |u: &Vector6<f64>| {
                let found = resist(&contacts, &reference(scale), &settings, &against(u), &mut workspace);
                let Resistance::Balanced(balance) = found else { panic!("{contacts:?}: {found:?}") };
                balance
            };
            let found = factor(&quality.weakest_wrench);
            let slack = 1e-7 * quality.epsilon_high;
            assert!(found.factor_low <= quality.epsilon_high + slack, "{found:?}, {quality:?}");
            assert!(quality.epsilon_low <= found.factor_high + slack, "{found:?}, {quality:?}");
            for _ in 0..5 {
                let u = Vector6::from_fn(|_, _| rng.random_range(-1.0..1.0_f64)).normalize();
                assert!(factor(&u).factor_high >= quality.epsilon_low, "{quality:?}");
            }
            for k in 0..6 {
                assert!(factor(&Vector6::ith(k, 1.0)).factor_high >= quality.epsilon_low, "{quality:?}");
            }
            compared += 1;
        }
    }
    assert!(compared > 60, "{compared}");
}

#[test]
fn what_is_no_disturbance_is_refused_and_limits_are_outcomes() {
    let zero = Vector3::zeros();
    assert!(Disturbance::new(zero, zero).is_err());
    for x in [f64::NAN, f64::INFINITY, 1e10] {
        assert!(Disturbance::new(Vector3::new(0.0, x, 1.0), zero).is_err());
        assert!(Disturbance::new(Vector3::x(), Vector3::new(0.0, x, 1.0)).is_err());
    }
    let pull = Disturbance::new(Vector3::x(), zero).unwrap();
    for max_iterations in [0, 3, 8] {
        let settings = Settings { max_iterations, ..Settings::default() };
        let found = resist(&tetrahedron(0.4), &reference(1.0), &settings, &pull, &mut Workspace::new());
        let Resistance::Unfinished(balance) = found else { panic!("{found:?}") };
        assert!(balance.factor_low <= balance.factor_high && balance.iterations <= max_iterations);
    }
}
