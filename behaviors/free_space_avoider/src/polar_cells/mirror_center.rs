//! Whether the mirror is where it is said to be: the robot's own image in the middle must be round about its center.

use std::f64::consts::TAU;

use nalgebra::{Matrix3, Vector2, Vector3};
use yamabico_core::camera::MirrorImage;
use yamabico_core::image::RgbView;
use yamabico_vision::floor_color::FloorColors;

/// Rays from the center.
const RAYS: usize = 24;
/// Floor begins within so many pixels of the blind center's edge, or a ray tells nothing.
const REACH_PX: f64 = 12.0;
/// Rays that must tell something, and the sectors of 60 degrees that they must come from.
const MIN_RAYS: usize = 10;
const MIN_SECTORS: usize = 4;
/// Rays that fit the circle no better than this (pixels) belong to something else.
const MAX_MISFIT_PX: f64 = 2.0;

/// How far (pixels of the mirror plane: ahead, left) the edge of the robot's own image lies beside where the mirror's center
/// should be; `None` where too little floor meets it, or where it is no circle.
#[must_use]
pub fn mirror_offset(picture: RgbView, image: &MirrorImage, colors: &FloorColors) -> Option<Vector2<f64>> {
    let blind_px = image.blind_radius_px();
    if blind_px < REACH_PX {
        return None;
    }
    let mut edges = [None; RAYS];
    for (ray, edge) in edges.iter_mut().enumerate() {
        let azimuth = TAU * ray as f64 / RAYS as f64;
        let is_floor = |radius_px: f64| {
            let pixel = image.pixel_from_polar(radius_px, azimuth);
            let is_inside = pixel.x >= 0.0 && pixel.y >= 0.0;
            is_inside && colors.contains(picture.pixel(pixel.x.round() as usize, pixel.y.round() as usize))
        };
        // The innermost radius from which on three pixels are floor.
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
    let told = || edges.iter().flatten().copied();
    let sectors = edges.chunks(RAYS / 6).filter(|rays| rays.iter().any(Option::is_some)).count();
    if told().count() < MIN_RAYS || sectors < MIN_SECTORS {
        return None;
    }
    // radius = mean + x cos + y sin, by least squares.
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for (azimuth, radius_px) in told() {
        let row = Vector3::new(1.0, azimuth.cos(), azimuth.sin());
        normal += row * row.transpose();
        right += row * radius_px;
    }
    let fit = normal.try_inverse()? * right;
    let misfit = |(azimuth, radius_px): (f64, f64)| {
        (radius_px - fit.x - fit.y * azimuth.cos() - fit.z * azimuth.sin()).powi(2)
    };
    let mean_square = told().map(misfit).sum::<f64>() / told().count() as f64;
    (mean_square.sqrt() <= MAX_MISFIT_PX).then(|| Vector2::new(fit.y, fit.z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_vision::floor_color::ColorBox;

    const GREEN: FloorColors = FloorColors::Box(ColorBox { least: [0, 100, 0], most: [90, 255, 90] });

    /// Green with a black disc, hidden on the left of `hidden_below`.
    fn picture(disc: Vector2<f64>, radius_px: f64, hidden_below: usize) -> Vec<u8> {
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
            let offset = measure(&picture(image.center() + shift, 24.0, 0)).unwrap();
            assert!((offset - Vector2::new(-shift.y, -shift.x)).norm() < 0.7, "{offset} for {shift}");
        }
        assert!(measure(&picture(image.center(), 24.0, 55)).is_some_and(|offset| offset.norm() < 1.0));
        assert_eq!(measure(&picture(image.center(), 24.0, 90)), None, "hidden on one side");
        assert_eq!(measure(&picture(image.center(), 2.0, 0)), None, "nothing is to be seen of the robot");
    }
}
