//! Where along its floor line a wall is seen.
//!
//! A wall looks alike all along its foot, whatever the light: floor, skirting, wall. A door interrupts it for no more than a
//! door's width; at the end of the wall it stops, and before a corner behind another corridor there is none.

use nalgebra::{Vector2, Vector3};
use yamabico_core::camera::Pinhole;
use yamabico_core::image::ImageView;
use yamabico_vision::corridor::sight::Sight;
use yamabico_vision::corridor::wall_distance::CorridorView;

use crate::foot::{FOOT_CONTRAST, FOOT_SAMPLES, FootProfile, are_alike, is_flat, likeness};

/// A wall that is seen again so much farther on goes on: an opening in it is a door's, meters.
const DOOR_M: f64 = 1.3;
/// Behind an edge higher than any door the wall must be gone so far only, meters: from afar the foot of a wall across the
/// corridor hides the rest of the gap.
const GAP_M: f64 = 0.6;
/// ... and at least so far beyond what the edge itself covers, meters.
const MIN_GAP_M: f64 = 0.3;
/// In such steps a wall is looked for, meters.
const STEP_M: f64 = 0.1;
/// A wall is there where it is seen at so many steps.
const MIN_STEPS: usize = 2;
/// Between these heights (m) a line on a wall is its floor line or the edge of its skirting.
const FOOT_HEIGHTS_M: [f64; 2] = [-0.1, 0.25];
/// The picture is compared so many columns before and behind an edge.
const FOOT_COLUMNS_PX: [f64; 4] = [2.0, 3.0, 4.0, 5.0];
/// So many columns from an edge the picture is that of one of its sides.
const CLEAR_COLUMNS_PX: f64 = 2.5;
/// The foot of what stands across the corridor, whose row differs by less than this (px), looks like the wall's.
const CLEAR_ROWS_PX: f64 = 2.0;
/// What a wall usually looks like is asked at so many places ...
const PLACES: usize = 24;
/// ... between these distances (m), each farther than the last by the same factor ...
const PLACES_M: [f64; 2] = [1.2, 9.0];
/// ... of which so many others must look alike.
const MIN_ALIKE: usize = 4;
/// A wall looks as usual where its foot correlates by this.
const AS_USUAL: f64 = 0.75;

/// The foot of one wall in a picture.
#[derive(Clone, Debug)]
pub struct WallFoot<'a> {
    image: ImageView<'a>,
    pinhole: &'a Pinhole,
    view: &'a CorridorView,
    distance_m: f64,
    usual: Option<FootProfile>,
}

impl<'a> WallFoot<'a> {
    /// The foot of the wall at a signed distance (m, positive on the left) from the camera, in the last picture of `sight`.
    #[must_use]
    pub fn new(image: ImageView<'a>, sight: &'a Sight, view: &'a CorridorView, distance_m: f64) -> Self {
        let mut foot = Self { image, pinhole: &sight.camera().pinhole, view, distance_m, usual: None };
        foot.usual = foot.most_common();
        foot
    }

    /// Whether the foot looks different before and behind an edge so far ahead (m): a shade on the wall leaves the skirting
    /// alike, and so does the edge of something farther away.
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

    /// Whether the wall is seen behind an edge so far ahead (m), no farther than a door is wide; also where nobody knows what
    /// the wall looks like.
    #[must_use]
    pub fn goes_on_behind(&self, ahead_m: f64) -> bool {
        self.usual.is_none() || self.is_seen_behind(ahead_m, DOOR_M)
    }

    /// Whether the wall is seen close behind an edge so far ahead (m), as behind a corner beyond another corridor.
    #[must_use]
    pub fn goes_on_close_behind(&self, ahead_m: f64) -> bool {
        self.is_seen_behind(ahead_m, GAP_M)
    }

    fn is_seen_behind(&self, ahead_m: f64, to_m: f64) -> bool {
        let clear_m = (CLEAR_COLUMNS_PX * self.column_m(ahead_m)).max(STEP_M);
        self.is_seen_between(ahead_m + clear_m, ahead_m + to_m.max(clear_m + MIN_GAP_M))
    }

    /// Whether the wall begins at an edge so far ahead (m), as behind another corridor: it is not seen before it, no farther
    /// than a door is wide.
    #[must_use]
    pub fn begins_at(&self, ahead_m: f64) -> bool {
        let row_m = ahead_m.powi(2) / (self.view.height_m * self.view.intrinsics.fy);
        let clear_m = (CLEAR_COLUMNS_PX * self.column_m(ahead_m))
            .max(CLEAR_ROWS_PX * row_m)
            .clamp(STEP_M, 0.8 * DOOR_M);
        self.usual.is_some() && !self.is_seen_between(ahead_m - DOOR_M, ahead_m - clear_m)
    }

    /// How far ahead (m) the wall is no longer seen, for farther than a door is wide; `None` where that is nowhere up to
    /// `farthest_m`.
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

    /// Where the wall is seen so far ahead and so high above the floor, meters: a pixel of the picture as it is.
    #[must_use]
    pub fn pixel(&self, ahead_m: f64, height_m: f64) -> Option<Vector2<f64>> {
        let point = Vector3::new(ahead_m, self.distance_m, height_m - self.view.height_m);
        self.pinhole.project(&(self.view.corridor_from_camera.transpose() * point).into()).ok()
    }

    /// Whether the wall is seen at some places between two distances, meters.
    fn is_seen_between(&self, from_m: f64, to_m: f64) -> bool {
        let steps = ((to_m - from_m) / STEP_M).floor().max(0.0) as u32;
        let places = (0..=steps).map(|step| from_m + STEP_M * f64::from(step));
        places.filter(|&ahead_m| self.is_seen_at(ahead_m)).nth(MIN_STEPS - 1).is_some()
    }

    /// Whether the wall is seen so far ahead, meters.
    #[must_use]
    pub fn is_seen_at(&self, ahead_m: f64) -> bool {
        let (Some(usual), Some(here)) = (&self.usual, self.profile(ahead_m)) else { return false };
        !is_flat(&here) && likeness(usual, &here) > AS_USUAL
    }

    /// What the foot looks like at most places.
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

    /// Meters along the wall that one column shows.
    fn column_m(&self, ahead_m: f64) -> f64 {
        ahead_m.powi(2) / (self.distance_m.abs() * self.view.intrinsics.fx)
    }

    /// Gray levels from below to above the foot of the wall; `None` outside the picture.
    fn profile(&self, ahead_m: f64) -> Option<FootProfile> {
        let mut profile = [0.0; FOOT_SAMPLES as usize];
        for (sample, level) in (0..).zip(&mut profile) {
            *level = self.level(ahead_m, sample)?;
        }
        Some(profile)
    }

    /// The gray level of one sample of the foot.
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
    use yamabico_vision::corridor::sight::CorridorCamera;

    const DISTANCE_M: f64 = 1.0;

    fn sight() -> (Sight, CorridorView) {
        let intrinsics = Intrinsics::from_horizontal_fov(640, 480, 1.05);
        let camera = CorridorCamera {
            pinhole: Pinhole::ideal(intrinsics),
            mount: Mount::tilted(0.6, 0.1),
            calibration: Calibration::Measured,
            horizon_sigma_rad: 0.01,
        };
        let attitude = CameraAttitude { heading: 0.03, tilt: 0.1 };
        let view = CorridorView::new(attitude, 0.0, 0.6, intrinsics);
        (Sight::new(camera, FloorLineRule::default()), view)
    }

    /// A wall on the left with a dark skirting, seen at these distances; else the floor, and a wall far behind.
    fn picture(view: &CorridorView, is_wall: impl Fn(f64) -> bool) -> Vec<u8> {
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
        let pixels = picture(&view, is_wall);
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
        let pixels = picture(&view, |_| true);
        let foot = WallFoot::new(ImageView::new(&pixels, 640, 480, 640).unwrap(), &sight, &view, DISTANCE_M);
        assert_eq!(foot.end(12.0), None);
    }
}
