//! What the stand-ins for devices and behaviours share.

use std::time::Duration;

use schemars::JsonSchema;
use serde::Deserialize;
use yamabico_core::message::{Axes, Message, MessageType, Odometry};
use yamabico_core::sensor::{DrivePlugin, SensorInfo, SensorKind, SensorPlugin};

/// From one reading to the next.
pub const PERIOD: Duration = Duration::from_millis(20);

/// A table without keys.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Nothing {}

/// The schema of a table without keys.
pub fn schema() -> schemars::Schema {
    schemars::schema_for!(Nothing)
}

/// Odometry every [`PERIOD`].
pub const fn sensor(kind: &'static str) -> SensorPlugin {
    SensorPlugin {
        kind,
        summary: "Odometry.",
        message: MessageType::of::<Odometry>(),
        schema,
        describe: |name, _| {
            Ok(SensorInfo {
                name: name.into(),
                message: Odometry::NAME,
                period_s: PERIOD.as_secs_f64(),
                latency_s: 0.0,
                kind: SensorKind::Other,
            })
        },
        most_bytes: |_| Ok(0),
        check: |_, _| Ok(()),
    }
}

/// A drive forward, sideways not.
pub const fn drive(kind: &'static str) -> DrivePlugin {
    DrivePlugin { kind, summary: "Obeys.", axes: Axes::PLANAR, schema }
}
