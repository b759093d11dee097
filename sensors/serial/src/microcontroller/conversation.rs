//! Conversation with a microcontroller that speaks the line protocol.

use std::time::Duration;

use yamabico_core::message::{Beam, Bumper, NO_ECHO, Odometry, RangeScanHeader};
use yamabico_core::time::Time;

use super::message::{Line, MOTORS_OFF, Measurement, STOPPED_BY_WATCHDOG, Sonar, VERSION};
use crate::commanded::{Commanded, wheel_speeds};
use crate::dead_reckoning::{DeadReckoning, WheelGeometry, difference_of_32_bits};
use crate::framing::Framer;
use crate::line::Conversation;
use crate::parts::{Base, Outbox};
use crate::stamps::Stamper;

/// Time between two drive lines: a lost one costs no more. The robot's watchdog must be longer than three of them.
const REPEAT: Duration = Duration::from_millis(20);
/// Time between two questions for the robot's identity while it has not answered.
const HELLO_PERIOD: Duration = Duration::from_millis(500);
/// Silence after which the robot counts as reset: its speeds and its clock begin anew.
const SILENCE: Duration = Duration::from_millis(500);

/// Sonars of the robot.
#[derive(Clone, Debug, Default)]
pub(crate) struct SonarRing {
    /// Beam of each sonar without its range, in the order of the protocol.
    pub beams: Vec<Beam>,
    /// Minimum and maximum range, m.
    pub range_m: [f64; 2],
    /// Time of each reading since the last scan.
    pub read: Vec<Option<Time>>,
}

/// Conversation with a microcontroller.
pub(crate) struct Microcontroller {
    wheels: WheelGeometry,
    commanded: Commanded,
    framer: Framer<Line>,
    /// True once the robot has confirmed this version.
    is_known: bool,
    is_refused: bool,
    asked: Time,
    heard: Time,
    driven: Option<(Time, [i32; 2])>,
    drive_sequence: u16,
    state: u16,
    device_ms: i64,
    last_ms: Option<u32>,
    stamper: Stamper,
    odometer: DeadReckoning,
    ring: SonarRing,
    sequence: u64,
    scan_sequence: u64,
    pub odometry: Outbox<(Odometry, Vec<u8>)>,
    pub bumpers: Outbox<(Bumper, Vec<u8>)>,
    pub scans: Outbox<(RangeScanHeader, Vec<Beam>)>,
}

impl Microcontroller {
    pub fn new(wheels: WheelGeometry, ring: SonarRing, commanded: Commanded) -> Microcontroller {
        Microcontroller {
            wheels,
            commanded,
            framer: Framer::default(),
            is_known: false,
            is_refused: false,
            asked: Time::ZERO,
            heard: Time::ZERO,
            driven: None,
            drive_sequence: 0,
            state: 0,
            device_ms: 0,
            last_ms: None,
            stamper: Stamper::default(),
            odometer: DeadReckoning::new(wheels),
            ring,
            sequence: 0,
            scan_sequence: 0,
            odometry: Outbox::default(),
            bumpers: Outbox::default(),
            scans: Outbox::default(),
        }
    }

    fn take(&mut self, line: Line, arrival: Time) {
        match line {
            Line::Identity { version: VERSION, .. } => self.is_known = true,
            Line::Identity { version, name, .. } => {
                self.is_known = false;
                if !std::mem::replace(&mut self.is_refused, true) {
                    tracing::error!(
                        "firmware `{name}` speaks version {version} of the line protocol, this driver version {VERSION}: \
                         the robot is not driven; install the firmware of this version"
                    );
                }
            }
            Line::Measurement(measurement) => self.measure(&measurement, arrival),
            Line::Hello | Line::Drive { .. } => {}
        }
    }

    fn measure(&mut self, measurement: &Measurement, arrival: Time) {
        let stepped = self.last_ms.map_or(0, |last| measurement.time_ms.wrapping_sub(last) as i32);
        self.last_ms = Some(measurement.time_ms);
        self.device_ms += i64::from(stepped);
        self.heard = arrival;
        let device_s = 1e-3 * self.device_ms as f64;
        let stamp = self.stamper.stamp(device_s, arrival);
        self.sequence += 1;
        let (sequence, stamp_ns) = (self.sequence, stamp.0);
        self.odometer.read(device_s, measurement.counts.map(i64::from), difference_of_32_bits);
        self.odometry.push((self.odometer.odometry(stamp, sequence), Vec::new()));
        let pressed = u64::from(measurement.bumpers);
        self.bumpers.push((Bumper { stamp_ns, sequence, pressed }, Vec::new()));
        if let Some(oldest) = self.ring.take(&measurement.sonars, stamp) {
            let [min_m, max_m] = self.ring.range_m;
            // Consecutive: a missing number would count as a lost scan.
            self.scan_sequence += 1;
            let sequence = self.scan_sequence;
            let header = RangeScanHeader { stamp_ns: oldest.0, sequence, min_m, max_m };
            self.scans.push((header, self.ring.beams.clone()));
        }
        self.tell_state(measurement.state);
    }

    fn tell_state(&mut self, state: u16) {
        let begins = |bit: u16| state & bit != 0 && self.state & bit == 0;
        if begins(STOPPED_BY_WATCHDOG) && self.driven.is_some_and(|(_, speeds)| speeds != [0, 0]) {
            tracing::warn!("the robot's own watchdog stopped it: drive lines are lost or late");
        }
        if begins(MOTORS_OFF) {
            tracing::warn!("the robot's motors are switched off by hand");
        }
        self.state = state;
    }

    fn drive(&mut self, now: Time, out: &mut Vec<u8>) {
        // A robot without commands gets no line, so that its own watchdog works, too.
        if !self.commanded.is_fresh(now) && self.driven.is_none_or(|(_, speeds)| speeds == [0, 0]) {
            return;
        }
        let speeds = wheel_speeds(&self.commanded.twist(now), self.wheels.track_m, self.wheels.max_mps);
        let speeds = speeds.map(|mps| (mps / self.wheels.m_per_count).round() as i32);
        if self.driven.is_none_or(|(at, sent)| sent != speeds || now.since(at) >= REPEAT) {
            self.driven = Some((now, speeds));
            self.drive_sequence = self.drive_sequence.wrapping_add(1);
            Line::Drive { sequence: self.drive_sequence, speeds }.encode(out);
        }
    }
}

impl SonarRing {
    /// Enters the readings of a line. Returns the time of the oldest one once every sonar has been read since the last scan.
    fn take(&mut self, sonars: &[Sonar], stamp: Time) -> Option<Time> {
        for ((beam, read), sonar) in self.beams.iter_mut().zip(&mut self.read).zip(sonars) {
            let echo_m = match sonar {
                Sonar::Unchanged => continue,
                Sonar::Silent => None,
                Sonar::Echo(range_mm) => Some(f64::from(*range_mm) / 1000.0),
            };
            let [_, max_m] = self.range_m;
            let echo_m = echo_m.filter(|range_m| *range_m <= max_m);
            (beam.range_m, beam.flags) =
                (echo_m.unwrap_or(max_m), if echo_m.is_some() { 0 } else { NO_ECHO });
            // The first reading counts, so that the oldest one is not forgotten.
            read.get_or_insert(stamp);
        }
        let oldest = self.read.iter().copied().collect::<Option<Vec<Time>>>()?.into_iter().min()?;
        self.read.fill(None);
        Some(oldest)
    }
}

impl Conversation for Microcontroller {
    fn begin(&mut self, now: Time) {
        self.framer.clear();
        (self.is_known, self.asked, self.driven, self.heard) = (false, Time::ZERO, None, now);
    }

    fn receive(&mut self, bytes: &[u8], arrival: Time) {
        let mut lines = Vec::new();
        self.framer.push(bytes, |line| lines.push(line));
        lines.into_iter().for_each(|line| self.take(line, arrival));
    }

    fn turn(&mut self, now: Time, out: &mut Vec<u8>) {
        if now.since(self.heard) > SILENCE {
            self.is_known = false;
        }
        if !self.is_known && now.since(self.asked) >= HELLO_PERIOD {
            self.asked = now;
            Line::Hello.encode(out);
        }
        if self.is_known {
            self.drive(now, out);
        }
    }

    fn frames(&self) -> (u64, u64) {
        (self.framer.frames(), self.framer.skipped())
    }

    fn end(&mut self, out: &mut Vec<u8>) {
        self.drive_sequence = self.drive_sequence.wrapping_add(1);
        Line::Drive { sequence: self.drive_sequence, speeds: [0, 0] }.encode(out);
    }
}

impl Base for Microcontroller {
    fn commanded(&mut self) -> &mut Commanded {
        &mut self.commanded
    }
}
