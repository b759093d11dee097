//! What every pixel of a mirror camera sees, worked out once.

use nalgebra::Vector2;

use super::mirror_camera::MirrorCamera;

/// Look-up tables over an image, row by row. Pixels outside the mirror's ring, and the very center, hold NaN everywhere.
///
/// A table pays where most pixels are asked for in every picture; for a few edge points
/// [`MirrorCamera::azimuth_from_pixel`] is as good.
#[derive(Clone, Debug, PartialEq)]
pub struct MirrorTable {
    width: usize,
    radius_px: Vec<f32>,
    azimuth_rad: Vec<f32>,
    around: Vec<[f32; 2]>,
    floor_radius_m: Vec<f32>,
    floor_slope_m_per_px: Vec<f32>,
}

impl MirrorTable {
    /// The tables of a camera whose upright mirror has its frame's origin `height_m` above the floor.
    #[must_use]
    pub fn new(camera: &MirrorCamera, height_m: f64) -> Self {
        let image = camera.image();
        let (width, height) = (image.width as usize, image.height as usize);
        let empty = || vec![f32::NAN; width * height];
        let mut table = Self {
            width,
            radius_px: empty(),
            azimuth_rad: empty(),
            around: vec![[f32::NAN; 2]; width * height],
            floor_radius_m: empty(),
            floor_slope_m_per_px: empty(),
        };
        for i in 0..width * height {
            let pixel = Vector2::new((i % width) as f64, (i / width) as f64);
            let Some(azimuth_rad) = camera.azimuth_from_pixel(pixel) else { continue };
            let radius_px = image.mirror_from_pixel(pixel).norm();
            let around = image.around(azimuth_rad);
            table.radius_px[i] = radius_px as f32;
            table.azimuth_rad[i] = azimuth_rad as f32;
            table.around[i] = [around.x as f32, around.y as f32];
            if let Some(floor) = camera.floor_radius_m(radius_px, height_m) {
                table.floor_radius_m[i] = floor as f32;
            }
            if let Some(slope) = camera.floor_slope_m_per_px(radius_px, height_m) {
                table.floor_slope_m_per_px[i] = slope as f32;
            }
        }
        table
    }

    /// Pixels in a row of the image.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Distance from the axis, pixels of the mirror plane.
    #[must_use]
    pub fn radius_px(&self) -> &[f32] {
        &self.radius_px
    }

    /// Azimuth, radians in (-pi, pi], to the left of ahead.
    #[must_use]
    pub fn azimuth_rad(&self) -> &[f32] {
        &self.azimuth_rad
    }

    /// How a pixel (right, down) moves, per pixel of the mirror plane, on the way of growing azimuth. The scalar product
    /// with the gradient is how fast the picture grows brighter that way.
    #[must_use]
    pub fn around(&self) -> &[[f32; 2]] {
        &self.around
    }

    /// Distance from the axis at which the floor is seen, meters; NaN from the horizon upwards.
    #[must_use]
    pub fn floor_radius_m(&self) -> &[f32] {
        &self.floor_radius_m
    }

    /// How that distance grows with the image radius, meters per pixel; NaN from the horizon upwards.
    #[must_use]
    pub fn floor_slope_m_per_px(&self) -> &[f32] {
        &self.floor_slope_m_per_px
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{FloorFormula, HyperboloidalMirror, Mirror, MirrorImage};

    #[test]
    fn the_table_tells_what_the_camera_tells() {
        let formula = FloorFormula { a: 10_120.0, b: 20.54, c: 2.298e5 };
        let mirror = HyperboloidalMirror::from_floor_formula(formula, 0.165).unwrap();
        let image = MirrorImage::centered(256, 220).with_ring(24.0, 118.0).unwrap();
        let camera = MirrorCamera::new(image, Mirror::Hyperboloidal(mirror)).unwrap();
        let table = MirrorTable::new(&camera, 0.165);
        assert_eq!((table.width(), table.azimuth_rad().len()), (256, 256 * 220));
        let mut seen = 0;
        for i in 0..256 * 220 {
            let pixel = Vector2::new((i % 256) as f64, (i / 256) as f64);
            let radius_px = image.mirror_from_pixel(pixel).norm();
            assert_eq!(table.azimuth_rad()[i].is_nan(), !image.is_in_ring(radius_px));
            assert_eq!(table.floor_radius_m()[i].is_nan(), !(24.0..mirror.horizon_px()).contains(&radius_px));
            let Some(azimuth) = camera.azimuth_from_pixel(pixel) else { continue };
            assert!((f64::from(table.azimuth_rad()[i]) - azimuth).abs() < 1e-6);
            let step = image.pixel_from_polar(radius_px, azimuth + 1e-6) - pixel;
            let [right, down] = table.around()[i].map(f64::from);
            assert!((step / (1e-6 * radius_px) - Vector2::new(right, down)).norm() < 1e-5);
            if let Some(r) = formula.floor_radius_m(radius_px) {
                assert!((f64::from(table.floor_radius_m()[i]) / r - 1.0).abs() < 1e-6);
                let slope = formula.slope_m_per_px(radius_px).unwrap();
                assert!((f64::from(table.floor_slope_m_per_px()[i]) / slope - 1.0).abs() < 1e-6);
            }
            seen += 1;
        }
        assert!(seen > 35_000);
    }
}
