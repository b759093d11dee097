//! Stream of sensor packets of the Open Interface.
//!
//! iRobot Create 2 Open Interface Specification (2018), "Stream" (opcode 148): header 19, number of bytes, packets with their
//! numbers, and a checksum with which all bytes add up to zero modulo 256.

use crate::framing::{Found, Frame};

/// First byte of a stream frame.
const HEADER: u8 = 19;
/// Packets of the stream in their order: number, and length in bytes.
pub(crate) const PACKETS: [(u8, usize); 11] = [
    (7, 1),  // bumps and wheel drops
    (8, 1),  // wall
    (9, 1),  // cliff left
    (10, 1), // cliff front left
    (11, 1), // cliff front right
    (12, 1), // cliff right
    (13, 1), // virtual wall
    (35, 1), // mode
    (43, 2), // left encoder
    (44, 2), // right encoder
    (45, 1), // light bumper
];
/// Number of bytes between the length and the checksum.
const CONTENT_LEN: usize = content_len();

const fn content_len() -> usize {
    let (mut len, mut i) = (0, 0);
    while i < PACKETS.len() {
        len += 1 + PACKETS[i].1;
        i += 1;
    }
    len
}

/// Contents of one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Readings {
    /// Bits: right bumper, left bumper, right wheel dropped, left wheel dropped.
    pub bumps: u8,
    /// True if the sensor on the right side sees a wall.
    pub wall: bool,
    /// True for a cliff at the left, front left, front right and right.
    pub cliffs: [bool; 4],
    /// True in the beam of a virtual wall.
    pub virtual_wall: bool,
    /// 0 off, 1 passive, 2 safe, 3 full.
    pub mode: u8,
    /// Counters of the left and the right wheel, which wrap.
    pub counts: [i16; 2],
    /// Bits of the light bumper from the left to the right: something is near.
    pub near: u8,
}

impl Frame for Readings {
    const MAX_LEN: usize = CONTENT_LEN + 3;

    fn at_start(bytes: &[u8]) -> Found<Readings> {
        if bytes[0] != HEADER || bytes.get(1).is_some_and(|len| usize::from(*len) != CONTENT_LEN) {
            return Found::Nothing;
        }
        let Some(frame) = bytes.get(..Self::MAX_LEN) else { return Found::Incomplete };
        let sum = frame.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
        match Readings::of(&frame[2..2 + CONTENT_LEN]) {
            Some(readings) if sum == 0 => Found::Frame(readings, Self::MAX_LEN),
            _ => Found::Nothing,
        }
    }
}

impl Readings {
    /// Reads the packets, or returns `None` if one has another number.
    fn of(mut content: &[u8]) -> Option<Readings> {
        let mut values = [0_u16; PACKETS.len()];
        for (value, (number, len)) in values.iter_mut().zip(PACKETS) {
            let (head, rest) = content.split_at_checked(1 + len)?;
            if head[0] != number {
                return None;
            }
            *value = head[1..].iter().fold(0, |value, byte| value << 8 | u16::from(*byte));
            content = rest;
        }
        let [bumps, wall, a, b, c, d, virtual_wall, mode, left, right, near] = values;
        Some(Readings {
            bumps: bumps as u8,
            wall: wall != 0,
            cliffs: [a, b, c, d].map(|cliff| cliff != 0),
            virtual_wall: virtual_wall != 0,
            mode: mode as u8,
            counts: [left as i16, right as i16],
            near: near as u8,
        })
    }

    /// Returns the bytes of a frame, as the robot sends it.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        let [a, b, c, d] = self.cliffs.map(u16::from);
        let values = [
            u16::from(self.bumps),
            u16::from(self.wall),
            a,
            b,
            c,
            d,
            u16::from(self.virtual_wall),
            u16::from(self.mode),
            self.counts[0] as u16,
            self.counts[1] as u16,
            u16::from(self.near),
        ];
        let mut frame = vec![HEADER, CONTENT_LEN as u8];
        for (value, (number, len)) in values.into_iter().zip(PACKETS) {
            frame.push(number);
            frame.extend(&value.to_be_bytes()[2 - len..]);
        }
        let sum = frame.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
        frame.push(sum.wrapping_neg());
        frame
    }

    /// Returns true if a wheel has dropped or a cliff is seen: the robot then leaves the safe mode by itself.
    #[must_use]
    pub fn is_unsafe(&self) -> bool {
        self.bumps & 0b1100 != 0 || self.cliffs.contains(&true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::framing::Framer;

    #[test]
    fn a_frame_survives_its_bytes() {
        let readings = Readings {
            bumps: 0b0110,
            wall: true,
            cliffs: [false, true, false, true],
            mode: 2,
            counts: [-32768, 19],
            near: 0x3f,
            ..Readings::default()
        };
        let bytes = readings.encode();
        assert_eq!(Readings::at_start(&bytes), Found::Frame(readings, bytes.len()));
        let mut framer = Framer::<Readings>::default();
        let mut seen = Vec::new();
        for byte in &bytes {
            framer.push(&[*byte], |frame| seen.push(frame));
        }
        assert_eq!(seen, [readings]);
    }

    #[test]
    fn a_damaged_frame_is_dropped_and_the_next_one_found() {
        let bytes = Readings { counts: [19, 19], ..Readings::default() }.encode();
        for damaged in 0..bytes.len() {
            let mut stream = bytes.clone();
            stream[damaged] ^= 0x40;
            stream.extend(&bytes);
            let mut framer = Framer::<Readings>::default();
            let mut seen = 0;
            framer.push(&stream, |_| seen += 1);
            assert_eq!((seen, framer.skipped()), (1, bytes.len() as u64), "byte {damaged}");
        }
    }
}
