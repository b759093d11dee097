//! The simulated drive.

use std::sync::{Arc, Mutex};

use schemars::JsonSchema;
use serde::Deserialize;
use yamabico_core::drive::Drive;
use yamabico_core::message::Command;
use yamabico_core::sensor::{DeviceError, MotionLimits};
use yamabico_core::time::Time;

use super::locked;
use crate::body::{BodyLimits, Urgency};
use crate::simulation::Simulation;

/// What the motors can do beyond the robot's limits, which the arbiter keeps.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MotorConfig {
    /// The body brakes by itself when no command has come for this long, ms, 20 to 5000.
    #[schemars(range(min = 20.0, max = 5000.0))]
    pub watchdog_ms: f64,
    /// Largest acceleration and deceleration that the motors can give, m/s^2, 0.1 to 20.
    #[schemars(range(min = 0.1, max = 20.0))]
    pub acceleration_mps2: f64,
    /// Largest acceleration of a turn that the motors can give, rad/s^2, 0.1 to 100.
    #[schemars(range(min = 0.1, max = 100.0))]
    pub angular_acceleration_radps2: f64,
}

impl Default for MotorConfig {
    fn default() -> Self {
        Self { watchdog_ms: 200.0, acceleration_mps2: 2.5, angular_acceleration_radps2: 10.0 }
    }
}

impl MotorConfig {
    /// The body that these motors give a robot with these limits; `axes` tells which axes the wheels have.
    #[must_use]
    pub fn body_limits(&self, robot: &MotionLimits, axes: [bool; 3]) -> BodyLimits {
        let top = [0, 1, 2].map(|i| if axes[i] { robot.speed[i] } else { 0.0 });
        let motors = [self.acceleration_mps2, self.acceleration_mps2, self.angular_acceleration_radps2];
        BodyLimits {
            speed: top,
            acceleration: motors,
            emergency: [0, 1, 2].map(|i| robot.emergency[i].min(motors[i])),
            watchdog_s: self.watchdog_ms * 1e-3,
        }
    }
}

/// Moves the simulation's body.
pub struct Motors {
    simulation: Arc<Mutex<Simulation>>,
}

impl Motors {
    /// The motors of this simulation.
    #[must_use]
    pub fn new(simulation: Arc<Mutex<Simulation>>) -> Self {
        Self { simulation }
    }
}

impl Drive for Motors {
    fn apply(&mut self, command: Option<&Command>, now: Time) -> Result<(), DeviceError> {
        let simulation = &mut *locked(&self.simulation, "drive")?;
        match command {
            Some(c) => {
                let urgency = if c.emergency == 0 { Urgency::Normal } else { Urgency::Emergency };

                simulation.command(&c.twist, urgency, now);
            }
            None => simulation.advance(now),
        }
        Ok(())
    }
}
