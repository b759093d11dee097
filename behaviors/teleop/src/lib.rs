//! Drives the robot by a joystick or the keyboard, only while the stick or key is held.
//!
//! An ordinary behavior with a priority: behaviors that outrank it halt or steer the robot whatever the operator does, and
//! behaviors below it take over when the operator lets go.
//!
//! ```
//! use yamabico_core::behavior::Setup;
//! use yamabico_core::message::Stick;
//! use yamabico_core::testing::Bench;
//! use yamabico_teleop::{STICK, Teleop};
//!
//! let mut bench = Bench::<Teleop>::new("speed_mps = 0.4", Setup::default())?;
//! let stick = Stick { stamp_ns: 1_000_000_000, forward: 0.5, ..Default::default() };
//! assert_eq!(bench.at(1.0).feed(&STICK, &stick, &[]).propose().twist.linear, 0.2);
//! # Ok::<(), yamabico_core::behavior::ParameterError>(())
//! ```

use schemars::JsonSchema;
use serde::Deserialize;
use smart_default::SmartDefault;
use yamabico_core::behavior::{Behavior, Inputs, Outputs, ParameterError, Plugin, Setup, Slot, SlotInfo};
use yamabico_core::message::{Axes, Axis, Proposal, Reason, Stick, Twist};
use yamabico_core::time::Time;

/// Input: the position of the stick.
pub const STICK: Slot<Stick> =
    Slot::required("stick", "position of the operator's stick, from `yamabico teleop`");

/// Parameters of [`Teleop`].
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema, SmartDefault)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Speed at full stick deflection forward, backward or sideways.
    #[default(0.3)]
    #[schemars(range(min = 0.02, max = 2.0))]
    pub speed_mps: f64,
    /// Turn rate at full rotation of the stick.
    #[default(0.8)]
    #[schemars(range(min = 0.05, max = 3.0))]
    pub turn_radps: f64,
    /// Dead-man timeout: age above which a stick message is ignored.
    #[default(300.0)]
    #[schemars(range(min = 50.0, max = 2000.0))]
    pub dead_man_ms: f64,
}

/// The behavior: proposes the twist of the stick while the stick is held.
#[derive(Clone, Debug)]
pub struct Teleop {
    config: Config,
    axes: Axes,
}

impl Plugin for Teleop {
    type Config = Config;
    const NAME: &'static str = "teleop";
    const SUMMARY: &'static str =
        "Drives the robot by a joystick or the keyboard, only while the stick or key is held.";
    const INPUTS: &'static [SlotInfo] = &[STICK.info()];
    const CLAIMS: Axes = Axes::ALL;

    fn new(config: Config, setup: &Setup) -> Result<Self, ParameterError> {
        let limits = &setup.robot.limits.speed;
        let fastest = limits[Axis::Linear as usize];
        if setup.robot.axes.contains(Axis::Linear) && config.speed_mps > fastest {
            let problem = format!(
                "must be at most the robot's {fastest} m/s, but is {} m/s: lower it",
                config.speed_mps
            );
            return Err(ParameterError::new("speed_mps", problem));
        }
        Ok(Self { config, axes: setup.robot.axes })
    }
}

impl Behavior for Teleop {
    fn propose(&mut self, inputs: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        let Some(stick) = inputs.latest(&STICK).map(|stick| *stick.header) else {
            return Proposal::abstain(Reason::NoInput).with_note(format_args!("no teleop command"));
        };
        let held = Time(stick.stamp_ns);
        let age_s = inputs.now().seconds_after(held);
        if age_s > self.config.dead_man_ms * 1e-3 {
            return Proposal::abstain(Reason::StaleInput)
                .with_evidence(inputs.now())
                .with_note(format_args!("no teleop command for {age_s:.1} s"));
        }
        match twist(&stick, &self.config).filter(|_| !held.is_future(inputs.now())) {
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

/// Returns the twist that the stick asks for; `None` if a deflection is not within -1 to 1.
fn twist(stick: &Stick, config: &Config) -> Option<Twist> {
    let shares = [stick.forward, stick.left, stick.turn];
    shares.iter().all(|share| share.abs() <= 1.0).then_some(Twist {
        linear: stick.forward * config.speed_mps,
        lateral: stick.left * config.speed_mps,
        angular: stick.turn * config.turn_radps,
    })
}
