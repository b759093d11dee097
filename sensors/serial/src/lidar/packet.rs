//! Packets of the lidars LD06, LD19 and LD08 (LDROBOT, "LD19 Development Manual"): 12 points at even angles.

use crate::framing::{Found, Frame};

/// First byte, and the second one: 12 points.
const HEADER: [u8; 2] = [0x54, 0x2c];
/// Number of points of a packet.
pub const POINTS: usize = 12;
/// Length of a packet, bytes.
const LEN: usize = 11 + 3 * POINTS;
/// A full turn, in hundredths of a degree.
pub const FULL_TURN: u16 = 36_000;
/// Largest angle between the first and the last point of a packet, hundredths of a degree: at 15 turns per second it is 13°.
const MAX_SPAN: u16 = 3000;

/// A packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Packet {
    /// Speed of rotation, degrees per second.
    pub speed: u16,
    /// Angle of the first and of the last point, hundredths of a degree, clockwise from ahead.
    pub angles: [u16; 2],
    /// Distance of each point, mm; zero without an echo.
    pub distances: [u16; POINTS],
    /// Strength of each echo; zero without one.
    pub intensities: [u8; POINTS],
    /// Time of the lidar, ms, which wraps at 30 000.
    pub stamp_ms: u16,
}

impl Packet {
    /// Returns the angle of the point `i`, degrees, clockwise from ahead.
    #[must_use]
    pub fn angle_deg(&self, i: usize) -> f64 {
        let span = f64::from(self.span()) / (POINTS - 1) as f64;
        (f64::from(self.angles[0]) + span * i as f64) / 100.0 % 360.0
    }

    /// Returns the angle from the first to the last point, hundredths of a degree.
    #[must_use]
    pub fn span(&self) -> u16 {
        let [first, last] = self.angles.map(|angle| angle % FULL_TURN);
        if last >= first { last - first } else { FULL_TURN - first + last }
    }

    /// Returns the bytes of the packet, as the lidar sends it.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = HEADER.to_vec();
        bytes.extend(self.speed.to_le_bytes());
        bytes.extend(self.angles[0].to_le_bytes());
        for (distance, intensity) in self.distances.iter().zip(self.intensities) {
            bytes.extend(distance.to_le_bytes());
            bytes.push(intensity);
        }
        bytes.extend(self.angles[1].to_le_bytes());
        bytes.extend(self.stamp_ms.to_le_bytes());
        bytes.push(checksum(&bytes));
        bytes
    }
}

impl Frame for Packet {
    const MAX_LEN: usize = LEN;

    fn at_start(bytes: &[u8]) -> Found<Packet> {
        if bytes.iter().zip(HEADER).any(|(byte, expected)| *byte != expected) {
            return Found::Nothing;
        }
        let Some(bytes) = bytes.get(..LEN) else { return Found::Incomplete };
        let word = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
        let packet = Packet {
            speed: word(2),
            angles: [word(4), word(LEN - 5)],
            distances: std::array::from_fn(|i| word(6 + 3 * i)),
            intensities: std::array::from_fn(|i| bytes[8 + 3 * i]),
            stamp_ms: word(LEN - 3),
        };
        let has_sum = checksum(&bytes[..LEN - 1]) == bytes[LEN - 1];
        let is_sound = has_sum && packet.angles.iter().all(|angle| *angle < FULL_TURN);
        if is_sound && packet.span() <= MAX_SPAN { Found::Frame(packet, LEN) } else { Found::Nothing }
    }
}

/// Returns the checksum: CRC-8 with the polynomial 0x4d, from zero.
fn checksum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |crc: u8, byte| {
        (0..8).fold(crc ^ byte, |crc, _| if crc & 0x80 == 0 { crc << 1 } else { crc << 1 ^ 0x4d })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_has_the_table_of_the_manual() {
        // First entries of the table in section 3 of the manual.
        let table: [u8; 17] = [
            0x00, 0x4d, 0x9a, 0xd7, 0x79, 0x34, 0xe3, 0xae, 0xf2, 0xbf, 0x68, 0x25, 0x8b, 0xc6, 0x11, 0x5c,
            0xa9,
        ];
        (0..17_u8).for_each(|byte| assert_eq!(checksum(&[byte]), table[usize::from(byte)]));
    }

    #[test]
    fn the_packet_of_the_manual_is_read() {
        // Example of section 3.2 of the manual.
        let bytes = [
            0x54, 0x2c, 0x68, 0x08, 0xab, 0x7e, 0xe0, 0x00, 0xe4, 0xdc, 0x00, 0xe2, 0xd9, 0x00, 0xe5, 0xd5,
            0x00, 0xe3, 0xd3, 0x00, 0xe4, 0xd0, 0x00, 0xe9, 0xcd, 0x00, 0xe4, 0xca, 0x00, 0xe2, 0xc7, 0x00,
            0xe9, 0xc5, 0x00, 0xe5, 0xc2, 0x00, 0xe5, 0xc0, 0x00, 0xe5, 0xbe, 0x82, 0x3a, 0x1a, 0x50,
        ];
        let Found::Frame(packet, LEN) = Packet::at_start(&bytes) else { panic!("not found") };
        assert_eq!((packet.speed, packet.angles), (2152, [32427, 33470]));
        assert_eq!((packet.distances[0], packet.distances[11], packet.intensities[0]), (224, 192, 228));
        assert!((packet.angle_deg(11) - 334.7).abs() < 1e-9);
        assert_eq!(packet.encode(), bytes);
    }
}
