//! The support function of many contacts at once: four contacts fill the lanes of vector registers.

use nalgebra::{Vector3, Vector6};

use super::friction::FrictionSet;
use super::quality::Norm;
use super::wrench::WrenchBasis;

/// Contacts that are worked on together.
pub(super) const LANES: usize = 4;
/// One number for each of them.
pub(super) type Lanes = [f64; LANES];

/// The bases of four contacts: column by column, row by row, contact beside contact. Lanes to spare repeat the last
/// contact without any force, which changes neither a greatest reach nor a sum.
#[derive(Debug, Clone)]
struct Group {
    columns: [[Lanes; 6]; 4],
    limits_n: Lanes,
}

/// What the friction of four contacts does along a direction, and how far they reach.
struct Reach {
    /// Two tangential components and torsion.
    friction: [Lanes; 3],
    total: Lanes,
}

/// What one contact gives to the wrench that reaches farthest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Part {
    /// Its place among the contacts.
    pub(super) contact: usize,
    /// Normal force, in units of the norm.
    pub(super) force: f64,
    /// Friction per unit of normal force, as a point of the unit ball.
    pub(super) friction: Vector3<f64>,
}

/// Finds the wrench of a grasp that reaches farthest along a direction.
#[derive(Debug, Clone, Default)]
pub(super) struct Support {
    groups: Vec<Group>,
}

impl Support {
    /// Becomes that of other contacts, in the memory that it has.
    pub(super) fn assign(&mut self, bases: &[WrenchBasis], limits_n: &[f64]) {
        self.groups.clear();
        for (bases, limits_n) in bases.chunks(LANES).zip(limits_n.chunks(LANES)) {
            let last = bases.len() - 1;
            let columns = std::array::from_fn(|column| {
                std::array::from_fn(|row| std::array::from_fn(|lane| bases[lane.min(last)].0[(row, column)]))
            });
            let limits_n = std::array::from_fn(|lane| limits_n.get(lane).copied().unwrap_or(0.0));
            self.groups.push(Group { columns, limits_n });
        }
    }

    /// The wrench that reaches farthest; zero without contacts.
    pub(super) fn farthest(
        &self,
        direction: &Vector6<f64>,
        norm: Norm,
        friction: &FrictionSet,
    ) -> Vector6<f64> {
        let direction = <[f64; 6]>::from(*direction);
        match norm {
            Norm::L1 => {
                let (mut most, mut best) = (f64::NEG_INFINITY, None);
                for group in &self.groups {
                    let reach = group.reach(&direction, friction);
                    for lane in 0..LANES {
                        if reach.total[lane] > most {
                            most = reach.total[lane];
                            best = Some((group, lane, reach.friction.map(|along| along[lane])));
                        }
                    }
                }
                best.map_or_else(Vector6::zeros, |(group, lane, along)| group.wrench(lane, along, friction))
            }
            Norm::LInf => {
                let mut sum = Vector6::zeros();
                for group in &self.groups {
                    let reach = group.reach(&direction, friction);
                    for lane in (0..LANES).filter(|&lane| reach.total[lane] > 0.0) {
                        let along = reach.friction.map(|along| along[lane]);
                        sum += group.wrench(lane, along, friction) * group.limits_n[lane];
                    }
                }
                sum
            }
        }
    }

    /// Tells who makes up the wrench that [`Support::farthest`] finds.
    pub(super) fn parts(
        &self,
        direction: &Vector6<f64>,
        norm: Norm,
        friction: &FrictionSet,
        mut tell: impl FnMut(Part),
    ) {
        let direction = <[f64; 6]>::from(*direction);
        let part = |at: usize, lane: usize, reach: &Reach, force: f64| Part {
            contact: at * LANES + lane,
            force,
            friction: friction.farthest(&Vector3::from(reach.friction.map(|along| along[lane]))),
        };
        let (mut most, mut best) = (f64::NEG_INFINITY, None);
        for (at, group) in self.groups.iter().enumerate() {
            let reach = group.reach(&direction, friction);
            for lane in 0..LANES {
                match norm {
                    Norm::L1 if reach.total[lane] > most => {
                        most = reach.total[lane];
                        best = Some(part(at, lane, &reach, 1.0));
                    }
                    // Lanes to spare have no force.
                    Norm::LInf if reach.total[lane] > 0.0 && group.limits_n[lane] > 0.0 => {
                        tell(part(at, lane, &reach, group.limits_n[lane]));
                    }
                    _ => {}
                }
            }
        }
        if let Some(best) = best {
            tell(best);
        }
    }
}

impl Group {
    fn reach(&self, direction: &[f64; 6], friction: &FrictionSet) -> Reach {
        let mut along = [[0.0; LANES]; 4];
        for (along, column) in along.iter_mut().zip(&self.columns) {
            for (x, row) in direction.iter().zip(column) {
                for lane in 0..LANES {
                    along[lane] += x * row[lane];
                }
            }
        }
        let [mut total, along @ ..] = along;
        let reach = friction.reach_of_each(&along);
        for lane in 0..LANES {
            total[lane] += reach[lane];
        }
        Reach { friction: along, total }
    }

    /// The wrench of a unit normal force at a contact, with the friction that goes farthest along `along`.
    fn wrench(&self, lane: usize, along: [f64; 3], friction: &FrictionSet) -> Vector6<f64> {
        let [x, y, z] = friction.farthest(&Vector3::from(along)).into();
        let [normal, first, second, torsion] = &self.columns;
        Vector6::from_fn(|row, _| {
            normal[row][lane] + first[row][lane] * x + second[row][lane] * y + torsion[row][lane] * z
        })
    }
}
