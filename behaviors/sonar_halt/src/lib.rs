//! Halts the robot while a sonar sees something nearer than its gate.
//!
//! Ohya, Kosaka & Kak (1998), section on the vision and sonar subsystems: sonars gated at half a meter, any echo halts.
//! Differs from \[1\]: three clean readings release, and a sonar that is silent, late or broken halts like an echo.

pub mod gate;

use schemars::JsonSchema;
use serde::Deserialize;
use yamabico_core::behavior::{Behavior, BuildError, Inputs, Outputs, Plugin, Setup, Slot, SlotInfo};
use yamabico_core::message::{Axes, Proposal, RangeScanHeader, Reason};
use yamabico_core::sensor::SensorKind;
use yamabico_core::time::Time;

use crate::gate::{Gate, Latch, Reading, Turning};

/// The sonar that is watched.
pub const SONAR: Slot<RangeScanHeader> = Slot::required("sonar", "ranges ahead of the robot");

/// A scan stamped later than now by more than this is refused, seconds.
const FUTURE_TOLERANCE_S: f64 = 0.02;

/// Parameters of [`SonarHalt`].
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// An echo nearer than this halts, m from the sensor, 0.05 to 5, default 0.5.
    #[schemars(range(min = 0.05, max = 5.0))]
    pub gate_m: f64,
    /// Clean scans in a row that release, 1 to 100, default 3.
    #[schemars(range(min = 1, max = 100))]
    pub clean_readings: u32,
    /// A sonar silent for longer halts, ms, 20 to 2000, default 300.
    #[schemars(range(min = 20.0, max = 2000.0))]
    pub stale_ms: f64,
    /// Room that turning in place needs around the robot's circle, m, 0 to 1, default 0.03.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub turning_margin_m: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self { gate_m: 0.5, clean_readings: 3, stale_ms: 300.0, turning_margin_m: 0.03 }
    }
}

impl Config {
    fn check(&self) -> Result<(), BuildError> {
        let between = |key: &str, value: f64, low: f64, high: f64| {
            if (low..=high).contains(&value) {
                Ok(())
            } else {
                Err(BuildError::new(key, format!("{value} is not between {low} and {high}")))
            }
        };
        between("gate_m", self.gate_m, 0.05, 5.0)?;
        between("clean_readings", f64::from(self.clean_readings), 1.0, 100.0)?;
        between("stale_ms", self.stale_ms, 20.0, 2000.0)?;
        between("turning_margin_m", self.turning_margin_m, 0.0, 1.0)
    }
}

/// Halts while something is nearer than the gate, and while the sonar cannot tell.
#[derive(Clone, Debug)]
pub struct SonarHalt {
    gate: Gate,
    latch: Latch,
    stale_s: f64,
    last_stamp: Option<Time>,
    cause: Cause,
}

/// Why the latch holds.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Cause {
    reason: Reason,
    turning: Turning,
    range_m: f64,
}

impl Cause {
    const fn blind(reason: Reason) -> Self {
        Self { reason, turning: Turning::Closed, range_m: f64::NAN }
    }
}

impl Plugin for SonarHalt {
    type Config = Config;
    const NAME: &'static str = "sonar-halt";
    const SUMMARY: &'static str = "Halts the robot while a sonar sees something nearer than its gate.";
    const INPUTS: &'static [SlotInfo] = &[SONAR.info()];
    const CLAIMS: Axes = Axes::NONE;

    fn new(config: Config, setup: &Setup) -> Result<Self, BuildError> {
        config.check()?;
        if let Some(SensorKind::Range { max_m, .. }) = setup.sensor(&SONAR).map(|sensor| &sensor.kind)
            && *max_m < config.gate_m
        {
            let problem = format!("{} m is beyond the sonar's range of {max_m} m", config.gate_m);
            return Err(BuildError::new("gate_m", problem));
        }
        Ok(Self {
            gate: Gate {
                gate_m: config.gate_m,
                turning_radius_m: setup.robot.radius_m + config.turning_margin_m,
            },
            latch: Latch::new(config.clean_readings),
            stale_s: config.stale_ms * 1e-3,
            last_stamp: None,
            cause: Cause::blind(Reason::NoInput),
        })
    }
}

impl Behavior for SonarHalt {
    fn propose(&mut self, inputs: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        self.count_losses(inputs);
        self.read_scans(inputs);
        self.watch_the_age(inputs.now());
        self.proposal()
    }
}

impl SonarHalt {
    fn count_losses(&mut self, inputs: &Inputs<'_>) {
        if inputs.lost(&SONAR) > 0 {
            self.trip(Cause::blind(Reason::Overflow));
        }
    }

    fn read_scans(&mut self, inputs: &Inputs<'_>) {
        for scan in inputs.fresh(&SONAR) {
            let stamp = Time(scan.header.stamp_ns);
            if stamp.seconds_after(inputs.now()) > FUTURE_TOLERANCE_S {
                self.trip(Cause::blind(Reason::MalformedInput));
                continue;
            }
            let is_newer = self.last_stamp.is_none_or(|last| stamp > last);
            match self.gate.read(scan.items) {
                Reading::Clean if is_newer => self.latch.clean(),
                Reading::Clean => {}
                Reading::Echo { range_m, turning } => {
                    self.trip(Cause { reason: Reason::Echo, turning, range_m });
                }
                Reading::Malformed => self.trip(Cause::blind(Reason::MalformedInput)),
            }
            if is_newer {
                self.last_stamp = Some(stamp);
            }
        }
    }

    fn watch_the_age(&mut self, now: Time) {
        match self.last_stamp {
            None if self.cause.reason != Reason::NoInput => {}
            None => self.trip(Cause::blind(Reason::NoInput)),
            Some(stamp) if now.seconds_after(stamp) > self.stale_s => {
                self.trip(Cause::blind(Reason::SonarStale));
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
