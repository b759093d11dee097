//! Drives ahead and slows down in front of obstacles.

use std::process::ExitCode;

use schemars::JsonSchema;
use serde::Deserialize;
use smart_default::SmartDefault;
use yamabico_core::behavior::{Behavior, Inputs, Outputs, ParameterError, Plugin, Setup, Slot, SlotInfo};
use yamabico_core::message::{Axes, NO_ECHO, Proposal, RangeScanHeader, Reason, Twist};

/// The input: wired to a sensor of the robot by `inputs = { sonar = "..." }` in the task file.
const SONAR: Slot<RangeScanHeader> = Slot::required("sonar", "ranges ahead of the robot");

/// The parameters: keys of `[behaviors.NAME]` in the task file. `yamabico check` refuses values out of range, `yamabico describe`
/// and editors show these texts.
#[derive(Debug, Deserialize, JsonSchema, SmartDefault)]
#[serde(deny_unknown_fields, default)]
struct Config {
    /// Speed while the path ahead is clear.
    #[default(0.3)]
    #[schemars(range(min = 0.02, max = 2.0))]
    speed_mps: f64,
    /// Distance from an obstacle at which the robot stops.
    #[default(0.6)]
    #[schemars(range(min = 0.1, max = 5.0))]
    stop_m: f64,
}

/// The behavior: its parameters, and whatever it keeps between two calls.
struct MyBehavior {
    config: Config,
}

impl Plugin for MyBehavior {
    type Config = Config;
    const NAME: &'static str = env!("CARGO_PKG_NAME");
    const SUMMARY: &'static str = "Drives ahead and slows down in front of obstacles.";
    const INPUTS: &'static [SlotInfo] = &[SONAR.info()];
    const CLAIMS: Axes = Axes::PLANAR;

    fn new(config: Config, _: &Setup) -> Result<Self, ParameterError> {
        Ok(MyBehavior { config })
    }
}

impl Behavior for MyBehavior {
    /// Called on every new scan. Without an input it abstains, and the behavior with the next lower priority drives.
    fn propose(&mut self, inputs: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        let Some(scan) = inputs.latest(&SONAR) else { return Proposal::abstain(Reason::NoInput) };
        let echoes = scan.items.iter().filter(|beam| beam.flags & NO_ECHO == 0).map(|beam| beam.range_m);
        let nearest_m = echoes.fold(scan.header.max_m, f64::min);
        // Full speed at twice the stopping distance or more. A value that is not finite stops the robot.
        let share = (nearest_m / self.config.stop_m - 1.0).clamp(0.0, 1.0);
        let speed = if share.is_finite() { share * self.config.speed_mps } else { 0.0 };
        Proposal::drive(Axes::PLANAR, Twist::planar(speed, 0.0))
    }
}

fn main() -> ExitCode {
    yamabico_host::process::main::<MyBehavior>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::{Beam, Kind};
    use yamabico_core::testing::Bench;

    /// The proposed speed, m/s, with an echo at `range_m`.
    fn speed_at(range_m: f64) -> f64 {
        let mut bench =
            Bench::<MyBehavior>::new("speed_mps = 0.4", Setup::default()).expect("valid parameters");
        let scan = RangeScanHeader { stamp_ns: 1, max_m: 3.0, ..Default::default() };
        bench.at(0.1).feed(&SONAR, &scan, &[Beam { range_m, ..Default::default() }]);
        bench.propose().twist.linear
    }

    #[test]
    fn it_slows_down_and_stops_in_front_of_an_obstacle() {
        assert_eq!(speed_at(2.0), 0.4);
        assert!((speed_at(0.9) - 0.2).abs() < 1e-9);
        assert_eq!(speed_at(0.5), 0.0);
        assert_eq!(speed_at(f64::NAN), 0.4, "a range that is not a number is ignored");
    }

    #[test]
    fn without_a_sonar_it_abstains() {
        let mut bench = Bench::<MyBehavior>::new("", Setup::default()).expect("valid parameters");
        assert_eq!(bench.propose().kind(), Some(Kind::Abstain));
    }
}
