//! Bumpers: a `Bool`, or the `Bump` of a Neato. Neither has a stamp.

use serde::Deserialize;
use yamabico_core::message::Bumper;

use crate::measurement::{Measurement, Refusal};

#[derive(Deserialize)]
pub(super) struct Bool {
    data: u8,
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
