//! Test doubles for behaviors: one that drives, and some that fail.

use std::time::Duration;

use yamabico_core::behavior::{
    Behavior, Inputs, Outputs, ParameterError, Plugin, Setup, Slot, SlotInfo, factory,
};
use yamabico_core::message::{Axes, Odometry, Proposal, Twist};
use yamabico_core::plugins::Plugins;
use yamabico_core::testing::NoParameters;

use super::devices::{DRIVES, SENSORS, open};
use crate::stand_ins::stand_in;

/// Drives straight ahead, whatever happens.
pub struct Runner;

impl Plugin for Runner {
    type Config = NoParameters;
    const NAME: &'static str = "runner";
    const SUMMARY: &'static str = "Drives straight on.";
    const INPUTS: &'static [SlotInfo] = &[];
    const CLAIMS: Axes = Axes::LINEAR;

    fn new(_: NoParameters, _: &Setup) -> Result<Self, ParameterError> {
        Ok(Runner)
    }
}

impl Behavior for Runner {
    fn propose(&mut self, _: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        Proposal::drive(Axes::LINEAR, Twist::planar(0.3, 0.0))
    }
}

/// Panics at every call.
pub struct Broken;

impl Plugin for Broken {
    type Config = NoParameters;
    const NAME: &'static str = "broken";
    const SUMMARY: &'static str = "Panics.";
    const INPUTS: &'static [SlotInfo] = &[];
    const CLAIMS: Axes = Axes::LINEAR;

    fn new(_: NoParameters, _: &Setup) -> Result<Self, ParameterError> {
        Ok(Broken)
    }
}

impl Behavior for Broken {
    fn propose(&mut self, _: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        panic!("a test panic")
    }
}

/// Proposes speeds that are not finite.
pub struct NotFinite;

impl Plugin for NotFinite {
    type Config = NoParameters;
    const NAME: &'static str = "not-finite";
    const SUMMARY: &'static str = "Proposes speeds that are not finite.";
    const INPUTS: &'static [SlotInfo] = &[];
    const CLAIMS: Axes = Axes::PLANAR;

    fn new(_: NoParameters, _: &Setup) -> Result<Self, ParameterError> {
        Ok(NotFinite)
    }
}

impl Behavior for NotFinite {
    fn propose(&mut self, _: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        Proposal::drive(Axes::PLANAR, Twist::planar(f64::NAN, f64::INFINITY))
    }
}

/// Drives straight ahead after a slow computation.
pub struct Slow;

/// Computing time of a proposal.
pub const COMPUTING_TIME: Duration = Duration::from_millis(8);

impl Plugin for Slow {
    type Config = NoParameters;
    const NAME: &'static str = "slow";
    const SUMMARY: &'static str = "Computes slowly.";
    const INPUTS: &'static [SlotInfo] = &[WHEELS_SLOT.info()];
    const CLAIMS: Axes = Axes::LINEAR;

    fn new(_: NoParameters, _: &Setup) -> Result<Self, ParameterError> {
        Ok(Slow)
    }
}

pub const WHEELS_SLOT: Slot<Odometry> = Slot::required("wheels", "Odometry.");

impl Behavior for Slow {
    fn propose(&mut self, _: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        std::thread::sleep(COMPUTING_TIME);
        Proposal::drive(Axes::LINEAR, Twist::planar(0.2, 0.0))
    }
}

pub fn plugins() -> Plugins {
    Plugins {
        behaviors: vec![factory::<Runner>(), factory::<Broken>(), factory::<NotFinite>(), factory::<Slow>()],
        drivers: vec![stand_in(&SENSORS, &DRIVES, open).shared()],
    }
}
