//! History of the belief, for corrections at the capture time of an old image.
//!
//! Ohya, Kosaka & Kak (1998), section 3: the result for an image taken at t0 corrects the pose at t0, and the dead
//! reckoning since then is repeated from there.

mod motion_since;

use nalgebra::Matrix3;
use thiserror::Error;
use yamabico_core::geometry::Pose2;
use yamabico_core::time::Time;

use motion_since::MotionSince;

use crate::belief::Belief;
use crate::motion::{Increment, MotionNoise, SLIP_INTERVAL_S, Speeds};

/// Number of odometry messages kept: 82 s at 50 Hz.
pub const CAPACITY: usize = 4096;
/// Maximum time by which an image may be newer than the newest odometry, s; the motion is extrapolated at constant
/// twist.
const MAX_AHEAD_S: f64 = 0.2;

/// Reason why a correction cannot be applied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum HistoryError {
    /// No odometry was received yet.
    #[error("no odometry yet")]
    Empty,
    /// The time is before the oldest entry.
    #[error("older than the oldest entry of the history")]
    TooOld,
    /// The time is before the last correction.
    #[error("older than the last correction")]
    OutOfOrder,
    /// The time is after the newest odometry by more than extrapolation permits.
    #[error("too far after the newest odometry")]
    Ahead,
}

/// Ring buffer of the belief at recent odometry messages.
#[derive(Clone, Debug)]
pub struct History {
    noise: MotionNoise,
    entries: Vec<Entry>,
    capacity: usize,
    /// Index of the oldest entry.
    oldest: usize,
    /// Time and posterior of the last correction.
    applied: Option<(Time, Belief)>,
    /// Speeds at the last correction.
    corrected_at: Speeds,
    /// Belief at the newest entry, with the uncertainty due to the delay of odometry.
    newest: Option<(Time, Belief)>,
}

#[derive(Clone, Copy, Debug)]
struct Entry {
    stamp: Time,
    /// Belief without the uncertainty due to the delay of odometry.
    belief: Belief,
    speeds: Speeds,
    /// Distance driven since the last correction, m.
    driven_m: f64,
    /// Motion to the next entry; zero in the newest.
    onward: Increment,
}

/// Position of a time in the history.
#[derive(Clone, Copy, Debug)]
struct Position {
    /// Number of the last entry not after the time, counted from the oldest.
    entry: usize,
    /// Fraction of the interval to the next entry; after the newest entry, in units of the last interval.
    fraction: f64,
}

impl History {
    /// Creates an empty history of at most `capacity` entries.
    #[must_use]
    pub fn new(capacity: usize, noise: MotionNoise) -> Self {
        let capacity = capacity.max(2);
        Self {
            noise,
            entries: Vec::with_capacity(capacity),
            capacity,
            oldest: 0,
            applied: None,
            corrected_at: Speeds::default(),
            newest: None,
        }
    }

    /// Discards all entries and starts with this belief.
    pub fn start(&mut self, stamp: Time, belief: Belief) {
        self.entries.clear();
        self.oldest = 0;
        self.applied = None;
        self.corrected_at = Speeds::default();
        let onward = Increment::default();
        self.entries.push(Entry { stamp, belief, speeds: self.corrected_at, driven_m: 0.0, onward });
        self.newest = Some((stamp, belief));
    }

    /// Discards all entries and starts with this belief at the speeds of the newest entry: after a jump of the odometry.
    pub fn start_anew(&mut self, stamp: Time, belief: Belief) {
        let speeds = self.newest_entry_mut().map_or(Speeds::default(), |newest| newest.speeds);
        self.start(stamp, belief);
        self.corrected_at = speeds;
        if let Some(newest) = self.newest_entry_mut() {
            newest.speeds = speeds;
        }
    }

    /// Appends a newer entry, propagated by this motion; ignores an older one.
    pub fn advance(&mut self, stamp: Time, increment: Increment) {
        let noise = self.noise;
        let Some(newest) = self.newest_entry_mut().filter(|newest| stamp > newest.stamp) else { return };
        let elapsed_s = stamp.seconds_after(newest.stamp);
        let (speeds, acceleration) = newest.speeds.after(&increment, elapsed_s);
        let slip_variance = noise.slip.variance(acceleration) * elapsed_s / SLIP_INTERVAL_S;
        let increment = Increment { slip_variance: increment.slip_variance + slip_variance, ..increment };
        newest.onward = increment;
        let belief = increment.move_belief(&newest.belief, newest.driven_m, &noise);
        let driven_m = newest.driven_m + increment.forward_m.abs();
        let entry = Entry { stamp, belief, speeds, driven_m, onward: Increment::default() };
        if self.entries.len() < self.capacity {
            self.entries.push(entry);
        } else {
            self.entries[self.oldest] = entry;
            self.oldest = (self.oldest + 1) % self.capacity;
        }
        self.renew_newest();
    }

    /// Returns the newest belief and its time; `None` before the start.
    #[must_use]
    pub fn newest(&self) -> Option<(Time, &Belief)> {
        self.newest.as_ref().map(|(stamp, belief)| (*stamp, belief))
    }

    /// Computes the belief at the newest entry, with the uncertainty due to the delay of odometry.
    fn renew_newest(&mut self) {
        let Some(last) = self.entries.len().checked_sub(1) else { return };
        let entry = &self.entries[self.index(last)];
        self.newest = Some((entry.stamp, self.delayed(entry.belief, &entry.speeds)));
    }

    /// Adds the uncertainty due to the delay of odometry to a belief at these speeds.
    fn delayed(&self, belief: Belief, speeds: &Speeds) -> Belief {
        let added = self.noise.delay_covariance(belief.pose.theta, &self.corrected_at, speeds);
        Belief { covariance: belief.covariance + added, ..belief }
    }

    /// Returns the belief at a time: the prior for an image taken then.
    ///
    /// # Errors
    /// No correction can be applied at this time.
    pub fn at(&self, stamp: Time) -> Result<Belief, HistoryError> {
        let position = self.position(stamp)?;
        let entry = &self.entries[self.index(position.entry)];
        if let Some((at, belief)) = &self.applied
            && *at >= entry.stamp
        {
            // The last correction lies between the entry and this time.
            let done = self.fraction_of(entry, position.entry, *at);
            let since = self.step(position.entry).scaled(position.fraction - done);
            return Ok(self.delayed(since.move_belief(belief, 0.0, &self.noise), &entry.speeds));
        }
        let onward = self.step(position.entry).scaled(position.fraction);
        Ok(self.delayed(onward.move_belief(&entry.belief, entry.driven_m, &self.noise), &entry.speeds))
    }

    /// Replaces the belief at a time and repeats the dead reckoning since then, rewriting all newer entries.
    ///
    /// # Errors
    /// No correction can be applied at this time; the history is unchanged.
    pub fn correct(&mut self, stamp: Time, posterior: Belief) -> Result<(), HistoryError> {
        let position = self.position(stamp)?;
        self.applied = Some((stamp, posterior));
        let index = self.index(position.entry);
        self.corrected_at = self.entries[index].speeds;
        if self.is_newest(position) {
            self.entries[index].belief = self.back_from_ahead(position, &posterior);
            self.entries[index].driven_m = 0.0;
            self.renew_newest();
            return Ok(());
        }
        if position.fraction == 0.0 {
            self.entries[index].belief = posterior;
            self.entries[index].driven_m = 0.0;
        }
        let (mut belief, mut driven_m) = (posterior, 0.0);
        let mut onward = self.entries[index].onward.scaled(1.0 - position.fraction);
        for number in position.entry + 1..self.entries.len() {
            belief = onward.move_belief(&belief, driven_m, &self.noise);
            driven_m += onward.forward_m.abs();
            let index = self.index(number);
            self.entries[index].belief = belief;
            self.entries[index].driven_m = driven_m;
            onward = self.entries[index].onward;
        }
        self.renew_newest();
        Ok(())
    }

    /// Applies the correction of an old image to the newest belief, as a robot without a history does. For comparison
    /// with [`History::correct`].
    ///
    /// # Errors
    /// No correction can be applied at this time; the history is unchanged.
    pub fn correct_newest(
        &mut self,
        stamp: Time,
        prior: &Belief,
        posterior: &Belief,
    ) -> Result<(), HistoryError> {
        self.position(stamp)?;
        let Some(newest) = self.newest_entry_mut() else { return Err(HistoryError::Empty) };
        let pose = newest.belief.pose;
        let turn = posterior.pose.theta - prior.pose.theta;
        newest.belief = Belief {
            pose: Pose2::new(
                pose.x + posterior.pose.x - prior.pose.x,
                pose.y + posterior.pose.y - prior.pose.y,
                pose.theta + turn,
            ),
            covariance: posterior.covariance,
        };
        newest.driven_m = 0.0;
        self.corrected_at = newest.speeds;
        self.applied = Some((stamp, *posterior));
        self.renew_newest();
        Ok(())
    }

    /// Returns the newest belief after [`History::correct`], computed in one step from the accumulated motion since
    /// then and its noise. Exact for this motion model; without the uncertainty due to the delay of odometry.
    ///
    /// # Errors
    /// No correction can be applied at this time.
    pub fn corrected_newest(&self, stamp: Time, posterior: &Belief) -> Result<Belief, HistoryError> {
        let position = self.position(stamp)?;
        if self.is_newest(position) {
            return Ok(self.back_from_ahead(position, posterior));
        }
        let entry = &self.entries[self.index(position.entry)];
        let before = entry.onward.scaled(position.fraction).move_pose(&entry.belief.pose);
        let mut motion = MotionSince { before, pose: before, driven_m: 0.0, noise: Matrix3::zeros() };
        let mut onward = entry.onward.scaled(1.0 - position.fraction);
        for number in position.entry + 1..self.entries.len() {
            motion.advance(&onward, &self.noise);
            onward = self.entries[self.index(number)].onward;
        }
        Ok(motion.propagate(posterior))
    }

    /// Returns the position of a time at which a correction can be applied.
    fn position(&self, stamp: Time) -> Result<Position, HistoryError> {
        let (newest, _) = self.newest().ok_or(HistoryError::Empty)?;
        if self.applied.is_some_and(|(at, _)| stamp < at) {
            return Err(HistoryError::OutOfOrder);
        }
        if stamp < self.entries[self.index(0)].stamp {
            return Err(HistoryError::TooOld);
        }
        if stamp.seconds_after(newest) > MAX_AHEAD_S {
            return Err(HistoryError::Ahead);
        }
        let (mut low, mut high) = (0, self.entries.len());
        while high - low > 1 {
            let middle = usize::midpoint(low, high);
            if self.entries[self.index(middle)].stamp <= stamp { low = middle } else { high = middle }
        }
        let fraction = self.fraction_of(&self.entries[self.index(low)], low, stamp);
        Ok(Position { entry: low, fraction })
    }

    fn is_newest(&self, position: Position) -> bool {
        position.entry + 1 == self.entries.len()
    }

    /// Returns the belief at the newest entry, given the belief at a time after it. Undoing the extrapolation adds no
    /// noise.
    fn back_from_ahead(&self, position: Position, belief: &Belief) -> Belief {
        let back = self.step(position.entry).scaled(-position.fraction);
        Belief { pose: back.move_pose(&belief.pose), ..*belief }
    }

    fn fraction_of(&self, entry: &Entry, number: usize, stamp: Time) -> f64 {
        let span_s = if number + 1 < self.entries.len() {
            self.entries[self.index(number + 1)].stamp.seconds_after(entry.stamp)
        } else if number > 0 {
            entry.stamp.seconds_after(self.entries[self.index(number - 1)].stamp)
        } else {
            return 0.0;
        };
        stamp.seconds_after(entry.stamp) / span_s
    }

    /// Returns the motion from an entry to the next one; for the newest entry, the motion that led to it.
    fn step(&self, number: usize) -> Increment {
        let number = if number + 1 == self.entries.len() { number.saturating_sub(1) } else { number };
        self.entries[self.index(number)].onward
    }

    fn index(&self, number: usize) -> usize {
        (self.oldest + number) % self.entries.len()
    }

    fn newest_entry_mut(&mut self) -> Option<&mut Entry> {
        let last = self.entries.len().checked_sub(1)?;
        let index = self.index(last);
        self.entries.get_mut(index)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The uncertainty from drift grows with the distance since the last correction, both in the history and in one
    /// step.
    #[test]
    fn drift_counts_from_the_last_correction() {
        let drift_only = MotionNoise {
            distance_per_distance_m: 0.0,
            turn_per_turn_rad: 0.0,
            turn_per_distance: 0.0,
            drift_per_distance: 0.01,
            ..MotionNoise::default()
        };
        let mut history = History::new(CAPACITY, drift_only);
        let certain = Belief { pose: Pose2::IDENTITY, covariance: Matrix3::zeros() };
        let stamp = |step: u32| Time::from_secs_f64(0.02 * f64::from(step));
        history.start(stamp(0), certain);
        for step in 1..=500 {
            history.advance(stamp(step), Increment { forward_m: 0.01, ..Increment::default() });
        }
        let sigma = |history: &History| history.newest().map(|(_, belief)| belief.sigma_theta_rad());
        let is_near = |sigma: Option<f64>, expected: f64| sigma.is_some_and(|s| (s - expected).abs() < 1e-9);
        assert!(is_near(sigma(&history), 0.05));
        let captured = Time(stamp(300).0 + 7_000_000);
        let in_one_step = history.corrected_newest(captured, &certain);
        assert_eq!(history.correct(captured, certain), Ok(()));
        assert!(is_near(sigma(&history), 0.01 * (2.0 - 0.0035)));
        assert!(is_near(in_one_step.ok().map(|belief| belief.sigma_theta_rad()), 0.01 * (2.0 - 0.0035)));
        history.advance(stamp(501), Increment { forward_m: 0.01, ..Increment::default() });
        assert!(is_near(sigma(&history), 0.01 * (2.01 - 0.0035)));
    }

    /// The uncertainty from a delay depends on the speeds at the last correction and now, not on what lies between.
    #[test]
    fn a_change_of_the_turn_rate_is_uncertain_until_it_is_undone_or_corrected() {
        let delay_only = MotionNoise {
            distance_per_distance_m: 0.0,
            turn_per_turn_rad: 0.0,
            turn_per_distance: 0.0,
            delay_s: 0.1,
            ..MotionNoise::default()
        };
        let certain = Belief { pose: Pose2::IDENTITY, covariance: Matrix3::zeros() };
        let stamp = |step: u32| Time::from_secs_f64(0.02 * f64::from(step));
        let sigma =
            |history: &History| history.newest().map_or(f64::NAN, |(_, belief)| belief.sigma_theta_rad());
        let turning = Increment { turn_rad: 0.01, ..Increment::default() };
        let mut history = History::new(CAPACITY, delay_only);
        history.start(stamp(0), certain);
        (1..=50).for_each(|step| history.advance(stamp(step), turning));
        assert!((sigma(&history) - 0.05).abs() < 1e-3, "{}", sigma(&history));
        let mut undone = history.clone();
        (51..=100).for_each(|step| undone.advance(stamp(step), Increment::default()));
        assert!(sigma(&undone) < 1e-3, "{}", sigma(&undone));
        assert_eq!(history.correct(stamp(50), certain), Ok(()));
        assert!(sigma(&history) < 1e-12);
        (51..=100).for_each(|step| history.advance(stamp(step), Increment::default()));
        assert!((sigma(&history) - 0.05).abs() < 1e-3, "{}", sigma(&history));
    }
}
