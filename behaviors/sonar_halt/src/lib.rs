//! Halts the robot while a sonar reports an echo nearer than a gate.
//!
//! ```
//! use yamabico_core::behavior::Setup;
//! use yamabico_core::message::{Beam, Kind, RangeScanHeader};
//! use yamabico_core::testing::Bench;
//! use yamabico_sonar_halt::{SONAR, SonarHalt};
//!
//! let mut bench = Bench::<SonarHalt>::new("gate_m = 0.5", Setup::default())?;
//! let beam = Beam { range_m: 0.4, ..Default::default() };
//! bench.at(0.1).feed(&SONAR, &RangeScanHeader { stamp_ns: 100_000_000, ..Default::default() }, &[beam]);
//! assert_eq!(bench.propose().kind(), Some(Kind::Halt));
//! # Ok::<(), yamabico_core::behavior::ParameterError>(())
//! ```
//!
//! Ohya, Kosaka & Kak (1998): sonars with a gate at 0.5 m; any echo halts. Differs from the paper: consecutive clean scans
//! release the halt, and a sonar that is silent, late or malformed halts like an echo.

pub mod gate;

use schemars::JsonSchema;
use serde::Deserialize;
use smart_default::SmartDefault;
use yamabico_core::behavior::{Behavior, Inputs, Outputs, ParameterError, Plugin, Setup, Slot, SlotInfo};
use yamabico_core::message::{Axes, Proposal, RangeScanHeader, Reason};
use yamabico_core::sensor::SensorKind;
use yamabico_core::time::Time;

use crate::gate::{Gate, Latch, Reading, Turning};

/// Input: the range scans.
pub const SONAR: Slot<RangeScanHeader> = Slot::required("sonar", "ranges ahead of the robot");

/// Tolerance for stamps in the future, s.
const FUTURE_TOLERANCE_S: f64 = 0.02;

/// Parameters of [`SonarHalt`].
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema, SmartDefault)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Range below which an echo halts the robot, measured from the sensor.
    #[default(0.5)]
    #[schemars(range(min = 0.05, max = 5.0))]
    pub gate_m: f64,
    /// Number of consecutive clean scans that release the halt.
    #[default(3)]
    #[schemars(range(min = 1, max = 100))]
    pub clean_readings: u32,
    /// Age of the newest scan above which the robot halts.
    #[default(300.0)]
    #[schemars(range(min = 20.0, max = 2000.0))]
    pub stale_ms: f64,
    /// Clearance around the robot's circle that turning in place requires.
    #[default(0.03)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub turning_margin_m: f64,
}

/// The behavior: halts while an echo is inside the gate, and while there is no valid scan.
#[derive(Clone, Debug)]
pub struct SonarHalt {
    gate: Gate,
    latch: Latch,
    stale_s: f64,
    last_stamp: Option<Time>,
    cause: Cause,
}

/// Reason for which the latch holds.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Cause {
    reason: Reason,
    turning: Turning,
    range_m: f64,
}

impl Cause {
    const fn without_range(reason: Reason) -> Self {
        Self { reason, turning: Turning::Closed, range_m: f64::NAN }
    }
}

impl Plugin for SonarHalt {
    type Config = Config;
    const NAME: &'static str = "sonar-halt";
    const SUMMARY: &'static str = "Halts the robot while a sonar sees something nearer than its gate.";
    const INPUTS: &'static [SlotInfo] = &[SONAR.info()];
    const CLAIMS: Axes = Axes::NONE;

    fn new(config: Config, setup: &Setup) -> Result<Self, ParameterError> {
        if let Some(SensorKind::Range { max_m, .. }) = setup.sensor(&SONAR).map(|sensor| &sensor.kind)
            && *max_m < config.gate_m
        {
            let problem = format!(
                "must be at most the sonar's range of {max_m} m, but is {} m: lower it",
                config.gate_m
            );
            return Err(ParameterError::new("gate_m", problem));
        }
        Ok(Self {
            gate: Gate {
                gate_m: config.gate_m,
                turning_radius_m: setup.robot.radius_m + config.turning_margin_m,
            },
            latch: Latch::new(config.clean_readings),
            stale_s: config.stale_ms * 1e-3,
            last_stamp: None,
            cause: Cause::without_range(Reason::NoInput),
        })
    }
}

impl Behavior for SonarHalt {
    fn propose(&mut self, inputs: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        self.check_losses(inputs);
        self.read_scans(inputs);
        self.check_age(inputs.now());
        self.proposal()
    }
}

impl SonarHalt {
    fn check_losses(&mut self, inputs: &Inputs<'_>) {
        if inputs.lost(&SONAR) > 0 {
            self.trip(Cause::without_range(Reason::Overflow));
        }
    }

    fn read_scans(&mut self, inputs: &Inputs<'_>) {
        for scan in inputs.fresh(&SONAR) {
            let stamp = Time(scan.header.stamp_ns);
            if stamp.seconds_after(inputs.now()) > FUTURE_TOLERANCE_S {
                self.trip(Cause::without_range(Reason::MalformedInput));
                continue;
            }
            let is_newer = self.last_stamp.is_none_or(|last| stamp > last);
            match self.gate.read(scan.items) {
                Reading::Clean if is_newer => self.latch.clean(),
                Reading::Clean => {}
                Reading::Echo { range_m, turning } => {
                    self.trip(Cause { reason: Reason::Echo, turning, range_m });
                }
                Reading::Malformed => self.trip(Cause::without_range(Reason::MalformedInput)),
            }
            if is_newer {
                self.last_stamp = Some(stamp);
            }
        }
    }

    fn check_age(&mut self, now: Time) {
        match self.last_stamp {
            None if self.cause.reason != Reason::NoInput => {}
            None => self.trip(Cause::without_range(Reason::NoInput)),
            Some(stamp) if now.seconds_after(stamp) > self.stale_s => {
                self.trip(Cause::without_range(Reason::SonarStale));
            }
            Some(_) => {}
        }
    }

    fn trip(&mut self, cause: Cause) {
        self.latch.trip();
        self.cause = cause;
    }

    fn proposal(&self) -> Proposal {
        let evidence = self.last_stamp.unwrap_or_default();
        if !self.latch.is_holding() {
            return Proposal::abstain(Reason::Clear).with_evidence(evidence);
        }
        let axes = match self.cause.turning {
            Turning::Open => Axes::LINEAR.union(Axes::LATERAL),
            Turning::Closed => Axes::ALL,
        };
        let halt = Proposal::halt(axes, self.cause.reason).with_evidence(evidence);
        if self.cause.range_m.is_nan() {
            return halt.with_note(format_args!("{}", self.cause.reason));
        }
        let missing = self.latch.missing();
        halt.with_note(format_args!("echo at {:.2} m; {missing} clean readings to go", self.cause.range_m))
    }
}
