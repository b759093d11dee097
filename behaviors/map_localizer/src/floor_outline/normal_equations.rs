use nalgebra::{Matrix3, Matrix4, Vector2, Vector3, Vector4};

/// Point that should lie on a line, in the frame to be corrected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineMeasurement {
    /// Measured point.
    pub point: Vector2<f64>,
    /// Unit normal of the line.
    pub normal: Vector2<f64>,
    /// Offset of the line along its normal.
    pub offset: f64,
    /// Weight of the squared distance.
    pub weight: f64,
    /// Derivative of the point's distance along the normal with respect to the common shift in the image; 0 if the
    /// shift is not estimated.
    pub shift_slope: f64,
}

/// Normal equations of a small correction (a, b, zeta), which moves a point p to Rot(-zeta) p + (a, b), and of a common
/// shift of all points in the image as the fourth unknown.
///
/// Sekimori et al. (2001), equation 15.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NormalEquations {
    /// Matrix, symmetric.
    pub matrix: Matrix4<f64>,
    /// Right-hand side.
    pub right: Vector4<f64>,
}

/// Condition number above which the equations count as singular.
const MAX_SOLVABLE_CONDITION: f64 = 1e12;

impl NormalEquations {
    /// Adds a measurement.
    #[inline]
    pub fn add(&mut self, measurement: &LineMeasurement) {
        let (p, n) = (measurement.point, measurement.normal);
        let row = Vector4::new(n.x, n.y, n.x * p.y - n.y * p.x, measurement.shift_slope);
        let error = measurement.offset - n.dot(&p);
        let weighted = row * measurement.weight;
        self.matrix += weighted * row.transpose();
        self.right += weighted * error;
    }

    /// Returns the equations of (a, b, zeta) alone.
    #[must_use]
    pub fn pose_block(&self) -> (Matrix3<f64>, Vector3<f64>) {
        (self.matrix.fixed_view::<3, 3>(0, 0).into(), self.right.fixed_rows::<3>(0).into())
    }

    /// Returns the condition number of the matrix of (a, b, zeta), with zeta in units of 1/`length` rad (1 for points
    /// in meters, 1000 for millimeters); infinite if singular.
    #[must_use]
    pub fn condition(&self, length: f64) -> f64 {
        let scale = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 1.0 / length));
        let (matrix, _) = self.pose_block();
        let values = (scale * matrix * scale).symmetric_eigenvalues();
        let (min, max) = (values.min(), values.max());
        if min > 0.0 && max.is_finite() { max / min } else { f64::INFINITY }
    }

    /// Returns the correction (a, b, zeta) and the inverse of its matrix; `None` if the matrix is singular. For
    /// `length` see [`NormalEquations::condition`].
    #[must_use]
    pub fn solve_pose(&self, length: f64) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        let (matrix, right) = self.pose_block();
        let inverse = matrix.cholesky()?.inverse();
        // The product of the norms is an upper bound of the condition number and cheaper to compute.
        let scale = Vector3::new(1.0, 1.0, 1.0 / length);
        let scaled = |m: &Matrix3<f64>, s: &Vector3<f64>| m.component_mul(&(s * s.transpose())).norm();
        let bound = scaled(&matrix, &scale) * scaled(&inverse, &scale.map(f64::recip));
        if bound <= MAX_SOLVABLE_CONDITION || self.condition(length) <= MAX_SOLVABLE_CONDITION {
            Some((inverse * right, inverse))
        } else {
            None
        }
    }

    /// Returns the correction including the common shift, and the inverse of the matrix; `None` if the matrix is
    /// singular.
    #[must_use]
    pub fn solve_all(&self) -> Option<(Vector4<f64>, Matrix4<f64>)> {
        let inverse = self.matrix.cholesky()?.inverse();
        let solution = inverse * self.right;
        solution.iter().all(|x| x.is_finite()).then_some((solution, inverse))
    }
}
