//! Projection of points and patches of the current picture into older ones.

use nalgebra::{Matrix3, Vector2, Vector3};

use super::floor_view::FloorView;
use super::parallax_search::Baseline;

/// Projection of a point at a depth on the ray of a pixel: `turn * pixel + shift / depth`, homogeneous.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Projection {
    pub turn: Matrix3<f32>,
    pub shift: Vector3<f32>,
    /// Factor on the gray levels of the older picture.
    pub gain: f32,
}

impl Projection {
    /// Projection into the older picture of `baseline`; `mean` is the mean gray level of the current one.
    pub fn new(view: &FloorView, baseline: &Baseline, mean: f32) -> Self {
        let motion = view.camera_motion(&baseline.motion);
        let matrix = view.intrinsics().matrix();
        Self {
            turn: (matrix * motion.rotation * inverse_intrinsics(view)).cast(),
            shift: (matrix * motion.translation).cast(),
            gain: mean / baseline.image.mean().max(1.0),
        }
    }

    /// Pixel of the older picture.
    #[inline(always)]
    pub fn pixel(&self, pixel: &Vector3<f32>, inverse_depth: f32) -> Vector2<f32> {
        let p = self.turn * pixel + self.shift * inverse_depth;
        p.xy() / p.z
    }
}

fn inverse_intrinsics(view: &FloorView) -> Matrix3<f64> {
    let camera = view.intrinsics();
    let (fx, fy) = (camera.fx, camera.fy);
    Matrix3::new(1.0 / fx, 0.0, -camera.cx / fx, 0.0, 1.0 / fy, -camera.cy / fy, 0.0, 0.0, 1.0)
}

/// Planes of the patches, as row vectors on homogeneous pixels: distance along the normal for depth 1.
pub(super) struct Planes {
    pub level: Vector3<f32>,
    /// Faces along the robot's x axis.
    pub upright: Vector3<f32>,
}

impl Planes {
    /// Planes seen by a camera.
    pub fn new(view: &FloorView) -> Self {
        let plane = |normal: Vector3<f64>| {
            inverse_intrinsics(view).tr_mul(&view.robot_from_camera().tr_mul(&normal)).cast()
        };
        Self { level: plane(-Vector3::z()), upright: plane(Vector3::x()) }
    }
}
