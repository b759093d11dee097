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
}

impl Search {
    /// After the robot has entered `state`: begun anew, and wider where it searches again without having got anywhere.
    pub fn after(self, state: State, robot: Option<Pose2>, along: Option<f64>) -> Self {
        let Search { place, earlier, .. } = self;
        let new = Search { along, place, earlier, ..Search::default() };
        let here = robot.map(|robot| robot.position());
        match (state, place, here) {
            (State::Search, Some(place), Some(here)) if (here - place).norm() < SAME_PLACE_M => {
                Search { earlier: earlier + 1, ..new }
            }
            (State::Search, ..) => Search { place: here, earlier: 0, ..new },
            _ => new,
        }
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
}
