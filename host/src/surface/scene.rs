//! What stands on a table, one thing from the other.

use std::collections::HashMap;

use nalgebra::Point3;

use super::table::TableTop;

/// Side of the cells that join points, in spacings of the points.
const CELL_PER_SPACING: f64 = 2.5;
/// Least such side: noise and the steps of a depth camera tear a thing apart.
const LEAST_CELL_M: f64 = 0.004;
/// Fewest points of a thing, also as a share of the largest one's.
const FEWEST_POINTS: usize = 40;
const LEAST_SHARE: f64 = 0.02;
/// Least height of a thing over the margin below which points are the table's, as a multiple of that margin.
const LEAST_HEIGHT: f64 = 1.0;
/// How far over the table a thing may begin, in its own heights: its foot may be hidden behind another.
const HIGHEST_FOOT: f64 = 1.0;
/// Share of the smaller footprint that two parts have in common when they are one thing.
const SAME_FOOTPRINT: f64 = 0.5;

/// A thing on the table.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneObject {
    /// Its points, as indices, ascending.
    pub members: Vec<u32>,
    /// Middle of its box (along the table's axes, from the table up), in the cloud's frame, metres.
    pub center: Point3<f64>,
    /// Sides of that box: two along the table, then the height over it, metres.
    pub size_m: [f64; 3],
}

impl SceneObject {
    /// Volume of the box.
    fn box_m3(&self) -> f64 {
        self.size_m.iter().product()
    }
}

/// Which thing of a scene to take.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Pick {
    /// All that stands there, as one body.
    #[default]
    Whole,
    /// By its number from 0; the largest comes first.
    Number(usize),
    /// The one with the largest box.
    Largest,
    /// The one nearest to the sensor, which is where the lines of sight come from, else the frame's origin.
    Nearest,
    /// The one nearest to a point in the cloud's frame, metres.
    At(Point3<f64>),
}

/// The things among some points (indices into `points`), the largest first. Two belong together when cells of a few
/// spacings join them, or when one stands over the other.
pub(super) fn objects(
    points: &[Point3<f64>],
    above: &[u32],
    table: &TableTop,
    spacing_m: f64,
    margin_m: f64,
) -> Vec<SceneObject> {
    let plane_from_cloud = table.plane.plane_from_cloud();
    let cloud_from_plane = plane_from_cloud.inverse();
    let placed: Vec<Point3<f64>> = above.iter().map(|&i| plane_from_cloud * points[i as usize]).collect();
    let cell_m = (CELL_PER_SPACING * spacing_m).max(LEAST_CELL_M);
    let mut parts: Vec<Part> = clusters(&placed, cell_m).into_iter().map(|c| Part::new(c, &placed)).collect();
    parts.sort_by(|a, b| b.members.len().cmp(&a.members.len()).then(a.members.cmp(&b.members)));
    let fewest = parts.first().map_or(0, |part| (part.members.len() as f64 * LEAST_SHARE) as usize);
    let mut things: Vec<Part> = Vec::new();
    for part in parts {
        match things.iter_mut().find(|thing| thing.is_one_with(&part)) {
            Some(thing) => thing.take(part),
            None => things.push(part),
        }
    }
    things.retain(|thing| {
        let height_m = thing.high.z - margin_m;
        thing.members.len() >= fewest.max(FEWEST_POINTS)
            && height_m > LEAST_HEIGHT * margin_m
            && thing.low.z - margin_m <= HIGHEST_FOOT * (thing.high.z - thing.low.z)
    });
    let mut found: Vec<SceneObject> = things
        .into_iter()
        .map(|Part { mut members, low, high }| {
            members.iter_mut().for_each(|member| *member = above[*member as usize]);
            members.sort_unstable();
            let middle = Point3::new(0.5 * (low.x + high.x), 0.5 * (low.y + high.y), 0.5 * high.z);
            let size_m = [high.x - low.x, high.y - low.y, high.z];
            SceneObject { members, center: cloud_from_plane * middle, size_m }
        })
        .collect();
    found.sort_by(|a, b| b.box_m3().total_cmp(&a.box_m3()).then(a.members.cmp(&b.members)));
    found
}

/// Points that hang together, and the box about them.
struct Part {
    members: Vec<u32>,
    low: Point3<f64>,
    high: Point3<f64>,
}

impl Part {
    fn new(members: Vec<u32>, points: &[Point3<f64>]) -> Self {
        let first = members.first().map_or_else(Point3::origin, |&i| points[i as usize]);
        let (low, high) = members.iter().fold((first, first), |(low, high), &i| {
            let p = &points[i as usize];
            (low.inf(p), high.sup(p))
        });
        Self { members, low, high }
    }

    /// Whether the smaller of the two stands for the most part over or under the other.
    fn is_one_with(&self, other: &Self) -> bool {
        let overlap = |axis: usize| {
            (self.high[axis].min(other.high[axis]) - self.low[axis].max(other.low[axis])).max(0.0)
        };
        let area = |part: &Self| (part.high.x - part.low.x) * (part.high.y - part.low.y);
        overlap(0) * overlap(1) > SAME_FOOTPRINT * area(self).min(area(other))
    }

    fn take(&mut self, other: Self) {
        self.members.extend(other.members);
        (self.low, self.high) = (self.low.inf(&other.low), self.high.sup(&other.high));
    }
}

/// Points joined by cells of side `cell_m` that touch, each cluster ascending.
pub(super) fn clusters(points: &[Point3<f64>], cell_m: f64) -> Vec<Vec<u32>> {
    let cell = |p: &Point3<f64>| [p.x, p.y, p.z].map(|c| (c / cell_m).floor() as i64);
    let mut number_of: HashMap<[i64; 3], u32> = HashMap::new();
    let mut cells: Vec<[i64; 3]> = Vec::new();
    let cell_of_point: Vec<u32> = points
        .iter()
        .map(|p| {
            let at = cell(p);
            *number_of.entry(at).or_insert_with(|| {
                cells.push(at);
                cells.len() as u32 - 1
            })
        })
        .collect();
    let mut cluster_of = vec![u32::MAX; cells.len()];
    let mut count = 0;
    for start in 0..cells.len() {
        if cluster_of[start] != u32::MAX {
            continue;
        }
        cluster_of[start] = count;
        let mut waiting = vec![start];
        while let Some(at) = waiting.pop() {
            for step in 0..27_i64 {
                let way = [step % 3 - 1, step / 3 % 3 - 1, step / 9 - 1];
                let next = [0, 1, 2].map(|a| cells[at][a].saturating_add(way[a]));
                if let Some(&next) = number_of.get(&next)
                    && cluster_of[next as usize] == u32::MAX
                {
                    cluster_of[next as usize] = count;
                    waiting.push(next as usize);
                }
            }
        }
        count += 1;
    }
    let mut clusters = vec![Vec::new(); count as usize];
    for (point, &cell) in cell_of_point.iter().enumerate() {
        clusters[cluster_of[cell as usize] as usize].push(point as u32);
    }
    clusters
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::{
        Closing, PointCloud, ReconstructError, Settings, Survey, Table,
        camera::{Thing, seen},
    };

    const THINGS: [Thing; 3] = [
        Thing::Box([-0.15, 0.0, 0.0], [-0.03, 0.06, 0.12]),
        Thing::Cylinder([0.1, 0.1], 0.04, 0.10),
        Thing::Box([0.0, -0.16, 0.0], [0.07, -0.1, 0.05]),
    ];

    fn table_scene() -> PointCloud {
        seen(&THINGS, [[0.0, -0.7, 0.7], [0.0, 0.0, 0.0]], 0.3, 300, 0.0008)
    }

    fn surveyed(cloud: &PointCloud, pick: Pick) -> Survey {
        Survey::new(cloud, &Settings { table: Table::Auto, close: true, pick, ..Settings::default() })
            .unwrap()
    }

    #[test]
    fn things_on_a_found_table_are_told_apart_and_the_wall_is_none() {
        let survey = surveyed(&table_scene(), Pick::Largest);
        let table = survey.table().unwrap();
        assert!(table.normal.z > 0.9995 && table.offset_m.abs() < 1e-3, "{table:?}");
        let found = survey.objects();
        assert_eq!(found.len(), 3, "{:?}", found.iter().map(|o| o.size_m).collect::<Vec<_>>());
        for (object, (x, y, height)) in
            found.iter().zip([(-0.09, 0.03, 0.12), (0.1, 0.1, 0.10), (0.035, -0.13, 0.05)])
        {
            assert!(
                (object.center.x - x).abs() < 0.012 && (object.center.y - y).abs() < 0.03,
                "{}",
                object.center
            );
            assert!((object.size_m[2] - height).abs() < 0.004, "{:?}", object.size_m);
        }
    }

    #[test]
    fn each_model_is_closed_and_stands_on_the_table() {
        let cloud = table_scene();
        let survey = surveyed(&cloud, Pick::Largest);
        for (number, height) in [0.12, 0.10, 0.05].into_iter().enumerate() {
            let model = survey.object(number).unwrap();
            assert!(model.report.watertight && model.report.components == 1, "{:?}", model.report);
            assert_eq!(model.report.closing, Closing::OnTable);
            let (low, high) = model.mesh.bounding_box();
            assert!(low.z.abs() < 2e-3 && (high.z - height).abs() < 4e-3, "{low} {high}");
        }
        let whole = surveyed(&cloud, Pick::Whole).pick().unwrap();
        assert!(whole.report.components >= 3, "{:?}", whole.report);
    }

    #[test]
    fn a_pick_means_one_of_them() {
        let cloud = table_scene();
        let number = |pick: Pick| surveyed(&cloud, pick).picked(&pick);
        assert_eq!(number(Pick::Largest), Ok(Some(0)));
        assert_eq!(number(Pick::Nearest), Ok(Some(2)));
        assert_eq!(number(Pick::Number(1)), Ok(Some(1)));
        assert_eq!(number(Pick::At(Point3::new(0.12, 0.1, 0.0))), Ok(Some(1)));
        assert_eq!(number(Pick::Number(3)), Err(ReconstructError::NoSuchObject { number: 3, objects: 3 }));
        let alone = cloud.filtered(|_, p| p.x < -0.02 && p.y > -0.01 && p.y < 0.07 && p.z > 0.004);
        assert_eq!(surveyed(&alone, Pick::Largest).picked(&Pick::Largest), Ok(None));
    }
}
