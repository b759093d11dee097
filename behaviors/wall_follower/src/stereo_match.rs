//! The same floor line in two aligned pictures, by what is bright and dark beside it.
//!
//! Differs from Kweon et al. (1991), section 3.4, where each picture's lines are found by themselves: two neighboring lines
//! of one skirting are not taken for each other.

use std::ops::RangeInclusive;

use nalgebra::Vector3;
use yamabico_core::image::ImageView;
use yamabico_vision::corridor::wall_distance::CorridorView;

/// Cotangents to either side of the line that are compared ...
const REACH: f64 = 0.1;
/// ... in such steps.
const STEP: f64 = 0.004;
/// Samples across the line.
const SAMPLES: usize = 2 * (REACH / STEP) as usize + 1;
/// The line is read from so far to so far ahead, in heights of the camera ...
const AHEAD: [f64; 2] = [2.5, 8.0];
/// ... at so many places, as far as the pictures show them.
const PLACES: u32 = 24;
/// Fewest places.
const MIN_PLACES: u32 = 6;
/// Least correlation of the two pictures.
const MIN_CORRELATION: f64 = 0.8;

/// A picture without distortion, and how its camera looks along the corridor.
#[derive(Clone, Copy, Debug)]
pub struct StereoPicture<'a> {
    /// Gray levels.
    pub image: ImageView<'a>,
    /// The camera; the two of a pair share their attitude.
    pub view: &'a CorridorView,
}

type Profile = [f64; SAMPLES];

/// The cotangent (lateral by height, positive to the left) in the right picture of the line that has `cotangent` in the left
/// one, for [`stereo_wall`](crate::stereo::stereo_wall); `parallax` is the range of their differences to look in. `None`
/// where the pictures do not show the line or do not look alike there.
#[must_use]
pub fn matching_cotangent(
    left: &StereoPicture<'_>,
    right: &StereoPicture<'_>,
    cotangent: f64,
    parallax: RangeInclusive<f64>,
) -> Option<f64> {
    let (first, last) = parallax.into_inner();
    let shown = |place: u32| {
        let ahead = ahead(place);
        let is_shown = |picture: &StereoPicture<'_>, from: f64, to: f64| {
            picture.level(ahead, from).is_some() && picture.level(ahead, to).is_some()
        };
        is_shown(left, cotangent - REACH, cotangent + REACH)
            && is_shown(right, cotangent + first - REACH, cotangent + last + REACH)
    };
    if (0..PLACES).filter(|&place| shown(place)).count() < MIN_PLACES as usize {
        return None;
    }
    let wanted = left.profile(cotangent, shown)?;
    let steps = ((last - first) / STEP).ceil() as u32;
    let alike = |step: u32| {
        let there = cotangent + first + STEP * f64::from(step);
        Some((there, correlation(&wanted, &right.profile(there, shown)?)))
    };
    let best = (0..=steps).filter_map(|step| Some((step, alike(step)?.1))).max_by(|a, b| a.1.total_cmp(&b.1));
    let (step, peak) = best.filter(|&(step, peak)| step > 0 && step < steps && peak >= MIN_CORRELATION)?;
    let (before, (there, _), after) = (alike(step - 1)?.1, alike(step)?, alike(step + 1)?.1);
    let bend = before - 2.0 * peak + after;
    let shift = if bend < -1e-12 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 };
    Some(there + STEP * shift)
}

/// Places nearer by are farther apart, as the picture shows them.
fn ahead(place: u32) -> f64 {
    let part = (f64::from(place) + 0.5) / f64::from(PLACES);
    1.0 / (1.0 / AHEAD[0] + (1.0 / AHEAD[1] - 1.0 / AHEAD[0]) * part)
}

impl StereoPicture<'_> {
    /// Mean gray levels across a line, over the places that are shown.
    fn profile(&self, cotangent: f64, shown: impl Fn(u32) -> bool) -> Option<Profile> {
        let mut profile = [0.0; SAMPLES];
        for place in (0..PLACES).filter(|&place| shown(place)) {
            for (sample, sum) in (0..).zip(&mut profile) {
                *sum += self.level(ahead(place), cotangent - REACH + STEP * f64::from(sample))?;
            }
        }
        Some(profile)
    }

    /// Gray level so many heights ahead of the camera and so many to its left, one below; `None` outside the picture.
    fn level(&self, ahead: f64, cotangent: f64) -> Option<f64> {
        let in_camera = self.view.corridor_from_camera.transpose() * Vector3::new(ahead, cotangent, -1.0);
        let pixel = self.view.intrinsics.pixel_from_normalized(in_camera.xy() / in_camera.z);
        let (width, height) = (self.image.width(), self.image.height());
        let is_inside = in_camera.z > 0.0
            && (0.0..width as f64 - 1.0).contains(&pixel.x)
            && (0.0..height as f64 - 1.0).contains(&pixel.y);
        is_inside.then(|| {
            let (u, v) = (pixel.x as usize, pixel.y as usize);
            let (right, down) = (pixel.x - u as f64, pixel.y - v as f64);
            let at = |u: usize, v: usize| f64::from(self.image.pixel(u, v));
            let row = |v: usize| at(u, v) + right * (at(u + 1, v) - at(u, v));
            row(v) + down * (row(v + 1) - row(v))
        })
    }
}

/// -1 to 1; 0 for a profile without contrast.
fn correlation(a: &Profile, b: &Profile) -> f64 {
    let mean = |profile: &Profile| profile.iter().sum::<f64>() / SAMPLES as f64;
    let (mean_a, mean_b) = (mean(a), mean(b));
    let sum = |x: &Profile, mean_x: f64, y: &Profile, mean_y: f64| {
        x.iter().zip(y).map(|(x, y)| (x - mean_x) * (y - mean_y)).sum::<f64>()
    };
    let squares = sum(a, mean_a, a, mean_a) * sum(b, mean_b, b, mean_b);
    if squares > 0.0 { sum(a, mean_a, b, mean_b) / squares.sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::camera::Intrinsics;
    use yamabico_vision::corridor::heading::CameraAttitude;

    const HEIGHT_M: f64 = 0.6;

    fn view() -> CorridorView {
        let intrinsics = Intrinsics::from_horizontal_fov(640, 480, 1.05);
        CorridorView::new(CameraAttitude { heading: 0.05, tilt: 0.09 }, 0.0, HEIGHT_M, intrinsics)
    }

    /// A floor that is bright up to this cotangent, then dark for 0.03, then of middle brightness.
    fn picture(view: &CorridorView, foot: f64) -> Vec<u8> {
        let pixel = |u: u32, v: u32| {
            let at = nalgebra::Vector2::new(f64::from(u), f64::from(v));
            view.floor_point(at).map_or(90, |point| match point.y / HEIGHT_M - foot {
                inside if inside < 0.0 => 180,
                skirting if skirting < 0.03 => 30,
                _ => 120,
            })
        };
        (0..480).flat_map(|v| (0..640).map(move |u| (u, v))).map(|(u, v)| pixel(u, v)).collect()
    }

    fn matched(left: &[u8], right: &[u8]) -> Option<f64> {
        let view = view();
        let on =
            |pixels| StereoPicture { image: ImageView::new(pixels, 640, 480, 640).unwrap(), view: &view };
        matching_cotangent(&on(left), &on(right), 1.51, 0.13..=0.3)
    }

    #[test]
    fn the_line_is_found_in_the_other_picture() {
        let view = view();
        for parallax in [0.16, 0.2, 0.25] {
            let right = matched(&picture(&view, 1.5), &picture(&view, 1.5 + parallax)).unwrap();
            assert!((right - 1.51 - parallax).abs() < 0.0033, "{right} for {parallax}");
        }
    }

    #[test]
    fn what_does_not_look_alike_is_none() {
        let seen = picture(&view(), 1.5);
        assert_eq!(matched(&seen, &vec![100; 640 * 480]), None, "no contrast");
        let inverse: Vec<u8> = picture(&view(), 1.7).iter().map(|level| 255 - level).collect();
        assert_eq!(matched(&seen, &inverse), None, "other contrast");
    }
}
