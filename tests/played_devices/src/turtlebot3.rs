//! An OpenCR board of a TurtleBot3: its registers, its wheels, and its heartbeat.

use std::time::{Duration, Instant};

use yamabico_serial::framing::Framer;
use yamabico_serial::turtlebot3::{BLOCK, BLOCK_LEN, HEARTBEAT, ID, Packet, STATUS, VELOCITY, WRITE};

use crate::plug::Device;

/// Travel of a wheel for each count of its encoder, m.
const M_PER_COUNT: f64 = 2.0 * std::f64::consts::PI * 0.033 / 4096.0;
/// Distance between the wheels of a Burger, m.
pub const TRACK_M: f64 = 0.16;

/// The board. It zeroes the command half a second after the last change of the heartbeat, and has no age of commands.
pub struct OpenCr {
    registers: [u8; 256],
    framer: Framer<Packet>,
    answers: Vec<u8>,
    /// Travel of the left and the right wheel, m.
    pub travel: [f64; 2],
    offset: i64,
    moved: Instant,
    beaten: Instant,
    /// Number of heartbeats.
    pub beats: u64,
}

impl OpenCr {
    /// Returns a board whose encoders begin at `offset`.
    pub fn new(offset: i64) -> OpenCr {
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
    pub fn command(&self) -> [f64; 2] {
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
