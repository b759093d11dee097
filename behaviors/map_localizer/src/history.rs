//! The recent past of the belief, so that what an old picture shows can be applied at the instant that it was taken.
//!
//! Ohya, Kosaka & Kak (1998), section 3: a result of vision for the image of t0 corrects the position of t0, and the dead
//! reckoning since then is done again from there.

use nalgebra::{Matrix2, Matrix3};
use thiserror::Error;
use yamabico_core::geometry::Pose2;
use yamabico_core::time::Time;

use crate::belief::Belief;
use crate::motion::{Increment, MotionNoise};

/// So many readings of the odometry are kept: 82 s at 50 a second.
pub const CAPACITY: usize = 4096;
/// A picture may be newer than the newest odometry by this, s: the motion is then assumed to go on.
const AHEAD_S: f64 = 0.2;

/// Why a result cannot be applied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum HistoryError {
    /// There is no odometry yet.
    #[error("no odometry yet")]
    Empty,
    /// Older than what is kept.
    #[error("older than the history")]
    TooOld,
    /// Older than the last result that was applied.
    #[error("out of order")]
    OutOfOrder,
    /// Much newer than the newest odometry.
    #[error("newer than the odometry")]
    Ahead,
}

/// The belief at recent readings of the odometry, a ring.
#[derive(Clone, Debug)]
pub struct History {
    noise: MotionNoise,
    entries: Vec<Entry>,
    capacity: usize,
    /// Of the oldest entry.
    oldest: usize,
    /// The last result, at its own instant, and when it was.
    applied: Option<(Time, Belief)>,
}

#[derive(Clone, Copy, Debug)]
struct Entry {
    stamp: Time,
    belief: Belief,
    /// Driven since the last result that was applied, meters.
    driven_m: f64,
    /// From here to the next entry; zero in the newest.
    onward: Increment,
}

/// Where an instant lies in the history.
#[derive(Clone, Copy, Debug)]
struct Place {
    /// Entries before it, counted from the oldest, less one.
    entry: usize,
    /// Share of the way to the next entry; beyond the newest, in units of the last way.
    share: f64,
}

impl History {
    /// An empty history of at most `capacity` readings.
    #[must_use]
    pub fn new(capacity: usize, noise: MotionNoise) -> Self {
        let capacity = capacity.max(2);
        Self { noise, entries: Vec::with_capacity(capacity), capacity, oldest: 0, applied: None }
    }

    /// Forgets everything and begins with this belief.
    pub fn start(&mut self, stamp: Time, belief: Belief) {
        self.entries.clear();
        self.oldest = 0;
        self.applied = None;
        self.entries.push(Entry { stamp, belief, driven_m: 0.0, onward: Increment::default() });
    }

    /// Moves on to a newer reading; an older one changes nothing.
    pub fn advance(&mut self, stamp: Time, increment: Increment) {
        let noise = self.noise;
        let Some(newest) = self.newest_entry_mut().filter(|newest| stamp > newest.stamp) else { return };
        newest.onward = increment;
        let belief = increment.move_belief(&newest.belief, newest.driven_m, &noise);
        let driven_m = newest.driven_m + increment.forward_m.abs();
        let entry = Entry { stamp, belief, driven_m, onward: Increment::default() };
        if self.entries.len() < self.capacity {
            self.entries.push(entry);
        } else {
            self.entries[self.oldest] = entry;
            self.oldest = (self.oldest + 1) % self.capacity;
        }
    }

    /// The newest belief and its instant; `None` before the start.
    #[must_use]
    pub fn newest(&self) -> Option<(Time, &Belief)> {
        let last = self.entries.len().checked_sub(1)?;
        let entry = &self.entries[self.index(last)];
        Some((entry.stamp, &entry.belief))
    }

    /// Readings that are kept.
    #[must_use]
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether nothing has begun yet.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// The belief at an instant: the prior for a picture taken then.
    ///
    /// # Errors
    /// An instant that no result can be applied at.
    pub fn at(&self, stamp: Time) -> Result<Belief, HistoryError> {
        let place = self.place(stamp)?;
        let entry = &self.entries[self.index(place.entry)];
        if let Some((at, belief)) = &self.applied
            && *at >= entry.stamp
        {
            // The last result lies between the entry and here.
            let done = self.share_of(entry, place.entry, *at);
            return Ok(self.step(place.entry).share(place.share - done).move_belief(
                belief,
                0.0,
                &self.noise,
            ));
        }
        let onward = self.step(place.entry).share(place.share);
        Ok(onward.move_belief(&entry.belief, entry.driven_m, &self.noise))
    }

    /// Replaces the belief at an instant, and does the dead reckoning since then again. Every reading since then is
    /// rewritten.
    ///
    /// # Errors
    /// An instant that no result can be applied at; nothing has changed then.
    pub fn correct(&mut self, stamp: Time, posterior: Belief) -> Result<(), HistoryError> {
        let place = self.place(stamp)?;
        self.applied = Some((stamp, posterior));
        let index = self.index(place.entry);
        if self.is_newest(place) {
            self.entries[index].belief = self.back_from_ahead(place, &posterior);
            self.entries[index].driven_m = 0.0;
            return Ok(());
        }
        if place.share == 0.0 {
            self.entries[index].belief = posterior;
            self.entries[index].driven_m = 0.0;
        }
        let (mut belief, mut driven_m) = (posterior, 0.0);
        let mut onward = self.entries[index].onward.share(1.0 - place.share);
        for number in place.entry + 1..self.entries.len() {
            belief = onward.move_belief(&belief, driven_m, &self.noise);
            driven_m += onward.forward_m.abs();
            let index = self.index(number);
            self.entries[index].belief = belief;
            self.entries[index].driven_m = driven_m;
            onward = self.entries[index].onward;
        }
        Ok(())
    }

    /// Moves the newest belief by what a result changed, whenever its picture was taken: what a robot does that keeps no
    /// history. For comparison.
    ///
    /// # Errors
    /// As [`History::correct`].
    pub fn correct_newest(
        &mut self,
        stamp: Time,
        prior: &Belief,
        posterior: &Belief,
    ) -> Result<(), HistoryError> {
        self.place(stamp)?;
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
        self.applied = Some((stamp, *posterior));
        Ok(())
    }

    /// The same as [`History::correct`] would make of the newest belief, in one step: the motion since then, turned, and its
    /// noise. Exact for this motion model.
    ///
    /// # Errors
    /// As [`History::correct`].
    pub fn corrected_newest(&self, stamp: Time, posterior: &Belief) -> Result<Belief, HistoryError> {
        let place = self.place(stamp)?;
        if self.is_newest(place) {
            return Ok(self.back_from_ahead(place, posterior));
        }
        let entry = &self.entries[self.index(place.entry)];
        let before = entry.onward.share(place.share).move_pose(&entry.belief.pose);
        let mut motion = MotionSince { before, pose: before, driven_m: 0.0, noise: Matrix3::zeros() };
        let mut onward = entry.onward.share(1.0 - place.share);
        for number in place.entry + 1..self.entries.len() {
            motion.advance(&onward, &self.noise);
            onward = self.entries[self.index(number)].onward;
        }
        Ok(motion.carry(posterior))
    }

    /// The place of an instant that a result can be applied at.
    fn place(&self, stamp: Time) -> Result<Place, HistoryError> {
        let (newest, _) = self.newest().ok_or(HistoryError::Empty)?;
        if self.applied.is_some_and(|(at, _)| stamp < at) {
            return Err(HistoryError::OutOfOrder);
        }
        if stamp < self.entries[self.index(0)].stamp {
            return Err(HistoryError::TooOld);
        }
        if stamp.seconds_after(newest) > AHEAD_S {
            return Err(HistoryError::Ahead);
        }
        let (mut low, mut high) = (0, self.entries.len());
        while high - low > 1 {
            let middle = usize::midpoint(low, high);
            if self.entries[self.index(middle)].stamp <= stamp { low = middle } else { high = middle }
        }
        let share = self.share_of(&self.entries[self.index(low)], low, stamp);
        Ok(Place { entry: low, share })
    }

    fn is_newest(&self, place: Place) -> bool {
        place.entry + 1 == self.entries.len()
    }

    /// The belief at the newest reading, given that at an instant beyond it. The way back brings no new doubt.
    fn back_from_ahead(&self, place: Place, belief: &Belief) -> Belief {
        let back = self.step(place.entry).share(-place.share);
        Belief { pose: back.move_pose(&belief.pose), ..*belief }
    }

    fn share_of(&self, entry: &Entry, number: usize, stamp: Time) -> f64 {
        let span_s = if number + 1 < self.entries.len() {
            self.entries[self.index(number + 1)].stamp.seconds_after(entry.stamp)
        } else if number > 0 {
            entry.stamp.seconds_after(self.entries[self.index(number - 1)].stamp)
        } else {
            return 0.0;
        };
        stamp.seconds_after(entry.stamp) / span_s
    }

    /// The motion onward from an entry; from the newest, the one that led to it.
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

/// The motion since a picture was taken, in a form that carries a result forward at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionSince {
    /// The pose at the picture as it was believed.
    pub before: Pose2,
    /// The pose now as it follows from that.
    pub pose: Pose2,
    /// Driven since the picture, meters.
    pub driven_m: f64,
    /// What the motion added to the covariance, from nothing at the picture.
    pub noise: Matrix3<f64>,
}

impl MotionSince {
    /// Takes the next motion.
    pub fn advance(&mut self, increment: &Increment, noise: &MotionNoise) {
        self.noise = increment.move_covariance(&self.noise, self.pose.theta, self.driven_m, noise);
        self.driven_m += increment.forward_m.abs();
        self.pose = increment.move_pose(&self.pose);
    }

    /// The belief now, given that at the picture.
    #[must_use]
    pub fn carry(&self, posterior: &Belief) -> Belief {
        let turn = posterior.pose.theta - self.before.theta;
        let (sin, cos) = turn.sin_cos();
        let way = (self.pose.x - self.before.x, self.pose.y - self.before.y);
        let way = (cos * way.0 - sin * way.1, sin * way.0 + cos * way.1);
        let state = Matrix3::new(1.0, 0.0, -way.1, 0.0, 1.0, way.0, 0.0, 0.0, 1.0);
        let mut turned = Matrix3::identity();
        turned.fixed_view_mut::<2, 2>(0, 0).copy_from(&Matrix2::new(cos, -sin, sin, cos));
        Belief {
            pose: Pose2::new(posterior.pose.x + way.0, posterior.pose.y + way.1, self.pose.theta + turn),
            covariance: state * posterior.covariance * state.transpose()
                + turned * self.noise * turned.transpose(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A drift's doubt grows with the way since the last result, in the history and in one step alike.
    #[test]
    fn a_drift_counts_from_the_last_result() {
        let of_drift = MotionNoise {
            way_per_way_m: 0.0,
            turn_per_turn_rad: 0.0,
            turn_per_way: 0.0,
            drift_per_way: 0.01,
        };
        let mut history = History::new(CAPACITY, of_drift);
        let certain = Belief { pose: Pose2::IDENTITY, covariance: Matrix3::zeros() };
        let stamp = |step: u32| Time::from_secs_f64(0.02 * f64::from(step));
        history.start(stamp(0), certain);
        for step in 1..=500 {
            history.advance(stamp(step), Increment { forward_m: 0.01, turn_rad: 0.0 });
        }
        let sigma = |history: &History| history.newest().map(|(_, belief)| belief.sigma_theta_rad());
        let is_near = |sigma: Option<f64>, expected: f64| sigma.is_some_and(|s| (s - expected).abs() < 1e-9);
        assert!(is_near(sigma(&history), 0.05));
        let seen = Time(stamp(300).0 + 7_000_000);
        let in_one_step = history.corrected_newest(seen, &certain);
        assert_eq!(history.correct(seen, certain), Ok(()));
        assert!(is_near(sigma(&history), 0.01 * (2.0 - 0.0035)));
        assert!(is_near(in_one_step.ok().map(|belief| belief.sigma_theta_rad()), 0.01 * (2.0 - 0.0035)));
        history.advance(stamp(501), Increment { forward_m: 0.01, turn_rad: 0.0 });
        assert!(is_near(sigma(&history), 0.01 * (2.01 - 0.0035)));
    }
}
