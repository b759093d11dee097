//! An omnidirectional camera: a camera that looks up at a mirror.
//!
//! At zero angles of the mount, the mirror's frame is the body frame: x forward, y left, z up along the mirror's axis.
//! Its origin is the lens center below a conic or hyperboloidal mirror, and the viewpoint of a radial model.

use nalgebra::{Point3, Vector2, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::conic_mirror::{ConicMirror, ConicMirrorConfig};
use super::hyperboloidal_mirror::{HyperboloidalMirror, HyperboloidalMirrorConfig};
use super::mirror_image::{MirrorImage, MirrorImageConfig};
use super::radial_model::{RadialModel, RadialModelConfig};
use crate::Hypotenuse;

/// A mirror of revolution, described in the half-plane of one azimuth by coordinates (distance from the axis, height
/// above the origin), m.
pub trait Meridian {
    /// Returns the viewpoint, in which all rays of the half-plane meet; a negative distance lies on the other side of
    /// the axis.
    fn viewpoint(&self) -> Vector2<f64>;

    /// Returns the unit direction (outward, up) of an image radius (pixels), or `None` if the mirror shows nothing
    /// there.
    fn direction(&self, radius_px: f64) -> Option<Vector2<f64>>;

    /// Returns the image radius (pixels) of a direction (outward, up) of any length, or `None` if the mirror does not
    /// show it.
    fn radius_px(&self, direction: Vector2<f64>) -> Option<f64>;

    /// Returns the derivative of the angle from straight down by the image radius, rad per pixel.
    fn nadir_slope(&self, radius_px: f64) -> f64;
}

/// Mirror models.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Mirror {
    /// A cone, with a circle of viewpoints.
    Conic(ConicMirror),
    /// A hyperboloid, with one viewpoint.
    Hyperboloidal(HyperboloidalMirror),
    /// A measured relation of image radius and direction, with one viewpoint.
    Radial(RadialModel),
}

impl Mirror {
    fn meridian(&self) -> &dyn Meridian {
        match self {
            Mirror::Conic(mirror) => mirror,
            Mirror::Hyperboloidal(mirror) => mirror,
            Mirror::Radial(model) => model,
        }
    }
}

impl Meridian for Mirror {
    fn viewpoint(&self) -> Vector2<f64> {
        self.meridian().viewpoint()
    }

    fn direction(&self, radius_px: f64) -> Option<Vector2<f64>> {
        self.meridian().direction(radius_px)
    }

    fn radius_px(&self, direction: Vector2<f64>) -> Option<f64> {
        self.meridian().radius_px(direction)
    }

    fn nadir_slope(&self, radius_px: f64) -> f64 {
        self.meridian().nadir_slope(radius_px)
    }
}

/// A ray in the mirror's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MirrorRay {
    /// Point at which the ray leaves the mirror, or the viewpoint of a central camera, m.
    pub origin: Point3<f64>,
    /// Unit direction.
    pub direction: Vector3<f64>,
}

/// An omnidirectional camera: a mirror and its image.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MirrorCamera {
    image: MirrorImage,
    mirror: Mirror,
}

/// Reason why a point cannot be projected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum MirrorProjectionError {
    /// The mirror does not reflect this direction into the lens.
    #[error("the mirror does not show this direction")]
    OutOfView,
    /// Camera or robot hide the point.
    #[error("the point lies in the blind center of the mirror")]
    BlindCenter,
    /// The mirror is too small.
    #[error("the point lies outside the rim of the mirror")]
    BeyondRim,
}

/// Invalid parameter of a mirror camera.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum MirrorError {
    /// The mirror's center is not finite.
    #[error("the mirror's center must be finite")]
    Center,
    /// The matrix from image to mirror cannot be inverted reliably.
    #[error(
        "the matrix `mirror_from_image` cannot be inverted: use a rotation or a reflection, with a determinant near 1 or -1"
    )]
    Orientation,
    /// The ring has no width.
    #[error(
        "a ring from {blind_radius_px} to {rim_radius_px} px is invalid: 0 <= blind_radius_px < rim_radius_px must hold"
    )]
    Ring {
        /// Radius of the blind center, pixels.
        blind_radius_px: f64,
        /// Radius of the rim, pixels.
        rim_radius_px: f64,
    },
    /// A length or an angle is impossible.
    #[error("the mirror is invalid: {0}")]
    Shape(&'static str),
    /// The floor formula does not satisfy a^2 > b^2 c, or its focus would lie below the lens.
    #[error(
        "the floor formula does not describe a hyperboloid above this lens: a^2 > b^2 c must hold, and a, b and c must be above 0"
    )]
    FloorFormula,
    /// A measured profile is not monotonic.
    #[error(
        "at {radius_px:.1} px the profile does not grow with the radius or leaves 0 to 180 degrees: correct the coefficients, or narrow the ring by `blind_radius_px` and `rim_radius_px`"
    )]
    Profile {
        /// First invalid image radius, pixels.
        radius_px: f64,
    },
    /// The mirror shows nothing at the blind center's edge or at the rim.
    #[error(
        "the mirror shows nothing at {radius_px:.1} px: narrow the ring by `blind_radius_px` and `rim_radius_px`"
    )]
    Rim {
        /// Image radius, pixels.
        radius_px: f64,
    },
}

impl MirrorError {
    /// Returns the table of the sensor to change: `picture` or `mirror`.
    #[must_use]
    pub fn key(&self) -> &'static str {
        match self {
            Self::Center | Self::Orientation | Self::Ring { .. } | Self::Rim { .. } => "picture",
            Self::Shape(_) | Self::FloorFormula | Self::Profile { .. } => "mirror",
        }
    }
}

impl MirrorCamera {
    /// Creates a camera.
    ///
    /// # Errors
    /// [`MirrorError::Rim`] if the mirror shows nothing at the edge of its blind center or at its rim.
    pub fn new(image: MirrorImage, mirror: Mirror) -> Result<Self, MirrorError> {
        for radius_px in [image.blind_radius_px(), image.rim_radius_px()] {
            if mirror.direction(radius_px).is_none() {
                return Err(MirrorError::Rim { radius_px });
            }
        }
        Ok(Self { image, mirror })
    }

    /// Returns the geometry of the mirror's image.
    #[must_use]
    pub fn image(&self) -> &MirrorImage {
        &self.image
    }

    /// Returns the mirror.
    #[must_use]
    pub fn mirror(&self) -> &Mirror {
        &self.mirror
    }

    /// Returns the ray through a pixel in the mirror's frame, or `None` outside the ring and at the very center, where
    /// the azimuth is undefined.
    #[must_use]
    pub fn ray_from_pixel(&self, pixel: Vector2<f64>) -> Option<MirrorRay> {
        let point = self.image.mirror_from_pixel(pixel);
        let radius_px = point.norm();
        if !(radius_px > 0.0 && self.image.is_in_ring(radius_px)) {
            return None;
        }
        let ahead = point / radius_px;
        let in_space = |p: Vector2<f64>| Vector3::new(p.x * ahead.x, p.x * ahead.y, p.y);
        let origin = match &self.mirror {
            Mirror::Conic(cone) => cone.reflection_point(radius_px),
            central => central.viewpoint(),
        };
        let direction = self.mirror.direction(radius_px)?;
        Some(MirrorRay { origin: in_space(origin).into(), direction: in_space(direction) })
    }

    /// Returns the azimuth at a pixel about the mirror's axis, rad in (-pi, pi], positive to the left of forward;
    /// `None` outside the ring and at the very center.
    #[must_use]
    pub fn azimuth_from_pixel(&self, pixel: Vector2<f64>) -> Option<f64> {
        let radius_px = self.image.mirror_from_pixel(pixel).norm();
        self.image.is_in_ring(radius_px).then(|| self.image.azimuth_from_pixel(pixel)).flatten()
    }

    /// Projects a point in the mirror's frame (m) to its pixel, which may lie outside the image but not outside the
    /// ring. A point on the axis has azimuth 0.
    ///
    /// # Errors
    /// [`MirrorProjectionError`] if the camera does not show the point.
    pub fn pixel_from_point(
        &self,
        point_in_mirror: &Point3<f64>,
    ) -> Result<Vector2<f64>, MirrorProjectionError> {
        let distance = point_in_mirror.x.hypotenuse(point_in_mirror.y);
        let radius_px = self.radius_px(distance, point_in_mirror.z)?;
        let share = if distance > 0.0 { point_in_mirror.xy().coords / distance } else { Vector2::x() };
        Ok(self.image.pixel_from_mirror(share * radius_px))
    }

    /// Returns the image radius (pixels) of a point at a distance from the axis and a height above the frame's origin,
    /// m.
    ///
    /// # Errors
    /// [`MirrorProjectionError`] if the camera does not show the point.
    pub fn radius_px(&self, distance_m: f64, height_m: f64) -> Result<f64, MirrorProjectionError> {
        let direction = Vector2::new(distance_m, height_m) - self.mirror.viewpoint();
        let radius_px = self
            .mirror
            .radius_px(direction)
            .filter(|r| r.is_finite())
            .ok_or(MirrorProjectionError::OutOfView)?;
        if radius_px < self.image.blind_radius_px() {
            return Err(MirrorProjectionError::BlindCenter);
        }
        // Tolerate rounding errors at the rim.
        if radius_px > self.image.rim_radius_px() * (1.0 + 1e-12) {
            return Err(MirrorProjectionError::BeyondRim);
        }
        Ok(radius_px)
    }

    /// Returns the distance from the axis (m) at which an image radius (pixels) shows the floor, for an upright mirror
    /// with its frame's origin `height_m` above the floor; `None` outside the ring and from the horizon upward.
    #[must_use]
    pub fn floor_radius_m(&self, radius_px: f64, height_m: f64) -> Option<f64> {
        let direction = self
            .mirror
            .direction(radius_px)
            .filter(|direction| direction.y < 0.0 && self.image.is_in_ring(radius_px))?;
        let viewpoint = self.mirror.viewpoint();
        Some(viewpoint.x + direction.x * (height_m + viewpoint.y) / -direction.y)
    }

    /// Returns the derivative of [`MirrorCamera::floor_radius_m`] by the image radius, m per pixel.
    #[must_use]
    pub fn floor_slope_m_per_px(&self, radius_px: f64, height_m: f64) -> Option<f64> {
        let direction = self
            .mirror
            .direction(radius_px)
            .filter(|direction| direction.y < 0.0 && self.image.is_in_ring(radius_px))?;
        Some(
            (height_m + self.mirror.viewpoint().y) * self.mirror.nadir_slope(radius_px)
                / (direction.y * direction.y),
        )
    }
}

/// A [`Mirror`] as a robot file writes it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum MirrorConfig {
    /// A cone, tip down.
    Conic(ConicMirrorConfig),
    /// A hyperboloid with the lens in its other focus.
    Hyperboloidal(HyperboloidalMirrorConfig),
    /// A measured profile.
    Radial(RadialModelConfig),
}

/// Creates a camera from the tables `picture` and `mirror` of a sensor.
///
/// # Errors
/// [`MirrorError`], with the [key](MirrorError::key) of the table to change.
pub fn mirror_camera(
    picture: &MirrorImageConfig,
    mirror: &MirrorConfig,
) -> Result<MirrorCamera, MirrorError> {
    let image = picture.image()?;
    let mirror = match mirror {
        MirrorConfig::Conic(config) => Mirror::Conic(config.mirror()?),
        MirrorConfig::Hyperboloidal(config) => Mirror::Hyperboloidal(config.mirror()?),
        MirrorConfig::Radial(config) => {
            Mirror::Radial(config.model(image.blind_radius_px(), image.rim_radius_px())?)
        }
    };
    MirrorCamera::new(image, mirror)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const CONFIGS: [&str; 3] = [
        "[picture]\nwidth = 512\nheight = 480\nblind_radius_px = 20\nrim_radius_px = 239.9\n\
         [mirror]\nkind = 'conic'\nvertex_angle_deg = 112.6\nlens_to_vertex_m = 0.11\nfocal_px = 576.563",
        "[picture]\nwidth = 256\nheight = 220\nrim_radius_px = 125\nmirror_from_image = [[0, -1], [1, 0]]\n\
         [mirror]\nkind = 'hyperboloidal'\nfocal_px = 479.374593\neccentricity = 1.26518485\nfoci_m = 0.0400837",
        "[picture]\nwidth = 462\nheight = 462\ncu = 229.5\ncv = 226.9\nblind_radius_px = 31\nrim_radius_px = 220\n\
         [mirror]\nkind = 'radial'\n\
         profile = { form = 'tangent', range_m = 1.788, deg_per_px = 0.40383, height_m = 0.6 }",
    ];

    #[derive(Deserialize)]
    struct Tables {
        picture: MirrorImageConfig,
        mirror: MirrorConfig,
    }

    fn camera(text: &str) -> Result<MirrorCamera, MirrorError> {
        let tables: Tables = toml::from_str(text).unwrap();
        mirror_camera(&tables.picture, &tables.mirror)
    }

    #[test]
    fn every_number_of_a_mirror_has_a_range() {
        fn check(schema: &serde_json::Value, seen: &mut usize) {
            let properties = schema.get("properties").and_then(|p| p.as_object()).into_iter().flatten();
            for (key, part) in properties {
                let inner = [part, &part["items"], &part["items"]["items"]];
                let kind = inner.iter().find(|part| {
                    let kinds = part["type"].to_string();
                    kinds.contains("number") || kinds.contains("integer")
                });
                if let Some(number) = kind {
                    assert!(
                        number["minimum"].is_number() && number["maximum"].is_number(),
                        "{key}: {number}"
                    );
                    *seen += 1;
                }
            }
            match schema {
                serde_json::Value::Object(parts) => parts.values().for_each(|part| check(part, seen)),
                serde_json::Value::Array(parts) => parts.iter().for_each(|part| check(part, seen)),
                _ => {}
            }
        }
        let mut seen = 0;
        check(&schemars::schema_for!(MirrorConfig).to_value(), &mut seen);
        check(&schemars::schema_for!(MirrorImageConfig).to_value(), &mut seen);
        assert_eq!(seen, 19);
    }

    #[test]
    fn a_misspelt_key_is_refused_and_a_wrong_table_named() {
        let misspelt = CONFIGS[0].replace("focal_px", "focal");
        assert!(toml::from_str::<Tables>(&misspelt).is_err());
        let beyond = CONFIGS[0].replace("239.9", "900");
        let error = camera(&beyond).unwrap_err();
        assert_eq!((error, error.key()), (MirrorError::Rim { radius_px: 900.0 }, "picture"));
        let flat = CONFIGS[1].replace("[[0, -1], [1, 0]]", "[[0, 0], [0, 0]]");
        assert_eq!(camera(&flat), Err(MirrorError::Orientation));
    }

    #[test]
    fn points_that_are_not_shown_are_refused() {
        let cone = camera(CONFIGS[0]).unwrap();
        assert_eq!(
            cone.pixel_from_point(&Point3::new(0.3, 0.0, -0.3)),
            Err(MirrorProjectionError::OutOfView)
        );
        assert_eq!(
            cone.pixel_from_point(&Point3::new(0.97, 0.3, -0.3)),
            Err(MirrorProjectionError::BlindCenter)
        );
        assert_eq!(cone.pixel_from_point(&Point3::new(3.0, 1.0, 1.0)), Err(MirrorProjectionError::BeyondRim));
        assert_eq!(
            cone.pixel_from_point(&Point3::new(f64::NAN, 1.0, 1.0)),
            Err(MirrorProjectionError::OutOfView)
        );
        assert_eq!(cone.ray_from_pixel(cone.image().center()), None);
        assert_eq!(cone.ray_from_pixel(Vector2::new(0.0, 0.0)), None);
        assert_eq!(cone.azimuth_from_pixel(Vector2::new(255.5, 230.0)), None);
    }

    proptest! {
        /// Points along the ray of a pixel project to that pixel.
        #[test]
        fn pixel_ray_pixel(share in 0.0..1.0, azimuth in -3.2..3.2, reach in 0.05..30.0, which in 0_usize..3) {
            let camera = camera(CONFIGS[which]).unwrap();
            let (blind, rim) = (camera.image().blind_radius_px(), camera.image().rim_radius_px());
            let radius_px = blind + 1e-6 + (rim - blind - 2e-6) * share;
            let pixel = camera.image().pixel_from_polar(radius_px, azimuth);
            let ray = camera.ray_from_pixel(pixel).unwrap();
            prop_assert!((ray.direction.norm() - 1.0).abs() < 1e-12);
            let back = camera.pixel_from_point(&(ray.origin + ray.direction * reach)).unwrap();
            prop_assert!((back - pixel).norm() < 1e-8, "{back} {pixel}");
            let point: Point3<f64> = ray.origin + ray.direction * reach;
            let turn = camera.azimuth_from_pixel(pixel).unwrap() - point.y.atan2(point.x);
            prop_assert!(turn.sin().abs() < 1e-9 && turn.cos() > 0.0);
        }

        /// A vertical line has one azimuth.
        #[test]
        fn vertical_lines_are_radial(x in -4.0..4.0, y in -4.0..4.0, z in -0.3..0.1, which in 0_usize..3) {
            let camera = camera(CONFIGS[which]).unwrap();
            if let Ok(pixel) = camera.pixel_from_point(&Point3::new(x, y, z)) {
                let turn = camera.azimuth_from_pixel(pixel).unwrap_or(0.0) - f64::atan2(y, x);
                prop_assert!(turn.sin().abs() < 1e-9 || x.hypotenuse(y) < 1e-6);
            }
        }

        #[test]
        fn slopes_match_differences(share in 0.05..0.95, which in 0_usize..3) {
            let camera = camera(CONFIGS[which]).unwrap();
            let (blind, rim) = (camera.image().blind_radius_px(), camera.image().rim_radius_px());
            let (r, h) = (blind + (rim - blind) * share, 1e-4);
            let angle = |r: f64| { let d = camera.mirror().direction(r).unwrap(); d.x.atan2(-d.y) };
            let difference = (angle(r + h) - angle(r - h)) / (2.0 * h);
            prop_assert!((difference / camera.mirror().nadir_slope(r) - 1.0).abs() < 1e-6);
            let floor = |r: f64| camera.floor_radius_m(r, 0.3);
            if let (Some(a), Some(b), Some(slope)) = (floor(r - h), floor(r + h), camera.floor_slope_m_per_px(r, 0.3)) {
                prop_assume!(b < 50.0);
                prop_assert!(((b - a) / (2.0 * h) / slope - 1.0).abs() < 1e-4);
            }
        }
    }
}
