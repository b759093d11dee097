//! What one picture alone says: forward, turn or stop.

use super::weights::Weights;

/// From this weight ahead on there is no way forward.
pub const AHEAD_LIMIT: f64 = 40.0;
/// From this weight on a side is blocked.
pub const SIDE_LIMIT: f64 = 80.0;

/// A side to turn to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Counterclockwise, seen from above.
    Left,
    /// Clockwise.
    Right,
}

impl Side {
    /// +1 for left, -1 for right: the sign of the turn rate.
    #[must_use]
    pub const fn sign(self) -> f64 {
        match self {
            Side::Left => 1.0,
            Side::Right => -1.0,
        }
    }
}

/// Whether the robot's own width fits as far as it needs to stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Passage {
    /// With room to spare.
    Open,
    /// Just so.
    Narrow,
    /// Something stands there.
    Obstructed,
}

/// The four answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decision {
    /// Drive on.
    Forward,
    /// Turn where it stands.
    Turn(Side),
    /// Blocked on both sides.
    Stop,
}

/// The side away from the heavier weight; equal weights: `previous`, or left where there was none.
#[must_use]
pub fn freer_side(weights: &Weights, previous: Option<Side>) -> Side {
    match weights.right.total_cmp(&weights.left) {
        std::cmp::Ordering::Greater => Side::Right,
        std::cmp::Ordering::Less => Side::Left,
        std::cmp::Ordering::Equal => previous.unwrap_or(Side::Left),
    }
}

/// The decision on one picture.
///
/// Differs from \[1\]: forward below the limit ahead and not above it, a turn away from the heavier side and not into it, and
/// never forward into what stands within the stopping distance.
#[must_use]
pub fn decide(weights: &Weights, passage: Passage, previous: Option<Side>) -> Decision {
    if weights.ahead < AHEAD_LIMIT && passage != Passage::Obstructed {
        Decision::Forward
    } else if is_blocked(weights) {
        Decision::Stop
    } else {
        Decision::Turn(freer_side(weights, previous))
    }
}

/// Whether both sides are blocked.
#[must_use]
pub fn is_blocked(weights: &Weights) -> bool {
    weights.right.min(weights.left) >= SIDE_LIMIT
}
