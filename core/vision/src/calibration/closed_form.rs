//! Intrinsics and poses in closed form, as the start of the adjustment.
//!
//! Zhang (2000), section 3.1, for a camera without skew.

use nalgebra::{Isometry3, Matrix3, Rotation3, SMatrix, SVector, Translation3, UnitQuaternion, Vector3};
use yamabico_geometry::camera::Intrinsics;

/// Range of a plausible focal length, as a share of the mean of width and height.
const FOCAL_SHARES: std::ops::Range<f64> = 0.2..20.0;

/// Computes the intrinsics from homographies (image from board, px from m) of at least two boards. Where the homographies do not
/// determine the principal point, it is the middle of the image; `None` if they determine nothing.
#[must_use]
pub fn intrinsics_of(homographies: &[Matrix3<f64>], [width, height]: [u32; 2]) -> Option<Intrinsics> {
    let (w, h) = (f64::from(width), f64::from(height));
    let (middle_u, middle_v, scale) = (0.5 * (w - 1.0), 0.5 * (h - 1.0), 2.0 / (w + h));
    let unit = Matrix3::new(scale, 0.0, -scale * middle_u, 0.0, scale, -scale * middle_v, 0.0, 0.0, 1.0);
    let mapped: Vec<Matrix3<f64>> = homographies
        .iter()
        .map(|homography| {
            let mapped = unit * homography;
            mapped / mapped.norm()
        })
        .collect();
    let found = general(&mapped).or_else(|| centered(&mapped))?;
    Some(Intrinsics {
        fx: found[0] / scale,
        fy: found[1] / scale,
        cx: found[2] / scale + middle_u,
        cy: found[3] / scale + middle_v,
        width,
        height,
    })
}

/// Returns the pose (camera from board) of a board with this homography (image from board).
#[must_use]
pub fn pose_of(homography: &Matrix3<f64>, intrinsics: &Intrinsics) -> Option<Isometry3<f64>> {
    let mapped = intrinsics.matrix().try_inverse()? * homography;
    let length = 0.5 * (mapped.column(0).norm() + mapped.column(1).norm());
    // The board is in front of the camera.
    let scale = mapped[(2, 2)].signum() / length;
    let (x, y): (Vector3<f64>, Vector3<f64>) = (mapped.column(0) * scale, mapped.column(1) * scale);
    let columns = Matrix3::from_columns(&[x, y, x.cross(&y)]);
    let svd = columns.svd(true, true);
    let rotation = svd.u? * svd.v_t?;
    let position: Vector3<f64> = mapped.column(2) * scale;
    let is_finite = rotation.iter().chain(position.iter()).all(|value| value.is_finite());
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    is_finite.then(|| Isometry3::from_parts(Translation3::from(position), turn))
}

/// Focal lengths and principal point from the image of the absolute conic.
fn general(homographies: &[Matrix3<f64>]) -> Option<[f64; 4]> {
    if homographies.len() < 3 {
        return None;
    }
    let mut normal = SMatrix::<f64, 5, 5>::zeros();
    for homography in homographies {
        let product = |i: usize, j: usize| {
            let (a, b) = (homography.column(i), homography.column(j));
            SVector::<f64, 5>::from([
                a[0] * b[0],
                a[1] * b[1],
                a[0] * b[2] + a[2] * b[0],
                a[1] * b[2] + a[2] * b[1],
                a[2] * b[2],
            ])
        };
        for row in [product(0, 1), product(0, 0) - product(1, 1)] {
            normal += row * row.transpose();
        }
    }
    let eigen = normal.symmetric_eigen();
    let conic = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
    let (b11, b22, b13, b23, b33) = (conic[0], conic[1], conic[2], conic[3], conic[4]);
    let scale = b33 - b13 * b13 / b11 - b23 * b23 / b22;
    let found = [(scale / b11).sqrt(), (scale / b22).sqrt(), -b13 / b11, -b23 / b22];
    let is_plausible = found[..2].iter().all(|focal| FOCAL_SHARES.contains(focal))
        && found[2..].iter().all(|center| center.abs() < 0.5)
        && (0.7..1.4).contains(&(found[0] / found[1]));
    is_plausible.then_some(found)
}

/// Focal length for a principal point in the middle and square pixels.
fn centered(homographies: &[Matrix3<f64>]) -> Option<[f64; 4]> {
    let (mut product, mut square) = (0.0, 0.0);
    for homography in homographies {
        let (a, b) = (homography.column(0), homography.column(1));
        for (plane, depth) in [
            (a[0] * b[0] + a[1] * b[1], a[2] * b[2]),
            (a[0] * a[0] + a[1] * a[1] - b[0] * b[0] - b[1] * b[1], a[2] * a[2] - b[2] * b[2]),
        ] {
            product += plane * depth;
            square += plane * plane;
        }
    }
    let focal = (-product / square).recip().sqrt();
    FOCAL_SHARES.contains(&focal).then_some([focal, focal, 0.0, 0.0])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(pose: &Isometry3<f64>, intrinsics: &Intrinsics) -> Matrix3<f64> {
        let rotation = pose.rotation.to_rotation_matrix().into_inner();
        let columns =
            [rotation.column(0).into_owned(), rotation.column(1).into_owned(), pose.translation.vector];
        intrinsics.matrix() * Matrix3::from_columns(&columns) * 1.7
    }

    #[test]
    fn exact_homographies_give_exact_intrinsics_and_poses() {
        let truth = Intrinsics { fx: 560.0, fy: 551.0, cx: 330.0, cy: 215.0, width: 640, height: 480 };
        let poses = [[0.4, 0.1, 0.2], [-0.3, 0.4, 0.1], [0.1, -0.5, -0.3], [0.5, 0.3, 1.4]]
            .map(|turn| Isometry3::new(Vector3::new(0.05, -0.1, 0.6), Vector3::from(turn)));
        let homographies: Vec<_> = poses.iter().map(|pose| seen(pose, &truth)).collect();
        let found = intrinsics_of(&homographies, [640, 480]).unwrap();
        assert!((found.matrix() - truth.matrix()).norm() < 1e-6, "{found:?}");
        for (pose, homography) in poses.iter().zip(&homographies) {
            let back = pose_of(homography, &truth).unwrap();
            assert!(back.rotation.angle_to(&pose.rotation) < 1e-9);
            assert!((back.translation.vector - pose.translation.vector).norm() < 1e-9);
        }
    }

    #[test]
    fn facing_boards_determine_nothing() {
        let camera = Intrinsics::from_horizontal_fov(640, 480, 1.0);
        let facing = |z: f64| seen(&Isometry3::new(Vector3::new(0.0, 0.0, z), Vector3::zeros()), &camera);
        assert!(intrinsics_of(&[facing(0.5), facing(0.7), facing(0.9)], [640, 480]).is_none());
    }
}
