//! Bumpers at the front of the robot, as a sensor.

use std::sync::{Arc, Mutex};

use schemars::JsonSchema;
use serde::Deserialize;
use smart_default::SmartDefault;
use yamabico_core::behavior::Outputs;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::Bumper;
use yamabico_core::sensor::{DeviceError, Due, Sensor};
use yamabico_core::time::Time;

use super::{Schedule, locked};
use crate::simulation::{Moment, Simulation};

/// Parameters of the bumpers.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct BumperConfig {
    /// Period of the readings.
    #[default(20.0)]
    #[schemars(range(min = 5.0, max = 1000.0))]
    pub period_ms: f64,
    /// Delay from a reading to its delivery.
    #[default(5.0)]
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub latency_ms: f64,
    /// Distance from the footprint at which a bumper is pressed.
    #[default(0.01)]
    #[schemars(range(min = 0.001, max = 0.1))]
    pub reach_m: f64,
}

/// Sensor that publishes the state of a left and a right bumper: bits 0 and 1.
pub struct Bumpers {
    name: String,
    config: BumperConfig,
    simulation: Arc<Mutex<Simulation>>,
    schedule: Schedule,
}

impl Bumpers {
    /// Returns the sensor `name`.
    #[must_use]
    pub fn new(name: &str, config: BumperConfig, simulation: Arc<Mutex<Simulation>>) -> Self {
        let schedule = Schedule::new(config.period_ms, config.latency_ms);
        Self { name: name.to_owned(), config, simulation, schedule }
    }

    /// Bit mask of the pressed bumpers.
    fn pressed(&self, simulation: &Simulation, moment: &Moment) -> u64 {
        let reach_m = self.config.reach_m;
        if simulation.clearance(moment).0 > reach_m {
            return 0;
        }
        // Each bumper is a step to the front and to its side: the footprint moved there comes nearer only to what is there.
        let is_nearer = |y: f64| {
            let pose = moment.pose * Pose2::new(0.5 * reach_m, y * reach_m, 0.0);
            simulation.clearance(&Moment { pose, ..*moment }).0
                < simulation.clearance(moment).0 - 0.25 * reach_m
        };
        u64::from(is_nearer(0.5)) | u64::from(is_nearer(-0.5)) << 1
    }
}

impl Sensor for Bumpers {
    fn poll(&mut self, now: Time, outputs: &mut Outputs<'_>) -> Result<Due, DeviceError> {
        let simulation = &mut *locked(&self.simulation, &self.name)?;
        simulation.advance(now);
        while let Some((sequence, stamp)) = self.schedule.oldest(simulation.origin(), now) {
            let pressed = self.pressed(simulation, &simulation.at(stamp));
            outputs.publish(&self.name, &Bumper { stamp_ns: stamp.0, sequence, pressed }, &[])?;
        }
        Ok(Due::At(self.schedule.next(simulation.origin())))
    }
}
