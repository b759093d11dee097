//! An OpenCR board that is played by a thread: its registers, its wheels, and its heartbeat.

use std::time::{Duration, Instant};

use yamabico_core::geometry::Twist;
use yamabico_core::message::{Imu, Odometry};
use yamabico_serial::framing::Framer;
use yamabico_serial::turtlebot3::{BLOCK, BLOCK_LEN, HEARTBEAT, ID, Packet, STATUS, VELOCITY, WRITE, driver};

use crate::bench::{Bench, MAX_STOP_S};
use crate::plug::{Device, Plug};

const SENSORS: [(&str, &str); 2] = [("encoders", ""), ("imu", "")];
const M_PER_COUNT: f64 = 2.0 * std::f64::consts::PI * 0.033 / 4096.0;
const TRACK_M: f64 = 0.16;

/// The board. It zeroes the command half a second after the last change of the heartbeat, and has no age of commands.
struct OpenCr {
    registers: [u8; 256],
    framer: Framer<Packet>,
    answers: Vec<u8>,
    travel: [f64; 2],
    offset: i64,
    moved: Instant,
    beaten: Instant,
    beats: u64,
}

impl OpenCr {
    fn new(offset: i64) -> OpenCr {
        let now = Instant::now();
        let mut registers = [0; 256];
        registers[80..84].copy_from_slice(&9.81_f32.to_le_bytes());
        registers[96..100].copy_from_slice(&1.0_f32.to_le_bytes());
        OpenCr {
            registers,
            framer: Framer::default(),
            answers: Vec::new(),
            travel: [0.0; 2],
            offset,
            moved: now,
            beaten: now,
            beats: 0,
        }
    }

    fn word(&self, address: usize) -> i32 {
        i32::from_le_bytes(self.registers[address..address + 4].try_into().unwrap())
    }

    /// Commanded speeds, m/s and rad/s.
    fn command(&self) -> [f64; 2] {
        [usize::from(VELOCITY), usize::from(VELOCITY) + 20]
            .map(|address| 0.01 * f64::from(self.word(address)))
    }

    fn obey(&mut self, packet: &Packet) {
        let word =
            |i: usize| usize::from(u16::from_le_bytes([packet.parameters[i], packet.parameters[i + 1]]));
        assert_eq!(packet.id, ID);
        let mut parameters = vec![0];
        if packet.instruction == WRITE {
            let (address, data) = (word(0), &packet.parameters[2..]);
            if address == usize::from(HEARTBEAT) && self.registers[address] != data[0] {
                (self.beaten, self.beats) = (Instant::now(), self.beats + 1);
            }
            self.registers[address..address + data.len()].copy_from_slice(data);
        } else {
            assert_eq!((word(0), word(2)), (usize::from(BLOCK), usize::from(BLOCK_LEN)));
            parameters.extend(&self.registers[word(0)..word(0) + word(2)]);
        }
        Packet { id: ID, instruction: STATUS, parameters }.encode(&mut self.answers);
    }
}

impl Device for OpenCr {
    fn receive(&mut self, bytes: &[u8]) {
        let mut packets = Vec::new();
        self.framer.push(bytes, |packet| packets.push(packet));
        packets.iter().for_each(|packet| self.obey(packet));
    }

    fn turn(&mut self, out: &mut Vec<u8>) {
        if self.beaten.elapsed() > Duration::from_millis(500) {
            self.registers[usize::from(VELOCITY)..usize::from(VELOCITY) + 24].fill(0);
        }
        let dt = self.moved.elapsed().as_secs_f64();
        self.moved = Instant::now();
        let [linear, angular] = self.command();
        for (i, sign) in [(0, -1.0), (1, 1.0)] {
            self.travel[i] += (linear + sign * 0.5 * TRACK_M * angular) * dt;
            let count = ((self.travel[i] / M_PER_COUNT).floor() as i64 + self.offset) as i32;
            self.registers[136 + 4 * i..140 + 4 * i].copy_from_slice(&count.to_le_bytes());
        }
        out.append(&mut self.answers);
    }
}

fn open(plug: &Plug<OpenCr>) -> Bench {
    let mut bench = Bench::open(&driver(), &plug.port(), "", &SENSORS, Some(""));
    bench.run_until(2.0, "no odometry", |bench| !bench.messages::<Odometry>("encoders").is_empty());
    bench
}

#[test]
fn it_drives_through_noise_and_past_the_end_of_its_counters() {
    let plug = Plug::new(OpenCr::new(i64::from(i32::MAX) - 500));
    plug.set(|manners| manners.damage = 0.001);
    let mut bench = open(&plug);
    bench.twist = Some(Twist::planar(0.1, 0.5));
    bench.run(2.0);
    assert_eq!(plug.device().command(), [0.1, 0.5]);
    bench.twist = Some(Twist::ZERO);
    bench.run(0.2);
    plug.set(|manners| manners.damage = 0.0);
    bench.run(0.3);
    let odometry = bench.messages::<Odometry>("encoders");
    let travel = plug.device().travel;
    let (last, turned) = (odometry.last().unwrap(), (travel[1] - travel[0]) / TRACK_M);
    assert!((last.theta - turned).abs() < 0.005 && turned > 0.5, "{} {turned}", last.theta);
    assert!(odometry.len() > 20, "{}", odometry.len());
    let imu = *bench.messages::<Imu>("imu").last().unwrap();
    assert!((imu.linear_acceleration[2] - 9.81).abs() < 1e-6 && imu.roll == 0.0 && imu.pitch == 0.0);
}

#[test]
fn the_heartbeat_stops_with_the_commands() {
    let plug = Plug::new(OpenCr::new(0));
    let mut bench = open(&plug);
    assert_eq!(plug.device().beats, 0, "no command, no beat");
    bench.twist = Some(Twist::planar(0.2, 0.0));
    bench.run(0.6);
    let beats = plug.device().beats;
    assert!((3..=8).contains(&beats) && plug.device().command()[0] == 0.2, "{beats}");
    bench.twist = None;
    let took_s = bench.run_until(1.0, "drives on", |_| plug.device().command() == [0.0; 2]);
    assert!((0.1..MAX_STOP_S).contains(&took_s), "{took_s}");
    let beats = plug.device().beats;
    bench.run(0.5);
    assert_eq!(plug.device().beats, beats, "no beat without a command");
    assert!(bench.messages::<Odometry>("encoders").len() > 20, "it still measures");
}

#[test]
fn a_pulled_cable_stops_the_board_and_it_comes_back() {
    let plug = Plug::new(OpenCr::new(0));
    let mut bench = open(&plug);
    bench.twist = Some(Twist::planar(0.2, 0.0));
    bench.run(0.5);
    plug.set(|manners| manners.is_pulled = true);
    let took_s = bench.run_until(1.0, "drives on", |_| plug.device().command() == [0.0; 2]);
    assert!(took_s < 0.3 + MAX_STOP_S, "{took_s}");
    bench.take::<Odometry>("encoders");
    plug.set(|manners| manners.is_pulled = false);
    let back_s = bench.run_until(2.0, "not back", |bench| {
        !bench.messages::<Odometry>("encoders").is_empty() && plug.device().command()[0] == 0.2
    });
    println!("turtlebot3: stopped {took_s:.2} s after the cable was pulled, back after {back_s:.2} s");
}
