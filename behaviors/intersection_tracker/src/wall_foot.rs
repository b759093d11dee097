//! Visibility of a wall along its floor line.
//!
//! The profile across the foot of a wall (floor, baseboard, wall) is similar all along, up to illumination. A door interrupts
//! it for at most a door's width; it stops at the end of the wall, and is absent before a corner behind another corridor.

use nalgebra::{Vector2, Vector3};
use yamabico_core::camera::Pinhole;
use yamabico_core::image::ImageView;
use yamabico_vision::corridor::observer::CorridorObserver;
use yamabico_vision::corridor::wall_distance::CorridorView;

use crate::foot::{FOOT_CONTRAST, FOOT_SAMPLES, FootProfile, are_alike, is_flat, likeness};

/// Maximum width of an opening that counts as a door, m.
const DOOR_M: f64 = 1.3;
/// Minimum gap behind an edge that is higher than a door, m: from a distance the foot of a wall across the corridor hides the
/// rest of the gap.
const GAP_M: f64 = 0.6;
/// Minimum gap beyond the columns that the edge itself covers, m.
const MIN_GAP_M: f64 = 0.3;
/// Step at which a wall is sampled, m.
const STEP_M: f64 = 0.1;
/// Minimum number of samples at which a wall is visible.
const MIN_STEPS: usize = 2;
/// Range of heights (m) of a floor line or the edge of a baseboard.
const FOOT_HEIGHTS_M: [f64; 2] = [-0.1, 0.25];
/// Columns before and behind an edge at which profiles are compared.
const FOOT_COLUMNS_PX: [f64; 4] = [2.0, 3.0, 4.0, 5.0];
/// Distance from an edge at which a column shows one side only, pixels.
const CLEAR_COLUMNS_PX: f64 = 2.5;
/// Minimum row difference (px) at which the foot of a wall across the corridor can be distinguished from this wall's.
const CLEAR_ROWS_PX: f64 = 2.0;
/// Number of samples from which the typical profile of a wall is chosen.
const PLACES: usize = 24;
/// Range of their distances (m), in geometric steps.
const PLACES_M: [f64; 2] = [1.2, 9.0];
/// Minimum number of other samples that must be similar.
const MIN_ALIKE: usize = 4;
/// Minimum correlation with the typical profile.
const AS_USUAL: f64 = 0.75;

/// Foot of one wall in an image.
#[derive(Clone, Debug)]
pub struct WallFoot<'a> {
    image: ImageView<'a>,
    pinhole: &'a Pinhole,
    view: &'a CorridorView,
    distance_m: f64,
    usual: Option<FootProfile>,
}

impl<'a> WallFoot<'a> {
    /// Returns the foot of the wall at a signed distance (m, positive on the left) from the camera, in the observer's last image.
    #[must_use]
    pub fn new(
        image: ImageView<'a>,
        sight: &'a CorridorObserver,
        view: &'a CorridorView,
        distance_m: f64,
    ) -> Self {
        let mut foot = Self { image, pinhole: &sight.camera().pinhole, view, distance_m, usual: None };
        foot.usual = foot.most_common();
        foot
    }

    /// Returns true if the profile differs before and behind an edge at this distance (m). It does not at a shadow on the wall, or
    /// at the edge of something farther away.
    #[must_use]
    pub fn differs_at(&self, ahead_m: f64) -> bool {
        let column_m = self.column_m(ahead_m);
        let mean = |sign: f64, sample: u32| {
            let levels =
                FOOT_COLUMNS_PX.map(|aside_px| self.level(ahead_m + sign * aside_px * column_m, sample));
            levels.into_iter().sum::<Option<f64>>().map(|sum| sum / FOOT_COLUMNS_PX.len() as f64)
        };
        let squares =
            (0..FOOT_SAMPLES).map(|sample| Some((mean(-1.0, sample)? - mean(1.0, sample)?).powi(2)));
        let sum = squares.sum::<Option<f64>>();
        sum.is_some_and(|sum| sum > FOOT_CONTRAST.powi(2) * f64::from(FOOT_SAMPLES))
    }

    /// Returns true if the wall is visible behind an edge at this distance (m), within the width of a door, or if its typical
    /// profile is unknown.
    #[must_use]
    pub fn goes_on_behind(&self, ahead_m: f64) -> bool {
        self.usual.is_none() || self.is_seen_behind(ahead_m, DOOR_M)
    }

    /// Returns true if the wall is visible close behind an edge at this distance (m), as behind a corner beyond another corridor.
    #[must_use]
    pub fn goes_on_close_behind(&self, ahead_m: f64) -> bool {
        self.is_seen_behind(ahead_m, GAP_M)
    }

    fn is_seen_behind(&self, ahead_m: f64, to_m: f64) -> bool {
        let clear_m = (CLEAR_COLUMNS_PX * self.column_m(ahead_m)).max(STEP_M);
        self.is_visible_between(ahead_m + clear_m, ahead_m + to_m.max(clear_m + MIN_GAP_M))
    }

    /// Returns true if the wall starts at an edge at this distance (m), as behind another corridor: it is not visible before it,
    /// within the width of a door.
    #[must_use]
    pub fn begins_at(&self, ahead_m: f64) -> bool {
        let row_m = ahead_m.powi(2) / (self.view.height_m * self.view.intrinsics.fy);
        let clear_m = (CLEAR_COLUMNS_PX * self.column_m(ahead_m))
            .max(CLEAR_ROWS_PX * row_m)
            .clamp(STEP_M, 0.8 * DOOR_M);
        self.usual.is_some() && !self.is_visible_between(ahead_m - DOOR_M, ahead_m - clear_m)
    }

    /// Returns the distance (m) at which the wall ends, for more than the width of a door; `None` if it does not up to `farthest_m`.
    #[must_use]
    pub fn end(&self, farthest_m: f64) -> Option<f64> {
        let (mut last_m, mut steps) = (None, 0);
        let places = (0..).map(|step| PLACES_M[0] + STEP_M * f64::from(step));
        for ahead_m in places.take_while(|&ahead_m| ahead_m < farthest_m + DOOR_M) {
            steps = if self.is_seen_at(ahead_m) { steps + 1 } else { 0 };
            if steps >= MIN_STEPS {
                last_m = Some(ahead_m);
            } else if last_m.is_some_and(|last_m| ahead_m > last_m + DOOR_M) {
                return last_m.map(|last_m| last_m + 0.5 * STEP_M);
            }
        }
        None
    }

    /// Returns the distorted pixel of a point of the wall at a distance and a height, m.
    #[must_use]
    pub fn pixel(&self, ahead_m: f64, height_m: f64) -> Option<Vector2<f64>> {
        let point = Vector3::new(ahead_m, self.distance_m, height_m - self.view.height_m);
        self.pinhole.project(&(self.view.corridor_from_camera.transpose() * point).into()).ok()
    }

    /// Returns true if the wall is visible at several samples between two distances, m.
    fn is_visible_between(&self, from_m: f64, to_m: f64) -> bool {
        let steps = ((to_m - from_m) / STEP_M).floor().max(0.0) as u32;
        let places = (0..=steps).map(|step| from_m + STEP_M * f64::from(step));
        places.filter(|&ahead_m| self.is_seen_at(ahead_m)).nth(MIN_STEPS - 1).is_some()
    }

    /// Returns true if the wall is visible at a distance, m.
    #[must_use]
    pub fn is_seen_at(&self, ahead_m: f64) -> bool {
        let (Some(usual), Some(here)) = (&self.usual, self.profile(ahead_m)) else { return false };
        !is_flat(&here) && likeness(usual, &here) > AS_USUAL
    }

    /// Returns the typical profile.
    fn most_common(&self) -> Option<FootProfile> {
        let [near_m, far_m] = PLACES_M;
        let mut profiles = [None; PLACES];
        for (place, profile) in profiles.iter_mut().enumerate() {
            let share = place as f64 / (PLACES - 1) as f64;
            let here = self.profile(near_m * (far_m / near_m).powf(share));
            *profile = here.filter(|here| !is_flat(here));
        }
        let alike =
            |one: &FootProfile| profiles.iter().flatten().filter(|other| are_alike(one, other)).count();
        let (count, usual) = profiles
            .iter()
            .flatten()
            .map(|profile| (alike(profile), *profile))
            .max_by_key(|(count, _)| *count)?;
        (count > MIN_ALIKE).then_some(usual)
    }

    /// Returns the length of the wall that one column covers, m.
    fn column_m(&self, ahead_m: f64) -> f64 {
        ahead_m.powi(2) / (self.distance_m.abs() * self.view.intrinsics.fx)
    }

    /// Returns the profile at a distance; `None` outside the image.
    fn profile(&self, ahead_m: f64) -> Option<FootProfile> {
        let mut profile = [0.0; FOOT_SAMPLES as usize];
        for (sample, level) in (0..).zip(&mut profile) {
            *level = self.level(ahead_m, sample)?;
        }
        Some(profile)
    }

    /// Returns the gray level of one sample.
    fn level(&self, ahead_m: f64, sample: u32) -> Option<f64> {
        let [lowest_m, highest_m] = FOOT_HEIGHTS_M;
        let height_m = lowest_m + (highest_m - lowest_m) * f64::from(sample) / f64::from(FOOT_SAMPLES - 1);
        let pixel = self.pixel(ahead_m, height_m)?;
        let (u, v) = (pixel.x.round(), pixel.y.round());
        let is_inside =
            u >= 1.0 && v >= 0.0 && u + 1.0 < self.image.width() as f64 && v < self.image.height() as f64;
        if !is_inside {
            return None;
        }
        let row = self.image.row(v as usize);
        let levels = row.get(u as usize - 1..=u as usize + 1)?;
        Some(levels.iter().map(|&level| f64::from(level)).sum::<f64>() / levels.len() as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::camera::Calibration;
    use yamabico_core::camera::{Intrinsics, Mount};
    use yamabico_vision::corridor::floor_lines::FloorLineRule;
    use yamabico_vision::corridor::heading::CameraAttitude;
    use yamabico_vision::corridor::observer::CorridorCamera;

    const DISTANCE_M: f64 = 1.0;

    fn sight() -> (CorridorObserver, CorridorView) {
        let intrinsics = Intrinsics::from_horizontal_fov(640, 480, 1.05);
        let camera = CorridorCamera {
            pinhole: Pinhole::ideal(intrinsics),
            mount: Mount::tilted(0.6, 0.1),
            calibration: Calibration::Measured,
            horizon_sigma_rad: 0.01,
        };
        let attitude = CameraAttitude { heading: 0.03, tilt: 0.1 };
        let view = CorridorView::new(attitude, 0.0, 0.6, intrinsics);
        (CorridorObserver::new(camera, FloorLineRule::default()), view)
    }

    /// A wall on the left with a dark baseboard, seen at these distances; else the floor, and a wall far behind.
    fn image(view: &CorridorView, is_wall: impl Fn(f64) -> bool) -> Vec<u8> {
        let level = |u: u32, v: u32| {
            let normalized = view.intrinsics.normalized_from_pixel(Vector2::new(f64::from(u), f64::from(v)));
            let ray = view.corridor_from_camera * normalized.push(1.0);
            let (ahead_m, height_m) = (DISTANCE_M * ray.x / ray.y, 0.6 + DISTANCE_M * ray.z / ray.y);
            match height_m {
                0.0..0.1 if ray.y > 0.0 && is_wall(ahead_m) => 40,
                0.1.. if ray.y > 0.0 && is_wall(ahead_m) => 190,
                _ if ray.z < -0.02 => 130,
                _ => 170,
            }
        };
        (0..480).flat_map(|v| (0..640).map(move |u| (u, v))).map(|(u, v)| level(u, v)).collect()
    }

    #[test]
    fn a_wall_goes_on_behind_a_door_and_ends_at_a_corridor() {
        let (sight, view) = sight();
        let is_wall = |ahead_m: f64| !(3.0..4.0).contains(&ahead_m) && !(6.0..8.0).contains(&ahead_m);
        let pixels = image(&view, is_wall);
        let image = ImageView::new(&pixels, 640, 480, 640).unwrap();
        let foot = WallFoot::new(image, &sight, &view, DISTANCE_M);
        for (ahead_m, is_there) in [(2.5, true), (3.5, false), (5.0, true), (7.0, false), (9.0, true)] {
            assert_eq!(foot.is_seen_at(ahead_m), is_there, "{ahead_m} m");
        }
        assert!(foot.goes_on_behind(3.0) && !foot.goes_on_behind(6.0));
        assert!(foot.begins_at(8.0) && !foot.begins_at(4.0) && !foot.begins_at(6.0));
        assert!(!foot.goes_on_close_behind(6.0) && foot.goes_on_close_behind(8.0));
        assert!(foot.differs_at(6.0) && !foot.differs_at(5.0));
        assert!((foot.end(12.0).unwrap() - 6.0).abs() < 0.15, "{:?}", foot.end(12.0));
    }

    #[test]
    fn what_has_no_foot_never_ends() {
        let (sight, view) = sight();
        let pixels = vec![120; 640 * 480];
        let image = ImageView::new(&pixels, 640, 480, 640).unwrap();
        let foot = WallFoot::new(image, &sight, &view, DISTANCE_M);
        assert!(foot.end(12.0).is_none() && foot.goes_on_behind(6.0) && !foot.begins_at(6.0));
        assert_eq!(foot.pixel(-1.0, 0.0), None, "behind the camera");
    }

    #[test]
    fn a_wall_that_is_seen_all_along_never_ends() {
        let (sight, view) = sight();
        let pixels = image(&view, |_| true);
        let foot = WallFoot::new(ImageView::new(&pixels, 640, 480, 640).unwrap(), &sight, &view, DISTANCE_M);
        assert_eq!(foot.end(12.0), None);
    }
}
