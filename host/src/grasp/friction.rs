//! The shape of a friction cone: the circular one, or a pyramid inside it.

use std::f64::consts::TAU;
use std::fmt;

use nalgebra::Vector3;
use thiserror::Error;

use super::support::{LANES, Lanes};

/// The friction set of every contact of a grasp.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ConeModel {
    /// Coulomb's circular cone; for a soft finger the ellipsoid in tangential force and torsion.
    Exact,
    /// A pyramid whose edges lie on the circular cone, hence inside it: epsilon comes out too small, by 6-11 % in the
    /// median for eight edges and by everything in the worst case.
    ///
    /// A soft finger adds two points, pure torsion to either side: with the edges they span a bipyramid inside the
    /// ellipsoid.
    Edges(EdgeCount),
}

/// Number of edges of a friction pyramid, 3 to [`EdgeCount::MAX`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct EdgeCount(u16);

/// A number that is no edge count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("{0} edges do not make a friction pyramid: give 3 to {max}, or `exact`", max = EdgeCount::MAX)]
pub struct EdgeCountError(pub u32);

impl EdgeCount {
    /// The finest pyramid: it differs from the cone by less than a millionth of the friction force.
    pub const MAX: u16 = 4096;

    /// Those of most programs' pyramids.
    pub(super) const FOUR: Self = Self(4);
    pub(super) const EIGHT: Self = Self(8);

    /// Checks the range.
    pub fn new(edges: u32) -> Result<Self, EdgeCountError> {
        match u16::try_from(edges) {
            Ok(count @ 3..=Self::MAX) => Ok(Self(count)),
            _ => Err(EdgeCountError(edges)),
        }
    }

    /// The number.
    #[must_use]
    pub fn get(self) -> u16 {
        self.0
    }
}

impl ConeModel {
    /// A pyramid with so many edges.
    pub fn edges(edges: u32) -> Result<Self, EdgeCountError> {
        EdgeCount::new(edges).map(Self::Edges)
    }
}

impl fmt::Display for ConeModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Exact => write!(f, "exact cone"),
            Self::Edges(count) => write!(f, "{}-edge pyramid", count.0),
        }
    }
}

/// Most edges of a pyramid that are tried one by one, and that are after folding the plane into an eighth.
const TRIED: usize = 8;
const FOLDED: usize = 64;

/// A cone model made ready for many support queries: the pyramid's edges in a table.
///
/// It works in friction coordinates: two tangential directions and torsion, each divided by its limit, so that the
/// circular cone is the unit ball (unit disc for a hard contact) and a pyramid a polygon inscribed in it, edge `k` at
/// the angle `2 pi k / m` from the first tangent.
#[derive(Debug, Clone)]
pub(super) struct FrictionSet {
    model: ConeModel,
    /// Cosine and sine of every edge; empty for the exact cone.
    edges: Vec<(f64, f64)>,
}

impl FrictionSet {
    pub(super) fn new(model: ConeModel) -> Self {
        let mut set = Self { model: ConeModel::Exact, edges: Vec::new() };
        set.set_model(model);
        set
    }

    /// Takes another model; free when it is the one before.
    pub(super) fn set_model(&mut self, model: ConeModel) {
        if self.model == model {
            return;
        }
        self.model = model;
        self.edges.clear();
        if let ConeModel::Edges(EdgeCount(m)) = model {
            self.edges.extend((0..m).map(|k| {
                let (sin, cos) = (TAU * f64::from(k) / f64::from(m)).sin_cos();
                (cos, sin)
            }));
        }
    }

    /// The farthest that the set reaches along `g`, the dot product of [`FrictionSet::farthest`] with it.
    pub(super) fn reach(&self, g: &Vector3<f64>) -> f64 {
        match self.model {
            ConeModel::Exact => g.norm(),
            ConeModel::Edges(_) => {
                let (cos, sin) = self.nearest_edge(g);
                (cos * g.x + sin * g.y).max(g.z.abs())
            }
        }
    }

    /// The point of the set that reaches farthest along `g`.
    pub(super) fn farthest(&self, g: &Vector3<f64>) -> Vector3<f64> {
        match self.model {
            ConeModel::Exact => g.try_normalize(0.0).unwrap_or_else(Vector3::zeros),
            ConeModel::Edges(_) => {
                let (cos, sin) = self.nearest_edge(g);
                if g.z.abs() > cos * g.x + sin * g.y {
                    Vector3::new(0.0, 0.0, g.z.signum())
                } else {
                    Vector3::new(cos, sin, 0.0)
                }
            }
        }
    }

    /// Points that span all that reach as far along `g` as the farthest, to within `slack`.
    pub(super) fn for_each_tie(&self, g: &Vector3<f64>, slack: f64, mut tell: impl FnMut(Vector3<f64>)) {
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
        match self.model {
            ConeModel::Exact if g.norm() > slack => {}
            ConeModel::Exact => axes.into_iter().for_each(tell),
            ConeModel::Edges(_) => {
                let most = self.reach(g) - slack;
                let edges = self.edges.iter().map(|&(cos, sin)| Vector3::new(cos, sin, 0.0));
                edges.chain([axes[2], -axes[2]]).filter(|point| point.dot(g) >= most).for_each(&mut tell);
            }
        }
    }

    /// [`FrictionSet::reach`] for several contacts at a time.
    pub(super) fn reach_of_each(&self, g: &[Lanes; 3]) -> Lanes {
        let [x, y, z] = g;
        match self.model {
            ConeModel::Exact => std::array::from_fn(|k| (x[k] * x[k] + y[k] * y[k] + z[k] * z[k]).sqrt()),
            ConeModel::Edges(_) if self.edges.len().is_multiple_of(8) && self.edges.len() <= FOLDED => {
                let mut most: Lanes = std::array::from_fn(|k| z[k].abs());
                let (mut long, mut short) = ([0.0; LANES], [0.0; LANES]);
                for k in 0..LANES {
                    let (x, y) = (x[k].abs(), y[k].abs());
                    (long[k], short[k]) = if x < y { (y, x) } else { (x, y) };
                }
                for &(cos, sin) in &self.edges[..=self.edges.len() / 8] {
                    for k in 0..LANES {
                        let reach = cos * long[k] + sin * short[k];
                        most[k] = if reach > most[k] { reach } else { most[k] };
                    }
                }
                most
            }
            ConeModel::Edges(_) => std::array::from_fn(|k| self.reach(&Vector3::new(x[k], y[k], z[k]))),
        }
    }

    /// Of a regular polygon the vertex nearest in angle is the farthest along `g`, so no edge need be tried; but a few
    /// are tried faster than an angle is found.
    fn nearest_edge(&self, g: &Vector3<f64>) -> (f64, f64) {
        let m = self.edges.len();
        if m <= TRIED {
            let reach = |&(cos, sin): &(f64, f64)| cos * g.x + sin * g.y;
            let first = self.edges[0];
            let farther =
                |(best, most), edge| if reach(&edge) > most { (edge, reach(&edge)) } else { (best, most) };
            return self.edges.iter().copied().fold((first, reach(&first)), farther).0;
        }
        // In -m/2..=m/2, so it fits.
        let k = (g.y.atan2(g.x) * (m as f64 / TAU)).round() as isize;
        self.edges[k.rem_euclid(m as isize) as usize]
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;
    use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};

    use super::*;

    #[test]
    fn the_nearest_edge_is_the_farthest_of_all() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for m in [3, 4, 5, 7, 8, 12, 16, 64, 72, 4096] {
            let set = FrictionSet::new(ConeModel::edges(m).unwrap());
            for _ in 0..200 {
                let g = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
                let by_trial = (0..m)
                    .map(|k| {
                        let angle = TAU * f64::from(k) / f64::from(m);
                        angle.cos() * g.x + angle.sin() * g.y
                    })
                    .fold(g.z.abs(), f64::max);
                assert!((set.reach(&g) - by_trial).abs() < 1e-14, "m {m}");
                assert!((set.farthest(&g).dot(&g) - by_trial).abs() < 1e-14, "m {m}");
                for each in set.reach_of_each(&[[g.x; LANES], [g.y; LANES], [g.z; LANES]]) {
                    assert!((each - by_trial).abs() < 1e-14, "m {m}");
                }
                assert!(by_trial <= FrictionSet::new(ConeModel::Exact).reach(&g));
            }
        }
    }

    #[test]
    fn edge_counts_have_a_range() {
        assert!(ConeModel::edges(3).is_ok() && ConeModel::edges(4096).is_ok());
        for edges in [0, 2, 4097, 65_536 + 8] {
            assert_eq!(ConeModel::edges(edges), Err(EdgeCountError(edges)));
        }
        assert!(EdgeCountError(2).to_string().starts_with("2 edges"));
    }
}
