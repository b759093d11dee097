//! A wall ahead: its distance from image to image, and the speed that it allows.

use yamabico_core::geometry::{Pose2, wrap_angle};

/// Deceleration before a wall, m/s^2.
const DECELERATION_MPS2: f64 = 0.3;
/// Number of images that confirm a wall, and of images without it that drop it.
const CONFIRMED: u32 = 3;
/// Ratio of a seen distance to the expected one up to which both are the same wall.
const SAME_WALL: f64 = 1.3;
/// Turn away from a wall from which on it no longer lies ahead, rad.
const ASIDE_RAD: f64 = 0.8;
/// Distance behind the robot's center at which a wall was not there, m.
const PASSED_M: f64 = -0.3;
/// Number of images over which a foot line must grow for a time to contact.
const GROWING: usize = 5;
/// Times to contact at which the speed is halved, and at which the robot stops, s.
const HALVED_S: f64 = 2.0;
const STOPPED_S: f64 = 1.0;

/// Wall across the way, propagated by odometry between images.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AheadTrack {
    wall: Option<Wall>,
    looming: Looming,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Wall {
    range_m: f64,
    images: u32,
    missed: u32,
    /// Turn since it was seen, rad.
    turned: f64,
}

impl Wall {
    fn is_confirmed(&self) -> bool {
        self.images >= CONFIRMED
    }

    /// True if its foot line lies below the image or aside.
    fn is_out_of_view(&self, nearest_m: f64) -> bool {
        self.range_m < 1.1 * nearest_m || self.turned.abs() > ASIDE_RAD
    }
}

/// Wall seen in one image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeenWall {
    /// Distance of its foot line from the camera, m.
    pub range_m: f64,
    /// Rows from the horizon to the foot line, px.
    pub depth_px: f64,
}

impl AheadTrack {
    /// Propagates over a motion: the new pose in the robot's frame before it.
    pub fn predict(&mut self, motion: &Pose2) {
        if let Some(wall) = &mut self.wall {
            let (sin, cos) = wall.turned.sin_cos();
            wall.range_m -= motion.x * cos - motion.y * sin;
            wall.turned = wrap_angle(wall.turned + motion.theta);
            if wall.range_m < PASSED_M {
                self.wall = None;
            }
        }
    }

    /// Updates by an image captured `elapsed_s` after the last; `nearest_m` is the nearest floor in view.
    pub fn update(&mut self, seen: Option<SeenWall>, nearest_m: f64, elapsed_s: f64) {
        self.looming.update(seen.map(|seen| seen.depth_px), elapsed_s);
        let known = self.wall.filter(|wall| {
            let ratio = seen.map_or(1.0, |seen| seen.range_m / wall.range_m.max(0.05));
            (1.0 / SAME_WALL..=SAME_WALL).contains(&ratio)
        });
        self.wall = match (seen, known) {
            (Some(seen), Some(wall)) => {
                let range_m = 0.5 * (wall.range_m + seen.range_m);
                Some(Wall { range_m, images: wall.images + 1, missed: 0, turned: 0.0 })
            }
            (Some(seen), None) => {
                // A wall that was confirmed is not replaced by a single line.
                let confirmed = self.wall.filter(|wall| wall.is_confirmed() && wall.missed < CONFIRMED);
                let fresh = Wall { range_m: seen.range_m, images: 1, missed: 0, turned: 0.0 };
                Some(confirmed.map_or(fresh, |wall| Wall { missed: wall.missed + 1, ..wall }))
            }
            // The foot line has left the image below: the wall is still there.
            (None, Some(wall)) if wall.is_confirmed() && wall.is_out_of_view(nearest_m) => Some(wall),
            (None, Some(wall)) => {
                let missed = Wall { missed: wall.missed + 1, ..wall };
                (missed.missed < CONFIRMED && wall.is_confirmed()).then_some(missed)
            }
            (None, None) => None,
        };
    }

    /// Forgets the wall.
    pub fn forget(&mut self) {
        *self = Self::default();
    }

    /// Distance of the wall from the camera, m; `None` unless several images agree and the robot points at it.
    #[must_use]
    pub fn range_m(&self) -> Option<f64> {
        self.wall.filter(|wall| wall.is_confirmed() && wall.turned.abs() < ASIDE_RAD).map(|wall| wall.range_m)
    }

    /// Maximum speed, m/s, of a robot that stops `stop_m` before the wall, at most `cruise_mps`.
    #[must_use]
    pub fn speed_limit(&self, cruise_mps: f64, stop_m: f64) -> f64 {
        let by_range = self
            .range_m()
            .map_or(f64::INFINITY, |range_m| (2.0 * DECELERATION_MPS2 * (range_m - stop_m).max(0.0)).sqrt());
        let by_looming = match self.looming.time_to_contact_s() {
            Some(time_s) if time_s < STOPPED_S => 0.0,
            Some(time_s) if time_s < HALVED_S => 0.5 * cruise_mps,
            _ => cruise_mps,
        };
        by_range.min(by_looming).min(cruise_mps)
    }
}

/// Growth of the depth of a foot line below the horizon.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Looming {
    first_px: f64,
    last_px: f64,
    elapsed_s: f64,
    grown: usize,
}

impl Looming {
    fn update(&mut self, depth_px: Option<f64>, elapsed_s: f64) {
        *self = match depth_px {
            Some(depth_px) if self.last_px > 0.0 && depth_px > self.last_px => Self {
                last_px: depth_px,
                elapsed_s: self.elapsed_s + elapsed_s,
                grown: self.grown + 1,
                ..*self
            },
            Some(depth_px) => Self { first_px: depth_px, last_px: depth_px, ..Self::default() },
            None => Self::default(),
        };
    }

    /// Time until the robot reaches the line at its present speed, s.
    fn time_to_contact_s(&self) -> Option<f64> {
        let grown_px = self.last_px - self.first_px;
        (self.grown >= GROWING).then(|| self.first_px * self.elapsed_s / grown_px)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(range_m: f64) -> Option<SeenWall> {
        Some(SeenWall { range_m, depth_px: 100.0 / range_m })
    }

    #[test]
    fn a_wall_counts_after_three_images_and_stops_the_robot_before_it() {
        let mut track = AheadTrack::default();
        for expected in [None, None, Some(2.0)] {
            track.update(seen(2.0), 0.5, 0.1);
            assert_eq!(track.range_m(), expected);
        }
        assert!((track.speed_limit(5.0, 0.6) - (2.0_f64 * 0.3 * 1.4).sqrt()).abs() < 1e-9);
        assert_eq!(track.speed_limit(0.4, 0.6), 0.4);
        track.predict(&Pose2::new(1.5, 0.0, 0.0));
        assert_eq!(track.speed_limit(0.4, 0.6), 0.0);
    }

    #[test]
    fn a_wall_below_the_image_stays_and_one_that_vanishes_in_view_goes() {
        let (mut below, mut vanished) = (AheadTrack::default(), AheadTrack::default());
        for track in [&mut below, &mut vanished] {
            for _ in 0..3 {
                track.update(seen(1.5), 1.3, 0.1);
            }
        }
        below.predict(&Pose2::new(0.5, 0.0, 0.0));
        for _ in 0..9 {
            below.update(None, 1.3, 0.1);
            vanished.update(None, 0.5, 0.1);
        }
        assert!((below.range_m().unwrap() - 1.0).abs() < 1e-9);
        assert_eq!(vanished.range_m(), None);
        below.predict(&Pose2::new(0.0, 0.0, 1.0));
        assert_eq!(below.range_m(), None, "the robot turned away");
        below.predict(&Pose2::new(0.0, 0.0, -1.0));
        assert!(below.range_m().is_some(), "and back");
        (0..8).for_each(|_| below.predict(&Pose2::new(0.0, 0.0, 0.25 * std::f64::consts::PI)));
        assert!(below.range_m().is_some(), "and around");
        below.predict(&Pose2::new(-0.4, 0.0, 0.0));
        assert!((below.range_m().unwrap() - 1.4).abs() < 1e-9, "the robot backed off");
        below.predict(&Pose2::new(0.0, 0.0, 0.5));
        below.predict(&Pose2::new(0.0, 0.4, 0.0));
        assert!((below.range_m().unwrap() - 1.4 - 0.4 * 0.5_f64.sin()).abs() < 1e-9, "it slid aside");
    }

    #[test]
    fn single_lines_at_changing_distances_are_no_wall() {
        let mut track = AheadTrack::default();
        for range_m in [1.0, 2.0, 1.0, 3.0, 1.5, 2.5, 1.2] {
            track.update(seen(range_m), 0.5, 0.1);
            assert_eq!(track.range_m(), None);
        }
    }

    #[test]
    fn a_line_that_grows_fast_gives_a_time_to_contact() {
        let mut looming = Looming::default();
        // One meter per second from three meters, an image each 0.1 s.
        for image in 0..8 {
            looming.update(Some(100.0 / (3.0 - 0.1 * f64::from(image))), 0.1);
        }
        assert!((looming.time_to_contact_s().unwrap() - 2.3).abs() < 1e-9);
        looming.update(Some(10.0), 0.1);
        assert_eq!(looming.time_to_contact_s(), None);
    }
}
