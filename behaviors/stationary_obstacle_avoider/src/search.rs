//! Where the robot turns to look for a passage, and when it has looked often enough.

use nalgebra::Point2;
use yamabico_core::geometry::Pose2;
use yamabico_core::time::Time;

use crate::halt_state_machine::State;

/// Directions from that of the path, degrees: at first as far aside as thresholds that were learned along the path hold, then
/// farther.
const DIRECTIONS_DEG: [[f64; 4]; 2] = [[0.0, 25.0, 0.0, -25.0], [0.0, 40.0, 0.0, -40.0]];
/// A direction in which no picture can be judged is left after this, seconds.
const PATIENCE_S: f64 = 1.5;
/// A robot that has moved by less (m) since its last search has got nowhere.
const SAME_PLACE_M: f64 = 0.1;
/// After so many halts at one place, whatever was chosen there leads nowhere.
const MAX_HALTS: usize = 5;

/// How far the search has come.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Search {
    /// Direction of the path, rad; `None` where that of the robot is to be taken.
    pub along: Option<f64>,
    station: usize,
    since: Option<Time>,
    /// Where the last search began.
    place: Option<Point2<f64>>,
    /// Searches there before.
    earlier: usize,
    /// Where it halted, and how often since it came there.
    halted: Option<(Point2<f64>, usize)>,
}

impl Search {
    /// After the robot has entered `state`: begun anew, and wider where it searches again without having got anywhere.
    pub fn after(self, state: State, robot: Option<Pose2>, along: Option<f64>) -> Self {
        let Search { place, earlier, halted, .. } = self;
        let new = Search { along, place, earlier, halted, ..Search::default() };
        let here = robot.map(|robot| robot.position());
        let is_here = |place: Option<Point2<f64>>| {
            place.zip(here).is_some_and(|(place, here)| (here - place).norm() < SAME_PLACE_M)
        };
        match state {
            State::Search if is_here(place) => Search { earlier: earlier + 1, halted: None, ..new },
            State::Search => Search { place: here, earlier: 0, halted: None, ..new },
            State::Halt => match halted.filter(|(place, _)| is_here(Some(*place))) {
                Some((place, halts)) => Search { halted: Some((place, halts + 1)), ..new },
                None => Search { halted: here.map(|here| (here, 1)), ..new },
            },
            _ => new,
        }
    }

    /// Whether it halted here so often that it is to be searched, whatever a look finds.
    pub fn is_due(&self) -> bool {
        self.halted.is_some_and(|(_, halts)| halts >= MAX_HALTS)
    }

    /// Whether the passages that were found are none: it was searched as wide as it goes, and the robot is still there.
    pub fn is_in_vain(&self) -> bool {
        self.earlier >= DIRECTIONS_DEG.len()
    }

    /// The direction to look in, from that of the path, rad.
    pub fn direction(&self) -> f64 {
        let directions = &DIRECTIONS_DEG[self.earlier.min(DIRECTIONS_DEG.len() - 1)];
        directions[self.station % directions.len()].to_radians()
    }

    /// Tells that the robot is turned to it.
    pub fn arrive(&mut self, now: Time) {
        self.since.get_or_insert(now);
    }

    /// Whether `picture` shows it; then it is done with.
    pub fn is_shown(&mut self, picture: Time) -> bool {
        let is_shown = self.since.is_some_and(|since| picture > since);
        if is_shown {
            self.go_on();
        }
        is_shown
    }

    /// Whether no picture of it can be judged; then it is done with.
    pub fn is_blind(&mut self, now: Time) -> bool {
        let is_over = self.since.is_some_and(|since| now.seconds_after(since) > PATIENCE_S);
        if is_over {
            self.go_on();
        }
        is_over
    }

    fn go_on(&mut self) {
        self.station += 1;
        self.since = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_search_that_leads_nowhere_widens_and_then_gives_up() {
        let at = |x: f64| Some(Pose2::new(x, 0.5, 0.1));
        let widest = |mut search: Search| {
            let directions = (1..8).map(|i| {
                search.arrive(Time::from_secs_f64(f64::from(i)));
                assert!(search.is_shown(Time::from_secs_f64(f64::from(i) + 0.1)));
                search.direction().abs()
            });
            directions.fold(0.0, f64::max).to_degrees()
        };
        let first = Search::default().after(State::Search, at(1.0), Some(0.0));
        let second = first.after(State::Avoid, at(1.0), None).after(State::Search, at(1.05), Some(0.0));
        let third = second.after(State::Halt, at(1.05), None).after(State::Search, at(1.05), Some(0.0));
        assert!(widest(first) < 30.0 && widest(second) > 35.0);
        assert!(!first.is_in_vain() && !second.is_in_vain() && third.is_in_vain());
        let elsewhere = second.after(State::Search, at(1.3), Some(0.0));
        assert!(widest(elsewhere) < 30.0, "a step ahead is a new search");
    }

    #[test]
    fn halts_at_one_place_call_for_a_search() {
        let halt = |search: Search, x: f64| {
            let at = Some(Pose2::new(x, 0.5, 0.1));
            search.after(State::Halt, at, None).after(State::Relook, at, None).after(State::Avoid, at, None)
        };
        let often = |step_m: f64| (0..5).fold(Search::default(), |s, i| halt(s, step_m * f64::from(i)));
        assert!(!(0..4).fold(Search::default(), |search, _| halt(search, 1.0)).is_due());
        assert!(often(0.01).is_due() && !often(0.11).is_due(), "who gets on has no need of it");
        assert!(!often(0.01).after(State::Search, None, None).is_due());
    }
}
