//! Halts the robot before it drives into what sonars or a laser scanner see, and while a bumper is pressed.
//!
//! ```
//! use yamabico_core::behavior::Setup;
//! use yamabico_core::message::{Beam, Kind, RangeScanHeader};
//! use yamabico_core::testing::Bench;
//! use yamabico_sonar_halt::{SONAR, SonarHalt};
//!
//! // Without odometry every echo nearer than the gate counts.
//! let mut bench = Bench::<SonarHalt>::new("gate_m = 0.5", Setup::default())?;
//! let beam = Beam { range_m: 0.4, ..Default::default() };
//! bench.at(0.1).feed(&SONAR, &RangeScanHeader { stamp_ns: 100_000_000, ..Default::default() }, &[beam]);
//! assert_eq!(bench.propose().kind(), Some(Kind::Halt));
//! # Ok::<(), yamabico_core::behavior::ParameterError>(())
//! ```
//!
//! Ohya, Kosaka & Kak (1998): sonars with a gate at 0.5 m; any echo halts. Differs from the paper: only what is on the path
//! that the footprint sweeps halts, nearer than the stopping distance; what approaches by itself halts by its time to contact
//! (Lee 1976); consecutive clean scans release the halt; a sonar that is silent, late or malformed halts like an echo.

pub mod approach_watch;
pub mod config;
pub mod contact;
pub mod latch;
pub mod motion;
pub mod overlay;
pub mod range_gate;
pub mod reading;
pub mod swept_gate;
pub mod swept_path;
pub mod time_to_contact;

use yamabico_core::behavior::{Behavior, Inputs, Outputs, ParameterError, Plugin, Setup, Slot, SlotInfo};
use yamabico_core::geometry::Hypotenuse;
use yamabico_core::message::{
    Axes, Axis, Beam, Bumper, DecisionHeader, Odometry, Proposal, RangeScanHeader, Reason, Twist, View,
};
use yamabico_core::sensor::{MotionLimits, SensorKind};
use yamabico_core::time::Time;

use crate::approach_watch::{Approach, ApproachWatch};
use crate::config::{Config, GateRule};
use crate::contact::Contact;
use crate::latch::Latch;
use crate::motion::Motion;
use crate::overlay::Gate;
use crate::range_gate::RangeGate;
use crate::reading::{Reading, TRANSLATION};
use crate::swept_gate::{StoppingDistance, SweptGate};

/// Input: the range scans.
pub const SONAR: Slot<RangeScanHeader> =
    Slot::required("sonar", "ranges ahead of the robot, of sonars or of a laser scanner");
/// Input: the motion that the robot has.
pub const ODOMETRY: Slot<Odometry> =
    Slot::preferred("odometry", "measured motion; without it `gate_m` holds");
/// Input: the motion that is wished.
pub const DECISION: Slot<DecisionHeader> =
    Slot::preferred("decision", "wished motion; without it, straight ahead at full speed");
/// Input: the bumpers at the front of the robot.
pub const BUMPER: Slot<Bumper> = Slot::preferred("bumper", "contacts ahead; without it, only ranges halt");

/// The behavior: halts for an echo that forbids the motion, and while there is no valid scan.
#[derive(Clone, Debug)]
pub struct SonarHalt {
    config: Config,
    limits: MotionLimits,
    range_gate: RangeGate,
    swept_gate: SweptGate,
    watch: ApproachWatch,
    contact: Contact,
    translation: Latch,
    turning: Latch,
    /// Halt for something that approaches.
    approaching: Latch,
    slow: Latch,
    last_stamp: Option<Time>,
    cause: Cause,
    approach: Option<Approach>,
}

/// Reason of the newest halt.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Cause {
    /// An echo at this range, and the length of the path until contact, m.
    Echo { range_m: f64, path_m: Option<f64> },
    /// Something that comes nearer by itself.
    Approach(Approach),
    /// A pressed bumper.
    Contact,
    /// No valid scan.
    Fault(Reason),
}

impl Plugin for SonarHalt {
    type Config = Config;
    const NAME: &'static str = "sonar-halt";
    const SUMMARY: &'static str =
        "Halts the robot before it drives into what a sonar or a laser scanner sees.";
    const INPUTS: &'static [SlotInfo] = &[SONAR.info(), ODOMETRY.info(), DECISION.info(), BUMPER.info()];
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
        let robot = &setup.robot;
        let turning_radius_m = robot.radius_m + config.turning_margin_m;
        let translation = robot.axes.intersection(TRANSLATION);
        let emergency_mps2 = translation.iter().map(|axis| robot.limits.emergency[axis as usize]);
        let stopping = StoppingDistance {
            reaction_s: config.reaction_ms * 1e-3,
            deceleration_mps2: emergency_mps2.fold(config.deceleration_mps2, f64::min),
            reserve_m: config.reserve_m,
        };
        let [linear, lateral, _] = robot.limits.speed;
        let gate_m = match config.gate {
            GateRule::Range => config.gate_m,
            GateRule::SweptPath => {
                config.gate_m.max(stopping.from_speed_m(linear.hypotenuse(lateral)) + config.margin_m)
            }
        };
        Ok(Self {
            limits: robot.limits,
            range_gate: RangeGate { gate_m, turning_radius_m },
            swept_gate: SweptGate { radius_m: robot.radius_m + config.margin_m, turning_radius_m, stopping },
            watch: ApproachWatch::default(),
            contact: Contact::new(setup.sensor(&BUMPER).is_some()),
            translation: Latch::holding(config.clean_readings),
            turning: Latch::holding(config.clean_readings),
            approaching: Latch::released(config.clean_readings),
            slow: Latch::released(config.clean_readings),
            last_stamp: None,
            cause: Cause::Fault(Reason::NoInput),
            approach: None,
            config,
        })
    }
}

impl Behavior for SonarHalt {
    fn propose(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) -> Proposal {
        let motion = Motion::read(inputs, self.config.stale_ms * 1e-3);
        self.check_losses(inputs);
        for scan in inputs.fresh(&SONAR) {
            self.read_scan(&scan, &motion, inputs.now());
        }
        if !inputs.is_fresh(&SONAR)
            && let Some(scan) = inputs.latest(&SONAR)
        {
            // The motion may have changed since.
            self.read_scan(&scan, &motion, inputs.now());
        }
        self.check_age(inputs.now());
        self.check_contact(inputs, &motion);
        if let Some(scan) = inputs.latest(&SONAR) {
            outputs.draw(&SONAR, scan.header, |overlay| {
                let twists = self.twists(&motion);
                let gate = match &twists {
                    Some(twists) => Gate::Swept(&self.swept_gate, twists),
                    None => Gate::Range(&self.range_gate),
                };
                let is_blocked = self.translation.is_holding() || self.approaching.is_holding();
                overlay::draw(overlay, &scan, gate, is_blocked);
            });
        }
        self.proposal()
    }
}

impl SonarHalt {
    fn check_losses(&mut self, inputs: &Inputs<'_>) {
        if inputs.lost(&SONAR) > 0 {
            self.watch.forget();
            self.fail(Reason::Overflow);
        }
    }

    fn read_scan(&mut self, scan: &View<'_, RangeScanHeader>, motion: &Motion, now: Time) {
        let stamp = Time(scan.header.stamp_ns);
        if stamp.is_future(now) {
            self.fail(Reason::MalformedInput);
            return;
        }
        let is_newer = self.last_stamp.is_none_or(|last| stamp > last);
        let twists = self.twists(motion);
        let reading = match &twists {
            Some(twists) => self.swept_gate.read(scan.items, twists),
            None => self.range_gate.read(scan.items),
        };
        let stops = match reading {
            Reading::Malformed => {
                self.fail(Reason::MalformedInput);
                return;
            }
            Reading::Clean => Axes::NONE,
            Reading::Echo { range_m, path_m, stops } => {
                self.cause = Cause::Echo { range_m, path_m };
                stops
            }
        };
        if is_newer {
            self.last_stamp = Some(stamp);
            self.watch_approaches(motion.measured, stamp, scan.items);
        }
        let near = self.approach.filter(|approach| approach.time_s < self.config.halt_s);
        if let Some(approach) = near {
            self.cause = Cause::Approach(approach);
        }
        let is_slow = self.approach.is_some_and(|approach| approach.time_s < self.config.slow_s);
        update(&mut self.translation, stops.contains(Axis::Linear), is_newer);
        update(&mut self.turning, stops.contains(Axis::Angular), is_newer);
        // While approaches cannot be judged, nothing tells that they have ended.
        let is_judged = is_newer && self.watch.is_full();
        update(&mut self.approaching, near.is_some(), is_judged);
        update(&mut self.slow, is_slow, is_judged);
    }

    /// Twists whose swept path must be free; `None` if the fixed range holds.
    fn twists(&self, motion: &Motion) -> Option<[Twist; 2]> {
        motion.twists(&self.limits).filter(|_| self.config.gate == GateRule::SweptPath)
    }

    /// Finds what moves towards the robot; nothing while the robot's own motion is not known.
    fn watch_approaches(&mut self, measured: Option<Twist>, stamp: Time, beams: &[Beam]) {
        self.approach = None;
        match measured {
            Some(measured) => {
                self.watch.push(stamp, measured, beams);
                self.approach = self.watch.soonest();
            }
            None => self.watch.forget(),
        }
    }

    fn check_age(&mut self, now: Time) {
        match self.last_stamp {
            // Scans came, but none was usable.
            None if matches!(self.cause, Cause::Fault(Reason::MalformedInput | Reason::Overflow)) => {}
            None => self.fail(Reason::NoInput),
            Some(stamp) if now.seconds_after(stamp) > self.config.stale_ms * 1e-3 => {
                self.fail(Reason::SonarStale);
            }
            Some(_) => {}
        }
    }

    /// Reads the bumpers: a silent one is a fault; a contact holds the robot unless it backs off.
    fn check_contact(&mut self, inputs: &Inputs<'_>, motion: &Motion) {
        self.contact.update(inputs);
        if self.contact.is_silent(inputs.now(), self.config.stale_ms * 1e-3) {
            self.fail(Reason::StaleInput);
        } else if self.contact.blocks(motion) {
            self.translation.trip();
            self.turning.trip();
            self.cause = Cause::Contact;
        }
    }

    fn fail(&mut self, reason: Reason) {
        self.translation.trip();
        self.turning.trip();
        self.cause = Cause::Fault(reason);
    }

    fn proposal(&self) -> Proposal {
        let evidence = self.last_stamp.unwrap_or_default();
        let latches = [
            (self.translation, TRANSLATION),
            (self.approaching, TRANSLATION),
            (self.turning, Axes::from(Axis::Angular)),
        ];
        let halted = latches
            .into_iter()
            .filter(|(latch, _)| latch.is_holding())
            .fold(Axes::NONE, |halted, (_, axes)| halted.union(axes));
        if !halted.is_empty() {
            return self.halt(halted).with_evidence(evidence);
        }
        if self.slow.is_holding() {
            let speed = self.config.slow_mps;
            let limit = Proposal::limit(TRANSLATION, Twist::new(speed, speed, 0.0), Reason::Echo);
            return limit.with_evidence(evidence).with_note(format_args!("obstacle approaching"));
        }
        Proposal::abstain(Reason::Clear).with_evidence(evidence)
    }

    fn halt(&self, axes: Axes) -> Proposal {
        let latches = [self.translation, self.approaching, self.turning];
        let missing = latches.iter().map(Latch::missing).max().unwrap_or_default();
        match self.cause {
            Cause::Fault(reason) => Proposal::halt(axes, reason).with_note(format_args!("{reason}")),
            Cause::Echo { range_m, path_m: None } => Proposal::halt(axes, Reason::Echo)
                .with_note(format_args!("echo at {range_m:.2} m; {missing} clean scans to release")),
            Cause::Echo { range_m, path_m: Some(path_m) } => Proposal::halt(axes, Reason::Echo).with_note(
                format_args!("echo at {range_m:.2} m, {path_m:.2} m to contact; {missing} clean scans to release"),
            ),
            Cause::Contact => Proposal::halt(axes, Reason::Echo)
                .with_note(format_args!("a bumper is pressed: only backing off releases it")),
            Cause::Approach(Approach { time_s, closing_mps }) => Proposal::halt(axes, Reason::Echo)
                .with_note(format_args!(
                    "closing at {closing_mps:.1} m/s, {time_s:.1} s to contact; {missing} clean scans to release"
                )),
        }
    }
}

/// Trips a latch, or counts a clean reading of a new scan.
fn update(latch: &mut Latch, trips: bool, is_newer: bool) {
    if trips {
        latch.trip();
    } else if is_newer {
        latch.clean();
    }
}
