//! The corridor: 25 m without contact, from a start off the center line and turned away from it.

use yamabico_core::message::{Message, MessageType, RawMessage, Truth, View};
use yamabico_core::time::Time;
use yamabico_host::config::Task;
use yamabico_runtime::execution::RunEnd;
use yamabico_runtime::record::Tap;

use crate::support::{run_seed, task};

/// Offset from the center line at the start, and its mean square after the first 5 m.
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
fn the_robot_stays_on_the_center_line_for_twenty_five_meters() {
    let presumed = task("corridor", &[]);
    let judged = task("corridor", &["behaviors.wall-follower.method=\"evidence\""]);
    let drive = |task: &Task, seed: u64| {
        let mut offsets = Offsets::default();
        let result = run_seed(task, seed, &mut offsets);
        assert_eq!((result.end, result.summary.contacts), (RunEnd::Arrived, Some(0)), "seed {seed}");
        let rms_m = (offsets.square_sum / offsets.count).sqrt();
        assert!(rms_m <= 0.05, "seed {seed}: RMS offset {rms_m} m after 5 m");
        offsets.start_m.unwrap()
    };
    let starts_m: Vec<f64> = std::thread::scope(|scope| {
        let drives: Vec<_> = [(&presumed, 1), (&presumed, 2), (&judged, 3)]
            .map(|(task, seed)| {
                scope.spawn({
                    let drive = &drive;
                    move || drive(task, seed)
                })
            })
            .into_iter()
            .collect();
        drives.into_iter().map(|drive| drive.join().unwrap()).collect()
    });
    assert!(starts_m[0] != starts_m[1], "each seed has another start");
}
