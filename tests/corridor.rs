//! The corridor: 25 m without contact, from a start beside the middle and turned away from it.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::Path;
use std::sync::atomic::AtomicBool;

use yamabico::plugins::plugins;
use yamabico_core::message::{Message, MessageType, RawMessage, Truth, View};
use yamabico_core::time::Time;
use yamabico_host::config::{Overrides, load};
use yamabico_runtime::execution::End;
use yamabico_runtime::record::Tap;
use yamabico_runtime::run::{Options, run};

/// Where the robot started beside the middle, and how far beside it it drove once it had come to it.
#[derive(Default)]
struct Offsets {
    start_m: Option<f64>,
    square_sum: f64,
    count: f64,
}

impl Tap for Offsets {
    fn message(&mut self, _: &str, message: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        if message.name != Truth::NAME {
            return;
        }
        let truth = View::<Truth>::of(RawMessage { header, items }).unwrap().header;
        self.start_m.get_or_insert(truth.y);
        if truth.distance_m > 5.0 {
            self.square_sum += truth.y.powi(2);
            self.count += 1.0;
        }
    }
}

#[test]
fn the_robot_keeps_to_the_middle_for_twenty_five_meters() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/corridor.toml");
    let task = load(&file, &Overrides::default(), &plugins()).unwrap_or_else(|e| panic!("{e}"));
    let drive = |seed: u64| {
        let options = Options { seed, ..Options::default() };
        let mut offsets = Offsets::default();
        let ran = run(&task, &options, &AtomicBool::new(false), &mut offsets, &mut |_| {}).unwrap();
        assert_eq!((ran.end, ran.summary.contacts), (End::Arrived, Some(0)), "seed {seed}");
        let rms_m = (offsets.square_sum / offsets.count).sqrt();
        assert!(rms_m <= 0.05, "seed {seed}: RMS offset {rms_m} m after 5 m");
        offsets.start_m.unwrap()
    };
    let starts_m: Vec<f64> = std::thread::scope(|scope| {
        let drives: Vec<_> = [1, 2]
            .map(|seed| {
                scope.spawn({
                    let drive = &drive;
                    move || drive(seed)
                })
            })
            .into_iter()
            .collect();
        drives.into_iter().map(|drive| drive.join().unwrap()).collect()
    });
    assert!(starts_m[0] != starts_m[1], "each seed starts elsewhere");
}
