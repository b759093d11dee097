//! The intersection: the tracker takes over from the wall-follower, steers between the ends of the walls and tells the distance.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::Path;
use std::sync::atomic::AtomicBool;

use yamabico::plugins::PLUGINS;
use yamabico_arbiter::execution::End;
use yamabico_arbiter::record::Tap;
use yamabico_arbiter::run::{Options, run};
use yamabico_core::behavior::{RawMessage, View};
use yamabico_core::config::{Overrides, load};
use yamabico_core::message::{Intersection, Message, MessageType, Truth};
use yamabico_core::time::Time;

/// World x at which the walls end, metres.
const END_M: f64 = 15.0;

/// Compares what is published with the truth.
#[derive(Default)]
struct Listener {
    x_m: f64,
    heard: u32,
    /// Largest error of the distance from 8 m on, as a share of it.
    worst: f64,
}

impl Tap for Listener {
    fn message(&mut self, _: &str, message: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        let raw = RawMessage { header, items };
        if message.name == Truth::NAME {
            self.x_m = View::<Truth>::of(raw).unwrap().header.x;
        } else if message.name == Intersection::NAME {
            let distance_m = View::<Intersection>::of(raw).unwrap().header.distance_m;
            let truth_m = END_M - self.x_m;
            self.heard += 1;
            if truth_m < 8.0 {
                self.worst = self.worst.max((distance_m - truth_m).abs() / truth_m);
            }
        }
    }
}

#[test]
fn the_robot_steers_between_the_ends_of_the_walls() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/intersection.toml");
    // As far as the tracker leads: 1.7 m before the walls end.
    let overrides = Overrides { set: vec!["run.goal.x_m=13.6".into()], ..Overrides::default() };
    let task = load(&file, &overrides, &PLUGINS).unwrap_or_else(|e| panic!("{e}"));
    let mut listener = Listener::default();
    let ran = run(&task, &Options::default(), &AtomicBool::new(false), &mut listener, &mut |_| {}).unwrap();
    let summary = &ran.summary;
    assert_eq!((ran.end, summary.contacts), (End::Arrived, Some(0)));
    let in_control_s = |name: &str| summary.control_s.get(name).copied().unwrap_or(0.0);
    assert!(in_control_s("intersection-tracker") > 20.0, "{:?}", summary.control_s);
    assert!(in_control_s("wall-follower") > 1.0, "{:?}", summary.control_s);
    assert!(listener.heard > 900, "{} messages", listener.heard);
    assert!(listener.worst < 0.05, "the distance is off by {:.1} %", 100.0 * listener.worst);
}
