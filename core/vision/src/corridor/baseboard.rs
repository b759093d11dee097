//! Foot of a wall whose detected line is the upper edge of its baseboard.
//!
//! A brightness profile is averaged along lines through the vanishing point, as a function of lateral distance:
//! averaging over a whole line reveals a step that is too faint for edge detection.

use nalgebra::{Vector2, Vector3};
use yamabico_geometry::camera::Pinhole;
use yamabico_geometry::image::ImageView;

use crate::corridor::wall_distance::CorridorView;

/// Number of lines in the profile.
const LINES: usize = 48;
/// Number of samples along each line.
const SAMPLES: u32 = 48;
/// Number of lines compared on either side of a step: coarse pass, then fine pass.
const STEP_REACH: [usize; 2] = [3, 10];

/// Search range and threshold for the foot of a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FootSearch {
    /// Signed lateral distance of the detected line, computed as if it lay on the floor, m.
    pub found_m: f64,
    /// Endpoints of the detected line, undistorted pixels.
    pub ends: [Vector2<f64>; 2],
    /// Start of the search range, as a share of `found_m`.
    pub nearest_share: f64,
    /// Minimum step from bright floor to dark baseboard, gray levels.
    pub min_contrast: f64,
}

/// Finds the line where a bright floor meets a darker baseboard, between `nearest_share` of the detected distance and
/// the detected line. Returns its signed lateral distance, m; `None` if there is no such step.
#[must_use]
pub fn find_wall_foot(
    image: ImageView<'_>,
    pinhole: &Pinhole,
    view: &CorridorView,
    search: &FootSearch,
) -> Option<f64> {
    let step = |range, reach| profile_step(image, pinhole, view, search, range, reach);
    let (first, contrast) = step([search.nearest_share, 0.99], STEP_REACH[0])?;
    if contrast < search.min_contrast {
        return None;
    }
    let (share, _) = step([first - 0.025, first + 0.025], STEP_REACH[1])?;
    Some(search.found_m * share)
}

/// Finds the steepest fall of brightness within a range of shares of the detected distance. Returns the share and the
/// step in gray levels.
fn profile_step(
    image: ImageView<'_>,
    pinhole: &Pinhole,
    view: &CorridorView,
    search: &FootSearch,
    range: [f64; 2],
    reach: usize,
) -> Option<(f64, f64)> {
    let share_of = |line: f64| range[0] + (range[1] - range[0]) * line / (LINES - 1) as f64;
    let mut profile = [0.0_f64; LINES];
    let camera_from_corridor = view.corridor_from_camera.transpose();
    let across = camera_from_corridor * Vector3::y();
    for sample in 0..SAMPLES {
        let part = (f64::from(sample) + 0.5) / f64::from(SAMPLES);
        let on_line = search.ends[0] + (search.ends[1] - search.ends[0]) * part;
        let ahead_m = view.floor_point(on_line)?.x;
        let middle = camera_from_corridor * Vector3::new(ahead_m, 0.0, -view.height_m);
        for (line, sum) in profile.iter_mut().enumerate() {
            let point = middle + across * (search.found_m * share_of(line as f64));
            let pixel = pinhole.project(&point.into()).ok()?;
            *sum += bilinear(image, pixel) / f64::from(SAMPLES);
        }
    }
    let step = |line: usize| {
        let inside: f64 = profile[line - reach..line].iter().sum();
        let outside: f64 = profile[line + 1..=line + reach].iter().sum();
        (inside - outside) / reach as f64
    };
    let best = (reach..LINES - reach).max_by(|&a, &b| step(a).total_cmp(&step(b)))?;
    let is_inner = best > reach && best + reach + 1 < LINES;
    let shift = if is_inner { peak_shift(step(best - 1), step(best), step(best + 1)) } else { 0.0 };
    Some((share_of(best as f64 + shift), step(best)))
}

/// Offset of the vertex of the parabola through three equidistant values, limited to half a step.
fn peak_shift(before: f64, at: f64, after: f64) -> f64 {
    let bend = before - 2.0 * at + after;
    if bend.abs() < 1e-9 { 0.0 } else { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) }
}

/// Bilinear interpolation of the gray level; pixels outside the image take the value of the border.
fn bilinear(image: ImageView<'_>, at: Vector2<f64>) -> f64 {
    let (u, v) = (at.x.max(0.0), at.y.max(0.0));
    let (left, top) = (u.floor(), v.floor());
    let (right_part, lower_part) = (u - left, v - top);
    let gray = |du: usize, dv: usize| f64::from(image.pixel(left as usize + du, top as usize + dv));
    let upper = gray(0, 0) * (1.0 - right_part) + gray(1, 0) * right_part;
    let lower = gray(0, 1) * (1.0 - right_part) + gray(1, 1) * right_part;
    upper * (1.0 - lower_part) + lower * lower_part
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::corridor::heading::CameraAttitude;
    use yamabico_geometry::camera::Intrinsics;

    /// Returns an image in which the floor plane is dark between `foot_m` and `top_m` on the left, and bright beyond.
    fn synthetic_image(view: &CorridorView, foot_m: f64, top_m: f64) -> Vec<u8> {
        let level = |u: u32, v: u32| match view.floor_point(Vector2::new(f64::from(u), f64::from(v))) {
            Some(point) if point.y > top_m => 180,
            Some(point) if point.y > foot_m => 60,
            _ => 75,
        };
        (0..480).flat_map(|v| (0..640).map(move |u| level(u, v))).collect()
    }

    #[test]
    fn the_foot_is_found_by_its_faint_step() {
        let attitude = CameraAttitude { heading: 0.05, tilt: 0.1 };
        let intrinsics = Intrinsics::from_horizontal_fov(640, 480, 1.05);
        let view = CorridorView::new(attitude, 0.0, 0.6, intrinsics);
        let pinhole = Pinhole::ideal(intrinsics);
        let pixel = |x: f64, y: f64| {
            let point = view.corridor_from_camera.transpose() * Vector3::new(x, y, -0.6);
            intrinsics.pixel_from_normalized(point.xy() / point.z)
        };
        let search = FootSearch {
            found_m: 1.2,
            ends: [pixel(2.8, 1.2), pixel(7.0, 1.2)],
            nearest_share: 0.6,
            min_contrast: 8.0,
        };
        let find = |foot_m: f64| {
            let data = synthetic_image(&view, foot_m, 1.2);
            find_wall_foot(ImageView::new(&data, 640, 480, 640).unwrap(), &pinhole, &view, &search)
        };
        for foot_m in [0.9, 1.0, 1.1] {
            let found = find(foot_m).unwrap();
            assert!((found - foot_m).abs() < 0.01, "{found} instead of {foot_m}");
        }
        assert_eq!(find(1.2), None);
    }
}
