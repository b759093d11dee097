//! The simulated sonars as a sensor.

use std::sync::{Arc, Mutex};

use rand_pcg::Pcg64;
use yamabico_core::behavior::{BuildError, Outputs};
use yamabico_core::message::{Beam, NO_ECHO, RangeScanHeader};
use yamabico_core::sensor::{DeviceError, Due, Sensor, SensorInfo, SensorKind};
use yamabico_core::time::Time;

use super::{Beat, locked};
use crate::scene::Place;
use crate::simulation::Simulation;
use crate::sonar::{SonarConfig, reading};

/// What behaviors are told of the sonars.
///
/// # Errors
/// A range gate nearer than the nearest range, or directions that are no angles.
pub fn info(config: &SonarConfig, name: &str) -> Result<SensorInfo, BuildError> {
    if config.max_m <= config.min_m {
        return Err(BuildError::new("max_m", "must be above min_m"));
    }
    if config.azimuths_deg.is_empty() || config.azimuths_deg.iter().any(|a| !(-180.0..=180.0).contains(a)) {
        return Err(BuildError::new("azimuths_deg", "needs at least one direction, each from -180 to 180"));
    }
    let kind = SensorKind::Range { min_m: config.min_m, max_m: config.max_m };
    Ok(super::info::<RangeScanHeader>(name, config.period_ms, config.latency_ms, kind))
}

/// Publishes scans of the simulation.
pub struct Sonars {
    name: String,
    config: SonarConfig,
    simulation: Arc<Mutex<Simulation>>,
    rng: Pcg64,
    beat: Beat,
    beams: Vec<Beam>,
    people: Vec<Place>,
}

impl Sonars {
    /// The sonars called `name`; `seed` gives their noise.
    #[must_use]
    pub fn new(name: &str, config: SonarConfig, simulation: Arc<Mutex<Simulation>>, seed: u64) -> Self {
        let beat = Beat::new(config.period_ms, config.latency_ms);
        let rng = crate::random::stream(seed, name);
        Self { name: name.to_owned(), config, simulation, rng, beat, beams: Vec::new(), people: Vec::new() }
    }
}

impl Sensor for Sonars {
    fn poll(&mut self, now: Time, outputs: &mut Outputs<'_>) -> Result<Due, DeviceError> {
        let simulation = &mut *locked(&self.simulation, &self.name)?;
        simulation.advance(now);
        while let Some((sequence, stamp)) = self.beat.oldest(simulation.origin(), now) {
            let moment = simulation.at(stamp);
            self.people.clear();
            self.people.extend(simulation.people(stamp));
            self.beams.clear();
            for azimuth_deg in &self.config.azimuths_deg {
                let azimuth_rad = azimuth_deg.to_radians();
                let echo = reading(
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
        Ok(Due::At(self.beat.next(simulation.origin())))
    }
}
