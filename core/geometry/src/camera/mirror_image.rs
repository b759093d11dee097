//! The image of a mirror: a ring in which the direction from the center is the azimuth.

use nalgebra::{Matrix2, Vector2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_inline_default::serde_inline_default;

use super::is_in_image;
use super::mirror_camera::MirrorError;

/// Orientation with the robot's forward direction up in the image, and its left on the left.
const BIRDS_EYE: [[f64; 2]; 2] = [[0.0, -1.0], [-1.0, 0.0]];

/// Position, orientation and size of the mirror in the image.
///
/// The mirror plane has its origin at the image of the mirror's axis; x points to the robot's front and y to its left,
/// in pixels, so that the polar angle of a point is its azimuth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "MirrorImageConfig", try_from = "MirrorImageConfig")]
pub struct MirrorImage {
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
    center: Vector2<f64>,
    mirror_from_image: Matrix2<f64>,
    image_from_mirror: Matrix2<f64>,
    blind_radius_px: f64,
    rim_radius_px: f64,
}

impl MirrorImage {
    /// Creates a centered image in bird's-eye orientation, without a blind center, with the rim at the image border.
    #[must_use]
    pub fn centered(width: u32, height: u32) -> Self {
        let turn = Matrix2::new(BIRDS_EYE[0][0], BIRDS_EYE[0][1], BIRDS_EYE[1][0], BIRDS_EYE[1][1]);
        Self {
            width,
            height,
            center: Vector2::new(0.5 * (f64::from(width) - 1.0), 0.5 * (f64::from(height) - 1.0)),
            mirror_from_image: turn,
            image_from_mirror: turn,
            blind_radius_px: 0.0,
            rim_radius_px: 0.5 * f64::from(width.min(height)),
        }
    }

    /// Returns columns and rows of the image.
    #[must_use]
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// Returns this image with the mirror's axis at another pixel (u, v).
    ///
    /// # Errors
    /// [`MirrorError::Center`] if the pixel is not finite.
    pub fn with_center(self, center: Vector2<f64>) -> Result<Self, MirrorError> {
        if !center.iter().all(|value| value.is_finite()) {
            return Err(MirrorError::Center);
        }
        Ok(Self { center, ..self })
    }

    /// Returns this image with another matrix from image to mirror directions: a rotated or mirrored image, or
    /// non-square pixels.
    ///
    /// # Errors
    /// [`MirrorError::Orientation`] if the matrix cannot be inverted.
    pub fn with_orientation(self, mirror_from_image: Matrix2<f64>) -> Result<Self, MirrorError> {
        let determinant = mirror_from_image.determinant().abs();
        match mirror_from_image.try_inverse() {
            Some(image_from_mirror) if (0.05..=20.0).contains(&determinant) => {
                Ok(Self { mirror_from_image, image_from_mirror, ..self })
            }
            _ => Err(MirrorError::Orientation),
        }
    }

    /// Returns this image with another ring from the blind center to the rim, pixels of the mirror plane.
    ///
    /// # Errors
    /// [`MirrorError::Ring`] unless 0 <= blind < rim.
    pub fn with_ring(self, blind_radius_px: f64, rim_radius_px: f64) -> Result<Self, MirrorError> {
        if blind_radius_px >= 0.0 && blind_radius_px < rim_radius_px && rim_radius_px.is_finite() {
            Ok(Self { blind_radius_px, rim_radius_px, ..self })
        } else {
            Err(MirrorError::Ring { blind_radius_px, rim_radius_px })
        }
    }

    /// Returns the pixel (u, v) of the mirror's axis.
    #[must_use]
    pub fn center(&self) -> Vector2<f64> {
        self.center
    }

    /// Returns the radius of the blind center, in which camera and robot hide the scene, pixels of the mirror plane.
    #[must_use]
    pub fn blind_radius_px(&self) -> f64 {
        self.blind_radius_px
    }

    /// Returns the radius of the mirror's rim, pixels of the mirror plane.
    #[must_use]
    pub fn rim_radius_px(&self) -> f64 {
        self.rim_radius_px
    }

    /// Returns the point of the mirror plane (x forward, y left, pixels) at a pixel.
    #[inline]
    #[must_use]
    pub fn mirror_from_pixel(&self, pixel: Vector2<f64>) -> Vector2<f64> {
        self.mirror_from_image * (pixel - self.center)
    }

    /// Returns the pixel of a point of the mirror plane.
    #[inline]
    #[must_use]
    pub fn pixel_from_mirror(&self, point_in_mirror: Vector2<f64>) -> Vector2<f64> {
        self.center + self.image_from_mirror * point_in_mirror
    }

    /// Returns the pixel at a radius (pixels of the mirror plane) and an azimuth (rad, positive to the left of
    /// forward).
    #[inline]
    #[must_use]
    pub fn pixel_from_polar(&self, radius_px: f64, azimuth_rad: f64) -> Vector2<f64> {
        let (sin, cos) = azimuth_rad.sin_cos();
        self.pixel_from_mirror(Vector2::new(radius_px * cos, radius_px * sin))
    }

    /// Returns the azimuth at a pixel, rad in (-pi, pi], positive to the left of forward; `None` on the axis, where it
    /// is undefined.
    #[must_use]
    pub fn azimuth_from_pixel(&self, pixel: Vector2<f64>) -> Option<f64> {
        let point = self.mirror_from_pixel(pixel);
        (point.norm_squared() > 0.0).then(|| point.y.atan2(point.x))
    }

    /// Returns the image direction of increasing radius at an azimuth: pixels per pixel of the mirror plane.
    #[must_use]
    pub fn outward(&self, azimuth_rad: f64) -> Vector2<f64> {
        let (sin, cos) = azimuth_rad.sin_cos();
        self.image_from_mirror * Vector2::new(cos, sin)
    }

    /// Returns the image direction of increasing azimuth at an azimuth: pixels per pixel of the mirror plane.
    #[must_use]
    pub fn around(&self, azimuth_rad: f64) -> Vector2<f64> {
        let (sin, cos) = azimuth_rad.sin_cos();
        self.image_from_mirror * Vector2::new(-sin, cos)
    }

    /// Returns true if a radius lies between blind center and rim.
    #[inline]
    #[must_use]
    pub fn is_in_ring(&self, radius_px: f64) -> bool {
        radius_px >= self.blind_radius_px && radius_px <= self.rim_radius_px
    }

    /// Returns true if the pixel lies in the image: within [-0.5, width - 0.5) and [-0.5, height - 0.5).
    #[must_use]
    pub fn contains(&self, pixel: Vector2<f64>) -> bool {
        is_in_image(pixel, [self.width, self.height])
    }
}

/// A [`MirrorImage`] as a robot file writes it.
#[serde_inline_default]
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MirrorImageConfig {
    /// Image width, pixels.
    #[schemars(range(min = 16, max = 8192))]
    pub width: u32,
    /// Image height, pixels.
    #[schemars(range(min = 16, max = 8192))]
    pub height: u32,
    /// Column of the mirror's axis, pixels; without it, (width - 1)/2.
    #[serde(default)]
    #[schemars(range(min = -8192.0, max = 16_384.0))]
    pub cu: Option<f64>,
    /// Row of the mirror's axis, pixels; without it, (height - 1)/2.
    #[serde(default)]
    #[schemars(range(min = -8192.0, max = 16_384.0))]
    pub cv: Option<f64>,
    /// Radius around the axis that shows only camera and robot.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 8192.0))]
    pub blind_radius_px: f64,
    /// Radius of the mirror's rim; without it, half of the image's shorter side.
    #[serde(default)]
    #[schemars(range(min = 1.0, max = 16_384.0))]
    pub rim_radius_px: Option<f64>,
    /// Matrix, as two rows, from (right, down) in the image to (forward, left) at the mirror. By default, up is forward
    /// and left is left. For a camera that looks up at its mirror, without flipping the image: [[0, -1], [1, 0]].
    #[serde_inline_default(BIRDS_EYE)]
    #[schemars(inner(inner(range(min = -4.0, max = 4.0))))]
    pub mirror_from_image: [[f64; 2]; 2],
}

impl MirrorImageConfig {
    /// The checked image.
    ///
    /// # Errors
    /// [`MirrorError`] for a matrix without inverse or a ring without width.
    pub fn image(&self) -> Result<MirrorImage, MirrorError> {
        let plain = MirrorImage::centered(self.width, self.height);
        let [[a, b], [c, d]] = self.mirror_from_image;
        let center = Vector2::new(self.cu.unwrap_or(plain.center.x), self.cv.unwrap_or(plain.center.y));
        plain
            .with_center(center)?
            .with_orientation(Matrix2::new(a, b, c, d))?
            .with_ring(self.blind_radius_px, self.rim_radius_px.unwrap_or(plain.rim_radius_px))
    }
}

impl TryFrom<MirrorImageConfig> for MirrorImage {
    type Error = MirrorError;

    fn try_from(config: MirrorImageConfig) -> Result<Self, MirrorError> {
        config.image()
    }
}

impl From<MirrorImage> for MirrorImageConfig {
    fn from(image: MirrorImage) -> Self {
        let m = &image.mirror_from_image;
        Self {
            width: image.width,
            height: image.height,
            cu: Some(image.center.x),
            cv: Some(image.center.y),
            blind_radius_px: image.blind_radius_px,
            rim_radius_px: Some(image.rim_radius_px),
            mirror_from_image: [[m.m11, m.m12], [m.m21, m.m22]],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn up_is_forward_and_left_is_left() {
        let image = MirrorImage::centered(512, 480);
        assert_eq!(image.mirror_from_pixel(Vector2::new(255.5, 139.5)), Vector2::new(100.0, 0.0));
        assert_eq!(image.azimuth_from_pixel(Vector2::new(155.5, 239.5)), Some(FRAC_PI_2));
        assert_eq!(image.azimuth_from_pixel(image.center()), None);
        assert!((image.outward(0.0) - Vector2::new(0.0, -1.0)).norm() < 1e-15);
        assert!((image.around(0.0) - Vector2::new(-1.0, 0.0)).norm() < 1e-15);
        assert_eq!((image.rim_radius_px(), image.is_in_ring(240.1)), (240.0, false));
    }

    #[test]
    fn an_image_that_was_not_flipped_has_left_on_its_right() {
        let config: MirrorImageConfig =
            toml::from_str("width = 64\nheight = 64\nmirror_from_image = [[0, -1], [1, 0]]").unwrap();
        let image = config.image().unwrap();
        assert_eq!(image.azimuth_from_pixel(Vector2::new(60.0, 31.5)), Some(FRAC_PI_2));
        let there = image.pixel_from_polar(20.0, 0.7);
        assert!((image.azimuth_from_pixel(there).unwrap() - 0.7).abs() < 1e-14);
        assert!((image.mirror_from_pixel(there).norm() - 20.0).abs() < 1e-13);
    }

    #[test]
    fn invalid_rings_and_orientations_are_refused() {
        let image = MirrorImage::centered(64, 48);
        assert!(matches!(image.with_ring(30.0, 24.0), Err(MirrorError::Ring { .. })));
        assert!(image.with_ring(-1.0, 24.0).is_err() && image.with_ring(0.0, f64::NAN).is_err());
        assert_eq!(image.with_orientation(Matrix2::new(1.0, 1.0, 1.0, 1.0)), Err(MirrorError::Orientation));
        assert_eq!(image.with_orientation(Matrix2::repeat(f64::NAN)), Err(MirrorError::Orientation));
        assert_eq!(image.with_center(Vector2::new(f64::NAN, 0.0)), Err(MirrorError::Center));
    }
}
