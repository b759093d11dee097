//! Image size, focal lengths and principal point of a pinhole camera.

use nalgebra::{Matrix3, Vector2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_inline_default::serde_inline_default;

use super::distortion::Distortion;
use super::is_in_image;
use super::pinhole::Pinhole;

/// Intrinsic parameters without distortion, and the image size; pixels, with pixel centers on integers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Intrinsics {
    /// Horizontal focal length, pixels.
    pub fx: f64,
    /// Vertical focal length, pixels.
    pub fy: f64,
    /// Column of the principal point, pixels.
    pub cx: f64,
    /// Row of the principal point, pixels.
    pub cy: f64,
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
}

impl Intrinsics {
    /// Returns columns and rows of the image.
    #[must_use]
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// Creates intrinsics with square pixels and a centered principal point from the horizontal field of view (rad, in
    /// (0, pi)) across the whole width: `fx = (width/2) / tan(fov/2)`.
    #[must_use]
    pub fn from_horizontal_fov(width: u32, height: u32, fov_rad: f64) -> Self {
        let focal = 0.5 * f64::from(width) / (0.5 * fov_rad).tan();
        Self {
            fx: focal,
            fy: focal,
            cx: 0.5 * (f64::from(width) - 1.0),
            cy: 0.5 * (f64::from(height) - 1.0),
            width,
            height,
        }
    }

    /// Returns the horizontal field of view across the whole width, rad.
    #[must_use]
    pub fn horizontal_fov(&self) -> f64 {
        2.0 * (0.5 * f64::from(self.width) / self.fx).atan()
    }

    /// Returns the matrix K, which maps a point of the plane z = 1 to its undistorted pixel.
    #[must_use]
    pub fn matrix(&self) -> Matrix3<f64> {
        Matrix3::new(self.fx, 0.0, self.cx, 0.0, self.fy, self.cy, 0.0, 0.0, 1.0)
    }

    /// Returns the normalized coordinates ((u - cx)/fx, (v - cy)/fy) of an undistorted pixel.
    #[must_use]
    pub fn normalized_from_pixel(&self, pixel: Vector2<f64>) -> Vector2<f64> {
        Vector2::new((pixel.x - self.cx) / self.fx, (pixel.y - self.cy) / self.fy)
    }

    /// Returns the undistorted pixel of normalized coordinates.
    #[must_use]
    pub fn pixel_from_normalized(&self, normalized: Vector2<f64>) -> Vector2<f64> {
        Vector2::new(self.fx * normalized.x + self.cx, self.fy * normalized.y + self.cy)
    }

    /// Returns true if the pixel lies in the image: within [-0.5, width - 0.5) and [-0.5, height - 0.5).
    #[must_use]
    pub fn contains(&self, pixel: Vector2<f64>) -> bool {
        is_in_image(pixel, [self.width, self.height])
    }

    /// Returns true for finite numbers, positive focal lengths and an image of at least one pixel.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        [self.fx, self.fy, self.cx, self.cy].iter().all(|value| value.is_finite())
            && self.fx > 0.0
            && self.fy > 0.0
            && self.width > 0
            && self.height > 0
    }
}

/// A pinhole camera as a robot file writes it: image size, field of view in degrees or focal lengths in pixels, and the
/// distortion.
#[serde_inline_default]
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct IntrinsicsConfig {
    /// Image width, pixels.
    #[schemars(range(min = 16, max = 8192))]
    pub width: u32,
    /// Image height, pixels.
    #[schemars(range(min = 16, max = 8192))]
    pub height: u32,
    /// Horizontal field of view, which gives a focal length that is not set.
    #[serde_inline_default(60.0)]
    #[schemars(range(min = 5.0, max = 170.0))]
    pub fov_deg: f64,
    /// Horizontal focal length, pixels; without it, from `fov_deg`.
    #[serde(default)]
    #[schemars(range(min = 1.0, max = 1e5))]
    pub fx: Option<f64>,
    /// Vertical focal length, pixels; without it, `fx`.
    #[serde(default)]
    #[schemars(range(min = 1.0, max = 1e5))]
    pub fy: Option<f64>,
    /// Column of the principal point, pixels; without it, (width - 1)/2.
    #[serde(default)]
    #[schemars(range(min = -8192.0, max = 16_384.0))]
    pub cx: Option<f64>,
    /// Row of the principal point, pixels; without it, (height - 1)/2.
    #[serde(default)]
    #[schemars(range(min = -8192.0, max = 16_384.0))]
    pub cy: Option<f64>,
    /// Brown-Conrady coefficients.
    #[serde(default)]
    pub distortion: Distortion,
}

impl IntrinsicsConfig {
    /// Returns the intrinsics.
    #[must_use]
    pub fn intrinsics(&self) -> Intrinsics {
        let from_fov = Intrinsics::from_horizontal_fov(self.width, self.height, self.fov_deg.to_radians());
        let fx = self.fx.unwrap_or(from_fov.fx);
        Intrinsics {
            fx,
            fy: self.fy.unwrap_or(fx),
            cx: self.cx.unwrap_or(from_fov.cx),
            cy: self.cy.unwrap_or(from_fov.cy),
            ..from_fov
        }
    }

    /// The whole camera.
    #[must_use]
    pub fn pinhole(&self) -> Pinhole {
        Pinhole::new(self.intrinsics(), self.distortion)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn field_of_view_gives_the_focal_length() {
        let intrinsics = Intrinsics::from_horizontal_fov(640, 480, 60.0_f64.to_radians());
        assert!((intrinsics.fx - 554.256_258_422_040_8).abs() < 1e-9);
        assert_eq!((intrinsics.cx, intrinsics.cy), (319.5, 239.5));
        assert!((intrinsics.horizontal_fov().to_degrees() - 60.0).abs() < 1e-12);
        let config: IntrinsicsConfig = toml::from_str("width = 640\nheight = 480\nfov_deg = 60.0").unwrap();
        assert_eq!(config.intrinsics(), intrinsics);
        assert!(toml::from_str::<IntrinsicsConfig>("width = 640\nheight = 480\nfov = 60.0").is_err());
    }

    #[test]
    fn every_number_of_a_camera_has_a_range() {
        let schema = schemars::schema_for!(IntrinsicsConfig).to_value();
        let distortion = &schema["$defs"]["Distortion"];
        for properties in [&schema["properties"], &distortion["properties"]] {
            for (key, part) in properties.as_object().unwrap().iter().filter(|(key, _)| *key != "distortion")
            {
                assert!(part["minimum"].is_number() && part["maximum"].is_number(), "{key}: {part}");
            }
        }
    }
}
