//! Points as a scanner delivers them.

use nalgebra::{Isometry3, Point3, Unit, Vector3};
use thiserror::Error;

/// Why a set of arrays is not a cloud.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum CloudError {
    /// An attribute array has another length than the points.
    #[error("{attribute}: {found} entries for {points} points")]
    Length {
        /// Which array.
        attribute: &'static str,
        /// Its length.
        found: usize,
        /// Number of points.
        points: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("point {index} has a coordinate that is not a finite number")]
    NotFinite {
        /// Index of the point.
        index: usize,
    },
}

/// Unorganised points, metres, in one frame (the robot base for a scan, the file's own for an imported cloud).
///
/// `normals`, `views` and `sweeps` are optional and as long as `points`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PointCloud {
    /// Positions, metres.
    pub points: Vec<Point3<f64>>,
    /// Outward unit surface normals.
    pub normals: Option<Vec<Unit<Vector3<f64>>>>,
    /// Lines of sight: unit vectors from each point **towards** the sensor that saw it. The surface there faces the
    /// sensor, so these orient normals without any guess.
    pub views: Option<Vec<Unit<Vector3<f64>>>>,
    /// Number of the sweep that each point was seen in: points of one sweep share the errors of the arm and of the
    /// hand-eye calibration, so that sweeps can be registered to each other as rigid bodies.
    pub sweeps: Option<Vec<u16>>,
}

impl PointCloud {
    /// A cloud with positions only. Errors when a coordinate is not finite.
    pub fn from_points(points: Vec<Point3<f64>>) -> Result<Self, CloudError> {
        Self { points, ..Self::default() }.checked()
    }

    /// Checks lengths and finiteness.
    pub fn checked(self) -> Result<Self, CloudError> {
        let points = self.points.len();
        let lengths = [
            ("normals", self.normals.as_ref().map(Vec::len)),
            ("views", self.views.as_ref().map(Vec::len)),
            ("sweeps", self.sweeps.as_ref().map(Vec::len)),
        ];
        for (attribute, length) in lengths {
            if let Some(found) = length.filter(|&found| found != points) {
                return Err(CloudError::Length { attribute, found, points });
            }
        }
        match self.points.iter().position(|p| !p.coords.iter().all(|c| c.is_finite())) {
            Some(index) => Err(CloudError::NotFinite { index }),
            None => Ok(self),
        }
    }

    /// Number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there is no point at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Smallest and largest corner, metres; `None` for an empty cloud.
    #[must_use]
    pub fn bounding_box(&self) -> Option<(Point3<f64>, Point3<f64>)> {
        bounding_box(&self.points)
    }

    /// The points for which `keep` holds, with their attributes.
    #[must_use]
    pub fn filtered(&self, mut keep: impl FnMut(usize, &Point3<f64>) -> bool) -> Self {
        let kept: Vec<usize> =
            self.points.iter().enumerate().filter(|(i, p)| keep(*i, p)).map(|(i, _)| i).collect();
        let pick = |array: &Option<Vec<Unit<Vector3<f64>>>>| {
            array.as_ref().map(|array| kept.iter().map(|&i| array[i]).collect())
        };
        Self {
            points: kept.iter().map(|&i| self.points[i]).collect(),
            normals: pick(&self.normals),
            views: pick(&self.views),
            sweeps: self.sweeps.as_ref().map(|sweeps| kept.iter().map(|&i| sweeps[i]).collect()),
        }
    }

    /// The same cloud in frame `a`, where `self` is in frame `b`.
    #[must_use]
    pub fn transformed(&self, a_from_b: &Isometry3<f64>) -> Self {
        let turn = |array: &Option<Vec<Unit<Vector3<f64>>>>| {
            array.as_ref().map(|array| array.iter().map(|v| a_from_b.rotation * v).collect())
        };
        Self {
            points: self.points.iter().map(|p| a_from_b * p).collect(),
            normals: turn(&self.normals),
            views: turn(&self.views),
            sweeps: self.sweeps.clone(),
        }
    }
}

/// Smallest and largest corner of a set of points; `None` when it is empty.
#[must_use]
pub fn bounding_box(points: &[Point3<f64>]) -> Option<(Point3<f64>, Point3<f64>)> {
    let first = points.first()?;
    Some(points.iter().fold((*first, *first), |(low, high), p| (low.inf(p), high.sup(p))))
}
