//! What a scan has not seen yet: a box of voxels about the target, carved by the lines of sight.
//!
//! A voxel is surface where points lie, empty where a line of sight passes, and unknown before. Unknown next to empty is
//! where the surface goes on, or where a shadow begins: what to look at next (the frontier of Connolly's next best view,
//! 1985).

use nalgebra::{Point3, Vector3};

use crate::surface::PointCloud;

/// State of a voxel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Voxel {
    Unknown,
    Empty,
    Surface,
}

/// An unknown voxel next to an empty one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frontier {
    /// Its numbers in the box.
    pub place: [usize; 3],
    /// Its middle, base frame.
    pub center: Point3<f64>,
    /// Unit vector towards what is empty: out of whatever is there.
    pub outward: Vector3<f64>,
}

/// The box of voxels.
#[derive(Debug, Clone)]
pub struct Unseen {
    low: Point3<f64>,
    size: [usize; 3],
    voxels: Vec<Voxel>,
    table_height_m: f64,
}

/// Side of a voxel: some stripes wide, so that a surface that was scanned has no holes.
const VOXEL_M: f64 = 0.003;
/// More say nothing that matters to a hand.
const MAX_SIDE: f64 = 200.0;
/// Points that are nearer to the table are taken for its own.
const TABLE_M: f64 = 0.0015;
/// A line of sight empties nothing nearer to its point than this, in voxels, and one that is asked about starts there. The
/// table has no voxels of its own that could be emptied by mistake.
const CLEARANCE: f64 = 1.8;
const TABLE_CLEARANCE: f64 = 0.5;
const STEP: f64 = 0.5;

impl Unseen {
    /// Knows nothing of the sphere that holds the target, above a table of the given height.
    #[must_use]
    pub fn new(center: &Point3<f64>, radius_m: f64, table_height_m: f64) -> Self {
        let low = Point3::new(center.x - radius_m, center.y - radius_m, table_height_m + TABLE_M);
        let high = center + Vector3::repeat(radius_m);
        // One voxel around it, so that every surface of the target can have empty neighbours.
        let low = low - Vector3::new(VOXEL_M, VOXEL_M, 0.0);
        let size = [0, 1, 2]
            .map(|axis| ((high[axis] - low[axis]) / VOXEL_M + 1.0).ceil().clamp(1.0, MAX_SIDE) as usize);
        let voxels = vec![Voxel::Unknown; size.iter().product()];
        Self { low, size, voxels, table_height_m }
    }

    fn index(&self, point: &Point3<f64>) -> Option<usize> {
        let mut place = [0; 3];
        for axis in 0..3 {
            let at = ((point[axis] - self.low[axis]) / VOXEL_M).floor();
            // Also what is no number.
            if !(0.0..self.size[axis] as f64).contains(&at) {
                return None;
            }
            place[axis] = at as usize;
        }
        Some((place[2] * self.size[1] + place[1]) * self.size[0] + place[0])
    }

    /// Takes note of a cloud in the base frame; without lines of sight it empties nothing.
    pub fn add(&mut self, cloud: &PointCloud) {
        for point in &cloud.points {
            if point.z > self.table_height_m + TABLE_M
                && let Some(index) = self.index(point)
            {
                self.voxels[index] = Voxel::Surface;
            }
        }
        for (point, view) in cloud.points.iter().zip(cloud.views.iter().flatten()) {
            let on_table = point.z <= self.table_height_m + TABLE_M;
            self.empty(point, view, if on_table { TABLE_CLEARANCE } else { CLEARANCE });
        }
    }

    /// Empties the unknown voxels along a ray until it leaves the box for good.
    fn empty(&mut self, from: &Point3<f64>, direction: &Vector3<f64>, clearance: f64) {
        for i in 0..self.steps() {
            let at = from + direction * ((clearance + STEP * f64::from(i)) * VOXEL_M);
            match self.index(&at) {
                Some(index) if self.voxels[index] == Voxel::Unknown => self.voxels[index] = Voxel::Empty,
                Some(_) => {}
                None if self.has_left(&at, direction) => return,
                None => {}
            }
        }
    }

    /// Steps that lead out of the box from everywhere in it.
    fn steps(&self) -> u32 {
        (self.size.iter().sum::<usize>() as f64 / STEP) as u32
    }

    fn has_left(&self, at: &Point3<f64>, direction: &Vector3<f64>) -> bool {
        (0..3).any(|axis| {
            let high = self.low[axis] + self.size[axis] as f64 * VOXEL_M;
            (direction[axis] >= 0.0 && at[axis] > high)
                || (direction[axis] <= 0.0 && at[axis] < self.low[axis])
        })
    }

    /// Whether a line of sight from a frontier is known to be free.
    #[must_use]
    pub fn is_clear(&self, from: &Point3<f64>, direction: &Vector3<f64>) -> bool {
        for i in 0..self.steps() {
            let at = from + direction * ((CLEARANCE + STEP * f64::from(i)) * VOXEL_M);
            match self.index(&at) {
                Some(index) if self.voxels[index] != Voxel::Empty => return false,
                Some(_) => {}
                None if self.has_left(&at, direction) => return true,
                None => {}
            }
        }
        true
    }

    fn center(&self, [x, y, z]: [usize; 3]) -> Point3<f64> {
        self.low + Vector3::new(x as f64 + 0.5, y as f64 + 0.5, z as f64 + 0.5) * VOXEL_M
    }

    fn at(&self, [x, y, z]: [usize; 3]) -> Voxel {
        self.voxels[(z * self.size[1] + y) * self.size[0] + x]
    }

    fn places(&self) -> impl Iterator<Item = [usize; 3]> {
        let [nx, ny, nz] = self.size;
        (0..nz).flat_map(move |z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])))
    }

    /// Middles of the voxels with surface.
    #[must_use]
    pub fn surface(&self) -> Vec<Point3<f64>> {
        self.places()
            .filter(|&place| self.at(place) == Voxel::Surface)
            .map(|place| self.center(place))
            .collect()
    }

    /// All unknown voxels that have an empty neighbour across a face.
    #[must_use]
    pub fn frontier(&self) -> Vec<Frontier> {
        let mut frontier = Vec::new();
        for place in self.places().filter(|&place| self.at(place) == Voxel::Unknown) {
            let mut outward = Vector3::zeros();
            for axis in 0..3 {
                for up in [false, true] {
                    let mut next = place;
                    next[axis] = match (up, place[axis]) {
                        (true, at) if at + 1 < self.size[axis] => at + 1,
                        (false, at) if at > 0 => at - 1,
                        _ => continue,
                    };
                    if self.at(next) == Voxel::Empty {
                        outward[axis] += if up { 1.0 } else { -1.0 };
                    }
                }
            }
            if let Some(outward) = outward.try_normalize(0.5) {
                frontier.push(Frontier { place, center: self.center(place), outward });
            }
        }
        frontier
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Unit;

    /// A plate seen from straight above, as far as x = 0; the table beyond.
    fn half_seen() -> Unseen {
        let mut unseen = Unseen::new(&Point3::new(0.0, 0.0, 0.02), 0.03, 0.0);
        let mut cloud = PointCloud::default();
        for i in -60..=60 {
            for j in -60..=60 {
                let (x, y) = (f64::from(i) * 0.0006, f64::from(j) * 0.0006);
                cloud.points.push(Point3::new(x, y, if x < 0.0 { 0.021 } else { 0.0 }));
            }
        }
        cloud.views = Some(vec![Unit::new_normalize(Vector3::z()); cloud.points.len()]);
        unseen.add(&cloud);
        unseen
    }

    #[test]
    fn the_wall_that_nobody_saw_is_the_frontier() {
        let unseen = half_seen();
        let frontier = unseen.frontier();
        assert!(!frontier.is_empty());
        let wall = frontier.iter().filter(|f| f.outward.x > 0.9 && f.center.x.abs() < 0.003);
        // 20 mm high and 60 mm wide, in voxels of 3 mm; the topmost row is surface already.
        assert!((80..160).contains(&wall.count()), "{}", frontier.len());
        // Looking at it from the side it faces is free, through the plate it is not.
        let middle = frontier.iter().find(|f| f.outward.x > 0.9 && f.center.z > 0.009).unwrap();
        assert!(unseen.is_clear(&middle.center, &Vector3::new(0.8, 0.0, 0.6)));
        assert!(!unseen.is_clear(&middle.center, &Vector3::new(-0.8, 0.0, 0.6)));
        assert!(unseen.surface().iter().all(|p| p.x < 0.003 && (p.z - 0.021).abs() < 0.003));
    }

    #[test]
    fn what_is_outside_is_no_matter() {
        let mut unseen = half_seen();
        let before = unseen.frontier().len();
        let far = PointCloud {
            points: vec![Point3::new(5.0, 0.0, 0.1), Point3::new(f64::NAN, 0.0, 0.0)],
            views: Some(vec![Unit::new_normalize(Vector3::z()); 2]),
            ..PointCloud::default()
        };
        unseen.add(&far);
        assert_eq!(unseen.frontier().len(), before);
    }
}
