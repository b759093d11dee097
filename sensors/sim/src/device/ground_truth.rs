//! Ground truth of a run, as a sensor.

use std::sync::{Arc, Mutex};

use yamabico_core::behavior::Outputs;
use yamabico_core::message::Truth;
use yamabico_core::sensor::{DeviceError, Due, Sensor};
use yamabico_core::time::Time;

use super::{Schedule, locked};
use crate::simulation::Simulation;

/// Name of the output, and of the sensor in errors.
const TRUTH: &str = "truth";

/// Sensor that publishes [`Truth`] on the output `truth`.
pub struct GroundTruth {
    simulation: Arc<Mutex<Simulation>>,
    schedule: Schedule,
}

impl GroundTruth {
    /// Returns a sensor with this period.
    #[must_use]
    pub fn new(period_ms: f64, simulation: Arc<Mutex<Simulation>>) -> Self {
        Self { simulation, schedule: Schedule::new(period_ms, 0.0) }
    }
}

impl Sensor for GroundTruth {
    fn poll(&mut self, now: Time, outputs: &mut Outputs<'_>) -> Result<Due, DeviceError> {
        let simulation = &mut *locked(&self.simulation, TRUTH)?;
        simulation.advance(now);
        while let Some((sequence, stamp)) = self.schedule.oldest(simulation.origin(), now) {
            let moment = simulation.at(stamp);
            let (clearance_m, person_m) = simulation.clearance(&moment);
            let header = Truth {
                stamp_ns: stamp.0,
                sequence,
                x: moment.pose.x,
                y: moment.pose.y,
                theta: moment.pose.theta,
                vx: moment.twist.linear,
                vy: moment.twist.lateral,
                omega: moment.twist.angular,
                distance_m: moment.distance_m,
                clearance_m,
                person_m,
                contacts: moment.contacts,
                struck: moment.struck,
            };
            outputs.publish(TRUTH, &header, &[])?;
        }
        Ok(Due::At(self.schedule.next(simulation.origin())))
    }
}
