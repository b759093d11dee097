//! A behavior of another program with a message type of its own: it turns odometry into the wind that the robot feels.

use std::process::ExitCode;

use schemars::JsonSchema;
use serde::Deserialize;
use yamabico_core::behavior::{Behavior, Inputs, Outputs, ParameterError, Plugin, Setup, Slot, SlotInfo};
use yamabico_core::message::{Axes, Odometry, Proposal, Reason};

yamabico_core::message_item! {
    /// A gust.
    pub struct Gust {
        /// Speed, m/s.
        pub speed_mps: f64,
        /// Direction in the robot frame, rad.
        pub azimuth_rad: f64,
    }
}

yamabico_core::message_type! {
    /// Wind at the robot, with its newest gusts.
    "acme.Wind.v1" Stream [Gust]
    pub struct Wind {
        /// Time of the measurement.
        pub stamp_ns: u64,
        /// Sequence number.
        pub sequence: u64,
        /// Mean speed, m/s.
        pub mean_mps: f64,
        /// Number of gusts since the start.
        pub gusts: u32,
        /// Zero.
        pub reserved: u32,
    }
}

const ODOMETRY: Slot<Odometry> = Slot::required("odometry", "motion of the robot");
const WIND: Slot<Wind> = Slot::optional("wind", "wind at the robot");

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Config {}

struct WindVane {
    sequence: u64,
}

impl Plugin for WindVane {
    type Config = Config;
    const NAME: &'static str = "wind-vane";
    const SUMMARY: &'static str = "Publishes the wind that the robot feels.";
    const INPUTS: &'static [SlotInfo] = &[ODOMETRY.info()];
    const OUTPUTS: &'static [SlotInfo] = &[WIND.info()];
    const CLAIMS: Axes = Axes::NONE;

    fn new(_: Config, _: &Setup) -> Result<Self, ParameterError> {
        Ok(WindVane { sequence: 0 })
    }
}

impl Behavior for WindVane {
    fn propose(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) -> Proposal {
        let Some(odometry) = inputs.latest(&ODOMETRY) else { return Proposal::abstain(Reason::NoInput) };
        self.sequence += 1;
        let wind = Wind {
            stamp_ns: odometry.header.stamp_ns,
            sequence: self.sequence,
            mean_mps: -odometry.header.vx,
            gusts: self.sequence as u32,
            reserved: 0,
        };
        let gusts = [Gust { speed_mps: 0.5, azimuth_rad: 1.0 }, Gust { speed_mps: 0.25, azimuth_rad: -1.0 }];
        // The output may have no subscriber.
        let _ = outputs.publish(WIND.name, &wind, &gusts);
        Proposal::abstain(Reason::Clear)
    }
}

fn main() -> ExitCode {
    yamabico_host::process::main::<WindVane>()
}
