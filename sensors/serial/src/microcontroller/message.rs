//! Lines of the protocol, `$fields*checksum` (see `docs/line-protocol.md`).

use crate::framing::{Found, Frame};

/// Version of the protocol.
pub const VERSION: u16 = 1;
/// Maximum number of sonars on a line.
pub const MAX_SONARS: usize = 8;
/// Length of the star, the checksum and the end of a line.
const TAIL_LEN: usize = 6;

/// A line between the computer and the robot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Line {
    /// Computer: which robot is this?
    Hello,
    /// Computer: speeds of the wheels.
    Drive {
        /// Number of the line. A line with the number of the one before does not count as new.
        sequence: u16,
        /// Counts per second of the left and the right wheel.
        speeds: [i32; 2],
    },
    /// Robot: answer to [`Line::Hello`], and after a reset.
    Identity {
        /// Version of the protocol that it speaks.
        version: u16,
        /// Name of the firmware.
        name: String,
        /// Time without a new drive line after which it stops its wheels, ms.
        watchdog_ms: u32,
    },
    /// Robot: its measurements.
    Measurement(Measurement),
}

/// Measurements of the robot.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Measurement {
    /// Number of the line.
    pub sequence: u16,
    /// Time of the robot, ms; wraps.
    pub time_ms: u32,
    /// Counters of the left and the right wheel; they wrap.
    pub counts: [i32; 2],
    /// Bits of the pressed bumpers.
    pub bumpers: u16,
    /// Number of the last drive line that the robot took.
    pub taken: u16,
    /// [`STOPPED_BY_WATCHDOG`] and [`MOTORS_OFF`].
    pub state: u16,
    /// Sonars in their order.
    pub sonars: Vec<Sonar>,
}

/// State bit: no new drive line came in time, and the wheels stand.
pub const STOPPED_BY_WATCHDOG: u16 = 1;
/// State bit: the motors are switched off by hand.
pub const MOTORS_OFF: u16 = 2;

/// Reading of a sonar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sonar {
    /// Not measured since the last line.
    Unchanged,
    /// No echo.
    Silent,
    /// Range, mm.
    Echo(u16),
}

impl Line {
    /// Appends the line to `out`.
    pub fn encode(&self, out: &mut Vec<u8>) {
        let fields = match self {
            Line::Hello => "H".to_owned(),
            Line::Drive { sequence, speeds: [left, right] } => format!("D,{sequence},{left},{right}"),
            Line::Identity { version, name, watchdog_ms } => format!("I,{version},{name},{watchdog_ms}"),
            Line::Measurement(measurement) => measurement.fields(),
        };
        let sum = checksum(fields.as_bytes());
        out.extend(format!("${fields}*{sum:04X}\n").into_bytes());
    }

    fn of(fields: &str) -> Option<Line> {
        let mut fields = fields.split(',');
        let line = match fields.next()? {
            "H" => Line::Hello,
            "D" => Line::Drive {
                sequence: number(&mut fields)?,
                speeds: [number(&mut fields)?, number(&mut fields)?],
            },
            "I" => Line::Identity {
                version: number(&mut fields)?,
                name: fields.next()?.to_owned(),
                watchdog_ms: number(&mut fields)?,
            },
            "M" => Line::Measurement(Measurement::of(&mut fields)?),
            _ => return None,
        };
        fields.next().is_none().then_some(line)
    }
}

impl Measurement {
    fn of<'a>(fields: &mut impl Iterator<Item = &'a str>) -> Option<Measurement> {
        let measurement = Measurement {
            sequence: number(fields)?,
            time_ms: number(fields)?,
            counts: [number(fields)?, number(fields)?],
            bumpers: number(fields)?,
            taken: number(fields)?,
            state: number(fields)?,
            sonars: fields.map(Sonar::of).collect::<Option<_>>()?,
        };
        (measurement.sonars.len() <= MAX_SONARS).then_some(measurement)
    }

    fn fields(&self) -> String {
        let [left, right] = self.counts;
        let (sequence, time_ms) = (self.sequence, self.time_ms);
        let mut fields =
            format!("M,{sequence},{time_ms},{left},{right},{},{},{}", self.bumpers, self.taken, self.state);
        for sonar in &self.sonars {
            fields += &match sonar {
                Sonar::Unchanged => ",".to_owned(),
                Sonar::Silent => ",-".to_owned(),
                Sonar::Echo(range_mm) => format!(",{range_mm}"),
            };
        }
        fields
    }
}

impl Sonar {
    fn of(field: &str) -> Option<Sonar> {
        match field {
            "" => Some(Sonar::Unchanged),
            "-" => Some(Sonar::Silent),
            range_mm => range_mm.parse().ok().map(Sonar::Echo),
        }
    }
}

fn number<'a, N: std::str::FromStr>(fields: &mut impl Iterator<Item = &'a str>) -> Option<N> {
    fields.next()?.parse().ok()
}

impl Frame for Line {
    const MAX_LEN: usize = 128;

    fn at_start(bytes: &[u8]) -> Found<Line> {
        if bytes[0] != b'$' {
            return Found::Nothing;
        }
        let rest = &bytes[1..bytes.len().min(Self::MAX_LEN)];
        // A line whose end was lost does not hide the next one.
        let is_end = |byte: &u8| !matches!(byte, b' '..=b'#' | b'%'..=b'~' | b'\r');
        let Some(end) = rest.iter().position(is_end) else {
            return if bytes.len() < Self::MAX_LEN { Found::Incomplete } else { Found::Nothing };
        };
        let len = end + 2;
        let text = rest[..end].strip_suffix(b"\r").unwrap_or(&rest[..end]);
        let Some((fields, tail)) = text.split_at_checked(text.len().saturating_sub(TAIL_LEN - 1)) else {
            return Found::Nothing;
        };
        let is_sound = rest[end] == b'\n' && tail == format!("*{:04X}", checksum(fields)).as_bytes();
        let line = std::str::from_utf8(fields).ok().filter(|_| is_sound).and_then(Line::of);
        line.map_or(Found::Nothing, |line| Found::Frame(line, len))
    }
}

/// Returns the checksum: CRC-16 with the polynomial 0x1021, from 0xffff, highest bit first (CCITT-FALSE).
#[must_use]
pub fn checksum(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0xffff, |crc: u16, byte| {
        (0..8).fold(
            crc ^ u16::from(*byte) << 8,
            |crc, _| {
                if crc & 0x8000 == 0 { crc << 1 } else { crc << 1 ^ 0x1021 }
            },
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::framing::Framer;

    fn lines() -> Vec<Line> {
        let sonars = vec![Sonar::Unchanged, Sonar::Silent, Sonar::Echo(812)];
        vec![
            Line::Hello,
            Line::Drive { sequence: 65_535, speeds: [-1200, i32::MAX] },
            Line::Identity { version: 1, name: "cart".into(), watchdog_ms: 200 },
            Line::Measurement(Measurement {
                sequence: 3,
                time_ms: u32::MAX,
                counts: [i32::MIN, 7],
                bumpers: 3,
                taken: 9,
                state: STOPPED_BY_WATCHDOG,
                sonars,
            }),
            Line::Measurement(Measurement::default()),
        ]
    }

    #[test]
    fn the_checksum_has_its_known_answer() {
        assert_eq!(checksum(b"123456789"), 0x29b1);
    }

    #[test]
    fn lines_survive_their_bytes() {
        let mut bytes = Vec::new();
        lines().iter().for_each(|line| line.encode(&mut bytes));
        let mut framer = Framer::<Line>::default();
        let mut seen = Vec::new();
        bytes.iter().for_each(|byte| framer.push(&[*byte], |line| seen.push(line)));
        assert_eq!(seen, lines());
        assert_eq!(framer.skipped(), 0);
    }

    #[test]
    fn a_line_without_its_end_does_not_hide_the_next_one() {
        let mut bytes = Vec::new();
        lines()[1].encode(&mut bytes);
        for cut in 1..bytes.len() {
            let stream = [&bytes[..cut], &bytes].concat();
            let mut framer = Framer::<Line>::default();
            let mut seen = 0;
            framer.push(&stream, |_| seen += 1);
            assert_eq!(seen, 1, "cut at {cut}");
        }
    }

    #[test]
    fn nonsense_with_a_checksum_is_no_line() {
        for fields in [
            "",
            "X",
            "D,1,2",
            "D,1,2,3,4",
            "D,-1,2,3",
            "M,1,2,3,4,5,6,7,x",
            "M,1,2,3,4,5,6,7,1,2,3,4,5,6,7,8,9",
        ] {
            let line = format!("${fields}*{:04X}\n", checksum(fields.as_bytes()));
            assert_eq!(Line::at_start(line.as_bytes()), Found::Nothing, "{fields}");
        }
    }
}
