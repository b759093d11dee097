//! Wheel odometry, as a sensor.

use std::sync::{Arc, Mutex};

use yamabico_core::behavior::Outputs;
use yamabico_core::message::Odometry;
use yamabico_core::sensor::{DeviceError, Due, Sensor};
use yamabico_core::time::Time;

use super::{Schedule, locked};
use crate::encoder::{EncoderConfig, Odometer};
use crate::simulation::{Moment, Simulation};

/// Sensor that publishes odometry of the simulated wheels.
pub struct WheelEncoders {
    name: String,
    simulation: Arc<Mutex<Simulation>>,
    odometer: Odometer,
    schedule: Schedule,
    last: Option<Moment>,
}

impl WheelEncoders {
    /// Returns the sensor `name`, with errors from `seed`.
    #[must_use]
    pub fn new(name: &str, config: EncoderConfig, simulation: Arc<Mutex<Simulation>>, seed: u64) -> Self {
        let odometer = Odometer::new(config, crate::random::stream(seed, name));
        let schedule = Schedule::new(config.period_ms, config.latency_ms);
        Self { name: name.to_owned(), simulation, odometer, schedule, last: None }
    }
}

impl Sensor for WheelEncoders {
    fn poll(&mut self, now: Time, outputs: &mut Outputs<'_>) -> Result<Due, DeviceError> {
        let simulation = &mut *locked(&self.simulation, &self.name)?;
        simulation.advance(now);
        while let Some((sequence, stamp)) = self.schedule.oldest(simulation.origin(), now) {
            let moment = simulation.at(stamp);
            if let Some(last) = self.last {
                let mut rolled = last.pose.relative(&moment.pose);
                rolled.theta -= moment.skid_rad - last.skid_rad;
                self.odometer.integrate(&rolled, stamp.seconds_after(last.at));
            }
            self.last = Some(moment);
            let (pose, twist, p) = (self.odometer.pose, self.odometer.twist, self.odometer.covariance);
            let header = Odometry {
                stamp_ns: stamp.0,
                sequence,
                x: pose.x,
                y: pose.y,
                theta: pose.theta,
                vx: twist.linear,
                vy: twist.lateral,
                omega: twist.angular,
                covariance: std::array::from_fn(|i| p[(i / 3, i % 3)]),
            };
            outputs.publish(&self.name, &header, &[])?;
        }
        Ok(Due::At(self.schedule.next(simulation.origin())))
    }
}
