//! Packets of the Dynamixel protocol 2.0 (ROBOTIS e-Manual, "Protocol 2.0"): header, length, instruction, parameters with
//! stuffed bytes, and a checksum.

use crate::framing::{Found, Frame};

/// First bytes of every packet.
const HEADER: [u8; 4] = [0xff, 0xff, 0xfd, 0x00];
/// Bytes after which a further 0xfd is stuffed, so that no header occurs inside.
const STUFFED_AFTER: [u8; 3] = [0xff, 0xff, 0xfd];
/// Number of bytes before the instruction, and of the checksum.
const PREFIX_LEN: usize = 7;
const CHECKSUM_LEN: usize = 2;
/// Maximum number of parameters of a packet.
const MAX_PARAMETERS: usize = 256;

/// Instructions.
pub const READ: u8 = 0x02;
/// Writes to the control table.
pub const WRITE: u8 = 0x03;
/// Answer of a device; its first parameter is an error.
pub const STATUS: u8 = 0x55;

/// A packet without header, stuffing and checksum.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Packet {
    /// Number of the device.
    pub id: u8,
    /// Instruction, or [`STATUS`].
    pub instruction: u8,
    /// Parameters.
    pub parameters: Vec<u8>,
}

impl Packet {
    /// Returns the request to read `len` bytes at `address`.
    #[must_use]
    pub fn read(id: u8, address: u16, len: u16) -> Packet {
        let parameters = [address.to_le_bytes(), len.to_le_bytes()].concat();
        Packet { id, instruction: READ, parameters }
    }

    /// Returns the request to write `data` at `address`.
    #[must_use]
    pub fn write(id: u8, address: u16, data: &[u8]) -> Packet {
        Packet { id, instruction: WRITE, parameters: [&address.to_le_bytes()[..], data].concat() }
    }

    /// Appends the bytes of the packet to `out`.
    pub fn encode(&self, out: &mut Vec<u8>) {
        let begin = out.len();
        let mut content = vec![self.instruction];
        for byte in &self.parameters {
            content.push(*byte);
            if content.ends_with(&STUFFED_AFTER) {
                content.push(STUFFED_AFTER[2]);
            }
        }
        out.extend(HEADER);
        out.push(self.id);
        out.extend(((content.len() + CHECKSUM_LEN) as u16).to_le_bytes());
        out.extend(content);
        let sum = checksum(&out[begin..]);
        out.extend(sum.to_le_bytes());
    }
}

impl Frame for Packet {
    /// A stuffed byte follows three others at most.
    const MAX_LEN: usize = PREFIX_LEN + 1 + MAX_PARAMETERS + MAX_PARAMETERS / 3 + CHECKSUM_LEN;

    fn at_start(bytes: &[u8]) -> Found<Packet> {
        if bytes.iter().zip(HEADER).any(|(byte, expected)| *byte != expected) {
            return Found::Nothing;
        }
        let Some(&[id, low, high]) = bytes.get(HEADER.len()..PREFIX_LEN) else { return Found::Incomplete };
        let len = PREFIX_LEN + usize::from(u16::from_le_bytes([low, high]));
        if !(PREFIX_LEN + 1 + CHECKSUM_LEN..=Self::MAX_LEN).contains(&len) {
            return Found::Nothing;
        }
        let Some(packet) = bytes.get(..len) else { return Found::Incomplete };
        let (content, sum) = packet.split_at(len - CHECKSUM_LEN);
        if checksum(content).to_le_bytes() != *sum {
            return Found::Nothing;
        }
        let parameters = unstuffed(&content[PREFIX_LEN + 1..]);
        Found::Frame(Packet { id, instruction: content[PREFIX_LEN], parameters }, len)
    }
}

fn unstuffed(stuffed: &[u8]) -> Vec<u8> {
    let mut bytes: Vec<u8> = Vec::with_capacity(stuffed.len());
    let mut was_stuffed_after = false;
    for byte in stuffed {
        if was_stuffed_after && *byte == STUFFED_AFTER[2] {
            was_stuffed_after = false;
            continue;
        }
        bytes.push(*byte);
        was_stuffed_after = bytes.ends_with(&STUFFED_AFTER);
    }
    bytes
}

/// Returns the checksum of a packet: CRC-16 with the polynomial 0x8005, from zero, highest bit first.
fn checksum(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0, |crc: u16, byte| {
        (0..8).fold(
            crc ^ u16::from(*byte) << 8,
            |crc, _| {
                if crc & 0x8000 == 0 { crc << 1 } else { crc << 1 ^ 0x8005 }
            },
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::framing::Framer;

    #[test]
    fn the_example_of_the_manual_is_met() {
        // e-Manual, "Ping": FF FF FD 00 01 03 00 01 19 4E.
        let mut bytes = Vec::new();
        Packet { id: 1, instruction: 1, parameters: Vec::new() }.encode(&mut bytes);
        assert_eq!(bytes, [0xff, 0xff, 0xfd, 0, 1, 3, 0, 1, 0x19, 0x4e]);
        // "Read": present position of device 1, 4 bytes at 132.
        bytes.clear();
        Packet::read(1, 132, 4).encode(&mut bytes);
        assert_eq!(bytes, [0xff, 0xff, 0xfd, 0, 1, 7, 0, 2, 0x84, 0, 4, 0, 0x1d, 0x15]);
    }

    #[test]
    fn headers_in_the_data_are_stuffed() {
        let data = [0xff, 0xff, 0xfd, 0xff, 0xff, 0xfd, 0xfd, 0x00, 0xff];
        let packet = Packet::write(200, 150, &data);
        let mut bytes = Vec::new();
        packet.encode(&mut bytes);
        assert_eq!(bytes.windows(4).filter(|window| *window == HEADER).count(), 1);
        let mut framer = Framer::<Packet>::default();
        let mut seen = Vec::new();
        bytes.iter().for_each(|byte| framer.push(&[*byte], |packet| seen.push(packet)));
        assert_eq!(seen, [packet]);
    }
}
