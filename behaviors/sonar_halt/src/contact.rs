//! Contact of the bumpers at the front of the robot.

use yamabico_core::behavior::Inputs;
use yamabico_core::time::Time;

use crate::BUMPER;
use crate::motion::Motion;

/// Forward speed up to which the robot does not push on, m/s.
const STANDING_MPS: f64 = 0.02;

/// State of the bumpers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    is_connected: bool,
    newest: Option<Time>,
    is_pressed: bool,
}

impl Contact {
    /// Returns the state before the first reading; bumpers that are connected must not be silent.
    #[must_use]
    pub const fn new(is_connected: bool) -> Self {
        Self { is_connected, newest: None, is_pressed: false }
    }

    /// Reads the bumpers. A press counts even if it was released before the call, and so does a lost reading.
    pub fn update(&mut self, inputs: &Inputs<'_>) {
        let mut pressed = inputs.lost(&BUMPER) > 0;
        let mut is_new = pressed;
        for reading in inputs.fresh(&BUMPER) {
            let stamp = Time(reading.header.stamp_ns);
            if stamp.is_next(self.newest, inputs.now()) {
                self.newest = Some(stamp);
                is_new = true;
                pressed |= reading.header.pressed != 0;
            }
        }
        if is_new {
            self.is_pressed = pressed;
        }
    }

    /// Returns true if connected bumpers have said nothing for longer than `stale_s`.
    #[must_use]
    pub fn is_silent(&self, now: Time, stale_s: f64) -> bool {
        match self.newest {
            Some(newest) => now.seconds_after(newest) > stale_s,
            None => self.is_connected,
        }
    }

    /// Returns true if a bumper is pressed, unless the robot backs off or stands and wishes to.
    #[must_use]
    pub fn blocks(&self, motion: &Motion) -> bool {
        let backs_off = motion.wished.is_some_and(|wished| wished.linear < 0.0)
            && motion.measured.is_some_and(|measured| measured.linear <= STANDING_MPS);
        self.is_pressed && !backs_off
    }
}
