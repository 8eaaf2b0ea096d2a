//! A uniform grid of points for nearest-neighbour queries.

use nalgebra::{Point3, Vector3};

use super::cloud::bounding_box;

/// A neighbour: squared distance, m^2, and index of the point in the slice that the grid was built from.
pub type Neighbour = (f64, u32);

/// Points sorted by the cell that they lie in (counting sort), so that a query reads memory in runs.
///
/// Every answer is ordered by distance and then by index, and so does not depend on how the points were sorted.
#[derive(Debug, Clone)]
pub struct Grid {
    low: Point3<f64>,
    cell_m: f64,
    dims: [usize; 3],
    /// First position in `order` of each cell, and one more at the end.
    starts: Vec<u32>,
    order: Vec<u32>,
    /// The points in the order of `order`.
    points: Vec<Point3<f64>>,
}

impl Grid {
    /// Sorts finite points into cells of about `cell_m`. Cells grow as needed to keep their number in proportion to the
    /// points, so that one stray point far away costs no memory. Cells hold 2 to 8 points at the best speed.
    #[must_use]
    pub fn new(points: &[Point3<f64>], cell_m: f64) -> Self {
        let (low, high) = bounding_box(points).unwrap_or((Point3::origin(), Point3::origin()));
        let extent = high - low;
        let most = 16 * points.len() + (1 << 16);
        let mut cell_m = if cell_m.is_finite() { cell_m.max(extent.max() * 1e-6) } else { extent.max() };
        if cell_m <= 0.0 {
            cell_m = 1.0;
        }
        let dims_of = |cell: f64| extent.map(|e| (e / cell).floor() + 1.0);
        while dims_of(cell_m).product() > most as f64 {
            cell_m *= 1.25;
        }
        let dims: [usize; 3] = dims_of(cell_m).map(|d| d as usize).into();
        let mut grid = Self { low, cell_m, dims, starts: Vec::new(), order: Vec::new(), points: Vec::new() };
        let cells: Vec<usize> = points.iter().map(|p| grid.cell_index(grid.cell_of(p))).collect();
        let mut starts = vec![0_u32; dims.iter().product::<usize>() + 1];
        for &cell in &cells {
            starts[cell + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut next = starts.clone();
        grid.order = vec![0; points.len()];
        for (index, &cell) in cells.iter().enumerate() {
            grid.order[next[cell] as usize] = index as u32;
            next[cell] += 1;
        }
        grid.points = grid.order.iter().map(|&i| points[i as usize]).collect();
        grid.starts = starts;
        grid
    }

    /// A grid for points that sample a surface at unknown density: the cell is guessed from the bounding box's faces.
    #[must_use]
    pub fn for_surface(points: &[Point3<f64>]) -> Self {
        let size = bounding_box(points).map_or_else(Vector3::zeros, |(low, high)| high - low);
        let faces = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
        let spacing =
            (faces / points.len().max(1) as f64).sqrt().max(size.max() / points.len().max(1) as f64);
        Self::new(points, 1.5 * spacing)
    }

    /// The `k` nearest points, nearest first; fewer when the grid holds fewer. `found` is overwritten; how far it reached
    /// before, as for a query nearby, is where the search begins, which changes its time only.
    pub fn nearest(&self, query: &Point3<f64>, k: usize, found: &mut Vec<Neighbour>) {
        let k = k.min(self.points.len());
        let before_m = found.last().filter(|_| found.len() == k).map_or(0.0, |last| 1.1 * last.0.sqrt());
        found.clear();
        if k == 0 {
            return;
        }
        // Not farther than some cells: what was far from everything says nothing of others.
        let mut reach_m = before_m.clamp(0.5 * self.cell_m, 3.0 * self.cell_m);
        loop {
            found.clear();
            // The best so far, sorted: for a dozen of them insertion beats sorting everything that is near.
            let (from, to) = self.visit(query, reach_m, |neighbour| {
                if found.len() == k {
                    if found.last().is_some_and(|last| compare(last, &neighbour).is_le()) {
                        return;
                    }
                    found.pop();
                }
                let mut place = found.len();
                while place > 0 && compare(&neighbour, &found[place - 1]).is_lt() {
                    place -= 1;
                }
                found.insert(place, neighbour);
            });
            // Points outside the visited cells are at least that far away.
            let farthest_m = found.last().map_or(f64::INFINITY, |last| last.0.sqrt());
            if found.len() == k && (farthest_m <= reach_m || self.is_everything(from, to)) {
                return;
            }
            // The k points found so far bound the distance of the k nearest; a little more, for the root's rounding.
            reach_m = if found.len() == k { farthest_m * (1.0 + 1e-9) } else { 2.0 * reach_m };
        }
    }

    /// All points within `radius_m`, nearest first. `found` is overwritten.
    pub fn within(&self, query: &Point3<f64>, radius_m: f64, found: &mut Vec<Neighbour>) {
        found.clear();
        self.visit(query, radius_m, |neighbour| {
            if neighbour.0 <= radius_m * radius_m {
                found.push(neighbour);
            }
        });
        found.sort_unstable_by(compare);
    }

    /// Shows every point of the cells that the box of half side `reach_m` about `query` touches. Returns the range of
    /// cells.
    fn visit(
        &self,
        query: &Point3<f64>,
        reach_m: f64,
        mut see: impl FnMut(Neighbour),
    ) -> ([usize; 3], [usize; 3]) {
        let reach = Vector3::repeat(reach_m);
        let (from, to) = (self.cell_of(&(query - reach)), self.cell_of(&(query + reach)));
        for z in from[2]..=to[2] {
            for y in from[1]..=to[1] {
                // Cells along x lie next to each other.
                let start = self.starts[self.cell_index([from[0], y, z])] as usize;
                let end = self.starts[self.cell_index([to[0], y, z]) + 1] as usize;
                for i in start..end {
                    see(((self.points[i] - query).norm_squared(), self.order[i]));
                }
            }
        }
        (from, to)
    }

    fn is_everything(&self, from: [usize; 3], to: [usize; 3]) -> bool {
        from == [0; 3] && to == self.dims.map(|d| d - 1)
    }

    /// The cell of a point, or the nearest border cell when it lies outside (casts of floats saturate).
    fn cell_of(&self, point: &Point3<f64>) -> [usize; 3] {
        let at = (point - self.low) / self.cell_m;
        [0, 1, 2].map(|axis| (at[axis] as usize).min(self.dims[axis] - 1))
    }

    fn cell_index(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.dims[0] * (y + self.dims[1] * z)
    }
}

fn compare(a: &Neighbour, b: &Neighbour) -> std::cmp::Ordering {
    a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn brute(points: &[Point3<f64>], query: &Point3<f64>) -> Vec<Neighbour> {
        let mut all: Vec<_> =
            points.iter().enumerate().map(|(i, p)| ((p - query).norm_squared(), i as u32)).collect();
        all.sort_by(compare);
        all
    }

    #[test]
    fn agrees_with_brute_force_inside_and_outside_the_box() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut point = || Point3::from([0, 1, 2].map(|_| rng.random_range(-1.0..1.0)));
        let points: Vec<_> = (0..300).map(|_| point()).collect();
        let queries: Vec<_> = (0..50).map(|_| point() * 2.0).collect();
        let mut found = Vec::new();
        for cell in [0.05, 0.3, 5.0] {
            let grid = Grid::new(&points, cell);
            for query in &queries {
                let expected = brute(&points, query);
                grid.nearest(query, 9, &mut found);
                assert_eq!(found, expected[..9]);
                grid.within(query, 0.5, &mut found);
                let near = expected.iter().filter(|n| n.0 <= 0.25).count();
                assert_eq!(found, expected[..near]);
            }
        }
    }

    #[test]
    fn stray_and_repeated_points_are_harmless() {
        let mut points = vec![Point3::new(1.0, 1.0, 1.0); 20];
        points.push(Point3::new(1e9, -1e9, 1e9));
        let grid = Grid::new(&points, 1e-3);
        let mut found = Vec::new();
        grid.nearest(&Point3::new(1.0, 1.0, 1.0), 50, &mut found);
        assert_eq!(found.len(), 21);
        assert_eq!(found[0], (0.0, 0));
        Grid::new(&[], 0.1).nearest(&Point3::origin(), 3, &mut found);
        assert!(found.is_empty());
    }
}
