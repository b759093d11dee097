//! Laser scanner, as a sensor.

use std::f64::consts::FRAC_PI_2;
use std::sync::{Arc, Mutex};

use nalgebra::{Point2, Vector3};
use rand::RngExt;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;
use schemars::JsonSchema;
use serde::Deserialize;
use smart_default::SmartDefault;
use yamabico_core::behavior::{Outputs, ParameterError};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Beam, RangeScanHeader};
use yamabico_core::range_scan::{LaserScanner, MAX_BEAMS};
use yamabico_core::sensor::{DeviceError, Due, Sensor, SensorInfo, SensorKind};
use yamabico_core::time::Time;

use super::{Schedule, locked};
use crate::scene::PersonPose;
use crate::simulation::Simulation;
use crate::sonar::first_hit;

/// Parameters of a laser scanner.
#[derive(Clone, Debug, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct LidarConfig {
    /// Period of the scans. All ranges of a scan are measured at one time.
    #[default(100.0)]
    #[schemars(range(min = 5.0, max = 1000.0))]
    pub period_ms: f64,
    /// Delay from a scan to its delivery.
    #[default(20.0)]
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub latency_ms: f64,
    /// Number of ranges of a scan.
    #[default(360)]
    #[schemars(range(min = 2, max = 2048))]
    pub beams: u32,
    /// Angle that a scan covers, with its middle straight ahead of the scanner.
    #[default(360.0)]
    #[schemars(range(min = 1.0, max = 360.0))]
    pub fov_deg: f64,
    /// Direction of the scanner, positive to the left.
    #[schemars(range(min = -180.0, max = 180.0))]
    pub yaw_deg: f64,
    /// Position forward of the robot's center.
    #[schemars(range(min = -5.0, max = 5.0))]
    pub x_m: f64,
    /// Position left of the robot's center.
    #[schemars(range(min = -5.0, max = 5.0))]
    pub y_m: f64,
    /// Height above the floor.
    #[default(0.2)]
    #[schemars(range(min = 0.02, max = 3.0))]
    pub z_m: f64,
    /// Minimum range; what is nearer is reported as too near.
    #[default(0.1)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_m: f64,
    /// Maximum range; what is farther is not reported.
    #[default(8.0)]
    #[schemars(range(min = 0.1, max = 100.0))]
    pub max_m: f64,
    /// Fraction of ranges that are lost.
    #[default(0.01)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub dropout: f64,
    /// Standard deviation of the range.
    #[default(0.01)]
    #[schemars(range(min = 0.0, max = 0.2))]
    pub noise_m: f64,
}

impl LidarConfig {
    fn scanner(&self) -> LaserScanner {
        let step_rad = self.fov_deg.to_radians() / f64::from(self.beams);
        LaserScanner {
            first_rad: -0.5 * (f64::from(self.beams) - 1.0) * step_rad,
            step_rad,
            min_m: self.min_m,
            max_m: self.max_m,
            mount: Pose2::new(self.x_m, self.y_m, self.yaw_deg.to_radians()),
        }
    }

    /// Returns the description of the sensor, and the size of a scan in bytes.
    ///
    /// # Errors
    /// A maximum range that is not above the minimum range.
    pub fn info(&self, name: &str) -> Result<(SensorInfo, usize), ParameterError> {
        if self.max_m <= self.min_m {
            return Err(ParameterError::new("max_m", "must be above min_m"));
        }
        let kind = SensorKind::Range { min_m: self.min_m, max_m: self.max_m };
        let info = super::info::<RangeScanHeader>(name, self.period_ms, self.latency_ms, kind);
        Ok((info, (self.beams as usize).min(MAX_BEAMS) * size_of::<Beam>()))
    }
}

/// Sensor that publishes laser scans.
pub struct Lidar {
    name: String,
    config: LidarConfig,
    simulation: Arc<Mutex<Simulation>>,
    random: Pcg64,
    schedule: Schedule,
    ranges: Vec<f32>,
    beams: Vec<Beam>,
    people: Vec<PersonPose>,
}

impl Lidar {
    /// Returns the sensor `name`, with noise from `seed`.
    #[must_use]
    pub fn new(name: &str, config: LidarConfig, simulation: Arc<Mutex<Simulation>>, seed: u64) -> Self {
        Self {
            name: name.to_owned(),
            schedule: Schedule::new(config.period_ms, config.latency_ms),
            random: crate::random::stream(seed, name),
            config,
            simulation,
            ranges: Vec::new(),
            beams: Vec::new(),
            people: Vec::new(),
        }
    }
}

impl Sensor for Lidar {
    fn poll(&mut self, now: Time, outputs: &mut Outputs<'_>) -> Result<Due, DeviceError> {
        let simulation = &mut *locked(&self.simulation, &self.name)?;
        simulation.advance(now);
        let scanner = self.config.scanner();
        while let Some((sequence, stamp)) = self.schedule.oldest(simulation.origin(), now) {
            let robot = simulation.at(stamp).pose;
            self.people.clear();
            self.people.extend(simulation.people(stamp));
            let at = robot.transform_point(Point2::new(scanner.mount.x, scanner.mount.y));
            let origin = Vector3::new(at.x, at.y, self.config.z_m);
            let first_rad = robot.theta + scanner.mount.theta + scanner.first_rad;
            self.ranges.clear();
            for i in 0..self.config.beams {
                // Every range draws both numbers, so that the random stream does not depend on the scene.
                let is_lost = self.random.random::<f64>() < self.config.dropout;
                let noise: f64 = self.random.sample(StandardNormal);
                let (sin, cos) = (first_rad + f64::from(i) * scanner.step_rad).sin_cos();
                let reach_m = self.config.max_m + 0.2;
                let direction = Vector3::new(cos, sin, 0.0);
                let hit = first_hit(&simulation.scene, &self.people, origin, direction, reach_m, FRAC_PI_2);
                self.ranges.push(match hit.map(|range_m| range_m + self.config.noise_m * noise) {
                    _ if is_lost => f32::NAN,
                    Some(range_m) if range_m < self.config.min_m => f32::NEG_INFINITY,
                    Some(range_m) => range_m as f32,
                    None => f32::INFINITY,
                });
            }
            self.beams.clear();
            // A scanner that lost every range has measured nothing.
            if scanner.beams(self.ranges.iter().copied(), &mut self.beams).is_err() {
                continue;
            }
            let (min_m, max_m) = (scanner.min_m, scanner.max_m);
            let header = RangeScanHeader { stamp_ns: stamp.0, sequence, min_m, max_m };
            outputs.publish(&self.name, &header, &self.beams)?;
        }
        Ok(Due::At(self.schedule.next(simulation.origin())))
    }
}
