//! Check of the mirror's center: the image of the robot itself in the middle must be a circle around it.

use std::f64::consts::TAU;

use nalgebra::{Matrix3, Vector2, Vector3};
use yamabico_core::camera::MirrorImage;
use yamabico_core::image::RgbView;
use yamabico_vision::floor_color::FloorColors;

/// Number of rays from the center.
const RAYS: usize = 24;
/// Maximum distance between the beginning of the floor and the edge of the blind center on a usable ray, px.
const REACH_PX: f64 = 12.0;
/// Minimum number of usable rays.
const MIN_RAYS: usize = 10;
/// Minimum number of sectors of 60 degrees with usable rays.
const MIN_SECTORS: usize = 4;
/// Maximum residual of the fitted circle, px (root mean square).
const MAX_RESIDUAL_PX: f64 = 2.0;

/// Measures the offset of the robot's own image from the calibrated mirror center (pixels of the mirror plane: ahead,
/// left). `None` if its edge meets too little floor or is not a circle.
#[must_use]
pub fn mirror_offset(image: RgbView, mirror: &MirrorImage, colors: &FloorColors) -> Option<Vector2<f64>> {
    let blind_px = mirror.blind_radius_px();
    if blind_px < REACH_PX {
        return None;
    }
    let mut edges = [None; RAYS];
    for (ray, edge) in edges.iter_mut().enumerate() {
        let azimuth = TAU * ray as f64 / RAYS as f64;
        let is_floor = |radius_px: f64| {
            let pixel = mirror.pixel_from_polar(radius_px, azimuth);
            let is_inside = pixel.x >= 0.0 && pixel.y >= 0.0;
            is_inside && colors.contains(image.pixel(pixel.x.round() as usize, pixel.y.round() as usize))
        };
        // Finds the innermost radius from which on three pixels are floor.
        let mut radius_px = blind_px - REACH_PX;
        let mut run = 0;
        while radius_px < blind_px + REACH_PX && run < 6 {
            run = if is_floor(radius_px) { run + 1 } else { 0 };
            radius_px += 0.5;
        }
        let begin = radius_px - 0.5 * f64::from(run);
        if run == 6 && begin > blind_px - REACH_PX {
            *edge = Some((azimuth, begin));
        }
    }
    let usable = || edges.iter().flatten().copied();
    let sectors = edges.chunks(RAYS / 6).filter(|rays| rays.iter().any(Option::is_some)).count();
    if usable().count() < MIN_RAYS || sectors < MIN_SECTORS {
        return None;
    }
    // Least squares: radius = mean + x cos + y sin.
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for (azimuth, radius_px) in usable() {
        let row = Vector3::new(1.0, azimuth.cos(), azimuth.sin());
        normal += row * row.transpose();
        right += row * radius_px;
    }
    let fit = normal.try_inverse()? * right;
    let square_residual = |(azimuth, radius_px): (f64, f64)| {
        (radius_px - fit.x - fit.y * azimuth.cos() - fit.z * azimuth.sin()).powi(2)
    };
    let mean_square = usable().map(square_residual).sum::<f64>() / usable().count() as f64;
    (mean_square.sqrt() <= MAX_RESIDUAL_PX).then(|| Vector2::new(fit.y, fit.z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_vision::floor_color::ColorBox;

    const GREEN: FloorColors = FloorColors::Box(ColorBox { min: [0, 100, 0], max: [90, 255, 90] });

    /// Returns a green image with a black disc, and black to the left of column `hidden_below`.
    fn image_with_disc(disc: Vector2<f64>, radius_px: f64, hidden_below: usize) -> Vec<u8> {
        let mut data = Vec::new();
        for v in 0..120 {
            for u in 0..140 {
                let is_disc = (Vector2::new(f64::from(u), f64::from(v)) - disc).norm() < radius_px;
                let is_hidden = is_disc || (u as usize) < hidden_below;
                data.extend(if is_hidden { [10, 10, 10] } else { [40, 150, 50] });
            }
        }
        data
    }

    #[test]
    fn a_shifted_center_is_measured() {
        let image = MirrorImage::centered(140, 120).with_ring(24.0, 59.0).unwrap();
        let measure = |data: &[u8]| mirror_offset(RgbView::new(data, 140, 120, 420).unwrap(), &image, &GREEN);
        for shift in [Vector2::zeros(), Vector2::new(5.0, 0.0), Vector2::new(-3.0, 4.0)] {
            // Right and down in the image is right and behind at the robot.
            let offset = measure(&image_with_disc(image.center() + shift, 24.0, 0)).unwrap();
            assert!((offset - Vector2::new(-shift.y, -shift.x)).norm() < 0.7, "{offset} for {shift}");
        }
        assert!(
            measure(&image_with_disc(image.center(), 24.0, 55)).is_some_and(|offset| offset.norm() < 1.0)
        );
        assert_eq!(measure(&image_with_disc(image.center(), 24.0, 90)), None, "hidden on one side");
        assert_eq!(measure(&image_with_disc(image.center(), 2.0, 0)), None, "the robot is not visible");
    }
}
