//! Derivatives of epsilon against finite differences, and its Lipschitz bounds against jumps.

use nalgebra::{Rotation3, Unit};

use super::*;

/// A contact moved, tilted and with other friction.
fn changed(c: &Contact, step: &Vector3<f64>, tilt: &Vector3<f64>, rougher: f64) -> Contact {
    let normal = c.inward_normal_in_object().into_inner();
    // Tilting by a vector across the normal: turning about their cross product.
    let turn = Rotation3::new(normal.cross(tilt));
    let contact = Contact::new(c.point_in_object() + step, turn * normal, c.friction() + rougher).unwrap();
    contact.with_torsion(c.torsional_m()).and_then(|new| new.with_max_force(c.max_force_n())).unwrap()
}

fn vector(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0))
}

/// Changes of all contacts at once, in every way: the steps, and what the gradient says of them.
struct Change {
    steps: Vec<(Vector3<f64>, Vector3<f64>, f64)>,
    rate: f64,
}

impl Change {
    fn random(rng: &mut ChaCha8Rng, contacts: &[Contact], gradient: &[ContactGradient]) -> Self {
        let mut rate = 0.0;
        let mut steps = Vec::new();
        for (contact, gradient) in contacts.iter().zip(gradient) {
            let normal: Unit<Vector3<f64>> = contact.inward_normal_in_object();
            let (step, any, rougher) = (vector(rng), vector(rng), rng.random_range(-1.0..1.0));
            let tilt = any - normal.into_inner() * normal.dot(&any);
            rate += gradient.point_per_m.dot(&step)
                + gradient.normal_per_rad.dot(&tilt)
                + gradient.friction * rougher;
            steps.push((step, tilt, rougher));
        }
        Self { steps, rate }
    }

    fn apply(&self, contacts: &[Contact], size: f64) -> Vec<Contact> {
        let changed = |(c, (step, tilt, rougher)): (&Contact, &(Vector3<f64>, Vector3<f64>, f64))| {
            changed(c, &(step * size), &(tilt * size), rougher * size)
        };
        contacts.iter().zip(&self.steps).map(changed).collect()
    }
}

fn kinds() -> [(Settings, f64); 6] {
    let tight = Settings { tolerance: 1e-11, ..Settings::default() };
    [
        (Settings { tolerance: 0.0, ..edges(8) }, 0.0),
        (Settings { tolerance: 0.0, norm: Norm::LInf, ..edges(5) }, 0.0),
        (Settings { tolerance: 0.0, force_norm: ForceNorm::Edge, ..edges(4) }, 0.2),
        (tight, 0.0),
        (Settings { force_norm: ForceNorm::Edge, ..tight }, 0.2),
        (Settings { norm: Norm::LInf, ..tight }, 0.1),
    ]
}

#[test]
fn the_gradient_is_what_finite_differences_give() {
    let mut rng = rng(91);
    let (mut workspace, mut gradient) = (Workspace::new(), Vec::new());
    let reference = WrenchReference::new(Point3::new(0.05, -0.1, 0.2), 0.7).unwrap();
    let (mut smooth, mut kinks) = (0, 0);
    for (settings, torsional_m) in kinds() {
        for trial in 0..60 {
            let hard = random_grasp(&mut rng, 3 + trial % 3, 0.6);
            let contacts: Vec<Contact> = hard
                .iter()
                .map(|c| {
                    let soft = c.with_torsion(torsional_m).unwrap();
                    soft.with_max_force(rng.random_range(0.5..2.0)).unwrap()
                })
                .collect();
            let (found, slope) =
                evaluate_with_gradient(&contacts, &reference, &settings, &mut workspace, &mut gradient);
            if slope != Slope::Gradient {
                kinks += usize::from(slope == Slope::Subgradient);
                assert!(slope == Slope::Subgradient || gradient.is_empty());
                continue;
            }
            let whole = evaluate(&contacts, &reference, &settings, &mut workspace);
            assert_eq!(found.quality().map(|q| q.epsilon_low), whole.quality().map(|q| q.epsilon_low));
            for _ in 0..3 {
                let change = Change::random(&mut rng, &contacts, &gradient);
                let mut epsilon = |size: f64| {
                    let changed = change.apply(&contacts, size);
                    match evaluate(&changed, &reference, &settings, &mut workspace) {
                        Closure::Force(quality) => quality.epsilon_low,
                        other => other.quality().map_or(0.0, |q| q.epsilon_low),
                    }
                };
                // A smaller step has less curvature and is less often across a kink, but fewer digits.
                let error = [1e-4, 1e-5, 1e-6]
                    .map(|size| (epsilon(size) - epsilon(-size)) / (2.0 * size) - change.rate)
                    .into_iter()
                    .map(f64::abs)
                    .fold(f64::INFINITY, f64::min);
                let scale: f64 = gradient
                    .iter()
                    .map(|g| g.point_per_m.norm() + g.normal_per_rad.norm() + g.friction.abs())
                    .sum();
                assert!(
                    error < 2e-4 * scale,
                    "{settings:?}, {contacts:?}: off by {error} at {}",
                    change.rate
                );
                smooth += 1;
            }
        }
    }
    assert!(smooth > 400 && kinks < smooth / 10, "{smooth} {kinks}");
}

#[test]
fn symmetric_grasps_have_a_subgradient_and_open_ones_none() {
    let (mut workspace, mut gradient) = (Workspace::new(), vec![ContactGradient::default(); 9]);
    let settings = Settings { tolerance: 1e-4, ..Settings::default() };
    for contacts in [tetrahedron(0.4), equator(3, 0.4), equator(4, 0.8)] {
        for settings in [settings, edges(8)] {
            let (found, slope) =
                evaluate_with_gradient(&contacts, &reference(1.0), &settings, &mut workspace, &mut gradient);
            assert!(found.quality().is_some());
            assert_eq!((slope, gradient.len()), (Slope::Subgradient, contacts.len()));
            assert!(gradient.iter().all(|g| g.point_per_m.iter().all(|x| x.is_finite())));
        }
    }
    let open = &tetrahedron(0.4)[..2];
    let (found, slope) =
        evaluate_with_gradient(open, &reference(1.0), &settings, &mut workspace, &mut gradient);
    assert!(matches!(found, Closure::None(_)) && slope == Slope::None && gradient.is_empty());
}

#[test]
fn no_change_of_a_contact_changes_epsilon_by_more_than_its_bound() {
    let mut rng = rng(92);
    let mut workspace = Workspace::new();
    let reference = reference(0.7);
    for trial in 0..300 {
        let (settings, torsional_m) = kinds()[trial % 6];
        let settings = Settings { tolerance: settings.tolerance.max(1e-6), ..settings };
        let mut contacts = random_grasp(&mut rng, 4, 0.7);
        for contact in &mut contacts {
            *contact = contact.with_torsion(torsional_m).and_then(|c| c.with_max_force(1.5)).unwrap();
        }
        let mut epsilon = |contacts: &[Contact]| {
            let found = evaluate(contacts, &reference, &settings, &mut workspace);
            found.quality().map_or(0.0, |q| q.epsilon_low)
        };
        let before = epsilon(&contacts);
        let at = trial % contacts.len();
        let bounds = lipschitz(&contacts[at], &reference, &settings);
        let size = 10.0_f64.powf(rng.random_range(-3.0..0.0));
        let zero = Vector3::zeros();
        let normal = contacts[at].inward_normal_in_object();
        let across = normal.cross(&vector(&mut rng)).normalize() * size;
        let is_round = settings.cone == ConeModel::Exact;
        for (step, tilt, rougher, most) in [
            (vector(&mut rng).normalize() * size, zero, 0.0, bounds.point_per_m),
            (zero, across, 0.0, if is_round { bounds.normal_per_rad } else { f64::INFINITY }),
            (zero, zero, size, bounds.friction),
        ] {
            let mut other = contacts.clone();
            other[at] = changed(&contacts[at], &step, &tilt, rougher);
            let change = (epsilon(&other) - before).abs();
            assert!(change <= most * size + 3e-6, "trial {trial}: {change} for {most} x {size}");
        }
    }
}
