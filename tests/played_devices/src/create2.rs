//! A Create 2: its modes, its stream, its wheels, and its habit of driving on.

use std::time::Instant;

use yamabico_serial::create2::Readings;

use crate::plug::Device;

/// Travel of a wheel for each count of its encoder, m.
const M_PER_COUNT: f64 = std::f64::consts::PI * 0.072 / 508.8;

/// The robot.
pub struct Roomba {
    /// Mode of the Open Interface: 0 off, 1 passive, 2 safe, 3 full.
    pub mode: u8,
    streams: bool,
    inbox: Vec<u8>,
    /// Speed of the left and the right wheel, m/s.
    pub speeds: [f64; 2],
    /// Travel of the left and the right wheel, m.
    pub travel: [f64; 2],
    /// Counters at the start.
    offset: i64,
    moved: Instant,
    begun: Instant,
    sent: u64,
    /// Bumps and dropped wheels, as in its packet 7.
    pub bumps: u8,
    /// Cliffs from left to right.
    pub cliffs: [bool; 4],
    /// Number of times that it was started by its command.
    pub starts: u32,
}

impl Roomba {
    /// Returns a robot whose encoders begin at `offset`.
    pub fn new(offset: i64) -> Roomba {
        let now = Instant::now();
        Roomba {
            mode: 1,
            streams: false,
            inbox: Vec::new(),
            speeds: [0.0; 2],
            travel: [0.0; 2],
            offset,
            moved: now,
            begun: now,
            sent: 0,
            bumps: 0,
            cliffs: [false; 4],
            starts: 0,
        }
    }

    /// Pulls the battery and puts it back.
    pub fn reset(&mut self) {
        *self = Roomba { starts: self.starts, ..Roomba::new(0) };
        self.mode = 0;
    }

    /// Counters of the encoders, which wrap.
    pub fn counts(&self) -> [i16; 2] {
        self.travel.map(|m| ((m / M_PER_COUNT).floor() as i64 + self.offset) as i16)
    }

    /// Obeys the first command of the inbox. Returns its length, or `None` if it is incomplete.
    fn obey(&mut self) -> Option<usize> {
        let inbox = &self.inbox;
        match *inbox.first()? {
            128 => {
                (self.mode, self.speeds) = (1, [0.0; 2]);
                self.starts += 1;
                Some(1)
            }
            131 => {
                if self.mode > 0 && self.bumps & 0b1100 == 0 && !self.cliffs.contains(&true) {
                    self.mode = 2;
                }
                Some(1)
            }
            145 => {
                let bytes: [u8; 4] = inbox.get(1..5)?.try_into().unwrap();
                let speed = |i: usize| f64::from(i16::from_be_bytes([bytes[i], bytes[i + 1]])) * 1e-3;
                if self.mode >= 2 {
                    self.speeds = [speed(2), speed(0)];
                }
                Some(5)
            }
            148 => {
                let len = 2 + usize::from(*inbox.get(1)?);
                inbox.get(len - 1)?;
                self.streams = self.mode > 0;
                (self.begun, self.sent) = (Instant::now(), 0);
                Some(len)
            }
            _ => Some(1),
        }
    }
}

impl Device for Roomba {
    fn receive(&mut self, bytes: &[u8]) {
        self.inbox.extend(bytes);
        while let Some(len) = self.obey() {
            self.inbox.drain(..len);
        }
    }

    fn turn(&mut self, out: &mut Vec<u8>) {
        let dt = self.moved.elapsed().as_secs_f64();
        self.moved = Instant::now();
        for (travel, speed) in self.travel.iter_mut().zip(self.speeds) {
            *travel += speed * dt;
        }
        if self.mode == 2 && (self.bumps & 0b1100 != 0 || self.cliffs.contains(&true)) {
            (self.mode, self.speeds) = (1, [0.0; 2]);
        }
        while self.streams && self.begun.elapsed().as_secs_f64() >= 0.015 * self.sent as f64 {
            self.sent += 1;
            let (bumps, cliffs, mode, counts) = (self.bumps, self.cliffs, self.mode, self.counts());
            out.extend(Readings { bumps, cliffs, mode, counts, ..Readings::default() }.encode());
        }
    }
}
