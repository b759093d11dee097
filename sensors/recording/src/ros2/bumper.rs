//! Bumpers: a `Bool`, or the `Bump` of a Neato. Neither has a stamp.

use serde::Deserialize;
use yamabico_core::message::Bumper;

use crate::measurement::{Measurement, Refusal};

#[derive(Deserialize)]
pub(super) struct Bool {
    data: u8,
}

pub(super) fn contact(message: &Bool) -> Result<Measurement, Refusal> {
    pressed(&[i32::from(message.data)])
}

/// `neato2_interfaces/msg/Bump`.
#[derive(Deserialize)]
pub(super) struct Bump {
    left_front: i32,
    left_side: i32,
    right_front: i32,
    right_side: i32,
}

pub(super) fn neato(message: &Bump) -> Result<Measurement, Refusal> {
    pressed(&[message.left_front, message.left_side, message.right_front, message.right_side])
}

fn pressed(states: &[i32]) -> Result<Measurement, Refusal> {
    if states.iter().any(|state| !(0..=1).contains(state)) {
        return Err(Refusal::Malformed("a bumper that is neither pressed nor free".to_owned()));
    }
    let bits = states.iter().enumerate().map(|(i, state)| u64::from(*state == 1) << i);
    Ok(Measurement::Bumper(Bumper { pressed: bits.sum(), ..Bumper::default() }))
}
