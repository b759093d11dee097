//! Control table of the OpenCR board of a TurtleBot3 (addresses of `turtlebot3_node`, ROBOTIS).

/// Number of the board on the line.
pub const ID: u8 = 200;
/// First address of the block that is read, and its length.
pub const BLOCK: u16 = 10;
/// Length of the block, bytes: to the end of the wheels' positions.
pub const BLOCK_LEN: u16 = 134;

/// Counter that shows that the computer is alive.
pub const HEARTBEAT: u16 = 19;
/// Two bumpers, one byte each.
const BUMPERS: u16 = 28;
/// Angular velocity, rad/s; x, y and z as 32-bit floats.
const GYRO: u16 = 60;
/// Acceleration, m/s²; x, y and z as 32-bit floats.
const ACCELERATION: u16 = 72;
/// Orientation as a quaternion; w, x, y and z as 32-bit floats.
const ORIENTATION: u16 = 96;
/// Positions of the left and the right wheel, counts.
const POSITIONS: u16 = 136;
/// Nonzero if the wheels hold and turn.
pub const TORQUE: u16 = 149;
/// Commanded velocities, six 32-bit integers: linear x, y, z in 0.01 m/s, angular x, y, z in 0.01 rad/s.
pub const VELOCITY: u16 = 150;

/// Measurements in a block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    /// Bits of the two bumpers, the first in the lowest.
    pub bumpers: u64,
    /// Angular velocity about x, y and z, rad/s.
    pub gyro: [f64; 3],
    /// Acceleration along x, y and z, m/s².
    pub acceleration: [f64; 3],
    /// Attitude as a quaternion: w, x, y, z.
    pub orientation: [f64; 4],
    /// Positions of the left and the right wheel, counts that wrap at 32 bits.
    pub positions: [i32; 2],
}

impl Block {
    /// Reads a block, or returns `None` if its length is wrong.
    #[must_use]
    pub fn of(bytes: &[u8]) -> Option<Block> {
        if bytes.len() != usize::from(BLOCK_LEN) {
            return None;
        }
        let at = |address: u16, i: usize| -> Option<[u8; 4]> {
            let begin = usize::from(address - BLOCK) + 4 * i;
            bytes.get(begin..begin + 4)?.try_into().ok()
        };
        let float = |address, i| at(address, i).map(|bytes| f64::from(f32::from_le_bytes(bytes)));
        let triple = |address| Some([float(address, 0)?, float(address, 1)?, float(address, 2)?]);
        let [w, x, y, z] = [0, 1, 2, 3].map(|i| float(ORIENTATION, i));
        let position = |i| at(POSITIONS, i).map(i32::from_le_bytes);
        let bumper = |i: usize| u64::from(bytes[usize::from(BUMPERS - BLOCK) + i] != 0);
        Some(Block {
            bumpers: bumper(0) | bumper(1) << 1,
            gyro: triple(GYRO)?,
            acceleration: triple(ACCELERATION)?,
            orientation: [w?, x?, y?, z?],
            positions: [position(0)?, position(1)?],
        })
    }

    /// Returns roll and pitch, rad; a positive pitch looks down. NaN if the orientation is not a finite quaternion.
    #[must_use]
    pub fn roll_and_pitch(&self) -> [f64; 2] {
        let norm = self.orientation.iter().map(|q| q * q).sum::<f64>().sqrt();
        let [w, x, y, z] = self.orientation.map(|q| q / norm);
        let roll = (2.0 * (w * x + y * z)).atan2(1.0 - 2.0 * (x * x + y * y));
        let pitch = (2.0 * (w * y - z * x)).clamp(-1.0, 1.0).asin();
        if norm.is_finite() && norm > 0.0 { [roll, pitch] } else { [f64::NAN; 2] }
    }
}

/// Returns the bytes of a velocity command: forward m/s, turn rad/s.
#[must_use]
pub fn velocity(linear: f64, angular: f64) -> [u8; 24] {
    let hundredths = |speed: f64| ((100.0 * speed).round() as i32).to_le_bytes();
    let mut bytes = [0; 24];
    bytes[..4].copy_from_slice(&hundredths(linear));
    bytes[20..].copy_from_slice(&hundredths(angular));
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_is_read_at_its_addresses() {
        let mut bytes = vec![0; usize::from(BLOCK_LEN)];
        let mut put = |address: u16, data: &[u8]| {
            let begin = usize::from(address - BLOCK);
            bytes[begin..begin + data.len()].copy_from_slice(data);
        };
        put(29, &[1]);
        put(68, &0.5_f32.to_le_bytes());
        put(80, &9.81_f32.to_le_bytes());
        put(96, &0.5_f32.sqrt().to_le_bytes());
        put(104, &0.5_f32.sqrt().to_le_bytes());
        put(136, &(-7_i32).to_le_bytes());
        put(140, &i32::MAX.to_le_bytes());
        let block = Block::of(&bytes).unwrap();
        assert_eq!((block.bumpers, block.gyro, block.positions), (2, [0.0, 0.0, 0.5], [-7, i32::MAX]));
        assert!((block.acceleration[2] - 9.81).abs() < 1e-6);
        let [roll, pitch] = block.roll_and_pitch();
        assert!(roll.is_finite() && (pitch - std::f64::consts::FRAC_PI_2).abs() < 1e-3, "{roll} {pitch}");
        assert_eq!(Block::of(&bytes[1..]), None);
        let nonsense = Block { orientation: [f64::NAN; 4], ..block };
        assert!(nonsense.roll_and_pitch()[0].is_nan());
    }

    #[test]
    fn velocities_are_hundredths() {
        let bytes = velocity(-0.22, 2.84);
        assert_eq!(i32::from_le_bytes(bytes[..4].try_into().unwrap()), -22);
        assert_eq!(i32::from_le_bytes(bytes[20..].try_into().unwrap()), 284);
        assert_eq!(velocity(f64::NAN, 0.0), [0; 24]);
    }
}
