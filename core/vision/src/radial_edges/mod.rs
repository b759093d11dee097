//! Radial edges in the image of a mirror camera: vertical edges of the environment, each at one azimuth.
//!
//! Yagi, Nishizawa & Yachida (1995), section II. Differs from \[1\]: points are thinned across the edge with sub-pixel
//! accuracy, and weighted by the square of their distance from the center, where azimuths are more accurate.

mod batch;
mod rows;
mod scan;

use nalgebra::{Matrix2, Vector2};
use thiserror::Error;

use super::azimuth_profile::{AzimuthEdge, AzimuthProfile, ProfileRule};
use super::vectorize;
use yamabico_geometry::camera::MirrorImage;
use yamabico_geometry::image::ImageView;

use batch::Geometry;
use rows::{Row, rows};
use scan::{Scan, Work};

/// Criteria for points of a radial edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadialEdgeRule {
    /// Minimum gradient across the edge, Sobel units (an ideal step of g gray levels gives 4 g), 1 to 1020.
    pub min_slope: f64,
    /// Maximum angle between the gradient and the direction of increasing azimuth, rad, 0 to pi/4.
    pub max_oblique_rad: f64,
    /// Minimum distance from the center, pixels.
    pub inner_radius_px: f64,
    /// Maximum distance from the center, pixels.
    pub outer_radius_px: f64,
}

impl RadialEdgeRule {
    /// Criteria for the ring of a mirror image, excluding its rim and 30 pixels around the center.
    #[must_use]
    pub fn within(image: &MirrorImage) -> Self {
        Self {
            min_slope: 60.0,
            max_oblique_rad: 15_f64.to_radians(),
            inner_radius_px: (image.blind_radius_px() + 2.0).max(30.0),
            outer_radius_px: image.rim_radius_px() - 2.0,
        }
    }
}

/// Error for an image whose size differs from the camera model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("an image of {width} x {height} pixels does not match the mirror camera")]
pub struct ImageSizeError {
    /// Width of the image, px.
    pub width: usize,
    /// Height of the image, px.
    pub height: usize,
}

/// Radial edge detector with its buffers.
#[derive(Clone, Debug)]
pub struct RadialEdges {
    size: [usize; 2],
    geometry: Geometry,
    min_along_axis: i16,
    rows: Vec<Row>,
    work: Work,
    profile: AzimuthProfile,
}

impl RadialEdges {
    /// Creates a detector for the images of this mirror.
    #[must_use]
    pub fn new(image: &MirrorImage, rule: &RadialEdgeRule, profile: ProfileRule) -> Self {
        let unit = |p: Vector2<f64>| image.mirror_from_pixel(image.center() + p);
        let mirror_from_image = Matrix2::from_columns(&[unit(Vector2::x()), unit(Vector2::y())]);
        let turned = Matrix2::new(0.0, -1.0, 1.0, 0.0) * mirror_from_image;
        let image_from_mirror = Matrix2::from_columns(&[image.outward(0.0), image.around(0.0)]);
        // A gradient that passes the angle test has at least this share along the axis nearest to it.
        let oblique = rule.max_oblique_rad.tan().clamp(0.0, 1.0);
        let stretch = image_from_mirror.singular_values().max();
        let share = (1.0 - oblique) * std::f64::consts::FRAC_1_SQRT_2 / stretch;
        let size = [image.width as usize, image.height as usize];
        Self {
            size,
            geometry: Geometry {
                center: image.center().cast(),
                mirror_from_image: mirror_from_image.cast(),
                around: (image_from_mirror * turned).cast(),
                min_slope: rule.min_slope as f32,
                max_oblique: oblique as f32,
                squared_radii: [rule.inner_radius_px, rule.outer_radius_px]
                    .map(|r| (r.max(1.0) * r.max(1.0)) as f32),
            },
            min_along_axis: (rule.min_slope * share).clamp(1.0, 1020.0) as i16,
            rows: rows(size, image.center(), rule.outer_radius_px * stretch),
            work: Work::new(size[0]),
            profile: AzimuthProfile::new(profile),
        }
    }

    /// Detects the edges of an image, in order of azimuth in [-pi, pi).
    ///
    /// # Errors
    /// [`ImageSizeError`]; the edges of the previous image are cleared.
    pub fn find(&mut self, image: ImageView) -> Result<&[AzimuthEdge], ImageSizeError> {
        self.profile.clear();
        let [width, height] = [image.width(), image.height()];
        if [width, height] != self.size {
            return Err(ImageSizeError { width, height });
        }
        vectorize::run(Scan {
            image,
            geometry: &self.geometry,
            min_slope: self.min_along_axis,
            rows: &self.rows,
            work: &mut self.work,
            profile: &mut self.profile,
        });
        Ok(self.profile.find())
    }

    /// Azimuth profile of the last image.
    #[must_use]
    pub fn profile(&self) -> &AzimuthProfile {
        &self.profile
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::azimuth_profile::EdgeSign;
    use crate::vectorize::Kernel;
    use yamabico_geometry::image::GrayImage;
    use yamabico_geometry::wrap_angle;

    /// Renders a ring of flat shades between these azimuths, as seen by a camera with square pixels.
    fn render(image: &MirrorImage, borders: &[(f64, u8)]) -> GrayImage {
        let mut picture = GrayImage::new(image.width as usize, image.height as usize);
        let width = picture.width();
        const FINE: usize = 6;
        for (i, out) in picture.pixels_mut().iter_mut().enumerate() {
            let mut sum = 0.0;
            for k in 0..FINE * FINE {
                let shift = |k: usize| (k as f64 + 0.5) / FINE as f64 - 0.5;
                let at = Vector2::new((i % width) as f64, (i / width) as f64)
                    + Vector2::new(shift(k % FINE), shift(k / FINE));
                let turn = image.azimuth_from_pixel(at).unwrap_or(0.0).rem_euclid(std::f64::consts::TAU);
                let shade = borders
                    .iter()
                    .rev()
                    .find(|(from, _)| turn >= *from)
                    .unwrap_or(&borders[borders.len() - 1]);
                sum += f64::from(shade.1);
            }
            *out = (sum / (FINE * FINE) as f64).round() as u8;
        }
        picture
    }

    fn cameras() -> Vec<MirrorImage> {
        let image = MirrorImage::centered(256, 240).with_ring(0.0, 118.0).unwrap();
        let turned = |m: [f64; 4]| {
            image
                .with_center(Vector2::new(130.3, 117.2))
                .unwrap()
                .with_orientation(Matrix2::new(m[0], m[1], m[2], m[3]))
                .unwrap()
        };
        let (sin, cos) = 0.6_f64.sin_cos();
        vec![image, turned([0.0, -1.0, 1.0, 0.0]), turned([cos, -sin, sin, cos])]
    }

    #[test]
    fn edges_are_found_for_every_orientation() {
        let borders: Vec<(f64, u8)> =
            (0..12).map(|i| (0.1 + 0.52 * f64::from(i), if i % 2 == 0 { 180 } else { 90 })).collect();
        for image in cameras() {
            let picture = render(&image, &borders);
            let rule = RadialEdgeRule::within(&image);
            let mut edges = RadialEdges::new(&image, &rule, ProfileRule::default());
            let found = edges.find(picture.view().unwrap()).unwrap();
            assert_eq!(found.len(), borders.len());
            for (azimuth, shade) in &borders {
                let edge = found
                    .iter()
                    .min_by(|a, b| {
                        let off = |e: &AzimuthEdge| wrap_angle(e.azimuth_rad - azimuth).abs();
                        off(a).total_cmp(&off(b))
                    })
                    .unwrap();
                let error = wrap_angle(edge.azimuth_rad - azimuth).abs();
                assert!(error < 0.03_f64.to_radians(), "{azimuth}: {} degrees", error.to_degrees());
                let sign = if *shade == 180 { EdgeSign::Brighter } else { EdgeSign::Darker };
                assert_eq!(edge.sign, sign);
                // From 30 to 116 pixels, without the ends.
                assert!((80.0..90.0).contains(&edge.length_px), "{} px", edge.length_px);
                assert!(edge.sigma_rad(0.3, 0.0) < 0.06_f64.to_radians());
            }
        }
    }

    #[test]
    fn the_two_instruction_sets_agree() {
        let image = cameras()[1];
        let borders: Vec<(f64, u8)> = (0..40).map(|i| (0.15 * f64::from(i), (i * 37 % 200) as u8)).collect();
        let picture = render(&image, &borders);
        let view = picture.view().unwrap();
        let mut edges = RadialEdges::new(&image, &RadialEdgeRule::within(&image), ProfileRule::default());
        let fast = edges.find(view).unwrap().to_vec();
        edges.profile.clear();
        Scan {
            image: view,
            geometry: &edges.geometry,
            min_slope: edges.min_along_axis,
            rows: &edges.rows,
            work: &mut edges.work,
            profile: &mut edges.profile,
        }
        .run();
        assert_eq!(edges.profile.find(), fast);
        assert!(fast.len() > 20);
    }

    #[test]
    fn rings_and_uniform_images_have_no_radial_edges() {
        let image = cameras()[0];
        let mut edges = RadialEdges::new(&image, &RadialEdgeRule::within(&image), ProfileRule::default());
        let mut plain = GrayImage::new(256, 240);
        plain.pixels_mut().fill(99);
        assert_eq!(edges.find(plain.view().unwrap()).unwrap(), []);
        for (i, out) in plain.pixels_mut().iter_mut().enumerate() {
            let r = image.mirror_from_pixel(Vector2::new((i % 256) as f64, (i / 256) as f64)).norm();
            *out = if ((r / 10.0) as usize).is_multiple_of(2) { 60 } else { 190 };
        }
        let found = edges.find(plain.view().unwrap()).unwrap();
        assert!(found.is_empty(), "{found:?}");
    }

    #[test]
    fn wrong_sizes_are_rejected_and_tiny_images_are_accepted() {
        let image = cameras()[0];
        let mut edges = RadialEdges::new(&image, &RadialEdgeRule::within(&image), ProfileRule::default());
        let small = GrayImage::new(100, 100);
        assert_eq!(edges.find(small.view().unwrap()), Err(ImageSizeError { width: 100, height: 100 }));
        for size in [1, 2, 3, 4, 5, 8] {
            let image = MirrorImage::centered(size, size);
            let mut edges = RadialEdges::new(&image, &RadialEdgeRule::within(&image), ProfileRule::default());
            let picture = GrayImage::new(size as usize, size as usize);
            assert_eq!(edges.find(picture.view().unwrap()).map(<[_]>::len), Ok(0));
        }
    }
}
