//! The intersection: the tracker takes over from the wall-follower, tells the distance, and hands over before the end.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::Path;
use std::sync::atomic::AtomicBool;

use yamabico::plugins::plugins;
use yamabico_core::message::{Intersection, Message, MessageType, RawMessage, Truth, View};
use yamabico_core::time::Time;
use yamabico_host::config::{Overrides, load};
use yamabico_runtime::execution::End;
use yamabico_runtime::record::Tap;
use yamabico_runtime::run::{Options, run};

/// World x at which the walls end, meters.
const END_M: f64 = 15.0;

/// Compares what is published with the truth.
#[derive(Default)]
struct Listener {
    x_m: f64,
    y_m: f64,
    heard: u32,
    /// Largest error of the distance, as a share of it.
    worst: f64,
    nearest_m: f64,
    /// Farthest from the middle of the corridor while messages come, meters.
    aside_m: f64,
}

impl Tap for Listener {
    fn message(&mut self, _: &str, message: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        let raw = RawMessage { header, items };
        if message.name == Truth::NAME {
            let truth = View::<Truth>::of(raw).unwrap().header;
            (self.x_m, self.y_m) = (truth.x, truth.y);
        } else if message.name == Intersection::NAME {
            let distance_m = View::<Intersection>::of(raw).unwrap().header.distance_m;
            let truth_m = END_M - self.x_m;
            self.heard += 1;
            self.worst = self.worst.max((distance_m - truth_m).abs() / truth_m);
            self.nearest_m = truth_m;
            self.aside_m = self.aside_m.max(self.y_m.abs());
        }
    }
}

#[test]
fn the_robot_steers_between_the_ends_of_the_walls_and_hands_over() {
    std::thread::scope(|scope| {
        for seeds in [[1, 2], [3, 4]] {
            scope.spawn(move || seeds.map(approach));
        }
    });
}

fn approach(seed: u64) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/intersection.toml");
    // Half a meter before the walls end is far enough: by then it is handed over.
    let overrides = Overrides { set: vec!["run.goal.x_m=14.5".into()], ..Overrides::default() };
    let task = load(&file, &overrides, &plugins()).unwrap_or_else(|e| panic!("{e}"));
    let mut listener = Listener::default();
    let options = Options { seed, ..Options::default() };
    let ran = run(&task, &options, &AtomicBool::new(false), &mut listener, &mut |_| {}).unwrap();
    let summary = &ran.summary;
    assert_eq!((ran.end, summary.contacts), (End::Arrived, Some(0)), "seed {seed}");
    let in_control_s = |name: &str| summary.control_s.get(name).copied().unwrap_or(0.0);
    assert!(in_control_s("intersection-tracker") > 20.0, "seed {seed}: {:?}", summary.control_s);
    assert!(in_control_s("wall-follower") > 1.0, "seed {seed}: {:?}", summary.control_s);
    assert!(listener.heard > 1000, "seed {seed}: {} messages", listener.heard);
    assert!(listener.worst < 0.05, "seed {seed}: the distance is off by {:.1} %", 100.0 * listener.worst);
    let nearest_m = listener.nearest_m;
    assert!((1.0..2.0).contains(&nearest_m), "seed {seed}: handed over at {nearest_m} m");
    assert!(listener.aside_m < 0.3, "seed {seed}: {} m beside the middle", listener.aside_m);
}
