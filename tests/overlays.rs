//! Overlays: every shipped behavior draws what its method sees, and drawing changes no message of a run.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::AtomicBool;

use yamabico_core::message::{Message, MessageType, OverlayHeader, OverlayMark};
use yamabico_core::overlay::layers;
use yamabico_core::time::Time;
use yamabico_host::config::Task;
use yamabico_runtime::execution::Overlays;
use yamabico_runtime::record::Tap;
use yamabico_runtime::run::{Options, RunResult, run};

use crate::support::task;

/// Layers with marks, by topic; and stamps of the drawn messages.
#[derive(Default)]
struct OverlayTap {
    layers: BTreeMap<String, BTreeSet<String>>,
    frames: BTreeSet<(String, u64)>,
    drawn_over: BTreeSet<(String, u64)>,
}

impl Tap for OverlayTap {
    fn message(&mut self, topic: &str, message: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        if message.name != OverlayHeader::NAME {
            self.frames.insert((topic.to_owned(), (message.stamps)(header).0.0));
            return;
        }
        let header: &OverlayHeader = bytemuck::from_bytes(header);
        let marks: Vec<OverlayMark> = bytemuck::pod_collect_to_vec(items);
        assert_eq!(header.omitted, 0, "{topic} has too many marks");
        let drawn = self.layers.entry(topic.to_owned()).or_default();
        drawn.extend(
            layers(&marks).filter(|layer| !layer.marks.is_empty()).map(|layer| layer.name.to_string()),
        );
        self.drawn_over.insert((header.topic.as_str().to_owned(), header.stamp_ns));
    }
}

fn run_with(task: &Task, overlays: Overlays, tap: &mut dyn Tap) -> RunResult {
    let folder = std::env::temp_dir().join(format!("yamabico-overlays-{}-{}", task.name, std::process::id()));
    let recording = Some(folder.join("run.mcap"));
    let options = Options { recording, overlays, ..Options::default() };
    let result = run(task, &options, &AtomicBool::new(false), tap, &mut |_| {}).unwrap();
    std::fs::remove_dir_all(folder).unwrap();
    result
}

/// Runs a task with and without overlays, and checks that these layers were drawn.
fn check(name: &str, set: &[&str], expected: &[(&str, &[&str])]) {
    let task = task(name, set);
    let mut drawn = OverlayTap::default();
    let with = run_with(&task, Overlays::Recorded, &mut drawn);
    let mut none = OverlayTap::default();
    let without = run_with(&task, Overlays::OnRequest, &mut none);
    assert_eq!(with.summary.digest, without.summary.digest, "{name}: drawing changed the run");
    assert!(none.layers.is_empty() && !with.summary.digest.is_empty());
    for (behavior, layers) in expected {
        let found = &drawn.layers[&format!("behaviors/{behavior}/overlay")];
        for layer in *layers {
            assert!(found.contains(*layer), "{name}, {behavior}: no {layer:?} in {found:?}");
        }
    }
    let strangers: Vec<_> = drawn.drawn_over.difference(&drawn.frames).collect();
    assert!(strangers.is_empty(), "{name}: overlays of messages that do not exist: {strangers:?}");
}

#[test]
fn of_the_hallway() {
    let localizer = ["expected, matched", "matched segments"];
    let lanes = ["floor ends", "occupied cells", "best lane"];
    let passages = ["edges explained by the map", "free regions"];
    let sonar = ["beams", "gate", "echoes"];
    check(
        "hallway",
        &["run.duration_s=6"],
        &[("map-localizer", &localizer), ("sonar-halt", &sonar), ("stationary-obstacle-avoider", &lanes)],
    );
    check(
        "hallway",
        &["run.duration_s=6", "behaviors.stationary-obstacle-avoider.method=\"passages\""],
        &[("stationary-obstacle-avoider", &passages)],
    );
}

#[test]
fn of_the_corridor() {
    let wall = ["segments along the corridor", "vanishing point", "floor lines", "walls"];
    check("corridor", &["run.duration_s=4"], &[("wall-follower", &wall)]);
}

#[test]
fn of_the_intersection() {
    let tracker = ["ends of walls", "tracked edges", "intersection"];
    check("intersection", &["run.duration_s=8"], &[("intersection-tracker", &tracker)]);
}

#[test]
fn of_the_office() {
    let grid = ["obstacle cells", "free cells of the path", "free cells by column", "free space"];
    check("office", &["run.duration_s=4"], &[("free-space-avoider", &grid)]);
}

#[test]
fn of_the_field() {
    let cells = ["rings", "free cells", "first obstacle cells", "free space"];
    check(
        "field",
        &["run.duration_s=3"],
        &[("free-space-avoider", &cells), ("map-localizer", &["outline of the floor", "floor plan"])],
    );
}

#[test]
fn of_the_room() {
    check("room", &["run.duration_s=3"], &[("map-localizer", &["expected", "matched"])]);
}
