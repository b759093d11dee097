//! The acute corner: with and without regard to its velocity the robot comes around it and touches nothing, and with it, sooner.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::Path;
use std::sync::atomic::AtomicBool;

use yamabico::plugins::plugins;
use yamabico_core::message::MessageType;
use yamabico_core::time::Time;
use yamabico_host::config::{Overrides, load};
use yamabico_runtime::execution::End;
use yamabico_runtime::record::Tap;
use yamabico_runtime::run::{Options, run};

const SEEDS: [u64; 3] = [1, 2, 3];

struct Nobody;

impl Tap for Nobody {
    fn message(&mut self, _: &str, _: &MessageType, _: Time, _: &[u8], _: &[u8]) {}
}

/// The time that all seeds take together, seconds.
fn time_s(velocity: &str) -> f64 {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/corner.toml");
    let set = vec![format!("behaviors.free-space-avoider.velocity=\"{velocity}\"")];
    let task = load(&file, &Overrides { robot: None, set }, &plugins()).unwrap_or_else(|e| panic!("{e}"));
    let drive = |seed| {
        let options = Options { seed, ..Options::default() };
        let ran = run(&task, &options, &AtomicBool::new(false), &mut Nobody, &mut |_| {}).unwrap();
        assert_eq!((ran.end, ran.summary.contacts), (End::Arrived, Some(0)), "{velocity}, seed {seed}");
        ran.summary.time_s
    };
    SEEDS.map(drive).iter().sum()
}

#[test]
fn the_robot_comes_around_sooner_if_it_considers_its_velocity() {
    let [considered_s, ignored_s] = ["considered", "ignored"].map(time_s);
    assert!(considered_s < ignored_s, "{considered_s} s and {ignored_s} s");
}
