//! How hard each finger presses: internal forces that balance, well inside the friction cones.

use nalgebra::{Vector3, Vector6};

use super::contact::Contact;
use super::wrench::{WrenchReference, tangents};

/// Edges of the cone that the tangential part is composed of.
const EDGES: usize = 8;

/// Share of the friction coefficient that the squeeze uses; the rest is left to the load and to errors.
const CONE_SHARE: f64 = 0.5;

/// Sweeps of the coordinate descent. With five contacts the residual stands still after some fifty.
const SWEEPS: usize = 400;

/// Weight of the forces' size against the wrench's: small, so that balance comes first, but enough to choose the least
/// forces among those that balance.
const RIDGE: f64 = 1e-4;

/// Contact forces of a squeeze.
#[derive(Debug, Clone, PartialEq)]
pub struct Grip {
    /// Force of each finger on the object, newtons, object frame, in the order of the contacts.
    pub forces_on_object_in_object: Vec<Vector3<f64>>,
    /// Length of the wrench that is left over (torque divided by the scale), as a share of the sum of normal forces: 0
    /// is a perfect balance.
    pub imbalance: f64,
}

/// Forces of every finger on the object whose sum, and whose moment about the centre of mass, vanish as nearly as the
/// cones allow, every finger pressing with at least half of the mean normal force `mean_normal_n` (newtons).
///
/// Non-negative least squares over the edges of half-width cones, by cyclic coordinate descent. `None` without contacts.
#[must_use]
pub fn balance(contacts: &[Contact], reference: &WrenchReference, mean_normal_n: f64) -> Option<Grip> {
    if contacts.is_empty() {
        return None;
    }
    let wrench = |contact: &Contact, force: &Vector3<f64>| {
        let arm =
            (contact.point_in_object() - reference.center_of_mass_in_object()) / reference.torque_scale_m();
        let torque = arm.cross(force);
        Vector6::new(force.x, force.y, force.z, torque.x, torque.y, torque.z)
    };
    // Columns: the edges of each contact, of unit normal force. Every finger presses with 1 at least.
    let edges: Vec<Vector3<f64>> = contacts
        .iter()
        .flat_map(|contact| {
            let normal = contact.inward_normal_in_object();
            let [first, second] = tangents(&normal);
            (0..EDGES).map(move |k| {
                let (sin, cos) = (std::f64::consts::TAU * k as f64 / EDGES as f64).sin_cos();
                normal.into_inner() + (first * cos + second * sin) * (CONE_SHARE * contact.friction())
            })
        })
        .collect();
    let columns: Vec<Vector6<f64>> =
        edges.iter().enumerate().map(|(j, edge)| wrench(&contacts[j / EDGES], edge)).collect();
    let mut forces: Vec<Vector3<f64>> =
        contacts.iter().map(|contact| contact.inward_normal_in_object().into_inner()).collect();
    let mut residual: Vector6<f64> = contacts.iter().zip(&forces).map(|(c, f)| wrench(c, f)).sum();

    let mut weights = vec![0.0; columns.len()];
    for _ in 0..SWEEPS {
        for (weight, column) in weights.iter_mut().zip(&columns) {
            let slope = column.dot(&residual) + RIDGE * *weight;
            let next = (*weight - slope / (column.norm_squared() + RIDGE)).max(0.0);
            residual += column * (next - *weight);
            *weight = next;
        }
    }
    for (j, weight) in weights.iter().enumerate() {
        forces[j / EDGES] += edges[j] * *weight;
    }
    let normal_sum: f64 =
        contacts.iter().zip(&forces).map(|(c, f)| f.dot(&c.inward_normal_in_object())).sum();
    let scale = mean_normal_n * contacts.len() as f64 / normal_sum;
    Some(Grip {
        imbalance: residual.norm() / normal_sum,
        forces_on_object_in_object: forces.into_iter().map(|force| force * scale).collect(),
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    fn reference(torque_scale_m: f64) -> WrenchReference {
        WrenchReference::new(Point3::origin(), torque_scale_m).unwrap()
    }

    fn contact(point: [f64; 3]) -> Contact {
        let point = Point3::from(point);
        Contact::new(point, -point.coords, 0.4).unwrap()
    }

    #[test]
    fn symmetric_contacts_share_the_load_alike() {
        let contacts: Vec<Contact> = (0..3)
            .map(|k| {
                let angle = std::f64::consts::TAU * f64::from(k) / 3.0;
                contact([angle.cos(), angle.sin(), 0.0])
            })
            .collect();
        let grip = balance(&contacts, &reference(1.0), 3.0).unwrap();
        assert!(grip.imbalance < 1e-3);
        for (force, contact) in grip.forces_on_object_in_object.iter().zip(&contacts) {
            assert!((force.dot(&contact.inward_normal_in_object()) - 3.0).abs() < 1e-2);
        }
    }

    #[test]
    fn one_thumb_balances_three_fingers_inside_half_the_cones() {
        let mut contacts = vec![Contact::new(Point3::new(-0.03, 0.0, 0.0), Vector3::x(), 0.4).unwrap()];
        for y in [-0.02, 0.0, 0.02] {
            contacts.push(Contact::new(Point3::new(0.03, y, 0.002), -Vector3::x(), 0.4).unwrap());
        }
        let grip = balance(&contacts, &reference(0.05), 2.0).unwrap();
        assert!(grip.imbalance < 0.02, "{}", grip.imbalance);
        let sum: Vector3<f64> = grip.forces_on_object_in_object.iter().sum();
        assert!(sum.norm() < 0.2, "{sum}");
        for (force, contact) in grip.forces_on_object_in_object.iter().zip(&contacts) {
            let normal = force.dot(&contact.inward_normal_in_object());
            let tangential = (force.norm_squared() - normal * normal).max(0.0).sqrt();
            assert!(normal > 0.0 && tangential <= 0.2 * normal + 1e-9);
        }
    }

    #[test]
    fn contacts_on_one_side_cannot_balance_and_say_so() {
        let contacts = [contact([1.0, 0.1, 0.0]), contact([1.0, -0.1, 0.0])];
        assert!(balance(&contacts, &reference(1.0), 1.0).unwrap().imbalance > 0.5);
        assert!(balance(&[], &reference(1.0), 1.0).is_none());
    }
}
