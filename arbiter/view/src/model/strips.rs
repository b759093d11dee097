//! Strips: who had control and how fast the robot was, over the last two minutes.

use std::collections::VecDeque;

use serde::Serialize;
use yamabico_core::message::{Axis, DecisionHeader, Name};
use yamabico_core::time::Time;

/// Time that the strips cover, s.
pub const STRIP_S: f64 = 120.0;
/// Minimum time between two samples, s.
const INTERVAL_S: f64 = 0.05;
/// Maximum number of behaviors whose names the strips distinguish.
const MAX_NAMES: usize = 64;

/// State of the robot at one instant; a number that is not known is null in JSON.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sample {
    /// Time.
    #[serde(skip)]
    pub at: Time,
    /// Index in [`Strips::names`] of the behavior in control of the linear, lateral and angular axis; -1 for none.
    pub owner: [i8; 3],
    /// Set on the axes that are stopped: by a halt, the emergency stop or a silent part.
    pub halted: [bool; 3],
    /// Wanted, allowed and commanded linear speed, m/s.
    pub linear: [f32; 3],
    /// Wanted, allowed and commanded turn rate, rad/s.
    pub angular: [f32; 3],
    /// Estimated position on the map, m.
    pub pose: Option<[f32; 2]>,
    /// True position on the map, m.
    pub truth: Option<[f32; 2]>,
}

/// Samples of the last two minutes, or of a whole recording.
#[derive(Clone, Debug)]
pub struct Strips {
    span_s: f64,
    names: Vec<Name>,
    samples: VecDeque<Sample>,
    dropped: u64,
}

impl Default for Strips {
    /// Strips of the last two minutes.
    fn default() -> Strips {
        Strips { span_s: STRIP_S, names: Vec::new(), samples: VecDeque::new(), dropped: 0 }
    }
}

impl Strips {
    /// Strips that keep every sample.
    pub(crate) fn of_everything() -> Strips {
        Strips { span_s: f64::INFINITY, ..Strips::default() }
    }

    /// Strips of the last two minutes before `end`, from those of a whole recording.
    pub(crate) fn until(&self, end: Time) -> Strips {
        let is_inside = |sample: &&Sample| sample.at <= end && end.seconds_after(sample.at) <= STRIP_S;
        let samples = self.samples.iter().filter(is_inside).copied().collect();
        Strips { names: self.names.clone(), samples, ..Strips::default() }
    }

    /// Names of the behaviors that had control, in the order of their first time.
    pub fn names(&self) -> impl ExactSizeIterator<Item = &str> {
        self.names.iter().map(Name::as_str)
    }

    /// Samples, the oldest first.
    pub fn samples(&self) -> impl DoubleEndedIterator<Item = &Sample> {
        self.samples.iter()
    }

    /// Number of samples so far, including those that dropped out.
    pub fn count(&self) -> u64 {
        self.dropped + self.samples.len() as u64
    }

    /// Share of the samples in which `behavior` had control of the linear or angular axis.
    pub fn control_share(&self, behavior: &str) -> f64 {
        let Some(index) = self.names.iter().position(|name| name.as_str() == behavior) else { return 0.0 };
        let index = index as i8;
        let is_in_control =
            |sample: &&Sample| (0..3).any(|axis| sample.owner[axis] == index && !sample.halted[axis]);
        let count = self.samples.iter().filter(is_in_control).count();
        count as f64 / self.samples.len().max(1) as f64
    }

    /// Takes in a decision, unless the last sample is less than 50 ms old.
    pub(crate) fn decision(
        &mut self,
        at: Time,
        header: &DecisionHeader,
        stopped: bool,
        pose: Option<[f32; 2]>,
        truth: Option<[f32; 2]>,
    ) {
        if self.samples.back().is_some_and(|last| at.seconds_after(last.at) < INTERVAL_S) {
            return;
        }
        let owner = header.source.map(|name| self.index(name));
        let halted = Axis::ALL.map(|axis| stopped || header.halted.contains(axis));
        let speeds =
            |axis| [&header.wished, &header.allowed, &header.commanded].map(|twist| twist.get(axis) as f32);
        let (linear, angular) = (speeds(Axis::Linear), speeds(Axis::Angular));
        self.samples.push_back(Sample { at, owner, halted, linear, angular, pose, truth });
        while self.samples.front().is_some_and(|first| at.seconds_after(first.at) > self.span_s) {
            self.samples.pop_front();
            self.dropped += 1;
        }
    }

    fn index(&mut self, name: Name) -> i8 {
        if name.is_empty() {
            return -1;
        }
        let known = self.names.iter().position(|known| *known == name);
        let index = known.or_else(|| {
            let has_room = self.names.len() < MAX_NAMES;
            has_room.then(|| self.names.push(name)).map(|()| self.names.len() - 1)
        });
        index.map_or(-1, |index| index as i8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_thinned_and_old_ones_drop_out() {
        let mut strips = Strips::default();
        let header = |name| DecisionHeader { source: [Name::new(name); 3], ..DecisionHeader::default() };
        for i in 0..20_000_u64 {
            let name = if i < 17_600 { "wall" } else { "avoider" };
            strips.decision(Time(i * 10_000_000), &header(name), false, None, None);
        }
        assert_eq!((strips.samples().count(), strips.count()), (2400, 4000));
        assert_eq!(strips.names().collect::<Vec<_>>(), ["wall", "avoider"]);
        assert!((strips.control_share("avoider") - 0.2).abs() < 1e-3);
        assert_eq!(strips.control_share("nobody"), 0.0);
    }
}
