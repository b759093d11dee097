//! The ladder: when the robot is stuck, and which rung it tries next.

use std::time::Duration;

use yamabico_core::geometry::Pose2;
use yamabico_core::time::Time;

use crate::config::{Config, Rung};
use crate::situation::Situation;

/// Time without a drive proposal of another behavior after which the robot is idle, s: a driver may miss a decision.
const IDLE_S: f64 = 1.0;

/// A rung that is being tried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attempt {
    /// Place in the ladder, from 0.
    pub index: usize,
    /// Maneuver of this attempt.
    pub rung: Rung,
    /// Pose at its beginning, odometry frame.
    pub start: Pose2,
    /// Time for which it has been tried, s; without the time in which everything was halted, but for backing off, which a halt may
    /// permit.
    pub elapsed_s: f64,
}

/// Progress of the robot and the place in the ladder.
#[derive(Clone, Debug, PartialEq)]
pub struct Ladder {
    rungs: Vec<Rung>,
    progress_timeout_s: f64,
    retry_s: f64,
    progress_m: f64,
    away_m: f64,
    /// Position and time of the last progress.
    anchor: Option<(Pose2, Time)>,
    /// Position at which the robot was stuck first.
    place: Option<Pose2>,
    next: usize,
    attempt: Option<Attempt>,
    last: Option<Time>,
    /// Time for which everything has been halted, s, and that at which the robot last tried to leave or was idle.
    halted_s: f64,
    left_s: f64,
    /// Time for which no other behavior has proposed to drive, s.
    idle_s: f64,
    /// Time since progress was last seen in which not everything was halted, s.
    free_s: f64,
}

impl Ladder {
    /// Creates a ladder at its first rung.
    #[must_use]
    pub fn new(config: &Config) -> Self {
        Self {
            rungs: config.ladder.clone(),
            progress_timeout_s: config.progress_timeout_s,
            retry_s: config.retry_s,
            progress_m: config.progress_m,
            away_m: config.away_m,
            anchor: None,
            place: None,
            next: 0,
            attempt: None,
            last: None,
            halted_s: 0.0,
            left_s: 0.0,
            idle_s: 0.0,
            free_s: 0.0,
        }
    }

    /// Number of rungs.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rungs.len()
    }

    /// Returns true if there is no rung.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rungs.is_empty()
    }

    /// Returns the time (s) since progress was last seen.
    #[must_use]
    pub fn stuck_s(&self, now: Time) -> f64 {
        self.anchor.map_or(0.0, |(_, since)| now.seconds_after(since))
    }

    /// Returns the time (s) for which all axes have been halted, once it exceeds the progress timeout.
    #[must_use]
    pub fn long_halted_s(&self) -> Option<f64> {
        (self.halted_s >= self.progress_timeout_s).then_some(self.halted_s)
    }

    fn is_stuck(&self, now: Time) -> bool {
        let progress_timeout_s = if self.place.is_some() { self.retry_s } else { self.progress_timeout_s };
        self.stuck_s(now) >= progress_timeout_s && self.free_s >= progress_timeout_s.min(self.retry_s)
    }

    /// Updates progress with the robot's pose (odometry frame) and situation; returns the attempt in progress or a new one.
    pub fn advance(&mut self, pose: &Pose2, situation: &Situation, now: Time) -> Option<Attempt> {
        let step = self.last.replace(now).map_or(Duration::ZERO, |last| now.since(last));
        let step_s = step.as_secs_f64();
        if situation.halter.is_some() {
            self.halted_s += step_s;
        } else {
            (self.halted_s, self.left_s) = (0.0, 0.0);
            self.free_s += step_s;
        }
        if situation.is_overruled {
            (self.attempt, self.halted_s, self.left_s) = (None, 0.0, 0.0);
            self.begin_anew(pose, now);
            return None;
        }
        self.idle_s = if situation.wants_to_drive { 0.0 } else { self.idle_s + step_s };
        if self.idle_s >= IDLE_S {
            // The time of a halt counts from the next drive proposal on.
            (self.attempt, self.left_s) = (None, self.halted_s);
            self.begin_anew(pose, now);
            return None;
        }
        let back_off = self.rungs.iter().position(|rung| *rung == Rung::BackOff);
        // A robot that stands may leave what it touches, if the halting behavior lets it; also from another rung, whose time stands still.
        let leaves = situation.halter.is_some()
            && situation.wants_to_drive
            && self.halted_s - self.left_s >= self.progress_timeout_s
            && back_off.is_some()
            && self.attempt.is_none_or(|attempt| attempt.rung != Rung::BackOff);
        if let Some(attempt) = self.attempt.as_mut().filter(|_| !leaves) {
            if situation.halter.is_none() || attempt.rung == Rung::BackOff {
                attempt.elapsed_s += step_s;
            }
            return self.attempt;
        }
        if self.anchor.is_none_or(|(anchor, _)| anchor.distance(pose) >= self.progress_m) {
            self.watch_from(pose, now);
        }
        if self.place.is_some_and(|place| place.distance(pose) >= self.away_m) {
            self.begin_anew(pose, now);
        }
        let is_stuck = self.is_stuck(now) && situation.wants_to_drive && situation.halter.is_none();
        let next = is_stuck.then(|| self.next % self.rungs.len().max(1));
        let index = if leaves { back_off } else { next };
        if let Some((index, &rung)) = index.and_then(|index| Some((index, self.rungs.get(index)?))) {
            self.place.get_or_insert(*pose);
            self.attempt = Some(Attempt { index, rung, start: *pose, elapsed_s: 0.0 });
        }
        self.attempt
    }

    /// Ends the attempt: the other behaviors drive again, and the next attempt is the next rung.
    pub fn finish(&mut self, pose: &Pose2, now: Time) {
        self.next = self.attempt.take().map_or(self.next, |attempt| attempt.index + 1);
        self.left_s = self.halted_s;
        self.watch_from(pose, now);
    }

    /// Starts the next rung at once.
    pub fn skip(&mut self, pose: &Pose2) -> Option<Attempt> {
        let index = (self.attempt?.index + 1) % self.rungs.len();
        self.attempt = Some(Attempt { index, rung: self.rungs[index], start: *pose, elapsed_s: 0.0 });
        self.attempt
    }

    /// Drops the attempt and forgets the time that has passed, such as after a time without inputs. The place in the ladder stays.
    pub fn pause(&mut self) {
        (self.last, self.attempt, self.anchor) = (None, None, None);
        (self.halted_s, self.left_s) = (0.0, 0.0);
    }

    /// Does the same as [`pause`](Self::pause), and begins again at the first rung, such as after a jump of the odometry frame.
    pub fn restart(&mut self) {
        self.pause();
        (self.place, self.next) = (None, 0);
    }

    fn watch_from(&mut self, pose: &Pose2, now: Time) {
        (self.anchor, self.free_s) = (Some((*pose, now)), 0.0);
    }

    fn begin_anew(&mut self, pose: &Pose2, now: Time) {
        self.watch_from(pose, now);
        (self.place, self.next) = (None, 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRIVING: Situation = Situation {
        wants_to_drive: true,
        is_overruled: false,
        is_held: false,
        is_turn_held: false,
        halter: None,
    };

    fn ladder() -> Ladder {
        Ladder::new(&Config {
            ladder: vec![Rung::Wait, Rung::Turn],
            progress_timeout_s: 10.0,
            retry_s: 3.0,
            ..Config::default()
        })
    }

    fn at(x: f64) -> Pose2 {
        Pose2::new(x, 0.0, 0.0)
    }

    fn seconds(seconds: f64) -> Time {
        Time::from_secs_f64(seconds)
    }

    #[test]
    fn rungs_follow_each_other_and_begin_anew_after_the_last() {
        let mut ladder = ladder();
        let mut tried = Vec::new();
        for i in 0..400 {
            let now = seconds(0.1 * f64::from(i));
            if let Some(attempt) = ladder.advance(&at(0.0), &DRIVING, now) {
                tried.push((i, attempt.rung));
                ladder.finish(&at(0.0), now);
            }
        }
        let expected = [(100, Rung::Wait), (130, Rung::Turn), (160, Rung::Wait), (190, Rung::Turn)];
        assert_eq!(tried[..4], expected);
    }

    #[test]
    fn progress_takes_it_back_to_the_first_rung_only_away_from_the_place() {
        let mut ladder = ladder();
        ladder.advance(&at(0.0), &DRIVING, seconds(0.0));
        assert_eq!(ladder.advance(&at(0.0), &DRIVING, seconds(10.0)).unwrap().rung, Rung::Wait);
        ladder.finish(&at(0.0), seconds(11.0));
        assert_eq!(ladder.advance(&at(0.5), &DRIVING, seconds(12.0)), None);
        assert_eq!(ladder.advance(&at(0.5), &DRIVING, seconds(17.0)).unwrap().rung, Rung::Turn, "still near");
        ladder.finish(&at(0.5), seconds(18.0));
        assert_eq!(ladder.advance(&at(1.2), &DRIVING, seconds(19.0)), None);
        assert_eq!(ladder.advance(&at(1.2), &DRIVING, seconds(28.0)), None, "the whole patience again");
        assert_eq!(ladder.advance(&at(1.2), &DRIVING, seconds(29.0)).unwrap().rung, Rung::Wait);
    }

    #[test]
    fn who_stands_because_nobody_wants_to_drive_is_not_stuck() {
        let mut ladder = ladder();
        for i in 0..100 {
            let situation = Situation { wants_to_drive: false, ..DRIVING };
            assert_eq!(ladder.advance(&at(0.0), &situation, seconds(f64::from(i))), None);
        }
        assert_eq!(ladder.advance(&at(0.0), &DRIVING, seconds(105.0)), None);
    }

    #[test]
    fn a_driver_that_misses_decisions_now_and_then_is_still_stuck() {
        let mut ladder = ladder();
        let idle = Situation { wants_to_drive: false, ..DRIVING };
        let rung = |ladder: &mut Ladder, situation: &Situation, i: u32| {
            let attempt = ladder.advance(&at(0.0), situation, seconds(0.1 * f64::from(i)));
            attempt.map(|attempt| attempt.rung)
        };
        for i in 0..100 {
            let situation = if i % 10 < 3 { &idle } else { &DRIVING };
            assert_eq!(rung(&mut ladder, situation, i), None, "{i}");
        }
        assert_eq!(rung(&mut ladder, &idle, 100), None);
        for i in 101..104 {
            assert_eq!(rung(&mut ladder, &DRIVING, i), Some(Rung::Wait), "{i}");
        }
        for i in 104..113 {
            assert_eq!(rung(&mut ladder, &idle, i), Some(Rung::Wait), "{i}");
        }
        for i in 114..120 {
            assert_eq!(rung(&mut ladder, &idle, i), None, "no drive proposal for {IDLE_S} s");
        }
        for i in 120..210 {
            assert_eq!(rung(&mut ladder, &DRIVING, i), None, "{i}");
        }
    }

    #[test]
    fn a_halt_of_everything_is_waited_for_and_a_higher_priority_ends_the_attempt() {
        let mut ladder = ladder();
        let halted = Situation { halter: Some("sonar-halt".into()), ..DRIVING };
        for i in 0..=30 {
            assert_eq!(ladder.advance(&at(0.0), &halted, seconds(f64::from(i))), None);
        }
        assert_eq!(ladder.long_halted_s(), Some(30.0));
        assert_eq!(ladder.advance(&at(0.0), &DRIVING, seconds(32.9)), None, "the others have their time");
        assert_eq!(ladder.advance(&at(0.0), &DRIVING, seconds(33.0)).unwrap().elapsed_s, 0.0);
        assert_eq!(
            ladder.advance(&at(0.0), &halted, seconds(50.0)).unwrap().elapsed_s,
            0.0,
            "its time stands still"
        );
        assert_eq!(ladder.advance(&at(0.0), &DRIVING, seconds(51.0)).unwrap().elapsed_s, 1.0);
        let overruled = Situation { is_overruled: true, ..DRIVING };
        assert_eq!(ladder.advance(&at(0.0), &overruled, seconds(52.0)), None);
    }

    #[test]
    fn a_robot_that_stays_halted_backs_off_now_and_then_if_it_is_to_drive() {
        let config = Config { progress_timeout_s: 10.0, ..Config::default() };
        let halted = Situation { halter: Some("sonar-halt".into()), ..DRIVING };
        let tried_at = |situation: &Situation| {
            let (mut ladder, mut tried) = (Ladder::new(&config), Vec::new());
            for s in 0..=40 {
                let now = seconds(f64::from(s));
                if let Some(attempt) = ladder.advance(&at(0.0), situation, now) {
                    assert_eq!(attempt.rung, Rung::BackOff);
                    if attempt.elapsed_s == 0.0 {
                        tried.push(s);
                    } else if attempt.elapsed_s > 3.0 {
                        ladder.finish(&at(0.0), now);
                    }
                }
            }
            tried
        };
        assert_eq!(tried_at(&halted), [10, 24, 38]);
        assert!(tried_at(&Situation { wants_to_drive: false, ..halted }).is_empty(), "none wants to drive");
        let mut ladder = Ladder::new(&config);
        let rung = |ladder: &mut Ladder, situation: &Situation, s: f64| {
            ladder.advance(&at(0.0), situation, seconds(s)).map(|attempt| attempt.rung)
        };
        assert_eq!(rung(&mut ladder, &DRIVING, 0.0), None);
        assert_eq!(rung(&mut ladder, &DRIVING, 10.0), Some(Rung::Wait));
        assert_eq!(rung(&mut ladder, &halted, 19.0), Some(Rung::Wait), "its time stands still");
        assert_eq!(rung(&mut ladder, &halted, 20.0), Some(Rung::BackOff));
    }

    #[test]
    fn a_halt_counts_only_while_somebody_may_drive_and_wants_to() {
        let halted = Situation { halter: Some("sonar-halt".into()), ..DRIVING };
        for parked in
            [Situation { is_overruled: true, ..halted }, Situation { wants_to_drive: false, ..halted }]
        {
            let mut ladder = Ladder::new(&Config { progress_timeout_s: 10.0, ..Config::default() });
            for s in 0..=20 {
                assert_eq!(ladder.advance(&at(0.0), &parked, seconds(f64::from(s))), None);
            }
            for s in 21..30 {
                assert_eq!(
                    ladder.advance(&at(0.0), &halted, seconds(f64::from(s))),
                    None,
                    "{s} s, {parked:?}"
                );
            }
            let attempt = ladder.advance(&at(0.0), &halted, seconds(30.0)).unwrap();
            assert_eq!(attempt.rung, Rung::BackOff);
        }
    }
}
