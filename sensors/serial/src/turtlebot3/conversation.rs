//! Conversation with the OpenCR board: one block read at a time, commands, and a heartbeat.

use std::time::Duration;

use yamabico_core::message::{Bumper, Imu, Odometry};
use yamabico_core::time::Time;

use super::packet::{Packet, STATUS};
use super::table::{BLOCK, BLOCK_LEN, Block, HEARTBEAT, ID, TORQUE, VELOCITY, velocity};
use crate::commanded::{Commanded, wheel_speeds};
use crate::dead_reckoning::{DeadReckoning, WheelGeometry, difference_of_32_bits};
use crate::framing::Framer;
use crate::line::Conversation;
use crate::parts::{Base, Outbox};

/// Time after which an answer counts as lost.
const ANSWER_TIMEOUT: Duration = Duration::from_millis(60);
/// Time between two heartbeats. The board stops the wheels 0.5 s after the last one.
const HEARTBEAT_PERIOD: Duration = Duration::from_millis(100);
/// Time between two commands of the same speed: a lost one costs no more.
const REPEAT: Duration = Duration::from_millis(100);

/// Conversation with a TurtleBot3.
pub(crate) struct TurtleBot3 {
    wheels: WheelGeometry,
    period: Duration,
    commanded: Commanded,
    framer: Framer<Packet>,
    /// Time of the request whose answer is awaited.
    asked: Option<Time>,
    last_asked: Time,
    beat: u8,
    beaten: Time,
    driven: Option<(Time, [u8; 24])>,
    has_torque: bool,
    odometer: DeadReckoning,
    sequence: u64,
    pub odometry: Outbox<(Odometry, Vec<u8>)>,
    pub imu: Outbox<(Imu, Vec<u8>)>,
    pub bumpers: Outbox<(Bumper, Vec<u8>)>,
}

impl TurtleBot3 {
    pub fn new(wheels: WheelGeometry, period: Duration, commanded: Commanded) -> TurtleBot3 {
        TurtleBot3 {
            wheels,
            period,
            commanded,
            framer: Framer::default(),
            asked: None,
            last_asked: Time::ZERO,
            beat: 0,
            beaten: Time::ZERO,
            driven: None,
            has_torque: false,
            odometer: DeadReckoning::new(wheels),
            sequence: 0,
            odometry: Outbox::default(),
            imu: Outbox::default(),
            bumpers: Outbox::default(),
        }
    }

    fn take(&mut self, packet: &Packet, arrival: Time) {
        if packet.id != ID || packet.instruction != STATUS {
            return;
        }
        let Some((error, data)) = packet.parameters.split_first() else { return };
        if *error != 0 {
            tracing::warn!("the OpenCR board reports the error {error:#04x}");
        }
        // The answers to writes are empty.
        let Some((block, asked)) = Block::of(data).zip(self.asked) else { return };
        self.asked = None;
        // Measured between the request and the answer.
        let stamp = asked + arrival.since(asked) / 2;
        self.sequence += 1;
        let (sequence, stamp_ns) = (self.sequence, stamp.0);
        self.odometer.read(stamp.as_secs_f64(), block.positions.map(i64::from), difference_of_32_bits);
        self.odometry.push((self.odometer.odometry(stamp, sequence), Vec::new()));
        self.bumpers.push((Bumper { stamp_ns, sequence, pressed: block.bumpers }, Vec::new()));
        let [roll, pitch] = block.roll_and_pitch();
        let (angular_velocity, linear_acceleration) = (block.gyro, block.acceleration);
        let imu = Imu { stamp_ns, sequence, angular_velocity, linear_acceleration, roll, pitch };
        self.imu.push((imu, Vec::new()));
    }

    fn drive(&mut self, now: Time, out: &mut Vec<u8>) {
        let twist = self.commanded.twist(now);
        let [left, right] = wheel_speeds(&twist, self.wheels.track_m, self.wheels.max_mps);
        let command = velocity(0.5 * (left + right), (right - left) / self.wheels.track_m);
        if self.driven.is_none_or(|(at, sent)| sent != command || now.since(at) >= REPEAT) {
            self.driven = Some((now, command));
            Packet::write(ID, VELOCITY, &command).encode(out);
        }
        // Without a heartbeat the board stops the wheels itself: it is a second watchdog only as long as no beat comes without
        // a fresh command.
        if self.commanded.is_fresh(now) && now.since(self.beaten) >= HEARTBEAT_PERIOD {
            self.beaten = now;
            self.beat = self.beat.wrapping_add(1);
            Packet::write(ID, HEARTBEAT, &[self.beat]).encode(out);
        }
    }

    fn ask(&mut self, now: Time, out: &mut Vec<u8>) {
        if self.asked.is_some_and(|asked| now.since(asked) < ANSWER_TIMEOUT)
            || now.since(self.last_asked) < self.period
        {
            return;
        }
        (self.asked, self.last_asked) = (Some(now), now);
        Packet::read(ID, BLOCK, BLOCK_LEN).encode(out);
    }
}

impl Conversation for TurtleBot3 {
    fn begin(&mut self, _: Time) {
        self.framer.clear();
        (self.asked, self.driven, self.has_torque) = (None, None, false);
    }

    fn receive(&mut self, bytes: &[u8], arrival: Time) {
        let mut packets = Vec::new();
        self.framer.push(bytes, |packet| packets.push(packet));
        packets.iter().for_each(|packet| self.take(packet, arrival));
    }

    fn turn(&mut self, now: Time, out: &mut Vec<u8>) {
        if !std::mem::replace(&mut self.has_torque, true) {
            Packet::write(ID, TORQUE, &[1]).encode(out);
        }
        self.drive(now, out);
        self.ask(now, out);
    }

    fn frames(&self) -> (u64, u64) {
        (self.framer.frames(), self.framer.skipped())
    }

    fn end(&mut self, out: &mut Vec<u8>) {
        Packet::write(ID, VELOCITY, &velocity(0.0, 0.0)).encode(out);
    }
}

impl Base for TurtleBot3 {
    fn commanded(&mut self) -> &mut Commanded {
        &mut self.commanded
    }
}
