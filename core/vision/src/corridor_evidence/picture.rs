//! Image geometry at a width of 640 px.

use nalgebra::Vector2;
use yamabico_geometry::camera::Intrinsics;

/// Width of every image after scaling, px.
pub const WIDTH: f64 = 640.0;

/// Geometry of an image scaled to a width of [`WIDTH`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Picture {
    /// Height, px.
    pub height: f64,
    /// Focal length, px.
    pub focal: f64,
    /// Principal point, px.
    pub center: Vector2<f64>,
    /// Pixels of the scaled image per pixel of the camera.
    pub scale: f64,
}

impl Picture {
    /// Scales the image of this camera.
    #[must_use]
    pub fn of(camera: &Intrinsics) -> Self {
        let scale = WIDTH / f64::from(camera.width).max(1.0);
        Self {
            height: f64::from(camera.height) * scale,
            focal: camera.fx * scale,
            center: Vector2::new(camera.cx, camera.cy) * scale,
            scale,
        }
    }

    /// Angle of a column from the optical axis, rad, positive to the right. If it is the column of the vanishing point, this is
    /// the heading of a level camera in the corridor, positive to the left.
    #[must_use]
    pub fn heading_of(&self, u: f64) -> f64 {
        ((u - self.center.x) / self.focal).atan()
    }

    /// Angle of a row below the optical axis, rad.
    #[must_use]
    pub fn depression_of(&self, v: f64) -> f64 {
        ((v - self.center.y) / self.focal).atan()
    }

    /// Horizontal field of view, rad.
    #[must_use]
    pub fn field_of_view(&self) -> f64 {
        2.0 * (0.5 * WIDTH / self.focal).atan()
    }
}
