//! Simulated drive.

use std::sync::{Arc, Mutex};

use schemars::JsonSchema;
use serde::Deserialize;
use smart_default::SmartDefault;
use yamabico_core::drive::Drive;
use yamabico_core::message::Command;
use yamabico_core::sensor::{DeviceError, MotionLimits};
use yamabico_core::time::Time;

use super::locked;
use crate::body::{BodyLimits, Urgency};
use crate::simulation::Simulation;

/// Limits of the motors, in addition to the robot's limits, which the arbiter keeps.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct MotorConfig {
    /// Time without a command after which the drive brakes by itself.
    #[default(200.0)]
    #[schemars(range(min = 20.0, max = 5000.0))]
    pub watchdog_ms: f64,
    /// Maximum acceleration and deceleration of the motors.
    #[default(2.5)]
    #[schemars(range(min = 0.1, max = 20.0))]
    pub acceleration_mps2: f64,
    /// Maximum angular acceleration of the motors.
    #[default(10.0)]
    #[schemars(range(min = 0.1, max = 100.0))]
    pub angular_acceleration_radps2: f64,
    /// Fraction of a turn in place that the body does not make although its wheels roll: they slip.
    #[schemars(range(min = 0.0, max = 0.9))]
    pub turn_slip: f64,
    /// Standard deviation of a turn of the body in an emergency stop that the wheels do not measure; drawn from the seed.
    #[schemars(range(min = 0.0, max = 45.0))]
    pub stop_skid_deg: f64,
}

impl MotorConfig {
    /// Returns the limits of a body with these motors and the robot's limits. `axes`: true for every axis that the wheels
    /// can move along (linear, lateral, angular).
    #[must_use]
    pub fn body_limits(&self, robot: &MotionLimits, axes: [bool; 3]) -> BodyLimits {
        let speed = [0, 1, 2].map(|i| if axes[i] { robot.speed[i] } else { 0.0 });
        let motors = [self.acceleration_mps2, self.acceleration_mps2, self.angular_acceleration_radps2];
        BodyLimits {
            speed,
            acceleration: motors,
            emergency: [0, 1, 2].map(|i| robot.emergency[i].min(motors[i])),
            watchdog_s: self.watchdog_ms * 1e-3,
            turn_slip: self.turn_slip,
        }
    }
}

/// Drive that moves the simulated body.
pub struct Motors {
    simulation: Arc<Mutex<Simulation>>,
}

impl Motors {
    /// Returns the drive of this simulation.
    #[must_use]
    pub fn new(simulation: Arc<Mutex<Simulation>>) -> Self {
        Self { simulation }
    }
}

impl Drive for Motors {
    fn apply(&mut self, command: Option<&Command>, now: Time) -> Result<(), DeviceError> {
        let simulation = &mut *locked(&self.simulation, "drive")?;
        match command {
            Some(command) => {
                let urgency = if command.emergency == 0 { Urgency::Normal } else { Urgency::Emergency };
                simulation.command(&command.twist, urgency, now);
            }
            None => simulation.advance(now),
        }
        Ok(())
    }
}
