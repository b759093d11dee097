//! Stops that no behavior can override: the emergency stop, silence of a critical behavior or sensor, a clock that runs backwards.

use std::time::Duration;

use yamabico_core::time::Time;

use crate::policy::Policy;

/// Cause of a stop of the whole robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The emergency stop is latched.
    EmergencyStop,
    /// The run ends.
    ShuttingDown,
    /// The critical behavior at this index is silent.
    Behavior(u16),
    /// The critical sensor at this index is silent.
    Sensor(u16),
    /// Time ran backwards and has not yet caught up with the latest instant seen.
    Clock,
}

impl Stop {
    /// Returns true if the robot brakes with the emergency deceleration.
    pub fn is_emergency(self) -> bool {
        self != Stop::ShuttingDown
    }
}

/// Stops requested from outside, in force until they are released.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StopRequests {
    emergency: bool,
    shutting_down: bool,
}

impl StopRequests {
    /// Latches the emergency stop.
    pub fn emergency_stop(&mut self) {
        self.emergency = true;
    }

    /// Releases the emergency stop. The end of a run cannot be revoked.
    pub fn reset(&mut self) {
        self.emergency = false;
    }

    /// Ends the run.
    pub fn shut_down(&mut self) {
        self.shutting_down = true;
    }

    /// Requested stop; the emergency stop comes first.
    pub fn requested(&self) -> Option<Stop> {
        if self.emergency {
            Some(Stop::EmergencyStop)
        } else if self.shutting_down {
            Some(Stop::ShuttingDown)
        } else {
            None
        }
    }
}

/// Watchdog of a critical behavior or sensor: time of its last sign of life and maximum silence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Watchdog {
    max_silence: Duration,
    last: Option<Time>,
}

impl Watchdog {
    /// A watchdog that has not been fed yet.
    pub fn new(max_silence: Duration) -> Watchdog {
        Watchdog { max_silence, last: None }
    }

    /// Records a sign of life at `at`.
    pub fn feed(&mut self, at: Time) {
        self.last = Some(at);
    }

    /// Returns true if the part has been silent for too long at `now`, was never fed, or was fed with a stamp more than
    /// `tolerance` in the future.
    pub fn is_silent(&self, now: Time, tolerance: Duration) -> bool {
        self.last.is_none_or(|last| now.since(last) > self.max_silence || last > now + tolerance)
    }
}

/// Instant and time steps of one decision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tick {
    /// Instant from which ages are counted: the latest one seen.
    pub now: Time,
    /// Time step for braking, s.
    pub braking_s: f64,
    /// Time step for speeding up, s: at most [`MAX_STEP_PERIODS`] periods.
    pub speeding_s: f64,
    /// Set if time ran backwards.
    pub backwards: bool,
}

/// Maximum time step for speeding up after a gap, periods.
pub const MAX_STEP_PERIODS: f64 = 2.0;

/// Clock of the decisions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DecisionClock {
    latest: Option<Time>,
}

impl DecisionClock {
    /// Advances to the next decision at `now`. The first decision has a step of one period. A decision in the past brakes for
    /// one period and does not speed up.
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
        Tick { now, braking_s: dt_s, speeding_s: dt_s.min(MAX_STEP_PERIODS * period_s), backwards: false }
    }
}
