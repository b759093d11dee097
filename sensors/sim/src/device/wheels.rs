//! The simulated wheel encoders as a sensor.

use std::sync::{Arc, Mutex};

use yamabico_core::behavior::Outputs;
use yamabico_core::message::Odometry;
use yamabico_core::sensor::{DeviceError, Due, Sensor};
use yamabico_core::time::Time;

use super::{Beat, locked};
use crate::encoder::{EncoderConfig, Odometer};
use crate::simulation::{Moment, Simulation};

/// Publishes odometry from the simulation's wheels.
pub struct WheelEncoders {
    name: String,
    simulation: Arc<Mutex<Simulation>>,
    odometer: Odometer,
    beat: Beat,
    last: Option<Moment>,
}

impl WheelEncoders {
    /// The encoders called `name`; `seed` gives their errors.
    #[must_use]
    pub fn new(name: &str, config: EncoderConfig, simulation: Arc<Mutex<Simulation>>, seed: u64) -> Self {
        let odometer = Odometer::new(config, crate::random::stream(seed, name));
        let beat = Beat::new(config.period_ms, config.latency_ms);
        Self { name: name.to_owned(), simulation, odometer, beat, last: None }
    }
}

impl Sensor for WheelEncoders {
    fn poll(&mut self, now: Time, outputs: &mut Outputs<'_>) -> Result<Due, DeviceError> {
        let simulation = &mut *locked(&self.simulation, &self.name)?;
        simulation.advance(now);
        while let Some((sequence, stamp)) = self.beat.oldest(simulation.origin(), now) {
            let moment = simulation.at(stamp);
            if let Some(last) = self.last {
                self.odometer.read(&last.pose.relative(&moment.pose), stamp.seconds_after(last.at));
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
        Ok(Due::At(self.beat.next(simulation.origin())))
    }
}
