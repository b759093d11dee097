//! Height of a static point from the motion of its floor foot: w = h / (h - z).
//!
//! The *foot* is the floor point of a pixel's ray, relative to the camera. While the camera moves by d, the foot of a
//! floor point stays, that of a point above runs toward the camera, that of a mirror image runs along with it: the
//! shift is exactly (1 - w) d. Plane and parallax: Sawhney (1994); Irani & Anandan (1998).

use nalgebra::{Point2, Vector2, Vector3};
use yamabico_geometry::Pose2;

use super::floor_view::FloorView;

/// Ratio w of the foot's distance to the point's, for a point at `height_m` below a camera at `camera_height_m`. 1 on
/// the floor, above 1 for a thing, between 0 and 1 for a mirror image, negative above the camera.
#[must_use]
pub fn foot_ratio(camera_height_m: f64, height_m: f64) -> f64 {
    camera_height_m / (camera_height_m - height_m)
}

/// Height of a point with the foot ratio `ratio`, m.
#[must_use]
pub fn height_m(camera_height_m: f64, ratio: f64) -> f64 {
    camera_height_m * (1.0 - 1.0 / ratio)
}

/// Image of a point in a floor that mirrors.
#[must_use]
pub fn mirrored(point: Vector3<f64>) -> Vector3<f64> {
    Vector3::new(point.x, point.y, -point.z)
}

/// A static point in two pictures, and where the floor behind it would have been.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parallax {
    /// Pixel in the current picture.
    pub current: Vector2<f64>,
    /// Pixel in the previous picture.
    pub previous: Vector2<f64>,
    /// Pixel of the previous picture that shows the floor below `current`; `None` from the horizon upward.
    pub floor: Option<Vector2<f64>>,
    /// Foot now minus foot then, m, in the previous robot frame; `None` if one of them does not exist.
    pub foot_shift: Option<Vector2<f64>>,
}

impl Parallax {
    /// Projects a point of the current robot frame (m); `None` if a camera does not have it in front.
    #[must_use]
    pub fn of_point(view: &FloorView, motion: &Pose2, point: &Vector3<f64>) -> Option<Self> {
        let moved = motion.transform_point(Point2::new(point.x, point.y));
        let before = Vector3::new(moved.x, moved.y, point.z);
        let current = view.project(&view.camera_from_robot(point))?;
        let previous = view.project(&view.camera_from_robot(&before))?;
        let foot_shift = view.floor_point(current).zip(view.floor_point(previous));
        Some(Self {
            current,
            previous,
            floor: view.warp(motion, 0.0, current),
            foot_shift: foot_shift.map(|(now, then)| motion.transform_point(now) - then),
        })
    }

    /// Deviation from the motion of the floor, px.
    #[must_use]
    pub fn deviation(&self) -> Option<Vector2<f64>> {
        self.floor.map(|floor| self.previous - floor)
    }
}
