//! Direction of travel: a corridor leads two ways, and the robot keeps its own.

use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_core::time::Time;

/// Distance from the place where the corridor was followed last up to which its direction is kept, m: farther away,
/// another behavior has led the robot elsewhere.
const KEPT_M: f64 = 3.0;
/// Distance over which the direction that is kept follows that of the corridor, m: longer than a box, a room or a pattern of the floor is
/// seen in passing.
const FOLLOWS_OVER_M: f64 = 4.0;
/// Angle to the direction that is kept up to which a wall ahead is across it, rad.
const AHEAD_RAD: f64 = 0.4;
/// Distance over which the corridor was followed from which its direction is settled, m: the first looks may be wrong.
const SETTLED_M: f64 = 1.0;
/// Angle between directions from which one leads back, rad.
const BACK_RAD: f64 = 1.9;
/// Angle from which a direction leads aside of one that is settled, or not yet, rad: wheels that slip turn the odometry by less.
const ASIDE_RAD: (f64, f64) = (0.26, 0.4);
/// Times for which no such direction is believed, s: before a wall across the way, and where none was seen. Lines on a wall meet
/// beside the corridor, and a robot that has turned before an obstacle sees a room or a corridor that crosses; a bend is still
/// there after the search.
const ASIDE_S: f64 = 8.0;
const ASIDE_WITHOUT_WALL_S: f64 = 30.0;
/// Angle to the direction that is kept up to which a single look is believed after a loss, rad; angle up to which looks agree on another
/// direction, rad, and how many must.
const LIKELY_RAD: f64 = 0.12;
const AGREE_RAD: f64 = 0.06;
const LOOKS: u32 = 4;

/// The direction in which the corridor was followed over the last meters, by odometry.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Direction {
    /// Position of the robot and the heading along the corridor, the time, and the distance over which it was followed, m.
    followed: Option<(Pose2, Time, f64)>,
    /// Another direction that the last looks agree on, rad, and their number.
    unlikely: (f64, u32),
    /// True if a wall across that direction has been seen since.
    ends: bool,
}

impl Direction {
    /// Keeps the direction of a corridor that the robot at `pose` follows with the heading `heading` relative to its axis, unless it
    /// leads away.
    pub fn follow(&mut self, pose: &Pose2, heading: f64, at: Time) {
        if self.leads_away(pose, heading, at) {
            return;
        }
        let seen = pose.theta - heading;
        let kept = self.heading(pose).filter(|kept| angle_difference(seen, *kept).abs() < self.aside_rad());
        let (theta, over_m) = match (kept, self.followed) {
            (Some(kept), Some((last, _, over_m))) => {
                // The mean over the first meters.
                let over_m = (over_m + last.distance(pose)).min(FOLLOWS_OVER_M);
                let share = if over_m > 0.0 { last.distance(pose) / over_m } else { 1.0 };
                (kept + share * angle_difference(seen, kept), over_m)
            }
            _ => (seen, 0.0),
        };
        *self = Self { followed: Some((Pose2 { theta, ..*pose }, at, over_m)), ends: false, ..*self };
    }

    /// True if a corridor that is seen from `pose` after a loss, with the heading `heading` relative to its axis, is likely the one that
    /// was followed, or if enough looks in a row agree on it.
    pub fn is_confirmed(&mut self, pose: &Pose2, heading: f64) -> bool {
        let seen = pose.theta - heading;
        let settled = self.heading(pose).filter(|_| self.is_settled());
        if settled.is_none_or(|kept| angle_difference(seen, kept).abs() < LIKELY_RAD) {
            self.unlikely = (seen, 0);
            return true;
        }
        let agrees = angle_difference(seen, self.unlikely.0).abs() < AGREE_RAD;
        self.unlikely = (seen, if agrees { self.unlikely.1 + 1 } else { 1 });
        self.unlikely.1 >= LOOKS
    }

    /// True if the corridor was followed over some distance: before that, the direction may be wrong.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        self.followed.is_some_and(|(.., over_m)| over_m >= SETTLED_M)
    }

    /// Angle between directions from which one leads aside, rad.
    fn aside_rad(&self) -> f64 {
        if self.is_settled() { ASIDE_RAD.0 } else { ASIDE_RAD.1 }
    }

    /// Notes a wall ahead of the robot at `pose`: in the direction that it keeps, the corridor ends.
    pub fn see_wall(&mut self, pose: &Pose2) {
        self.ends |=
            self.heading(pose).is_some_and(|kept| angle_difference(pose.theta, kept).abs() < AHEAD_RAD);
    }

    /// Forgets the direction: the robot turns back on purpose.
    pub fn forget(&mut self) {
        *self = Self::default();
    }

    /// Heading along the corridor for a robot at `pose`, odometry frame, rad; `None` if it is unknown here.
    #[must_use]
    pub fn heading(&self, pose: &Pose2) -> Option<f64> {
        let (followed, ..) = self.followed.filter(|(followed, ..)| followed.distance(pose) < KEPT_M)?;
        Some(followed.theta)
    }

    /// True if a corridor seen from `pose` with the heading `heading` relative to its axis leads back, or, until some time after
    /// the last one was followed, aside.
    #[must_use]
    pub fn leads_away(&self, pose: &Pose2, heading: f64, now: Time) -> bool {
        let (Some(kept), Some((_, at, _))) = (self.heading(pose), self.followed) else { return false };
        let off = angle_difference(pose.theta - heading, kept).abs();
        let aside_s = if self.ends { ASIDE_S } else { ASIDE_WITHOUT_WALL_S };
        off > BACK_RAD || (off > self.aside_rad() && now.seconds_after(at) < aside_s)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn the_direction_follows_a_slow_bend_and_not_a_wavering_heading() {
        let mut direction = Direction::default();
        let heading = |direction: &Direction, pose: &Pose2| direction.heading(pose).expect("known");
        for step in 0..50 {
            let pose = Pose2::new(0.02 * f64::from(step), 0.0, 0.1);
            direction.follow(&pose, if step % 5 == 4 { -0.4 } else { 0.1 }, Time(0));
            assert!(heading(&direction, &pose).abs() < 1e-9, "another direction now and then");
        }
        for step in 0..50 {
            let pose = Pose2::new(1.0 + 0.02 * f64::from(step), 0.0, 0.0);
            direction.follow(&pose, -0.2, Time(0));
            assert!(heading(&direction, &pose) < 0.15, "another direction over a meter");
        }
        let mut direction = Direction::default();
        for step in 0..200 {
            let pose = Pose2::new(0.05 * f64::from(step), 0.0, 0.002 * f64::from(step));
            direction.follow(&pose, 0.0, Time(0));
            assert!((pose.theta - heading(&direction, &pose)).abs() < 0.17, "a bend of 25 m radius");
        }
    }

    #[test]
    fn after_a_loss_looks_must_agree_on_another_direction() {
        let (mut direction, here) = (Direction::default(), Pose2::new(1.0, 0.5, 0.2));
        assert!(direction.is_confirmed(&here, 0.5), "nothing was followed");
        direction.follow(&Pose2::new(0.4, 0.5, 0.2), 0.1, Time(0));
        assert!(direction.is_confirmed(&here, 0.5), "not settled");
        direction.follow(&Pose2::new(-0.2, 0.5, 0.2), 0.2, Time(0));
        direction.follow(&here, 0.2, Time(0));
        assert!(direction.is_settled() && direction.is_confirmed(&here, 0.1));
        let looks = |direction: &mut Direction, headings: [f64; 5]| {
            headings.map(|heading| direction.is_confirmed(&here, heading))
        };
        assert_eq!(looks(&mut direction, [0.0, 0.4, 0.0, 0.4, 0.0]), [false; 5]);
        assert!(direction.is_confirmed(&here, 0.2));
        assert_eq!(looks(&mut direction, [0.0, 0.02, -0.02, 0.0, 0.02]), [false, false, false, true, true]);
        assert!(direction.is_confirmed(&Pose2::new(4.5, 0.5, 0.2), 0.4), "elsewhere");
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
        assert!(!direction.leads_away(&Pose2::new(1.2, 0.5, 0.3), 0.0, Time(0)), "a correction");
        assert!(!direction.leads_away(&Pose2::new(4.2, 0.5, 3.0), 0.0, later), "elsewhere");
        direction.forget();
        assert!(!direction.leads_away(&turned, 0.0, later));
    }
}
