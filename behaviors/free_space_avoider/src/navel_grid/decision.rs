//! Decision from one image: forward, turn, or stop.

use super::weights::Weights;

/// Weight ahead from which on the path forward is blocked.
pub const AHEAD_LIMIT: f64 = 40.0;
/// Weight of a side from which on that side is blocked.
pub const SIDE_LIMIT: f64 = 80.0;

/// Direction of a turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Counterclockwise from above.
    Left,
    /// Clockwise from above.
    Right,
}

impl Side {
    /// Returns the sign of the turn rate: +1 for left, -1 for right.
    #[must_use]
    pub const fn sign(self) -> f64 {
        match self {
            Side::Left => 1.0,
            Side::Right => -1.0,
        }
    }
}

/// State of the path ahead: the robot's width over its stopping distance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Passage {
    /// Free with additional clearance.
    Open,
    /// Free without additional clearance.
    Narrow,
    /// Contains an obstacle.
    Obstructed,
}

/// One of the four decisions of the method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decision {
    /// Drive forward.
    Forward,
    /// Turn in place.
    Turn(Side),
    /// Stop: both sides are blocked.
    Stop,
}

/// Returns the side away from the obstacles with the higher weight. For equal weights it is `previous`, or left without
/// it.
#[must_use]
pub fn freer_side(weights: &Weights, previous: Option<Side>) -> Side {
    match weights.right.total_cmp(&weights.left) {
        std::cmp::Ordering::Greater => Side::Right,
        std::cmp::Ordering::Less => Side::Left,
        std::cmp::Ordering::Equal => previous.unwrap_or(Side::Left),
    }
}

/// Decides from the weights of one image.
///
/// Differs from \[1\]: forward below the limit ahead instead of above it, a turn away from the obstacles instead of
/// toward them, and never forward with an obstacle within the stopping distance.
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

/// Returns true if both sides are blocked.
#[must_use]
pub fn is_blocked(weights: &Weights) -> bool {
    weights.right.min(weights.left) >= SIDE_LIMIT
}
