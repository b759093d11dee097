//! Direction of travel: a corridor leads two ways, and the robot keeps its own.

use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_core::time::Time;

/// Distance from the place where the corridor was followed last up to which its direction is kept, m: farther away,
/// another behavior has led the robot elsewhere.
const KEPT_M: f64 = 1.5;
/// Distance over which the direction that is kept follows that of the corridor, m: a bend is longer, and a pattern of the floor that
/// leads aside is taken for the corridor in one frame or another.
const FOLLOWS_OVER_M: f64 = 1.0;
/// Angle between directions from which one leads back, rad.
const BACK_RAD: f64 = 1.9;
/// Angle between directions from which one leads aside, rad.
const ASIDE_RAD: f64 = 0.4;
/// Times for which no such direction is believed, s: before a wall across the way, and where none was seen. Lines on a wall meet
/// beside the corridor, and a robot that has turned before an obstacle sees a room or a corridor that crosses; a bend is still
/// there after the search.
const ASIDE_S: f64 = 8.0;
const ASIDE_WITHOUT_WALL_S: f64 = 30.0;

/// The direction in which the corridor was followed last, by odometry.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Direction {
    /// Position of the robot, the heading along the corridor, and the time.
    followed: Option<(Pose2, Time)>,
    /// True if a wall across that direction has been seen since.
    ends: bool,
}

impl Direction {
    /// Keeps the direction of a corridor that the robot at `pose` follows with the heading `heading` relative to its axis.
    pub fn follow(&mut self, pose: &Pose2, heading: f64, at: Time) {
        let seen = pose.theta - heading;
        let theta =
            self.followed.filter(|(last, _)| last.distance(pose) < KEPT_M).map_or(seen, |(last, _)| {
                let share = (last.distance(pose) / FOLLOWS_OVER_M).min(1.0);
                last.theta + share * angle_difference(seen, last.theta)
            });
        *self = Self { followed: Some((Pose2 { theta, ..*pose }, at)), ends: false };
    }

    /// Notes a wall ahead of the robot at `pose`: in the direction that it keeps, the corridor ends.
    pub fn see_wall(&mut self, pose: &Pose2) {
        self.ends |=
            self.heading(pose).is_some_and(|kept| angle_difference(pose.theta, kept).abs() < ASIDE_RAD);
    }

    /// Forgets the direction: the robot turns back on purpose.
    pub fn forget(&mut self) {
        *self = Self::default();
    }

    /// Heading along the corridor for a robot at `pose`, odometry frame, rad; `None` if it is unknown here.
    #[must_use]
    pub fn heading(&self, pose: &Pose2) -> Option<f64> {
        let (followed, _) = self.followed.filter(|(followed, _)| followed.distance(pose) < KEPT_M)?;
        Some(followed.theta)
    }

    /// True if a corridor seen from `pose` with the heading `heading` relative to its axis leads back, or, until some time after
    /// the last one was followed, aside.
    #[must_use]
    pub fn leads_away(&self, pose: &Pose2, heading: f64, now: Time) -> bool {
        let (Some(kept), Some((_, at))) = (self.heading(pose), self.followed) else { return false };
        let off = angle_difference(pose.theta - heading, kept).abs();
        let aside_s = if self.ends { ASIDE_S } else { ASIDE_WITHOUT_WALL_S };
        off > BACK_RAD || (off > ASIDE_RAD && now.seconds_after(at) < aside_s)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn a_wavering_heading_does_not_lead_the_direction_aside() {
        let mut direction = Direction::default();
        let off = |direction: &Direction, pose: &Pose2| direction.heading(pose).expect("known").abs();
        for step in 0..20 {
            let pose = Pose2::new(0.02 * f64::from(step), 0.0, 0.1);
            direction.follow(&pose, if step % 5 == 4 { -0.3 } else { 0.1 }, Time(0));
            assert!(off(&direction, &pose) < 0.1);
        }
        for step in 0..100 {
            direction.follow(&Pose2::new(0.4 + 0.05 * f64::from(step), 0.0, 0.0), 0.5, Time(0));
        }
        assert!(off(&direction, &Pose2::new(5.4, 0.0, 0.0)) > 0.45, "a bend");
    }

    #[test]
    fn the_other_way_is_told_from_a_bend_and_forgotten_elsewhere() {
        let mut direction = Direction::default();
        let later = Time::from_secs_f64(10.0);
        let here = Pose2::new(1.0, 0.5, 0.2);
        assert!(!direction.leads_away(&here, 0.0, later), "nothing was followed");
        direction.follow(&here, 0.1, Time(0));
        assert!((direction.heading(&here).expect("known") - 0.1).abs() < 1e-12);
        let turned = Pose2::new(1.2, 0.5, 3.0);
        assert!(direction.leads_away(&turned, 0.0, later));
        assert!(!direction.leads_away(&turned, PI, later), "the same axis the right way");
        let bend = Pose2::new(1.2, 0.5, 1.6);
        assert!(direction.leads_away(&bend, 0.0, later), "the corridor goes on");
        direction.see_wall(&Pose2::new(1.2, 0.5, 1.0));
        assert!(direction.leads_away(&bend, 0.0, later), "a wall beside it");
        direction.see_wall(&Pose2::new(1.2, 0.5, 0.2));
        assert!(!direction.leads_away(&bend, 0.0, later), "a bend of a right angle");
        assert!(direction.leads_away(&bend, 0.0, Time::from_secs_f64(2.0)), "not at once");
        assert!(!direction.leads_away(&Pose2::new(1.2, 0.5, 0.4), 0.0, Time(0)), "a correction");
        assert!(!direction.leads_away(&Pose2::new(2.8, 0.5, 3.0), 0.0, later), "elsewhere");
        direction.forget();
        assert!(!direction.leads_away(&turned, 0.0, later));
    }
}
