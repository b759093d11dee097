//! Sonars on the GPIO lines of a single-board computer: the driver `gpio`.
//!
//! A [`Ring`](ring::Ring) fires its sonars one at a time, and an [`echo`] is made of the edges that the kernel stamped. Both know no
//! device: the lines are a trait, [`Lines`](ring::Lines), so that a test can play the worst of them.

pub mod config;
pub mod echo;
#[cfg(feature = "lines")]
mod kernel_lines;
pub mod ranger;
pub mod ring;

use std::path::Path;
use std::sync::Arc;

use yamabico_core::behavior::ParameterError;
use yamabico_core::driver::{
    Device, DeviceSpec, Driver, DriverInfo, PartSpec, SensorDescription, SensorOffer,
};
use yamabico_core::message::{Beam, Message, RangeScanHeader};
use yamabico_core::parameters::{read, schema_of};
use yamabico_core::sensor::{Sensor, SensorInfo, SensorKind};

use config::{ChipConfig, SonarConfig};

/// Returns the driver `gpio`, with sensors of the kind `sonars`. Without the feature `lines` it checks robot files, but opens nothing.
#[must_use]
pub fn driver() -> Arc<dyn Driver> {
    Arc::new(GpioDriver {
        info: DriverInfo {
            name: "gpio".into(),
            summary: "Sonars on the GPIO lines of a Raspberry Pi or another single-board computer.".into(),
            parameters: schema_of::<ChipConfig>(),
            files: Vec::new(),
            sensors: vec![SensorOffer::new::<RangeScanHeader, SonarConfig>(
                "sonars",
                "Sonars with a trigger and an echo line (HC-SR04 and its like), which fire one at a time; a scan once each has measured.",
            )],
            drives: Vec::new(),
        },
    })
}

struct GpioDriver {
    info: DriverInfo,
}

impl Driver for GpioDriver {
    fn info(&self) -> &DriverInfo {
        &self.info
    }

    fn describe_sensor(&self, sensor: &PartSpec, _: &Path) -> Result<SensorDescription, ParameterError> {
        let config: SonarConfig = read(&sensor.table)?;
        config.check()?;
        let period_s = config.period_s();
        let info = SensorInfo {
            name: sensor.name.clone(),
            message: RangeScanHeader::NAME,
            period_s,
            // A scan is stamped by its oldest measurement.
            latency_s: period_s,
            kind: SensorKind::Range { min_m: config.min_m, max_m: config.max_m },
        };
        Ok(SensorDescription { info, max_item_bytes: config.azimuths_deg.len() * size_of::<Beam>() })
    }

    fn open(&self, spec: DeviceSpec) -> Result<Device, ParameterError> {
        let chip: ChipConfig = read(&spec.table)?;
        if spec.sensors.len() > 1 {
            // Two rings would hear each other.
            let problem =
                format!("device `{}` has one sensor of the kind `sonars`: put all sonars into it", spec.name);
            return Err(ParameterError::new("kind", problem));
        }
        let sensor = |part: &PartSpec| -> Result<(String, Box<dyn Sensor>), ParameterError> {
            let config: SonarConfig = read(&part.table)?;
            config.check()?;
            Ok((part.name.clone(), open(&part.name, &chip, &config)?))
        };
        let sensors = spec.sensors.iter().map(sensor).collect::<Result<_, _>>()?;
        Ok(Device { sensors, drive: None, ground_truth: None, walls: Vec::new() })
    }
}

#[cfg(feature = "lines")]
fn open(name: &str, chip: &ChipConfig, config: &SonarConfig) -> Result<Box<dyn Sensor>, ParameterError> {
    let (path, wiring) = (chip.chip.clone(), config.wiring());
    let open = move || kernel_lines::KernelLines::open(&path, &wiring);
    let ranger = ranger::Ranger::start(name, ring::Ring::new(config.ring()), open);
    Ok(Box::new(ranger.map_err(|problem| ParameterError::new("chip", problem))?))
}

#[cfg(not(feature = "lines"))]
fn open(_: &str, _: &ChipConfig, _: &SonarConfig) -> Result<Box<dyn Sensor>, ParameterError> {
    let problem =
        "this program was built without GPIO lines: `cargo install --path arbiter/cli --features gpio`";
    Err(ParameterError::new("chip", problem))
}
