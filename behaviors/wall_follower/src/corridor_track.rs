//! State of the robot in the corridor, propagated from frame to frame by odometry.
//!
//! Heading, left wall and right wall are three scalar Kalman filters; the corridor's axis is fixed in the odometry frame.

use nalgebra::Vector2;
use yamabico_core::geometry::{Pose2, wrap_angle};

use crate::centering::Walls;
use crate::wall_track::WallTrack;
use crate::width_memory::WidthMemory;
use yamabico_core::odometry_track::travel;
use yamabico_vision::corridor::floor_lines::WallEstimate;
use yamabico_vision::corridor::observer::{CorridorObservation, CorridorPrediction};

/// Heading variance per radian turned (odometry), rad.
pub(crate) const VARIANCE_PER_TURN: f64 = 1e-3;
/// Heading variance per meter driven, rad^2/m.
pub(crate) const VARIANCE_PER_METER: f64 = 2e-4;
/// Heading variance per second without odometry, rad^2/s: allows turns of 0.5 rad/s.
const VARIANCE_PER_SECOND_BLIND: f64 = 0.25;
/// Speed that is presumed without odometry, m/s.
const BLIND_MPS: f64 = 0.4;
/// Innovation of the heading (rad) above which, if also above three standard deviations, it is rejected, until
/// [`CONSISTENT_FRAMES`] agree.
const HEADING_JUMP_RAD: f64 = 0.045;
/// Number of consecutive frames that overrule a rejection.
const CONSISTENT_FRAMES: u32 = 3;
/// Standard deviation (rad) above which the heading is lost.
const HEADING_LOST_RAD: f64 = 0.175;

/// State of the robot in the corridor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Heading relative to the axis, rad, positive to the left.
    pub heading: f64,
    /// Standard deviation of the heading, rad.
    pub heading_sigma: f64,
    /// Signed distances from the robot's center to the walls.
    pub walls: Walls,
    /// Standard deviations of these distances, m; NaN for a wall that is not visible.
    pub wall_sigmas_m: [f64; 2],
    /// Width of the corridor, m, if known.
    pub width_m: Option<f64>,
}

/// Outcome of an observation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The observation updated the state.
    Accepted,
    /// The heading contradicts the prediction: the observation was rejected.
    Gated,
}

/// The filters. All states refer to the pose at the last frame.
#[derive(Clone, Debug, Default)]
pub struct CorridorTrack {
    axis: Option<Axis>,
    anchor: Pose2,
    walls: [WallTrack; 2],
    widths: WidthMemory,
    rejected: Option<(f64, u32)>,
    /// Distances up to which no wall stands on the left and right at the last frame, m.
    floor_m: [f64; 2],
    min_width_m: f64,
}

/// The corridor's axis in the odometry frame.
#[derive(Clone, Copy, Debug)]
struct Axis {
    angle: f64,
    variance: f64,
}

/// Motion of the robot between two frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// By odometry, to this pose in the odometry frame.
    To(Pose2),
    /// Unknown: there is no odometry.
    Unknown {
        /// Time since the last frame, s.
        elapsed_s: f64,
    },
}

impl CorridorTrack {
    /// Creates the track of a corridor that is at least `min_width_m` wide.
    #[must_use]
    pub fn new(min_width_m: f64) -> Self {
        Self { min_width_m, ..Self::default() }
    }

    /// Returns true if the heading is known well enough to steer by.
    #[must_use]
    pub fn has_heading(&self) -> bool {
        self.axis.is_some_and(|axis| axis.variance.sqrt() < HEADING_LOST_RAD)
    }

    /// Drops everything but the width of the corridor.
    pub fn lose(&mut self) {
        *self = Self { anchor: self.anchor, widths: self.widths.clone(), ..Self::new(self.min_width_m) };
    }

    /// Propagates the state to the pose of the next frame.
    pub fn predict(&mut self, motion: Motion) {
        let (pose, unknown_s) = match motion {
            Motion::To(pose) => (pose, 0.0),
            Motion::Unknown { elapsed_s } => (self.anchor, elapsed_s),
        };
        let (meters, turned) = travel(&self.anchor, &pose);
        // What was seen ages without odometry, too.
        let meters = meters + BLIND_MPS * unknown_s;
        let across_m = self.axis.map_or(0.0, |axis| across(axis.angle, &self.anchor, &pose));
        if let Some(axis) = &mut self.axis {
            axis.variance += VARIANCE_PER_TURN * turned + VARIANCE_PER_METER * meters;
            axis.variance += VARIANCE_PER_SECOND_BLIND * unknown_s;
        }
        for wall in &mut self.walls {
            wall.drive(meters, across_m);
        }
        self.widths.drive(meters);
        self.anchor = pose;
    }

    /// Returns the prediction for the next frame, after [`CorridorTrack::predict`].
    #[must_use]
    pub fn prediction(&self) -> Option<CorridorPrediction> {
        let axis = self.axis.filter(|_| self.has_heading())?;
        Some(CorridorPrediction {
            heading: wrap_angle(self.anchor.theta - axis.angle),
            heading_sigma: axis.variance.sqrt(),
            walls: self.walls.map(|wall| {
                wall.estimate().map(|wall| WallEstimate { sigma_m: wall.sigma_m.max(0.02), ..wall })
            }),
            floor_m: self.floor_m,
        })
    }

    /// Takes in how far the floor reaches to the left and right of the predicted pose, m, and drops walls that are nearer: with
    /// them, the width that they were seen at.
    pub fn take_floor(&mut self, floor_m: [f64; 2]) {
        self.floor_m = floor_m;
        for (wall, reach_m) in self.walls.iter_mut().zip(floor_m) {
            if wall.estimate().is_some_and(|known| known.distance_m.abs() < reach_m) {
                *wall = WallTrack::default();
                self.widths = WidthMemory::default();
            }
        }
    }

    /// Updates the state by an observation at the predicted pose.
    pub fn update(&mut self, observation: &CorridorObservation) -> Verdict {
        if !self.update_axis(observation) {
            return Verdict::Gated;
        }
        let seen = [observation.left, observation.right];
        let pair = self.known_pair(seen);
        for (side, wall) in pair.into_iter().enumerate() {
            if let Some(wall) = wall {
                self.walls[side].update(wall);
            }
        }
        if let [Some(left), Some(right)] = pair {
            self.widths.add(left.distance_m - right.distance_m);
        }
        self.drop_impossible_wall(pair);
        Verdict::Accepted
    }

    /// Drops the wall that was not seen now of two that are too near to each other.
    fn drop_impossible_wall(&mut self, seen: [Option<WallEstimate>; 2]) {
        let [Some(left), Some(right)] = self.walls.map(|wall| wall.estimate()) else { return };
        if left.distance_m - right.distance_m < self.min_width_m {
            match seen {
                [None, Some(_)] => self.walls[0].drop_known(),
                [Some(_), None] => self.walls[1].drop_known(),
                _ => {}
            }
        }
    }

    /// Returns the state at a later pose in the odometry frame; `None` without a heading.
    #[must_use]
    pub fn estimate_at(&self, pose: &Pose2) -> Option<Estimate> {
        let axis = self.axis.filter(|_| self.has_heading())?;
        let across_m = across(axis.angle, &self.anchor, pose);
        let walls = self.walls.map(|wall| wall.estimate());
        let [left, right] = walls.map(|wall| wall.map(|wall| wall.distance_m - across_m));
        Some(Estimate {
            heading: wrap_angle(pose.theta - axis.angle),
            heading_sigma: axis.variance.sqrt(),
            walls: Walls { left_m: left, right_m: right },
            wall_sigmas_m: walls.map(|wall| wall.map_or(f64::NAN, |wall| wall.sigma_m)),
            width_m: self.widths.median_m(),
        })
    }

    fn update_axis(&mut self, observation: &CorridorObservation) -> bool {
        let seen = wrap_angle(self.anchor.theta - observation.heading);
        let noise = observation.heading_sigma.powi(2);
        let Some(axis) = self.axis.as_mut().filter(|axis| axis.variance.sqrt() < HEADING_LOST_RAD) else {
            self.axis = Some(Axis { angle: seen, variance: noise });
            return true;
        };
        let innovation = wrap_angle(seen - axis.angle);
        let sigma = (axis.variance + noise).sqrt();
        if innovation.abs() > (3.0 * sigma).max(HEADING_JUMP_RAD) {
            let agreeing = match self.rejected {
                Some((angle, count)) if wrap_angle(seen - angle).abs() < HEADING_JUMP_RAD => count + 1,
                _ => 1,
            };
            self.rejected = Some((seen, agreeing));
            if agreeing < CONSISTENT_FRAMES {
                return false;
            }
            *axis = Axis { angle: seen, variance: noise };
            self.walls.iter_mut().for_each(WallTrack::drop_known);
        } else {
            let gain = axis.variance / (axis.variance + noise);
            axis.angle = wrap_angle(axis.angle + gain * innovation);
            axis.variance *= 1.0 - gain;
        }
        self.rejected = None;
        true
    }

    /// Returns the observed walls without the one that contradicts the known width, unless another width is confirmed.
    fn known_pair(&mut self, seen: [Option<WallEstimate>; 2]) -> [Option<WallEstimate>; 2] {
        let [Some(left), Some(right)] = seen else { return seen };
        let width_m = left.distance_m - right.distance_m;
        if self.widths.fits(width_m) {
            return seen;
        }
        if self.widths.contradict(width_m) {
            self.walls.iter_mut().for_each(WallTrack::drop_known);
            return seen;
        }
        let innovation = |side: usize, wall: WallEstimate| {
            let known = self.walls[side].estimate();
            known.map_or(f64::INFINITY, |known| (wall.distance_m - known.distance_m).abs())
        };
        let (by_left, by_right) = (innovation(0, left), innovation(1, right));
        if by_left.is_infinite() && by_right.is_infinite() {
            seen
        } else if by_left <= by_right {
            [seen[0], None]
        } else {
            [None, seen[1]]
        }
    }
}

/// Returns the displacement between two poses to the left of an axis (angle in the odometry frame), m.
fn across(axis_angle: f64, from: &Pose2, to: &Pose2) -> f64 {
    let (sin, cos) = axis_angle.sin_cos();
    Vector2::new(-sin, cos).dot(&(to.position() - from.position()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn observation(heading: f64, left: Option<f64>, right: Option<f64>) -> CorridorObservation {
        let wall = |d: f64| WallEstimate { distance_m: d, sigma_m: 0.01 };
        CorridorObservation {
            heading,
            heading_sigma: 0.002,
            tilt: 0.0,
            vanishing_point: Vector2::zeros(),
            left: left.map(wall),
            right: right.map(wall),
        }
    }

    fn see(track: &mut CorridorTrack, pose: Pose2, left: Option<f64>, right: Option<f64>) -> Verdict {
        track.predict(Motion::To(pose));
        track.update(&observation(pose.theta, left, right))
    }

    #[test]
    fn walls_nearer_than_the_floor_reaches_are_dropped_with_their_width() {
        let mut track = CorridorTrack::new(0.8);
        let at = |x: f64| Pose2::new(x, 0.0, 0.0);
        for step in 0..20 {
            see(&mut track, at(0.05 * f64::from(step)), Some(0.6), Some(-0.3));
        }
        let here = at(0.95);
        track.take_floor([0.5, 0.2]);
        let estimate = track.estimate_at(&here).expect("a heading");
        assert!(
            estimate.walls.left_m.is_some() && estimate.walls.right_m.is_some() && estimate.width_m.is_some()
        );
        track.take_floor([0.5, 0.5]);
        let estimate = track.estimate_at(&here).expect("a heading");
        assert!(estimate.walls.left_m.is_some() && estimate.walls.right_m.is_none(), "{estimate:?}");
        assert!(estimate.width_m.is_none() && track.prediction().expect("known").floor_m == [0.5, 0.5]);
    }

    #[test]
    fn two_walls_that_nothing_could_pass_between_are_not_both_kept() {
        let mut track = CorridorTrack::new(0.8);
        let at = |x: f64| Pose2::new(x, 0.0, 0.0);
        see(&mut track, at(0.0), Some(0.27), None);
        see(&mut track, at(0.05), None, Some(-0.27));
        let walls = track.estimate_at(&at(0.05)).expect("a heading").walls;
        assert!(walls.left_m.is_none() && walls.right_m.is_some(), "the one that is seen is kept: {walls:?}");
        see(&mut track, at(0.1), Some(0.9), None);
        let walls = track.estimate_at(&at(0.1)).expect("a heading").walls;
        assert!(walls.left_m.is_some() && walls.right_m.is_some(), "{walls:?}");
    }

    #[test]
    fn odometry_carries_the_estimate_to_now() {
        let mut track = CorridorTrack::default();
        assert!(track.estimate_at(&Pose2::IDENTITY).is_none());
        track.predict(Motion::To(Pose2::new(0.0, 0.0, 0.5)));
        track.update(&observation(0.1, Some(1.0), Some(-1.0)));
        // The axis is at 0.4 in the odometry frame; one meter across it to the left is a meter toward the left wall.
        let later = Pose2::new(-0.4_f64.sin() * 0.3, 0.4_f64.cos() * 0.3, 0.2);
        let now = track.estimate_at(&later).unwrap();
        assert!((now.heading + 0.2).abs() < 1e-12);
        assert!((now.walls.left_m.unwrap() - 0.7).abs() < 1e-12);
        assert!((now.walls.right_m.unwrap() + 1.3).abs() < 1e-12);
        assert_eq!(now.width_m, Some(2.0));
    }

    #[test]
    fn a_jump_of_the_heading_is_refused_until_it_lasts() {
        let mut track = CorridorTrack::default();
        see(&mut track, Pose2::IDENTITY, Some(1.0), Some(-1.0));
        for expected in [Verdict::Gated, Verdict::Gated, Verdict::Accepted] {
            track.predict(Motion::To(Pose2::IDENTITY));
            assert_eq!(track.update(&observation(0.3, None, None)), expected);
        }
        assert!((track.estimate_at(&Pose2::IDENTITY).unwrap().heading - 0.3).abs() < 1e-9);
    }

    #[test]
    fn a_recess_is_passed_and_a_wider_corridor_is_accepted() {
        let mut track = CorridorTrack::default();
        let at = |x: f64| Pose2::new(x, 0.0, 0.0);
        see(&mut track, at(0.0), Some(1.0), None);
        see(&mut track, at(0.2), Some(1.3), None);
        assert!((track.estimate_at(&at(0.2)).unwrap().walls.left_m.unwrap() - 1.0).abs() < 1e-9);
        for step in 2..6 {
            see(&mut track, at(0.2 * f64::from(step)), Some(1.3), None);
        }
        assert!((track.estimate_at(&at(1.0)).unwrap().walls.left_m.unwrap() - 1.3).abs() < 0.01);
    }

    #[test]
    fn the_width_outlives_a_wall_and_then_is_forgotten() {
        let mut track = CorridorTrack::default();
        see(&mut track, Pose2::IDENTITY, Some(1.0), Some(-0.8));
        for step in 1..=8 {
            see(&mut track, Pose2::new(0.25 * f64::from(step), 0.0, 0.0), Some(1.0), None);
        }
        let two_meters_on = track.estimate_at(&Pose2::new(2.0, 0.0, 0.0)).unwrap();
        assert!(two_meters_on.walls.right_m.is_none(), "unseen for too long");
        assert!((two_meters_on.width_m.unwrap() - 1.8).abs() < 1e-9);
        for step in 9..=14 {
            see(&mut track, Pose2::new(0.25 * f64::from(step), 0.0, 0.0), Some(1.0), None);
        }
        assert_eq!(track.estimate_at(&Pose2::new(3.5, 0.0, 0.0)).unwrap().width_m, None);
    }

    #[test]
    fn a_wall_that_does_not_fit_the_width_is_left_out() {
        let mut track = CorridorTrack::default();
        see(&mut track, Pose2::IDENTITY, Some(1.0), Some(-1.0));
        see(&mut track, Pose2::IDENTITY, Some(1.0), Some(-0.87));
        see(&mut track, Pose2::IDENTITY, Some(1.0), Some(-0.80));
        let estimate = track.estimate_at(&Pose2::IDENTITY).unwrap();
        assert!(estimate.walls.right_m.unwrap() < -0.90, "{estimate:?}");
    }

    #[test]
    fn a_width_that_was_wrong_gives_way_to_one_that_lasts() {
        let mut track = CorridorTrack::default();
        see(&mut track, Pose2::IDENTITY, Some(1.0), Some(-0.24));
        for step in 1..=4 {
            see(&mut track, Pose2::new(0.2 * f64::from(step), 0.0, 0.0), Some(1.0), Some(-1.0));
        }
        let estimate = track.estimate_at(&Pose2::new(0.8, 0.0, 0.0)).unwrap();
        assert!((estimate.width_m.unwrap() - 2.0).abs() < 1e-9, "{estimate:?}");
        assert!((estimate.walls.right_m.unwrap() + 1.0).abs() < 1e-9, "{estimate:?}");
    }

    #[test]
    fn without_odometry_the_frame_dominates() {
        let mut track = CorridorTrack::default();
        track.update(&observation(0.0, None, None));
        track.predict(Motion::Unknown { elapsed_s: 0.1 });
        assert_eq!(track.update(&observation(0.2, None, None)), Verdict::Accepted);
        assert!((track.estimate_at(&Pose2::IDENTITY).unwrap().heading - 0.2).abs() < 0.01);
    }

    #[test]
    fn a_lost_heading_leaves_the_width_wherever_the_robot_is() {
        let mut track = CorridorTrack::default();
        let far = |x: f64| Motion::To(Pose2::new(x, -20.0, 0.0));
        for i in 0..5 {
            track.predict(far(50.0 + 0.1 * f64::from(i)));
            track.update(&observation(0.0, Some(1.0), Some(-1.0)));
        }
        track.lose();
        track.predict(far(50.5));
        track.update(&observation(0.0, Some(1.0), None));
        let estimate = track.estimate_at(&Pose2::new(50.5, -20.0, 0.0)).unwrap();
        assert!((estimate.width_m.expect("a width") - 2.0).abs() < 1e-9, "{estimate:?}");
    }

    #[test]
    fn without_odometry_walls_out_of_view_are_forgotten() {
        let mut track = CorridorTrack::default();
        track.update(&observation(0.0, Some(1.0), Some(-1.0)));
        for i in 0..40 {
            track.predict(Motion::Unknown { elapsed_s: 0.1 });
            track.update(&observation(0.0, None, Some(-1.0)));
            let walls = track.estimate_at(&Pose2::IDENTITY).unwrap().walls;
            assert_eq!(walls.left_m.is_some(), i < 24, "after {i} pictures");
            assert!(walls.right_m.is_some());
        }
    }
}
