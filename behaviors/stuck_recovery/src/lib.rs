//! Recovers a robot that is commanded to drive but makes no progress.
//!
//! ```
//! use yamabico_core::behavior::Setup;
//! use yamabico_core::message::{DecisionHeader, Kind, Mode, Odometry, Twist};
//! use yamabico_core::testing::Bench;
//! use yamabico_stuck_recovery::{DECISION, ODOMETRY, StuckRecovery};
//!
//! let mut bench = Bench::<StuckRecovery>::new("progress_timeout_s = 2.0", Setup::default())?;
//! let mut proposal = None;
//! for stamp_ns in (0..=3_000_000_000).step_by(100_000_000) {
//!     let wished = Twist::planar(0.4, 0.0);
//!     let decision = DecisionHeader { stamp_ns, wished, mode: Mode::Driving.code(), ..Default::default() };
//!     bench.at(stamp_ns as f64 * 1e-9).feed(&ODOMETRY, &Odometry { stamp_ns, ..Default::default() }, &[]);
//!     proposal = Some(bench.feed(&DECISION, &decision, &[]).propose());
//! }
//! assert_eq!(proposal.and_then(|proposal| proposal.kind()), Some(Kind::Drive));
//! # Ok::<(), yamabico_core::behavior::ParameterError>(())
//! ```

pub mod config;
pub mod ladder;
pub mod maneuver;
pub mod room;
pub mod situation;
pub mod trail;

use yamabico_core::behavior::{Behavior, Inputs, Outputs, ParameterError, Plugin, Setup, Slot, SlotInfo};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{
    Axes, DecisionHeader, Name, ObstaclesHeader, Odometry, Proposal, RangeScanHeader, Reason, Twist,
};
use yamabico_core::odometry_track::travel;
use yamabico_core::time::Time;

use crate::config::{Config, Rung};
use crate::ladder::{Attempt, Ladder};
use crate::maneuver::Surroundings;
use crate::room::Room;
use crate::situation::Situation;
use crate::trail::Trail;

/// Input: wheel odometry.
pub const ODOMETRY: Slot<Odometry> =
    Slot::required("odometry", "progress, and the way on which the robot came");
/// Input: the arbiter's decisions.
pub const DECISION: Slot<DecisionHeader> =
    Slot::required("decision", "wishes and halts of the other behaviors");
/// Input: range scans.
pub const SONAR: Slot<RangeScanHeader> = Slot::preferred("sonar", "room at the sides, ahead and behind");
/// Input: obstacles around the robot.
pub const OBSTACLES: Slot<ObstaclesHeader> =
    Slot::preferred("obstacles", "what a camera saw in the way ahead and behind");

/// Distance below which the robot stands still, m.
const STILL_M: f64 = 0.01;
/// Angle below which the robot stands still, rad.
const STILL_RAD: f64 = 0.02;
/// Step from one odometry reading to the next above which the odometry frame has jumped, m and rad.
const JUMP_M: f64 = 0.2;
const JUMP_RAD: f64 = 0.5;

/// The behavior: abstains until the robot is stuck, then works through its ladder.
#[derive(Clone, Debug)]
pub struct StuckRecovery {
    config: Config,
    name: Name,
    ladder: Ladder,
    trail: Trail,
    radius_m: f64,
    room: Room,
    /// Stamp of the oldest sensor data behind `room`; none if it is unknown.
    room_evidence: Option<Time>,
    /// 1 if the next turn goes to the left, -1 if to the right.
    side: f64,
    odometry: Option<(Time, Pose2)>,
    /// Pose at which the robot came to a standstill, and when.
    stood: Option<(Time, Pose2)>,
    /// Rung of the last call.
    acting: Option<usize>,
}

impl Plugin for StuckRecovery {
    type Config = Config;
    const NAME: &'static str = "stuck-recovery";
    const SUMMARY: &'static str = "Recovers a robot that is commanded to drive but makes no progress.";
    const INPUTS: &'static [SlotInfo] = &[ODOMETRY.info(), DECISION.info(), SONAR.info(), OBSTACLES.info()];
    const CLAIMS: Axes = Axes::PLANAR;

    fn new(config: Config, setup: &Setup) -> Result<Self, ParameterError> {
        if config.away_m <= config.back_m.max(config.side_m) {
            let problem = format!(
                "must be above back_m, {} m, and side_m, {} m, which the robot drives itself, but is {} m: raise it",
                config.back_m, config.side_m, config.away_m
            );
            return Err(ParameterError::new("away_m", problem));
        }
        Ok(Self {
            name: Name::new(&setup.name),
            ladder: Ladder::new(&config),
            trail: Trail::default(),
            radius_m: setup.robot.radius_m,
            room: Room::UNKNOWN,
            room_evidence: None,
            side: 1.0,
            odometry: None,
            stood: None,
            acting: None,
            config,
        })
    }
}

impl Behavior for StuckRecovery {
    fn propose(&mut self, inputs: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        let now = inputs.now();
        self.take_odometry(inputs);
        self.take_room(inputs);
        let Some(((stamp, pose), decision)) = self.odometry.zip(inputs.latest(&DECISION)) else {
            self.pause();
            return Proposal::abstain(Reason::NoInput);
        };
        if !self.is_fresh(stamp, now) || !self.is_fresh(Time(decision.header.stamp_ns), now) {
            self.pause();
            return Proposal::abstain(Reason::StaleInput).with_evidence(stamp);
        }
        let situation = Situation::of(&decision, &self.name);
        let proposal = match self.ladder.advance(&pose, &situation, now) {
            Some(attempt) => self.attempt(attempt, &pose, &situation, now),
            None => self.watch(&pose, &situation),
        };
        proposal.with_evidence(self.evidence(stamp))
    }
}

impl StuckRecovery {
    fn take_odometry(&mut self, inputs: &Inputs<'_>) {
        for odometry in inputs.fresh(&ODOMETRY) {
            let (stamp, header) = (Time(odometry.header.stamp_ns), odometry.header);
            let pose = Pose2::new(header.x, header.y, header.theta);
            if pose.is_finite() && stamp.is_next(self.odometry.map(|(last, _)| last), inputs.now()) {
                let last = self.odometry.replace((stamp, pose));
                if last.is_some_and(|(_, last)| has_jumped(&last, &pose)) {
                    self.pause();
                    self.ladder.restart();
                    self.trail = Trail::default();
                }
                let stands = |stood: &Pose2| {
                    let (moved_m, turned_rad) = travel(stood, &pose);
                    moved_m < STILL_M && turned_rad < STILL_RAD
                };
                if self.stood.is_none_or(|(_, stood)| !stands(&stood)) {
                    self.stood = Some((stamp, pose));
                }
            }
        }
    }

    fn take_room(&mut self, inputs: &Inputs<'_>) {
        let scan = inputs.latest(&SONAR);
        let fresh = scan.filter(|scan| self.is_fresh(Time(scan.header.stamp_ns), inputs.now()));
        self.room_evidence = fresh.map(|scan| Time(scan.header.stamp_ns));
        self.room = fresh.map_or(Room::UNKNOWN, |scan| Room::of(scan.items, self.radius_m));
        let obstacles = inputs.latest(&OBSTACLES);
        if let Some(fresh) = obstacles.filter(|seen| self.is_fresh(Time(seen.header.stamp_ns), inputs.now()))
        {
            self.room = self.room.limited_by(fresh.items, self.radius_m);
            let evidence = Time(fresh.header.evidence_ns);
            self.room_evidence = Some(self.room_evidence.map_or(evidence, |scan| scan.min(evidence)));
        }
    }

    /// Stamp of the oldest sensor data behind the proposal, given that of the odometry.
    fn evidence(&self, odometry: Time) -> Time {
        let rung = self.acting.and_then(|index| self.config.ladder.get(index));
        let room = self.room_evidence.filter(|_| rung.is_some_and(|rung| rung.watches_room()));
        room.map_or(odometry, |room| room.min(odometry))
    }

    fn is_fresh(&self, stamp: Time, now: Time) -> bool {
        now.seconds_after(stamp) <= self.config.stale_ms * 1e-3 && !stamp.is_future(now)
    }

    /// Forgets what was observed before a time without fresh inputs.
    fn pause(&mut self) {
        self.ladder.pause();
        (self.stood, self.acting) = (None, None);
    }

    /// Abstains, and extends the trail.
    fn watch(&mut self, pose: &Pose2, situation: &Situation) -> Proposal {
        self.acting = None;
        self.trail.push(pose);
        match (situation.halter, self.ladder.long_halted_s()) {
            (Some(halter), Some(halted_s)) => Proposal::abstain(Reason::PassageBlocked)
                .with_note(format_args!("waiting for {halted_s:.0} s, halted by {halter}")),
            _ => Proposal::abstain(Reason::Clear),
        }
    }

    /// Executes a rung; one without motion or waiting time is skipped.
    fn attempt(&mut self, attempt: Attempt, pose: &Pose2, situation: &Situation, now: Time) -> Proposal {
        let mut attempt = attempt;
        // Backing off is the only motion that a halt of every axis may permit once it is wished.
        if let Some(halter) = situation.halter.filter(|_| attempt.rung != Rung::BackOff) {
            if maneuver::drives_ahead(&attempt, pose, self.side, &self.config) {
                return self.finish(attempt.rung, pose, now);
            }
            return Proposal::abstain(Reason::PassageBlocked).with_note(format_args!(
                "{} of {}, {}: waits, {halter} halts",
                attempt.index + 1,
                self.ladder.len(),
                attempt.rung.as_str()
            ));
        }
        for _ in 0..self.ladder.len() {
            if self.acting.replace(attempt.index) != Some(attempt.index) {
                self.begin(attempt.rung);
            }
            if let Some(twist) = self.twist(&attempt, pose, situation.is_held, now) {
                return self.drive(&attempt, twist, situation, now);
            }
            let skips = attempt.elapsed_s == 0.0 && situation.halter.is_none();
            let next = skips.then(|| self.ladder.skip(pose)).flatten();
            let Some(next) = next else { break };
            attempt = next;
        }
        self.finish(attempt.rung, pose, now)
    }

    /// Ends the attempt, and abstains.
    fn finish(&mut self, rung: Rung, pose: &Pose2, now: Time) -> Proposal {
        self.ladder.finish(pose, now);
        self.acting = None;
        Proposal::abstain(Reason::Clear).with_note(format_args!("{} done, handing back", rung.as_str()))
    }

    fn twist(&mut self, attempt: &Attempt, pose: &Pose2, is_held: bool, now: Time) -> Option<Twist> {
        let (room, side) = (self.room, self.side);
        let stood_s = self.stood.map_or(0.0, |(since, _)| now.seconds_after(since));
        let mut around = Surroundings { pose: *pose, stood_s, room, is_held, trail: &mut self.trail, side };
        maneuver::twist(attempt, &mut around, &self.config)
    }

    /// Chooses the side once, when the rung begins.
    fn begin(&mut self, rung: Rung) {
        if rung == Rung::Turn {
            self.side = self.room.wider_side(self.side);
        }
    }

    fn drive(&self, attempt: &Attempt, twist: Twist, situation: &Situation, now: Time) -> Proposal {
        let (number, count, rung) = (attempt.index + 1, self.ladder.len(), attempt.rung.as_str());
        // A robot that touches something and must not turn backs off straight at first.
        let leaves = attempt.rung == Rung::BackOff && situation.is_turn_held;
        let drive = Proposal::drive(Axes::PLANAR, twist);
        let proposal = if twist.linear == 0.0 || leaves { drive.uncoupled() } else { drive };
        if attempt.rung == Rung::Ask {
            let stuck_s = self.ladder.stuck_s(now);
            return proposal.with_reason(Reason::PassageBlocked).with_note(format_args!(
                "{number} of {count}, {rung}: please help, stuck again for {stuck_s:.0} s"
            ));
        }
        proposal
            .with_reason(Reason::Searching)
            .with_note(format_args!("{number} of {count}, {rung}, {:.1} s", attempt.elapsed_s))
    }
}

/// Returns true if the robot cannot have moved this far between two readings, such as after a restart of the base.
fn has_jumped(from: &Pose2, to: &Pose2) -> bool {
    let (moved_m, turned_rad) = travel(from, to);
    moved_m > JUMP_M || turned_rad > JUMP_RAD
}
