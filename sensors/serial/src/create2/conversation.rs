//! Conversation with the Open Interface: modes, the stream, and drive commands.

use std::time::Duration;

use yamabico_core::message::{Beam, Bumper, Odometry, RangeScanHeader};
use yamabico_core::time::Time;

use super::proximity::Proximity;
use super::stream::{PACKETS, Readings};
use crate::commanded::{Commanded, wheel_speeds};
use crate::dead_reckoning::{DeadReckoning, WheelGeometry, difference_of_16_bits};
use crate::framing::Framer;
use crate::line::Conversation;
use crate::parts::{Base, Outbox};
use crate::stamps::PeriodicStamper;

/// Opcodes of the Open Interface.
const START: u8 = 128;
const SAFE: u8 = 131;
const DRIVE_DIRECT: u8 = 145;
const STREAM: u8 = 148;
/// Mode in which the robot drives and watches cliffs and wheel drops itself.
const SAFE_MODE: u8 = 2;

/// Period of the stream (Open Interface Specification, "Stream").
pub(crate) const STREAM_PERIOD: Duration = Duration::from_millis(15);
/// Time that the robot needs to change its mode.
const MODE_CHANGE: Duration = Duration::from_millis(50);
/// Silence after which the conversation begins anew: the robot was reset, or its stream stopped.
const SILENCE: Duration = Duration::from_millis(1000);
/// Silence after which a pulse tries to wake the robot.
const SLEEP: Duration = Duration::from_secs(5);
/// Time between two drive commands: a lost byte spoils one of them.
const REPEAT: Duration = Duration::from_millis(50);
/// Time on the floor, away from cliffs, after which a robot that left the safe mode is put back into it.
const SETTLED: Duration = Duration::from_secs(2);

/// Travel of a wheel per count: a wheel of 72 mm with 508.8 counts per revolution (Open Interface Specification, packet 43).
pub(crate) const M_PER_COUNT: f64 = std::f64::consts::PI * 0.072 / 508.8;

/// Step of the beginning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    Start,
    Safe,
    Stream,
    Running,
}

/// Conversation with a Create 2 or a Roomba.
pub(crate) struct Create2 {
    wheels: WheelGeometry,
    commanded: Commanded,
    framer: Framer<Readings>,
    step: Step,
    /// Time of the last step, of the last attempt to wake the robot, and of the last frame or of the beginning.
    stepped: Time,
    woken: Time,
    heard: Time,
    driven: Option<(Time, [i16; 2])>,
    /// Time since when the robot stands on the floor, away from cliffs.
    settled: Option<Time>,
    asked_for_safe: Time,
    stamper: PeriodicStamper,
    odometer: DeadReckoning,
    sequence: u64,
    pub odometry: Outbox<(Odometry, Vec<u8>)>,
    pub bumpers: Outbox<(Bumper, Vec<u8>)>,
    pub scans: Outbox<(RangeScanHeader, Vec<Beam>)>,
    mode: u8,
}

impl Create2 {
    pub fn new(track_m: f64, max_mps: f64, commanded: Commanded) -> Create2 {
        let wheels = WheelGeometry { m_per_count: M_PER_COUNT, track_m, max_mps };
        Create2 {
            wheels,
            commanded,
            framer: Framer::default(),
            step: Step::Start,
            stepped: Time::ZERO,
            woken: Time::ZERO,
            heard: Time::ZERO,
            driven: None,
            settled: None,
            asked_for_safe: Time::ZERO,
            stamper: PeriodicStamper::new(STREAM_PERIOD),
            odometer: DeadReckoning::new(wheels),
            sequence: 0,
            odometry: Outbox::default(),
            bumpers: Outbox::default(),
            scans: Outbox::default(),
            mode: SAFE_MODE,
        }
    }

    fn take(&mut self, readings: &Readings, stamp: Time, arrival: Time) {
        self.sequence += 1;
        let (sequence, stamp_ns) = (self.sequence, stamp.0);
        self.odometer.read(stamp.as_secs_f64(), readings.counts.map(i64::from), difference_of_16_bits);
        self.odometry.push((self.odometer.odometry(stamp, sequence), Vec::new()));
        self.bumpers.push((Bumper { stamp_ns, sequence, pressed: pressed(readings) }, Vec::new()));
        self.scans.push(Proximity::scan(readings, stamp_ns, sequence));
        self.settled = if readings.is_unsafe() { None } else { self.settled.or(Some(arrival)) };
        if readings.mode != self.mode {
            let name =
                ["off", "passive", "safe", "full"].get(usize::from(readings.mode)).unwrap_or(&"unknown");
            tracing::info!("the robot is in the mode `{name}`");
            self.mode = readings.mode;
        }
        self.heard = arrival;
    }

    /// Sends the beginning step by step: the robot needs time between changes of its mode.
    fn begin_step(&mut self, now: Time, out: &mut Vec<u8>) {
        if self.step == Step::Running || now.since(self.stepped) < MODE_CHANGE {
            return;
        }
        self.stepped = now;
        self.step = match self.step {
            Step::Start => {
                out.push(START);
                Step::Safe
            }
            Step::Safe => {
                out.push(SAFE);
                Step::Stream
            }
            Step::Stream | Step::Running => {
                out.extend([STREAM, PACKETS.len() as u8]);
                out.extend(PACKETS.map(|(number, _)| number));
                Step::Running
            }
        };
    }

    /// Puts a robot that left the safe mode back into it, once it has stood on the floor for a while.
    fn return_to_safe_mode(&mut self, now: Time, out: &mut Vec<u8>) {
        let is_settled = self.settled.is_some_and(|since| now.since(since) >= SETTLED);
        if self.mode != SAFE_MODE && is_settled && now.since(self.asked_for_safe) >= SETTLED {
            self.asked_for_safe = now;
            out.push(SAFE);
        }
    }

    fn drive(&mut self, now: Time, out: &mut Vec<u8>) {
        let speeds = wheel_speeds(&self.commanded.twist(now), self.wheels.track_m, self.wheels.max_mps);
        let [left, right] = speeds.map(|mps| (1000.0 * mps).round() as i16);
        let is_due = |(at, sent)| sent != [left, right] || now.since(at) >= REPEAT;
        if self.driven.is_none_or(is_due) {
            self.driven = Some((now, [left, right]));
            out.push(DRIVE_DIRECT);
            out.extend(right.to_be_bytes());
            out.extend(left.to_be_bytes());
        }
    }
}

impl Conversation for Create2 {
    fn begin(&mut self, now: Time) {
        self.framer.clear();
        (self.step, self.stepped, self.driven) = (Step::Start, Time::ZERO, None);
        (self.heard, self.settled, self.mode) = (now, None, SAFE_MODE);
    }

    fn receive(&mut self, bytes: &[u8], arrival: Time) {
        let mut frames = Vec::new();
        self.framer.push(bytes, |readings| frames.push(readings));
        if frames.is_empty() {
            return;
        }
        let stamps = self.stamper.stamps(frames.len(), arrival);
        frames.iter().zip(stamps).for_each(|(readings, stamp)| self.take(readings, stamp, arrival));
    }

    fn turn(&mut self, now: Time, out: &mut Vec<u8>) {
        if self.step == Step::Running && now.since(self.heard.max(self.stepped)) > SILENCE {
            (self.step, self.stepped) = (Step::Start, Time::ZERO);
        }
        self.begin_step(now, out);
        if self.step == Step::Running {
            self.return_to_safe_mode(now, out);
            self.drive(now, out);
        }
    }

    fn frames(&self) -> (u64, u64) {
        (self.framer.frames(), self.framer.skipped())
    }

    fn end(&mut self, out: &mut Vec<u8>) {
        out.extend([DRIVE_DIRECT, 0, 0, 0, 0]);
    }

    fn wants_waking(&mut self, now: Time) -> bool {
        let is_due = now.since(self.heard.max(self.woken)) > SLEEP;
        if is_due {
            self.woken = now;
        }
        is_due
    }
}

impl Base for Create2 {
    fn commanded(&mut self) -> &mut Commanded {
        &mut self.commanded
    }
}

/// Returns the bits of the message: left and right bumper, left and right wheel dropped, cliffs from the left to the right,
/// virtual wall.
fn pressed(readings: &Readings) -> u64 {
    let bumps = u64::from(readings.bumps);
    let bit = |i: u32| bumps >> i & 1;
    let cliffs =
        readings.cliffs.iter().enumerate().map(|(i, cliff)| u64::from(*cliff) << (4 + i)).sum::<u64>();
    bit(1) | bit(0) << 1 | bit(3) << 2 | bit(2) << 3 | cliffs | u64::from(readings.virtual_wall) << 8
}
