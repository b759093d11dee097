//! Homography between two planes, by the direct linear transform on normalized coordinates.

use nalgebra::{Matrix3, SMatrix, SVector, Vector2};

/// Computes the homography that maps `from` to `to`, scaled to a lower right element of 1 where that is not zero; `None` for fewer
/// than four pairs, or points on a line.
#[must_use]
pub fn homography(from: &[Vector2<f64>], to: &[Vector2<f64>]) -> Option<Matrix3<f64>> {
    if from.len() != to.len() || from.len() < 4 {
        return None;
    }
    let (from_unit, to_unit) = (normalization(from)?, normalization(to)?);
    let mut normal = SMatrix::<f64, 9, 9>::zeros();
    for (a, b) in from.iter().zip(to) {
        let (p, q) = (apply(&from_unit, *a), apply(&to_unit, *b));
        for row in [
            SVector::<f64, 9>::from([p.x, p.y, 1.0, 0.0, 0.0, 0.0, -q.x * p.x, -q.x * p.y, -q.x]),
            SVector::<f64, 9>::from([0.0, 0.0, 0.0, p.x, p.y, 1.0, -q.y * p.x, -q.y * p.y, -q.y]),
        ] {
            normal += row * row.transpose();
        }
    }
    let eigen = normal.symmetric_eigen();
    let mut order: Vec<usize> = (0..9).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    // Two vanishing eigenvalues: the points do not determine the homography.
    if eigen.eigenvalues[order[1]] < 1e-10 * eigen.eigenvalues[order[8]] {
        return None;
    }
    let h = eigen.eigenvectors.column(order[0]);
    let unit = Matrix3::new(h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], h[8]);
    let mapped = to_unit.try_inverse()? * unit * from_unit;
    let last = mapped[(2, 2)];
    Some(if last.abs() > 1e-12 * mapped.norm() { mapped / last } else { mapped })
}

/// Maps a point by a homography.
#[must_use]
pub fn apply(homography: &Matrix3<f64>, point: Vector2<f64>) -> Vector2<f64> {
    let mapped = homography * point.push(1.0);
    mapped.xy() / mapped.z
}

/// Returns the similarity that moves the points to a mean of zero and a mean distance of sqrt 2; `None` for coinciding points.
fn normalization(points: &[Vector2<f64>]) -> Option<Matrix3<f64>> {
    let count = points.len() as f64;
    let mean = points.iter().sum::<Vector2<f64>>() / count;
    let distance = points.iter().map(|point| (point - mean).norm()).sum::<f64>() / count;
    let scale = std::f64::consts::SQRT_2 / distance;
    let unit = Matrix3::new(scale, 0.0, -scale * mean.x, 0.0, scale, -scale * mean.y, 0.0, 0.0, 1.0);
    (distance > 0.0 && unit.iter().all(|value| value.is_finite())).then_some(unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_homography_is_recovered_and_a_line_is_refused() {
        let truth = Matrix3::new(1.2, 0.1, 30.0, -0.2, 0.9, 50.0, 4e-4, -2e-4, 1.0);
        let from: Vec<Vector2<f64>> =
            (0..20).map(|i| Vector2::new(f64::from(i % 5) * 30.0, f64::from(i / 5) * 40.0)).collect();
        let to: Vec<Vector2<f64>> = from.iter().map(|point| apply(&truth, *point)).collect();
        let found = homography(&from, &to).unwrap();
        assert!((found - truth).norm() < 1e-8, "{found}");
        assert!(homography(&from[..5], &to[..5]).is_none(), "on a line");
        assert!(homography(&from[..3], &to[..3]).is_none());
        assert!(homography(&[Vector2::zeros(); 8], &to[..8]).is_none());
    }
}
