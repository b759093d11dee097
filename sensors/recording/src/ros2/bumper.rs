//! Bumpers: a `Bool`, the `Bump` of a Neato, or the hazards of a Create 3. The first two have no stamp.

use serde::Deserialize;
use yamabico_core::message::Bumper;

use super::Header;
use crate::measurement::{Measurement, Refusal};

#[derive(Deserialize)]
pub(super) struct Bool {
    data: u8,
}

impl Bool {
    pub(super) fn is_true(&self) -> bool {
        self.data != 0
    }
}

pub(super) fn contact(message: &Bool) -> Result<Measurement, Refusal> {
    pressed(&[message.data])
}

/// `neato2_interfaces/msg/Bump`.
#[derive(Deserialize)]
pub(super) struct Bump {
    left_front: u8,
    left_side: u8,
    right_front: u8,
    right_side: u8,
}

pub(super) fn neato(message: &Bump) -> Result<Measurement, Refusal> {
    pressed(&[message.left_front, message.left_side, message.right_front, message.right_side])
}

fn pressed(states: &[u8]) -> Result<Measurement, Refusal> {
    if states.iter().any(|state| *state > 1) {
        return Err(Refusal::Malformed("a bumper that is neither pressed nor free".to_owned()));
    }
    let bits = states.iter().enumerate().map(|(i, state)| u64::from(*state == 1) << i);
    Ok(Measurement::Bumper(Bumper { pressed: bits.sum(), ..Bumper::default() }))
}

/// `irobot_create_msgs/msg/HazardDetectionVector`.
#[derive(Deserialize)]
pub(super) struct Hazards {
    header: Header,
    detections: Vec<Hazard>,
}

#[derive(Deserialize)]
struct Hazard {
    header: Header,
    kind: u8,
}

/// Kinds of hazards that count as contact.
const BUMP: u8 = 1;
const CLIFF: u8 = 2;
const WHEEL_DROP: u8 = 4;
/// Frames of the zones of a bumper from left to right, the first in the lowest bit.
const ZONES: [&str; 5] =
    ["bump_left", "bump_front_left", "bump_front_center", "bump_front_right", "bump_right"];

/// Bits 0 to 4 are the zones of the bumper, 5 a zone of another name, 6 a cliff, 7 a dropped wheel.
pub(super) fn hazards(message: &Hazards) -> Result<Measurement, Refusal> {
    let bit = |hazard: &Hazard| match hazard.kind {
        BUMP => Some(ZONES.iter().position(|zone| *zone == hazard.header.frame_id).unwrap_or(ZONES.len())),
        CLIFF => Some(ZONES.len() + 1),
        WHEEL_DROP => Some(ZONES.len() + 2),
        _ => None,
    };
    let pressed = message.detections.iter().filter_map(bit).fold(0, |all, bit| all | 1 << bit);
    Ok(Measurement::Bumper(Bumper { pressed, stamp_ns: message.header.stamp_ns(), ..Bumper::default() }))
}
