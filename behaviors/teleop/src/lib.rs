//! Drives as somebody holds a stick, and only while somebody does.
//!
//! A behavior like any other: what outranks it halts or steers the robot whatever the hand does, and what it outranks takes
//! over when the hand lets go.

use schemars::JsonSchema;
use serde::Deserialize;
use yamabico_core::behavior::{Behavior, BuildError, Inputs, Outputs, Plugin, Setup, Slot, SlotInfo};
use yamabico_core::message::{Axes, Axis, Proposal, Reason, Stick, Twist};
use yamabico_core::time::Time;

/// Where the stick is held.
pub const STICK: Slot<Stick> =
    Slot::required("stick", "where somebody holds the stick, from `yamabico teleop`");

/// A stick held later than now by more than this is nobody's, seconds.
const FUTURE_TOLERANCE_S: f64 = 0.02;

/// Parameters of [`Teleop`].
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Speed with the stick held all the way forward, back or to the side, m/s, 0.02 to 2, default 0.3.
    #[schemars(range(min = 0.02, max = 2.0))]
    pub speed_mps: f64,
    /// Turn rate with the stick held all the way round, rad/s, 0.05 to 3, default 0.8.
    #[schemars(range(min = 0.05, max = 3.0))]
    pub turn_radps: f64,
    /// The dead man's time: nobody holds a stick that was held longer ago, ms, 50 to 2000, default 300.
    #[schemars(range(min = 50.0, max = 2000.0))]
    pub dead_man_ms: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self { speed_mps: 0.3, turn_radps: 0.8, dead_man_ms: 300.0 }
    }
}

/// Drives as somebody holds a stick.
#[derive(Clone, Debug)]
pub struct Teleop {
    config: Config,
    axes: Axes,
}

impl Plugin for Teleop {
    type Config = Config;
    const NAME: &'static str = "teleop";
    const SUMMARY: &'static str = "Drives as somebody holds a stick, and only while somebody does.";
    const INPUTS: &'static [SlotInfo] = &[STICK.info()];
    const CLAIMS: Axes = Axes::ALL;

    fn new(config: Config, setup: &Setup) -> Result<Self, BuildError> {
        let limits = &setup.robot.limits.speed;
        let fastest = limits[Axis::Linear as usize];
        if setup.robot.axes.contains(Axis::Linear) && config.speed_mps > fastest {
            let problem = format!("{} m/s is more than the robot's {fastest} m/s", config.speed_mps);
            return Err(BuildError::new("speed_mps", problem));
        }
        Ok(Self { config, axes: setup.robot.axes })
    }
}

impl Behavior for Teleop {
    fn propose(&mut self, inputs: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        let Some(stick) = inputs.latest(&STICK).map(|stick| *stick.header) else {
            return Proposal::abstain(Reason::NoInput).with_note(format_args!("nobody holds the stick"));
        };
        let held = Time(stick.stamp_ns);
        let age_s = inputs.now().seconds_after(held);
        if age_s > self.config.dead_man_ms * 1e-3 {
            return Proposal::abstain(Reason::StaleInput)
                .with_evidence(inputs.now())
                .with_note(format_args!("the stick was let go {age_s:.1} s ago"));
        }
        match twist(&stick, &self.config).filter(|_| age_s > -FUTURE_TOLERANCE_S) {
            Some(twist) => Proposal::drive(self.axes, twist).with_evidence(held).with_note(format_args!(
                "stick {:+.0} % forward, {:+.0} % left, {:+.0} % round",
                100.0 * stick.forward,
                100.0 * stick.left,
                100.0 * stick.turn
            )),
            None => Proposal::abstain(Reason::MalformedInput),
        }
    }
}

/// What the stick asks for; `None` where it is held nowhere that a stick can be.
fn twist(stick: &Stick, config: &Config) -> Option<Twist> {
    let shares = [stick.forward, stick.left, stick.turn];
    shares.iter().all(|share| share.abs() <= 1.0).then_some(Twist {
        linear: stick.forward * config.speed_mps,
        lateral: stick.left * config.speed_mps,
        angular: stick.turn * config.turn_radps,
    })
}
