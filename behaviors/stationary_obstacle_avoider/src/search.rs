//! Directions of the search for a passage, and its end.

use nalgebra::Point2;
use yamabico_core::geometry::Pose2;
use yamabico_core::time::Time;

use crate::halt_state_machine::State;

/// Directions to look in, relative to the path, degrees: for the first search at a place, within the range of
/// headings that thresholds learned along the path apply to; for the second one, beyond it.
const DIRECTIONS_DEG: [[f64; 4]; 2] = [[0.0, 25.0, 0.0, -25.0], [0.0, 40.0, 0.0, -40.0]];
/// Time after which a direction that gives no usable frame is left, s.
const DIRECTION_TIMEOUT_S: f64 = 1.5;
/// Distance within which two searches or halts are at the same place, m.
const SAME_PLACE_M: f64 = 0.1;
/// Number of halts at one place that starts a search: the passages found there lead nowhere.
const MAX_HALTS: usize = 5;

/// Progress of the search.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Search {
    /// Direction of the path, rad, map frame; `None` if unknown (the robot's heading is used).
    pub along: Option<f64>,
    index: usize,
    reached: Option<Time>,
    /// Position at which the last search began, m, map frame.
    place: Option<Point2<f64>>,
    /// Number of earlier searches at that position.
    earlier: usize,
    /// Position of the last halt (m, map frame), and number of halts there.
    halted: Option<(Point2<f64>, usize)>,
}

impl Search {
    /// Returns the progress after the robot has entered `state`: a new search, in wider directions if the last one
    /// was at the same place.
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

    /// Returns true if the robot halted so often at one place that it must search, whatever passages are found.
    pub fn is_due(&self) -> bool {
        self.halted.is_some_and(|(_, halts)| halts >= MAX_HALTS)
    }

    /// Returns true if all searches at this place were completed and the robot is still there.
    pub fn is_exhausted(&self) -> bool {
        self.earlier >= DIRECTIONS_DEG.len()
    }

    /// Returns the direction to look in, relative to the path, rad.
    pub fn direction(&self) -> f64 {
        let directions = &DIRECTIONS_DEG[self.earlier.min(DIRECTIONS_DEG.len() - 1)];
        directions[self.index % directions.len()].to_radians()
    }

    /// Records that the robot is turned to the current direction.
    pub fn mark_reached(&mut self, now: Time) {
        self.reached.get_or_insert(now);
    }

    /// Advances to the next direction if a frame captured at `frame_stamp` shows the current one. Returns true if it
    /// does.
    pub fn advance_if_shown(&mut self, frame_stamp: Time) -> bool {
        let is_shown = self.reached.is_some_and(|reached| frame_stamp > reached);
        if is_shown {
            self.advance();
        }
        is_shown
    }

    /// Advances to the next direction if the current one gave no usable frame in time. Returns true if so.
    pub fn advance_if_timed_out(&mut self, now: Time) -> bool {
        let is_over = self.reached.is_some_and(|reached| now.seconds_after(reached) > DIRECTION_TIMEOUT_S);
        if is_over {
            self.advance();
        }
        is_over
    }

    fn advance(&mut self) {
        self.index += 1;
        self.reached = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_repeated_search_widens_and_then_ends() {
        let at = |x: f64| Some(Pose2::new(x, 0.5, 0.1));
        let widest = |mut search: Search| {
            let directions = (1..8).map(|i| {
                search.mark_reached(Time::from_secs_f64(f64::from(i)));
                assert!(search.advance_if_shown(Time::from_secs_f64(f64::from(i) + 0.1)));
                search.direction().abs()
            });
            directions.fold(0.0, f64::max).to_degrees()
        };
        let first = Search::default().after(State::Search, at(1.0), Some(0.0));
        let second = first.after(State::Avoid, at(1.0), None).after(State::Search, at(1.05), Some(0.0));
        let third = second.after(State::Halt, at(1.05), None).after(State::Search, at(1.05), Some(0.0));
        assert!(widest(first) < 30.0 && widest(second) > 35.0);
        assert!(!first.is_exhausted() && !second.is_exhausted() && third.is_exhausted());
        let elsewhere = second.after(State::Search, at(1.3), Some(0.0));
        assert!(widest(elsewhere) < 30.0, "a search elsewhere starts with the narrow directions");
    }

    #[test]
    fn repeated_halts_at_one_place_start_a_search() {
        let halt = |search: Search, x: f64| {
            let at = Some(Pose2::new(x, 0.5, 0.1));
            search.after(State::Halt, at, None).after(State::Relook, at, None).after(State::Avoid, at, None)
        };
        let often = |step_m: f64| (0..5).fold(Search::default(), |s, i| halt(s, step_m * f64::from(i)));
        assert!(!(0..4).fold(Search::default(), |search, _| halt(search, 1.0)).is_due());
        assert!(
            often(0.01).is_due() && !often(0.11).is_due(),
            "halts at different places must not start a search"
        );
        assert!(!often(0.01).after(State::Search, None, None).is_due());
    }
}
