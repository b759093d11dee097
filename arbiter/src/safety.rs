//! What stops the robot whatever the behaviors want: the emergency stop, silence of a critical part, the clock.

use std::time::Duration;

use yamabico_core::time::Time;

use crate::policy::Policy;

/// Why the whole robot is being stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The emergency stop is latched.
    EmergencyStop,
    /// The run ends.
    ShuttingDown,
    /// The critical behavior of this index is silent.
    Behavior(u16),
    /// The critical sensor of this index is silent.
    Sensor(u16),
    /// Time ran backwards; it has not yet caught up with the latest instant seen.
    Clock,
}

impl Stop {
    /// Whether to brake with the emergency deceleration.
    pub fn is_emergency(self) -> bool {
        self != Stop::ShuttingDown
    }
}

/// What somebody ordered, until further notice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Orders {
    emergency: bool,
    shutting_down: bool,
}

impl Orders {
    /// Latches the emergency stop.
    pub fn stop(&mut self) {
        self.emergency = true;
    }

    /// Releases the emergency stop. The end of a run cannot be taken back.
    pub fn reset(&mut self) {
        self.emergency = false;
    }

    /// Ends the run.
    pub fn shut_down(&mut self) {
        self.shutting_down = true;
    }

    /// The stop that is ordered.
    pub fn stop_ordered(&self) -> Option<Stop> {
        if self.emergency {
            Some(Stop::EmergencyStop)
        } else if self.shutting_down {
            Some(Stop::ShuttingDown)
        } else {
            None
        }
    }
}

/// When a part was last heard, and how long it may be silent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Watch {
    longest: Duration,
    heard: Option<Time>,
}

impl Watch {
    /// A part not heard yet.
    pub fn new(longest: Duration) -> Watch {
        Watch { longest, heard: None }
    }

    /// It was heard at `at`.
    pub fn hear(&mut self, at: Time) {
        self.heard = Some(at);
    }

    /// Whether it has been silent for too long at `now`, or was never heard, or was heard later than `tolerance` from now.
    pub fn is_silent(&self, now: Time, tolerance: Duration) -> bool {
        self.heard.is_none_or(|heard| now.since(heard) > self.longest || heard > now + tolerance)
    }
}

/// The instant and the time that one decision may use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tick {
    /// The instant that ages are counted to: the latest one seen.
    pub now: Time,
    /// Time that braking may use, seconds.
    pub braking_s: f64,
    /// Time that speeding up may use, seconds: at most [`LONGEST_STEP_PERIODS`] periods.
    pub speeding_s: f64,
    /// Whether time ran backwards.
    pub backwards: bool,
}

/// After a gap the robot speeds up by no more than this many periods' worth.
pub const LONGEST_STEP_PERIODS: f64 = 2.0;

/// The course of time over the decisions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Course {
    latest: Option<Time>,
}

impl Course {
    /// The next decision is at `now`. The first one uses one period. One in the past brakes for one period and does not
    /// speed up.
    pub fn advance(&mut self, now: Time, policy: &Policy) -> Tick {
        let period_s = if policy.rate_hz > 0.0 { 1.0 / policy.rate_hz } else { 0.0 };
        let Some(latest) = self.latest else {
            self.latest = Some(now);
            return Tick { now, braking_s: period_s, speeding_s: period_s, backwards: false };
        };
        if now < latest {
            return Tick { now: latest, braking_s: period_s, speeding_s: 0.0, backwards: true };
        }
        self.latest = Some(now);
        let dt_s = now.since(latest).as_secs_f64();
        Tick { now, braking_s: dt_s, speeding_s: dt_s.min(LONGEST_STEP_PERIODS * period_s), backwards: false }
    }
}
