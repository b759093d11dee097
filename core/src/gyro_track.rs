//! Recent turn rates of a gyro, and the turn between two times.

use crate::time::Time;

const CAPACITY: usize = 256;
/// Longest silence that is bridged, s.
const MAX_GAP_S: f64 = 0.1;
/// Time constant with which the bias follows the rate of a robot that stands, s.
const BIAS_S: f64 = 1.0;
/// Maximum bias, rad/s; a larger rate at standing wheels is a robot that is turned.
const MAX_BIAS_RADPS: f64 = 0.1;

/// A ring buffer of turn rates. Never allocates.
#[derive(Clone, Debug)]
pub(crate) struct GyroTrack {
    samples: [Sample; CAPACITY],
    len: usize,
    newest: usize,
    bias_radps: f64,
}

/// One measurement.
#[derive(Clone, Copy, Debug, Default)]
struct Sample {
    stamp: Time,
    /// Turn rate without bias, rad/s.
    turn_radps: f64,
    /// Turn since the first sample after the last silence, rad.
    turned_rad: f64,
    /// Number of silences before it.
    span: u32,
}

impl Default for GyroTrack {
    fn default() -> Self {
        Self { samples: [Sample::default(); CAPACITY], len: 0, newest: 0, bias_radps: 0.0 }
    }
}

impl GyroTrack {
    /// Stamp of the newest measurement.
    pub fn newest(&self) -> Option<Time> {
        (self.len > 0).then(|| self.samples[self.newest].stamp)
    }

    /// Adds a turn rate (rad/s) that is newer than the last; `stands` if the wheels do not turn.
    pub fn push(&mut self, stamp: Time, turn_radps: f64, stands: bool) {
        let last = self.samples[self.newest];
        let gap_s = if self.len > 0 { stamp.seconds_after(last.stamp) } else { f64::INFINITY };
        let is_still = stands && turn_radps.abs() < MAX_BIAS_RADPS;
        if is_still && gap_s < MAX_GAP_S {
            self.bias_radps += (turn_radps - self.bias_radps) * (gap_s / BIAS_S);
        }
        let turn_radps = turn_radps - self.bias_radps;
        let (span, turned_rad) = match gap_s < MAX_GAP_S {
            true => (last.span, last.turned_rad + 0.5 * (last.turn_radps + turn_radps) * gap_s),
            false => (last.span + 1, 0.0),
        };
        self.newest = (self.newest + 1) % CAPACITY;
        self.samples[self.newest] = Sample { stamp, turn_radps, turned_rad, span };
        self.len = (self.len + 1).min(CAPACITY);
    }

    /// Returns the turn between two times, rad; `None` if the gyro was silent meanwhile, or has forgotten it.
    pub fn turn_rad(&self, from: Time, to: Time) -> Option<f64> {
        let (first_span, first_rad) = self.turned_at(from)?;
        let (last_span, last_rad) = self.turned_at(to)?;
        (first_span == last_span).then_some(last_rad - first_rad)
    }

    /// Span and turn at a time, extrapolated for at most [`MAX_GAP_S`] after the newest measurement of a span.
    fn turned_at(&self, at: Time) -> Option<(u32, f64)> {
        let samples = (0..self.len).map(|back| &self.samples[(self.newest + CAPACITY - back) % CAPACITY]);
        let before = samples.clone().find(|sample| sample.stamp <= at)?;
        let after = samples.take_while(|sample| sample.stamp > at).last();
        let since_s = at.seconds_after(before.stamp);
        let turn_radps = match after.filter(|after| after.span == before.span) {
            Some(after) => {
                let share = since_s / after.stamp.seconds_after(before.stamp);
                before.turn_radps + 0.5 * share * (after.turn_radps - before.turn_radps)
            }
            None => before.turn_radps,
        };
        (since_s < MAX_GAP_S).then_some((before.span, before.turned_rad + turn_radps * since_s))
    }
}
