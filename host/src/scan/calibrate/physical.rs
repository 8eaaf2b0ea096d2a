//! The physical model: a pinhole camera that looks at the laser plane (a homography) through a lens that distorts.

use nalgebra::{DMatrix, DVector, Matrix2, Matrix3, SMatrix, SVector, Vector2, Vector3};
use serde::{Deserialize, Serialize};

use super::scaling::Scaling;
use crate::scan::levenberg::{LeastSquares, Levenberg, Step};

/// Eight of the homography, radial k1 and k2, tangential p1 and p2, and the centre of distortion.
pub const PHYSICAL_PARAMETERS: usize = 14;

/// Homography and Brown's distortion, from the laser plane to pixels; read backwards to measure.
///
/// It is fitted in the direction in which light goes, so that the residuals are pixels, whose noise is the same
/// everywhere.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PhysicalModel {
    pixel_scaling: Scaling,
    target_scaling: Scaling,
    /// Rows of the homography between scaled units; its last element is 1.
    homography: [f64; 8],
    /// k1, k2, p1, p2, in scaled pixels.
    distortion: [f64; 4],
    /// Scaled pixels.
    center: [f64; 2],
}

/// How the fit went.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PhysicalFit {
    /// Iterations of Levenberg-Marquardt.
    pub(super) iterations: u32,
    /// Whether it ended because nothing improved any more.
    pub(super) converged: bool,
    /// Root mean square of a pixel coordinate's residual, corrected for the fitted parameters: the noise of the
    /// markers where the model fits.
    pub(super) noise_px: f64,
}

const MAX_ITERATIONS: u32 = 200;
/// An iteration that gains a smaller share is the last.
const LEAST_IMPROVEMENT: f64 = 1e-7;
/// Newton's iterations that undo the distortion; it is quadratic, and starts within a few per cent.
const UNDISTORT_ITERATIONS: u32 = 20;

impl PhysicalModel {
    /// Fits the model; `None` when the pairs determine no homography, or the result cannot be read backwards at one of
    /// them.
    pub(super) fn fit(pixels: &[[f64; 2]], targets_m: &[[f64; 2]]) -> Option<(Self, PhysicalFit)> {
        let (pixel_scaling, target_scaling) = (Scaling::of(pixels), Scaling::of(targets_m));
        let problem = Pairs {
            pixels: pixels.iter().map(|&p| pixel_scaling.shrink(p).into()).collect(),
            targets: targets_m.iter().map(|&t| target_scaling.shrink(t).into()).collect(),
        };
        let mut start = DVector::zeros(PHYSICAL_PARAMETERS);
        start.rows_mut(0, 8).copy_from(&problem.homography()?);
        let mut fit = Levenberg::new(&problem, start, 0.0);
        let (mut iterations, mut converged) = (0, false);
        while iterations < MAX_ITERATIONS {
            match fit.step(&problem) {
                Step::Stuck => converged = true,
                Step::Improved(share) => {
                    iterations += 1;
                    converged = share < LEAST_IMPROVEMENT;
                }
            }
            if converged {
                break;
            }
        }
        let p = fit.parameters.as_slice();
        let (mut homography, mut distortion) = ([0.0; 8], [0.0; 4]);
        homography.copy_from_slice(&p[..8]);
        distortion.copy_from_slice(&p[8..12]);
        let model = Self { pixel_scaling, target_scaling, homography, distortion, center: [p[12], p[13]] };
        let freedom = (2 * pixels.len()).saturating_sub(PHYSICAL_PARAMETERS).max(1) as f64;
        let noise_px = pixel_scaling.half * (fit.cost / freedom).sqrt();
        let sound = noise_px.is_finite() && pixels.iter().all(|&pixel| model.map(pixel).is_some());
        sound.then_some((model, PhysicalFit { iterations, converged, noise_px }))
    }

    /// Point of the laser plane that a pixel sees, metres; `None` where the distortion cannot be undone.
    #[must_use]
    pub fn map(&self, pixel: [f64; 2]) -> Option<[f64; 2]> {
        let wanted = Vector2::from(self.pixel_scaling.shrink(pixel));
        let center = Vector2::from(self.center);
        let mut pinhole = wanted;
        let mut error = f64::INFINITY;
        for _ in 0..UNDISTORT_ITERATIONS {
            let (distorted, slope) = distort(pinhole - center, &self.distortion);
            let miss = center + distorted - wanted;
            error = miss.norm();
            if error < 1e-13 {
                break;
            }
            // Where the map folds over itself, the answer would be another pixel's.
            if slope.determinant() <= 0.0 {
                return None;
            }
            pinhole -= slope.try_inverse()? * miss;
        }
        if error.is_nan() || error > 1e-9 {
            return None;
        }
        let back = homography_matrix(&self.homography).try_inverse()? * pinhole.push(1.0);
        let target = back.xy() / back.z;
        target.iter().all(|x| x.is_finite()).then(|| self.target_scaling.expand(target.into()))
    }
}

fn homography_matrix(h: &[f64]) -> Matrix3<f64> {
    Matrix3::new(h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], 1.0)
}

/// Brown's distortion of a point seen from the centre, and its derivative.
fn distort(d: Vector2<f64>, &[k1, k2, p1, p2]: &[f64; 4]) -> (Vector2<f64>, Matrix2<f64>) {
    let (x, y) = (d.x, d.y);
    let r2 = d.norm_squared();
    let radial = 1.0 + r2 * (k1 + r2 * k2);
    let slope = 2.0 * (k1 + 2.0 * k2 * r2);
    let tangential = tangential_basis(d) * Vector2::new(p1, p2);
    let cross = slope * x * y + 2.0 * (p1 * x + p2 * y);
    let derivative = Matrix2::new(
        radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x,
        cross,
        cross,
        radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x,
    );
    (d * radial + tangential, derivative)
}

/// Columns: what p1 and p2 add.
fn tangential_basis(d: Vector2<f64>) -> Matrix2<f64> {
    let (x, y, r2) = (d.x, d.y, d.norm_squared());
    Matrix2::new(2.0 * x * y, r2 + 2.0 * x * x, r2 + 2.0 * y * y, 2.0 * x * y)
}

/// Marker pairs in scaled units.
struct Pairs {
    pixels: Vec<Vector2<f64>>,
    targets: Vec<Vector2<f64>>,
}

type Rows = SMatrix<f64, 2, PHYSICAL_PARAMETERS>;

/// Pixel of a target, and its derivatives by the parameters.
fn project(parameters: &[f64], target: &Vector2<f64>) -> (Vector2<f64>, Rows) {
    let (homography, rest) = parameters.split_at(8);
    let distortion = [rest[0], rest[1], rest[2], rest[3]];
    let center = Vector2::new(rest[4], rest[5]);
    let scaled: Vector3<f64> = homography_matrix(homography) * target.push(1.0);
    let pinhole = scaled.xy() / scaled.z;
    let d = pinhole - center;
    let (distorted, slope) = distort(d, &distortion);

    let mut pinhole_by_homography = SMatrix::<f64, 2, 8>::zeros();
    let row = target.push(1.0).transpose() / scaled.z;
    for axis in 0..2 {
        pinhole_by_homography.fixed_view_mut::<1, 3>(axis, 3 * axis).copy_from(&row);
        pinhole_by_homography
            .fixed_view_mut::<1, 2>(axis, 6)
            .copy_from(&(-row.fixed_columns::<2>(0) * pinhole[axis]));
    }
    let r2 = d.norm_squared();
    let mut rows = Rows::zeros();
    rows.fixed_columns_mut::<8>(0).copy_from(&(slope * pinhole_by_homography));
    rows.fixed_columns_mut::<1>(8).copy_from(&(d * r2));
    rows.fixed_columns_mut::<1>(9).copy_from(&(d * r2 * r2));
    rows.fixed_columns_mut::<2>(10).copy_from(&tangential_basis(d));
    rows.fixed_columns_mut::<2>(12).copy_from(&(Matrix2::identity() - slope));
    (center + distorted, rows)
}

impl Pairs {
    /// The homography that the pairs determine by linear least squares: the start of the fit.
    fn homography(&self) -> Option<SVector<f64, 8>> {
        let mut normal = SMatrix::<f64, 8, 8>::zeros();
        let mut right = SVector::<f64, 8>::zeros();
        for (pixel, target) in self.pixels.iter().zip(&self.targets) {
            for axis in 0..2 {
                let mut row = SVector::<f64, 8>::zeros();
                row.fixed_rows_mut::<3>(3 * axis).copy_from(&target.push(1.0));
                row.fixed_rows_mut::<2>(6).copy_from(&(-target * pixel[axis]));
                normal += row * row.transpose();
                right += row * pixel[axis];
            }
        }
        normal.cholesky().map(|factor| factor.solve(&right))
    }
}

impl LeastSquares for Pairs {
    fn cost(&self, parameters: &DVector<f64>) -> f64 {
        let p = parameters.as_slice();
        self.pixels.iter().zip(&self.targets).map(|(u, t)| (project(p, t).0 - u).norm_squared()).sum()
    }

    fn linearise(&self, parameters: &DVector<f64>, jtj: &mut DMatrix<f64>, jtr: &mut DVector<f64>) -> f64 {
        let mut normal = SMatrix::<f64, PHYSICAL_PARAMETERS, PHYSICAL_PARAMETERS>::zeros();
        let mut right = SVector::<f64, PHYSICAL_PARAMETERS>::zeros();
        let mut cost = 0.0;
        for (pixel, target) in self.pixels.iter().zip(&self.targets) {
            let (projected, rows) = project(parameters.as_slice(), target);
            let residual = projected - pixel;
            normal += rows.transpose() * rows;
            right += rows.transpose() * residual;
            cost += residual.norm_squared();
        }
        jtj.copy_from(&normal);
        jtr.copy_from(&right);
        cost
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_jacobian_is_the_slope_of_the_projection() {
        let parameters: Vec<f64> = [1.1, 0.1, 0.05, -0.2, 0.6, 0.1, 0.02, 0.2]
            .into_iter()
            .chain([-0.05, 0.02, 0.003, -0.004, 0.1, -0.2])
            .collect();
        let target = Vector2::new(0.7, -0.4);
        let (_, rows) = project(&parameters, &target);
        for i in 0..PHYSICAL_PARAMETERS {
            let moved = |by: f64| {
                let mut p = parameters.clone();
                p[i] += by;
                project(&p, &target).0
            };
            let slope = (moved(1e-6) - moved(-1e-6)) / 2e-6;
            assert!((slope - rows.column(i)).norm() < 1e-8, "parameter {i}: {slope} {}", rows.column(i));
        }
    }

    #[test]
    fn a_fold_of_the_lens_is_no_point() {
        let identity = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
        let unit = Scaling { center: [0.0, 0.0], half: 1.0 };
        let model = PhysicalModel {
            pixel_scaling: unit,
            target_scaling: unit,
            homography: identity,
            distortion: [-0.3, 0.0, 0.0, 0.0],
            center: [0.0, 0.0],
        };
        // x - 0.3 x^3 rises to 0.7027 at most.
        let back = model.map([0.6, 0.0]).unwrap();
        assert!((back[0] * (1.0 - 0.3 * back[0] * back[0]) - 0.6).abs() < 1e-9);
        assert_eq!(model.map([0.75, 0.0]), None);
        assert_eq!(model.map([f64::NAN, 0.0]), None);
    }

    #[test]
    fn pairs_on_a_line_determine_nothing() {
        let line: Vec<[f64; 2]> = (0..50).map(|i| [f64::from(i), 2.0 * f64::from(i)]).collect();
        assert_eq!(PhysicalModel::fit(&line, &line), None);
    }
}
