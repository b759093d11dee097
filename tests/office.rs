//! The office: without a map the robot finds its way among furniture and touches nothing.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use yamabico::plugins::plugins;
use yamabico_core::message::{Message, MessageType, RawMessage, Truth, View};
use yamabico_core::time::Time;
use yamabico_host::config::{Overrides, load};
use yamabico_runtime::execution::End;
use yamabico_runtime::record::Tap;
use yamabico_runtime::run::{Options, run};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The rooms that the robot has been in.
#[derive(Default)]
struct Rooms {
    first: bool,
    second: bool,
}

impl Tap for Rooms {
    fn message(&mut self, _: &str, message: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        if message.name == Truth::NAME
            && let Some(truth) = View::<Truth>::of(RawMessage { header, items })
        {
            self.first |= truth.header.x < 4.0;
            self.second |= truth.header.x > 5.3;
        }
    }
}

#[test]
fn the_robot_touches_nothing_and_keeps_on_finding_a_way() {
    let task = load(&root().join("configs/office.toml"), &Overrides::default(), &plugins())
        .unwrap_or_else(|e| panic!("{e}"));
    let drive = |seed| {
        let mut rooms = Rooms::default();
        let options = Options { seed, ..Options::default() };
        let ran = run(&task, &options, &AtomicBool::new(false), &mut rooms, &mut |_| {}).unwrap();
        let summary = &ran.summary;
        assert_eq!((ran.end, summary.contacts), (End::TimeOver, Some(0)), "seed {seed}");
        assert!(summary.distance_m > 15.0, "seed {seed}: {} m", summary.distance_m);
        assert!(rooms.first && rooms.second, "seed {seed}: it went through the doorway");
    };
    std::thread::scope(|scope| [1, 2].map(|seed| scope.spawn(move || drive(seed))).map(|_| ()));
}
