//! Ring of sonars, as a sensor.

use std::sync::{Arc, Mutex};

use rand_pcg::Pcg64;
use yamabico_core::behavior::{Outputs, ParameterError};
use yamabico_core::message::{Beam, NO_ECHO, RangeScanHeader};
use yamabico_core::sensor::{DeviceError, Due, Sensor, SensorInfo, SensorKind};
use yamabico_core::sonar_ring::RingGeometry;
use yamabico_core::time::Time;

use super::{Schedule, locked};
use crate::scene::PersonPose;
use crate::simulation::Simulation;
use crate::sonar::{SonarConfig, measure_range};

/// Returns the description of the sensor.
///
/// # Errors
/// A maximum range that is not above the minimum range, or invalid azimuths.
pub fn info(config: &SonarConfig, name: &str) -> Result<SensorInfo, ParameterError> {
    let ring = RingGeometry {
        azimuths_deg: &config.azimuths_deg,
        cone_deg: config.cone_deg,
        from_center_m: 0.0,
        range_m: [config.min_m, config.max_m],
    };
    ring.check()?;
    let kind = SensorKind::Range { min_m: config.min_m, max_m: config.max_m };
    Ok(super::info::<RangeScanHeader>(name, config.period_ms, config.latency_ms, kind))
}

/// Sensor that publishes sonar scans.
pub struct Sonars {
    name: String,
    config: SonarConfig,
    simulation: Arc<Mutex<Simulation>>,
    rng: Pcg64,
    schedule: Schedule,
    beams: Vec<Beam>,
    people: Vec<PersonPose>,
}

impl Sonars {
    /// Returns the sensor `name`, with noise from `seed`.
    #[must_use]
    pub fn new(name: &str, config: SonarConfig, simulation: Arc<Mutex<Simulation>>, seed: u64) -> Self {
        let schedule = Schedule::new(config.period_ms, config.latency_ms);
        let rng = crate::random::stream(seed, name);
        Self {
            name: name.to_owned(),
            config,
            simulation,
            rng,
            schedule,
            beams: Vec::new(),
            people: Vec::new(),
        }
    }
}

impl Sensor for Sonars {
    fn poll(&mut self, now: Time, outputs: &mut Outputs<'_>) -> Result<Due, DeviceError> {
        let simulation = &mut *locked(&self.simulation, &self.name)?;
        simulation.advance(now);
        while let Some((sequence, stamp)) = self.schedule.oldest(simulation.origin(), now) {
            let moment = simulation.at(stamp);
            self.people.clear();
            self.people.extend(simulation.people(stamp));
            self.beams.clear();
            for azimuth_deg in &self.config.azimuths_deg {
                let azimuth_rad = azimuth_deg.to_radians();
                let echo = measure_range(
                    &self.config,
                    azimuth_rad,
                    &simulation.scene,
                    &self.people,
                    &moment.pose,
                    &mut self.rng,
                );
                self.beams.push(Beam {
                    azimuth_rad,
                    cone_rad: self.config.cone_deg.to_radians(),
                    range_m: echo.unwrap_or(self.config.max_m),
                    x_m: self.config.x_m,
                    y_m: self.config.y_m,
                    flags: if echo.is_some() { 0 } else { NO_ECHO },
                    reserved: 0,
                });
            }
            let (min_m, max_m) = (self.config.min_m, self.config.max_m);
            let header = RangeScanHeader { stamp_ns: stamp.0, sequence, min_m, max_m };
            outputs.publish(&self.name, &header, &self.beams)?;
        }
        Ok(Due::At(self.schedule.next(simulation.origin())))
    }
}
