use nalgebra::{Matrix3, Matrix4, Vector2, Vector3, Vector4};

/// A point that should lie on a line, in the frame that is to be corrected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineMeasurement {
    /// The point.
    pub point: Vector2<f64>,
    /// Normal of the line, of unit length.
    pub normal: Vector2<f64>,
    /// Offset of the line along its normal.
    pub offset: f64,
    /// Weight of the squared distance.
    pub weight: f64,
    /// Derivative of the point's distance along the normal by the common shift in the picture; 0 where that is not asked for.
    pub shift_slope: f64,
}

/// The linear equations of a small correction (a, b, zeta): a point p belongs at Rot(-zeta) p + (a, b); and, as the fourth
/// unknown, of a common shift of all points in the picture.
///
/// Sekimori et al. (2001), equation 15.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NormalEquations {
    /// Symmetric.
    pub matrix: Matrix4<f64>,
    /// The right-hand side.
    pub right: Vector4<f64>,
}

/// Beyond this condition the equations have no solution.
const SINGULAR: f64 = 1e12;

impl NormalEquations {
    /// Adds a point.
    #[inline]
    pub fn add(&mut self, of: &LineMeasurement) {
        let (p, n) = (of.point, of.normal);
        let row = Vector4::new(n.x, n.y, n.x * p.y - n.y * p.x, of.shift_slope);
        let error = of.offset - n.dot(&p);
        let weighted = row * of.weight;
        self.matrix += weighted * row.transpose();
        self.right += weighted * error;
    }

    /// The equations of the pose alone.
    #[must_use]
    pub fn of_pose(&self) -> (Matrix3<f64>, Vector3<f64>) {
        (self.matrix.fixed_view::<3, 3>(0, 0).into(), self.right.fixed_rows::<3>(0).into())
    }

    /// Largest over smallest eigenvalue of the pose's matrix, with the turn's unknown in units of 1/`length` radians (1 for points in
    /// meters, 1000 for millimeters). Infinite for a singular one.
    #[must_use]
    pub fn condition(&self, length: f64) -> f64 {
        let scale = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 1.0 / length));
        let (matrix, _) = self.of_pose();
        let values = (scale * matrix * scale).symmetric_eigenvalues();
        let (least, most) = (values.min(), values.max());
        if least > 0.0 && most.is_finite() { most / least } else { f64::INFINITY }
    }

    /// The correction (a, b, zeta), and the inverse of its matrix; `None` where the points leave it open.
    #[must_use]
    pub fn solve_pose(&self, length: f64) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        let (matrix, right) = self.of_pose();
        let inverse = matrix.cholesky()?.inverse();
        // The product of the norms bounds the condition, and is at hand.
        let scale = Vector3::new(1.0, 1.0, 1.0 / length);
        let scaled = |m: &Matrix3<f64>, s: &Vector3<f64>| m.component_mul(&(s * s.transpose())).norm();
        let bound = scaled(&matrix, &scale) * scaled(&inverse, &scale.map(f64::recip));
        if bound <= SINGULAR || self.condition(length) <= SINGULAR {
            Some((inverse * right, inverse))
        } else {
            None
        }
    }

    /// The correction with the common shift as the fourth, and the inverse of the matrix.
    #[must_use]
    pub fn solve_all(&self) -> Option<(Vector4<f64>, Matrix4<f64>)> {
        let inverse = self.matrix.cholesky()?.inverse();
        let solution = inverse * self.right;
        solution.iter().all(|x| x.is_finite()).then_some((solution, inverse))
    }
}
