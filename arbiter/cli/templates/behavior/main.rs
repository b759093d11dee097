//! Drives ahead, the slower the nearer something is.

use std::process::ExitCode;

use schemars::JsonSchema;
use serde::Deserialize;
use yamabico_core::behavior::{Behavior, BuildError, Inputs, Outputs, Plugin, Setup, Slot, SlotInfo};
use yamabico_core::message::{Axes, NO_ECHO, Proposal, RangeScanHeader, Reason, Twist};

/// What is ahead.
const SONAR: Slot<RangeScanHeader> = Slot::required("sonar", "ranges ahead of the robot");

/// The keys of its table in a task file; unit, range and default of each are told to `check` and `describe`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct Config {
    /// Speed where nothing is near, m/s, 0.02 to 2, default 0.3.
    #[schemars(range(min = 0.02, max = 2.0))]
    speed_mps: f64,
    /// It stands before anything nearer than this, m, 0.1 to 5, default 0.6.
    #[schemars(range(min = 0.1, max = 5.0))]
    stop_m: f64,
}

impl Default for Config {
    fn default() -> Self {
        Config { speed_mps: 0.3, stop_m: 0.6 }
    }
}

/// The behavior: what it keeps from one call to the next.
struct Creeper {
    config: Config,
}

impl Plugin for Creeper {
    type Config = Config;
    const NAME: &'static str = env!("CARGO_PKG_NAME");
    const SUMMARY: &'static str = "Drives ahead, the slower the nearer something is.";
    const INPUTS: &'static [SlotInfo] = &[SONAR.info()];
    const CLAIMS: Axes = Axes::PLANAR;

    fn new(config: Config, _: &Setup) -> Result<Self, BuildError> {
        Ok(Creeper { config })
    }
}

impl Behavior for Creeper {
    fn propose(&mut self, inputs: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        let Some(scan) = inputs.latest(&SONAR) else { return Proposal::abstain(Reason::NoInput) };
        let echoes = scan.items.iter().filter(|beam| beam.flags & NO_ECHO == 0).map(|beam| beam.range_m);
        let nearest_m = echoes.fold(scan.header.max_m, f64::min);
        // Full speed from twice the distance at which it stands; what is no number stands.
        let share = (nearest_m / self.config.stop_m - 1.0).clamp(0.0, 1.0);
        let speed = if share.is_finite() { share * self.config.speed_mps } else { 0.0 };
        Proposal::drive(Axes::PLANAR, Twist::planar(speed, 0.0))
    }
}

fn main() -> ExitCode {
    yamabico_host::process::main::<Creeper>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::{Beam, Kind};
    use yamabico_core::testing::Bench;

    fn speed_before(range_m: f64) -> f64 {
        let mut bench = Bench::<Creeper>::new("speed_mps = 0.4", Setup::default()).expect("a valid table");
        let scan = RangeScanHeader { stamp_ns: 1, max_m: 3.0, ..Default::default() };
        bench.at(0.1).feed(&SONAR, &scan, &[Beam { range_m, ..Default::default() }]);
        bench.propose().twist.linear
    }

    #[test]
    fn it_slows_down_and_stands_before_what_is_near() {
        assert_eq!(speed_before(2.0), 0.4);
        assert!((speed_before(0.9) - 0.2).abs() < 1e-9);
        assert_eq!(speed_before(0.5), 0.0);
        assert_eq!(speed_before(f64::NAN), 0.4, "no range is none that is near");
    }

    #[test]
    fn without_a_sonar_it_says_so() {
        let mut bench = Bench::<Creeper>::new("", Setup::default()).expect("a valid table");
        assert_eq!(bench.propose().kind(), Some(Kind::Abstain));
    }
}
