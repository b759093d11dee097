//! Echoes ahead that are suddenly nearer, although the robot hardly moved: what crosses its way.

use std::collections::VecDeque;

use yamabico_core::geometry::{Pose2, angle_difference};

use super::arrivals::STAYS_S;

/// Time over which ranges are compared, s; that of the latest ones, which are not; and the shortest time that is enough, s.
const WINDOW_S: f64 = 1.5;
const LATEST_S: f64 = 0.25;
const MIN_WINDOW_S: f64 = 0.6;
/// Range up to which an echo matters, m, and the distance by which it is nearer than all before, m.
const NEAR_M: f64 = 1.2;
const NEARER_M: f64 = 0.4;
/// Time without a near echo after which what came has gone, s: single echoes are lost.
const GONE_S: f64 = 0.5;
/// Turn above which the beam looks elsewhere, rad.
const TURN_RAD: f64 = 0.06;

/// Ranges of the nearest echo ahead, and the time at which one last came near.
#[derive(Clone, Debug, Default)]
pub(super) struct SuddenEcho {
    recent: VecDeque<(f64, f64, Pose2)>,
    came_s: Option<f64>,
    /// Time of the last echo that was near.
    near_s: f64,
}

impl SuddenEcho {
    /// Takes in the range (m, infinite without an echo) that a robot at `pose` (odometry) measures at `now_s` (s).
    pub fn update(&mut self, now_s: f64, range_m: f64, pose: Pose2) {
        let (oldest_s, latest_s) = (now_s - WINDOW_S, now_s - LATEST_S);
        while self.recent.front().is_some_and(|&(at_s, ..)| !(oldest_s..now_s).contains(&at_s)) {
            self.recent.pop_front();
        }
        let before = || self.recent.iter().filter(|&&(at_s, ..)| at_s < latest_s);
        let is_long_enough = before().next().is_some_and(|&(at_s, ..)| now_s - at_s > MIN_WINDOW_S);
        let is_farther = |&(_, before_m, from): &(f64, f64, Pose2)| {
            before_m > range_m + NEARER_M + from.distance(&pose)
                && angle_difference(from.theta, pose.theta).abs() < TURN_RAD
        };
        if range_m < NEAR_M {
            self.near_s = now_s;
            if is_long_enough && before().all(is_farther) {
                self.came_s = Some(now_s);
            }
        }
        self.recent.push_back((now_s, range_m, pose));
    }

    /// True if what is near ahead came there some seconds ago at most.
    pub fn moves(&self, now_s: f64) -> bool {
        let has_come = self.came_s.is_some_and(|came_s| now_s - came_s < STAYS_S);
        has_come && now_s - self.near_s < GONE_S
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Moves at the end of a series of scans 0.05 s apart, each with a range and the position and heading of the robot.
    fn moves(scans: impl Iterator<Item = (f64, f64, f64)>) -> bool {
        let (mut echo, mut now_s) = (SuddenEcho::default(), 10.0);
        for (range_m, x, theta) in scans {
            now_s += 0.05;
            echo.update(now_s, range_m, Pose2::new(x, 0.0, theta));
        }
        echo.moves(now_s)
    }

    #[test]
    fn what_steps_before_the_robot_moves() {
        let steps = |scans: i32| (0..scans).map(|i| (if i < 40 { f64::INFINITY } else { 0.8 }, 0.0, 0.0));
        assert!(moves(steps(42)) && moves(steps(130)));
        assert!(!moves(steps(160)), "it has stayed");
        let then_silent = |scans: usize| steps(42).chain([(f64::INFINITY, 0.0, 0.0)].repeat(scans));
        assert!(moves(then_silent(5)), "single echoes are lost");
        assert!(!moves(then_silent(12)), "it has gone");
        let runs = (0..60).map(|i| (f64::max(2.0 - 0.1 * f64::from(i - 40).max(0.0), 0.6), 0.0, 0.0));
        assert!(moves(runs), "it comes nearer");
    }

    #[test]
    fn what_the_robot_drives_or_turns_to_stands() {
        let drives = (0..80).map(|i| 0.02 * f64::from(i));
        assert!(!moves(drives.map(|x| (2.0 - x, x, 0.0))));
        let turns = (0..80).map(|i| (if i < 60 { 2.5 } else { 0.8 }, 0.0, 0.01 * f64::from(i)));
        assert!(!moves(turns));
        let flickers = (0..80).map(|i| (if i % 9 == 0 { 0.8 } else { f64::INFINITY }, 0.0, 0.0));
        assert!(!moves(flickers.chain([(0.8, 0.0, 0.0)])), "an echo that comes and goes is none that came");
        assert!(!moves([(f64::INFINITY, 0.0, 0.0), (0.8, 0.0, 0.0)].into_iter()), "too short a time");
        assert!(!moves((0..50).map(|_| (f64::NAN, f64::NAN, 0.0))));
    }
}
