//! How well the mount is known.

use std::fmt;

use nalgebra::{DMatrix, DVector, Matrix6, SMatrix, SymmetricEigen, Vector3, Vector6};

use super::problem::{COLUMNS, LENGTH_M, MOUNT, Problem};
use crate::scan::levenberg::LeastSquares;

/// Covariance of a mount.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Uncertainty {
    /// Of the turn about the palm's axes \[rad\], then of the shift of the scanner's origin along them \[m\].
    pub covariance: Matrix6<f64>,
}

impl Uncertainty {
    /// Standard deviations of the turn about the palm's axes.
    #[must_use]
    pub fn rotation_std_rad(&self) -> [f64; 3] {
        std::array::from_fn(|i| self.covariance[(i, i)].max(0.0).sqrt())
    }

    /// Standard deviations of the scanner's origin along the palm's axes.
    #[must_use]
    pub fn position_std_m(&self) -> [f64; 3] {
        std::array::from_fn(|i| self.covariance[(3 + i, 3 + i)].max(0.0).sqrt())
    }

    /// Standard deviation, in space, of a point that stands still in the scanner frame; `arm` leads to it from the
    /// scanner's origin, in the palm's axes, metres. Turn and shift make up for each other: at the targets' distance it
    /// is smaller than at the scanner.
    #[must_use]
    pub fn point_std_m(&self, arm: &Vector3<f64>) -> f64 {
        let mut jacobian = SMatrix::<f64, 3, 6>::zeros();
        jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&-arm.cross_matrix());
        jacobian.fixed_view_mut::<3, 3>(0, 3).fill_with_identity();
        (jacobian * self.covariance * jacobian.transpose()).trace().max(0.0).sqrt()
    }

    /// Standard deviation along a direction, as a multiple of it.
    #[must_use]
    pub fn along(&self, direction: &WeakDirection) -> f64 {
        let WeakDirection { turn_rad: turn, shift_m: shift } = direction;
        let scaled = shift / (LENGTH_M * LENGTH_M);
        let vector = Vector6::new(turn.x, turn.y, turn.z, scaled.x, scaled.y, scaled.z);
        (vector.dot(&(self.covariance * vector)).max(0.0)).sqrt()
    }

    /// From the covariance of parameters that begin with the mount's.
    pub(super) fn of_parameters(covariance: &DMatrix<f64>) -> Self {
        let mut block: Matrix6<f64> = covariance.fixed_view::<MOUNT, MOUNT>(0, 0).into_owned();
        for i in 3..MOUNT {
            for j in 0..MOUNT {
                block[(i, j)] *= LENGTH_M;
                block[(j, i)] *= LENGTH_M;
            }
        }
        Self { covariance: block }
    }
}

/// A motion of the mount, of which the measurements say least.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WeakDirection {
    /// Turn about the palm's axes; with the shift, a unit vector when lengths are counted in 0.2 m.
    pub turn_rad: Vector3<f64>,
    /// Shift along them.
    pub shift_m: Vector3<f64>,
}

impl WeakDirection {
    /// Whether it is a shift. A turn shifts the scanner too when its axis passes the target, at 0.2 m from it.
    #[must_use]
    pub fn is_shift(&self) -> bool {
        self.turn_rad.norm() < 0.3 * self.shift_m.norm() / LENGTH_M
    }
}

impl fmt::Display for WeakDirection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let axis = |v: &Vector3<f64>| {
            let v = v.normalize();
            format!("({:.2}, {:.2}, {:.2})", v.x, v.y, v.z)
        };
        if self.is_shift() {
            let axis = axis(&self.shift_m);
            return write!(
                f,
                "a shift along the palm's {axis} changes nothing; turn the palm about other axes too"
            );
        }
        write!(
            f,
            "a turn about the palm's {} changes nothing; sweep with the target elsewhere in the scanner's field too, \
             nearer, farther, and to either side",
            axis(&self.turn_rad)
        )
    }
}

/// Covariance of all parameters at a minimum, from the noise of the points.
pub(super) struct Covariance {
    pub(super) parameters: DMatrix<f64>,
    /// Worst over best determined direction of the mount, standard deviations.
    pub(super) condition: f64,
    pub(super) weakest: WeakDirection,
}

/// The share of the largest diagonal element that is added where nothing at all is known.
const RIDGE: f64 = 1e-14;

/// `A^-1 M A^-1`, A the weighted normal matrix and M that of the pulls' squares (Huber 1981, section 7.6): it holds
/// for points whose noise differs, as at the flanks of a ball, and leaves outliers out.
pub(super) fn covariance(problem: &Problem<'_>) -> Covariance {
    let n = problem.parameters();
    let zero = DVector::zeros(n);
    let (mut normal, mut gradient) = (DMatrix::zeros(n, n), DVector::zeros(n));
    problem.linearise(&zero, &mut normal, &mut gradient);
    let mut pulls = DMatrix::zeros(n, n);
    let (mut points, mut weights, mut curvatures) = (0.0, 0.0, 0.0);
    problem.each_profile(&zero, |profile, rows| {
        let mut square = SMatrix::<f64, COLUMNS, COLUMNS>::zeros();
        for (residual, row) in rows {
            let weight = problem.loss.weight(*residual);
            points += 1.0;
            weights += weight;
            curvatures += problem.loss.curvature(*residual);
            square.ger((weight * residual).powi(2), row, row, 1.0);
        }
        problem.scatter(profile, &square, &mut pulls);
    });
    let ridge = RIDGE * normal.diagonal().max().max(f64::MIN_POSITIVE);
    for i in 0..n {
        normal[(i, i)] += ridge;
    }
    let inverse = normal.try_inverse().unwrap_or_else(|| DMatrix::identity(n, n) / ridge);
    // The weighted normal matrix stands for that of second derivatives, which is smaller by the mean.
    let correction = weights / f64::max(curvatures, 0.1 * weights);
    let freedom = points / f64::max(points - n as f64, 1.0);
    let parameters = &inverse * pulls * &inverse * (correction * correction * freedom);
    let (condition, weakest) = weakest(&inverse);
    Covariance { parameters, condition, weakest }
}

fn weakest(inverse: &DMatrix<f64>) -> (f64, WeakDirection) {
    if inverse.nrows() < MOUNT {
        return (1.0, WeakDirection { turn_rad: Vector3::zeros(), shift_m: Vector3::zeros() });
    }
    let block: Matrix6<f64> = inverse.fixed_view::<MOUNT, MOUNT>(0, 0).into_owned();
    let eigen = SymmetricEigen::new((block + block.transpose()) * 0.5);
    let (most, least) = (eigen.eigenvalues.max(), eigen.eigenvalues.min());
    let direction = eigen.eigenvectors.column(eigen.eigenvalues.imax());
    let direction = direction * direction[direction.iamax()].signum();
    let turn_rad = direction.fixed_rows::<3>(0).into_owned();
    let shift_m = direction.fixed_rows::<3>(3) * LENGTH_M;
    let condition = if least > 0.0 { (most / least).sqrt() } else { f64::MAX };
    (condition, WeakDirection { turn_rad, shift_m })
}
