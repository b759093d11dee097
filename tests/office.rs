//! The office: without a map the robot drives among furniture without contact.

use yamabico_core::message::{Message, MessageType, RawMessage, Truth, View};
use yamabico_core::time::Time;
use yamabico_runtime::execution::RunEnd;
use yamabico_runtime::record::Tap;

use crate::support::{run_seed, task};

/// Rooms that the robot has visited.
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
fn the_robot_has_no_contact_and_visits_both_rooms() {
    let task = task("office", &[]);
    let drive = |seed| {
        let mut rooms = Rooms::default();
        let result = run_seed(&task, seed, &mut rooms);
        let summary = &result.summary;
        assert_eq!((result.end, summary.contacts), (RunEnd::TimeOver, Some(0)), "seed {seed}");
        assert!(summary.distance_m > 15.0, "seed {seed}: {} m", summary.distance_m);
        assert!(rooms.first && rooms.second, "seed {seed}: it did not pass the doorway");
    };
    std::thread::scope(|scope| [1, 2].map(|seed| scope.spawn(move || drive(seed))).map(|_| ()));
}
