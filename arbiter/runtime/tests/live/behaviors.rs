//! Behaviors that stand in for real ones: one that drives, and some that fail.

use std::time::Duration;

use yamabico_core::behavior::{
    Behavior, BuildError, Inputs, Outputs, Plugin, Setup, Slot, SlotInfo, factory,
};
use yamabico_core::message::{Axes, Odometry, Proposal, Twist};
use yamabico_core::plugins::Plugins;
use yamabico_core::testing::NoParameters;

use super::devices::{DRIVES, SENSORS, open};
use super::stand_ins::stand_in;

/// Drives straight on, whatever happens.
pub struct Runner;

impl Plugin for Runner {
    type Config = NoParameters;
    const NAME: &'static str = "runner";
    const SUMMARY: &'static str = "Drives straight on.";
    const INPUTS: &'static [SlotInfo] = &[];
    const CLAIMS: Axes = Axes::LINEAR;

    fn new(_: NoParameters, _: &Setup) -> Result<Self, BuildError> {
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

    fn new(_: NoParameters, _: &Setup) -> Result<Self, BuildError> {
        Ok(Broken)
    }
}

impl Behavior for Broken {
    fn propose(&mut self, _: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        panic!("as every time")
    }
}

/// Proposes what is no number.
pub struct Raving;

impl Plugin for Raving {
    type Config = NoParameters;
    const NAME: &'static str = "raving";
    const SUMMARY: &'static str = "Proposes what is no number.";
    const INPUTS: &'static [SlotInfo] = &[];
    const CLAIMS: Axes = Axes::PLANAR;

    fn new(_: NoParameters, _: &Setup) -> Result<Self, BuildError> {
        Ok(Raving)
    }
}

impl Behavior for Raving {
    fn propose(&mut self, _: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        Proposal::drive(Axes::PLANAR, Twist::planar(f64::NAN, f64::INFINITY))
    }
}

/// Drives straight on, and takes its time.
pub struct Sleepy;

/// How long it takes for each proposal.
pub const SLEEPS: Duration = Duration::from_millis(8);

impl Plugin for Sleepy {
    type Config = NoParameters;
    const NAME: &'static str = "sleepy";
    const SUMMARY: &'static str = "Takes its time.";
    const INPUTS: &'static [SlotInfo] = &[WHEELS_SLOT.info()];
    const CLAIMS: Axes = Axes::LINEAR;

    fn new(_: NoParameters, _: &Setup) -> Result<Self, BuildError> {
        Ok(Sleepy)
    }
}

pub const WHEELS_SLOT: Slot<Odometry> = Slot::required("wheels", "Odometry.");

impl Behavior for Sleepy {
    fn propose(&mut self, _: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        std::thread::sleep(SLEEPS);
        Proposal::drive(Axes::LINEAR, Twist::planar(0.2, 0.0))
    }
}

pub fn plugins() -> Plugins {
    Plugins {
        behaviors: vec![factory::<Runner>(), factory::<Broken>(), factory::<Raving>(), factory::<Sleepy>()],
        drivers: vec![stand_in(&SENSORS, &DRIVES, open).shared()],
    }
}
