//! The intersection: the tracker takes over from the wall-follower, publishes the distance, and hands over before the end.

use yamabico_core::message::{Intersection, Message, MessageType, RawMessage, Truth, View};
use yamabico_core::time::Time;
use yamabico_runtime::execution::RunEnd;
use yamabico_runtime::record::Tap;

use crate::support::{run_seed, task};

/// World x at which the walls end, m.
const END_M: f64 = 15.0;

/// Compares the published distances with the ground truth.
#[derive(Default)]
struct DistanceTap {
    x_m: f64,
    y_m: f64,
    messages: u32,
    /// Maximum relative error of the distance.
    max_error: f64,
    /// True distance at the latest message, m.
    last_m: f64,
    /// Maximum distance from the center line at a message, m.
    max_offset_m: f64,
}

impl Tap for DistanceTap {
    fn message(&mut self, _: &str, message: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        let raw = RawMessage { header, items };
        if message.name == Truth::NAME {
            let truth = View::<Truth>::of(raw).unwrap().header;
            (self.x_m, self.y_m) = (truth.x, truth.y);
        } else if message.name == Intersection::NAME {
            let distance_m = View::<Intersection>::of(raw).unwrap().header.distance_m;
            let truth_m = END_M - self.x_m;
            self.messages += 1;
            self.max_error = self.max_error.max((distance_m - truth_m).abs() / truth_m);
            self.last_m = truth_m;
            self.max_offset_m = self.max_offset_m.max(self.y_m.abs());
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
    // Half a meter before the end of the walls the tracker must have handed over.
    let task = task("intersection", &["run.goal.x_m=14.5"]);
    let mut tap = DistanceTap::default();
    let result = run_seed(&task, seed, &mut tap);
    let summary = &result.summary;
    assert_eq!((result.end, summary.contacts), (RunEnd::Arrived, Some(0)), "seed {seed}");
    let in_control_s = |name: &str| summary.control_s.get(name).copied().unwrap_or(0.0);
    assert!(in_control_s("intersection-tracker") > 20.0, "seed {seed}: {:?}", summary.control_s);
    assert!(in_control_s("wall-follower") > 1.0, "seed {seed}: {:?}", summary.control_s);
    assert!(tap.messages > 1000, "seed {seed}: {} messages", tap.messages);
    assert!(tap.max_error < 0.05, "seed {seed}: the distance is off by {:.1} %", 100.0 * tap.max_error);
    let last_m = tap.last_m;
    assert!((1.0..2.0).contains(&last_m), "seed {seed}: handed over at {last_m} m");
    assert!(tap.max_offset_m < 0.3, "seed {seed}: {} m off the center line", tap.max_offset_m);
}
