//! `yamabico learn thresholds`: the table that it writes, and the tasks that it refuses.

use std::path::Path;
use std::process::Output;

use serde_json::Value;
use yamabico_stationary_obstacle_avoider::threshold_table::ThresholdTable;
use yamabico_testkit::config;

use crate::program::{TestFolder, assert_exit, yamabico};

/// A drive of one meter through the empty hallway.
const SHORT: [&str; 6] = [
    "--set",
    "robot.devices.sim.clutter=\"none\"",
    "--set",
    "run.goal.x_m=1.5",
    "--set",
    "run.duration_s=20",
];

/// The method of the paper.
const PASSAGES: [&str; 2] = ["--set", "behaviors.stationary-obstacle-avoider.method=\"passages\""];

fn learn(task: &Path, folder: &TestFolder, arguments: &[&str]) -> Output {
    let mut command = yamabico();
    command.args(["learn", "thresholds"]).arg(task).arg("--out").arg(folder.file("learned.toml"));
    command.args(arguments).output().unwrap()
}

#[test]
fn a_short_drive_through_the_empty_hallway_teaches_thresholds() {
    let folder = TestFolder::new("thresholds");
    let output =
        learn(&config("hallway.toml"), &folder, &[&["--json", "--every", "0.5"], &SHORT[..]].concat());
    assert_exit(&output, 0, &[]);
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    let learned = ThresholdTable::read(&folder.file("learned.toml")).unwrap();
    assert_eq!(json["places"].as_array().unwrap().len(), learned.places.len());
    assert_eq!((learned.width, learned.height, learned.regions), (256, 240, 5));
    assert!((2..=5).contains(&learned.places.len()), "{} places in 1.2 m", learned.places.len());
    for place in &learned.places {
        assert!((0.0..=2.0).contains(&place.x_m) && place.y_m.abs() < 0.3, "{place:?}");
        assert!(place.t0 >= 5 && place.recall >= 0.5, "{place:?}");
    }
    let plot = image::open(json["plot"].as_str().unwrap()).unwrap();
    assert!(plot.width() > 400);
}

#[test]
fn thresholds_of_another_camera_or_missing_ones_are_learned_again() {
    let folder = TestFolder::new("thresholds-again");
    let larger = ["--set", "robot.sensors.front.intrinsics={ width = 320, height = 240, fov_deg = 60 }"];
    let missing = ["--set", "behaviors.stationary-obstacle-avoider.thresholds=\"no-such-table.toml\""];
    let required = ["--set", "behaviors.stationary-obstacle-avoider.requires_thresholds=true"];
    let table = config("maps/hallway-thresholds.toml");
    let table = format!("behaviors.stationary-obstacle-avoider.thresholds={table:?}");
    let table = ["--set", &table];
    let check = |set: &[&str], status: i32, text: &str| {
        let mut command = yamabico();
        let checked =
            command.arg("check").arg(config("hallway.toml")).args(PASSAGES).args(set).output().unwrap();
        assert_exit(&checked, status, &["thresholds", text]);
    };
    check(&[&larger[..], &table[..]].concat(), 0, "were learned with images of 256 x 240 pixels");
    check(&[&larger[..], &table[..], &required[..]].concat(), 2, "learn them again");
    check(&missing, 2, "no-such-table.toml");
    for (set, width) in [([larger, table].concat(), 320), (missing.to_vec(), 256)] {
        let output = learn(&config("hallway.toml"), &folder, &[&PASSAGES[..], &set[..], &SHORT[..]].concat());
        assert_exit(&output, 0, &["places learned"]);
        assert_eq!(ThresholdTable::read(&folder.file("learned.toml")).unwrap().width, width);
    }
}

#[test]
fn a_drive_in_real_time_and_a_recording_teach_thresholds() {
    let folder = TestFolder::new("thresholds-live");
    let missing = ["--set", "behaviors.stationary-obstacle-avoider.thresholds=\"no-such-table.toml\""];
    let live = learn(&config("hallway.toml"), &folder, &[&["--live"], &missing[..], &SHORT[..]].concat());
    assert_exit(&live, 0, &["places learned", "name it as `thresholds`"]);
    let learned = ThresholdTable::read(&folder.file("learned.toml")).unwrap();
    assert!((1..=6).contains(&learned.places.len()), "{:?}", learned.places);

    let (recording, text) = (folder.file("run.mcap"), |name: &str| std::fs::read(folder.file(name)).unwrap());
    assert_exit(&learn(&config("hallway.toml"), &folder, &SHORT), 0, &[]);
    let driven = text("learned.toml");
    let off = ["--set", "behaviors.stationary-obstacle-avoider.enabled=false"];
    let mut run = yamabico();
    run.arg("run").arg(config("hallway.toml")).args(SHORT).args(off).arg("--record").arg(&recording);
    assert_exit(&run.arg("--out").arg(folder.path()).output().unwrap(), 0, &[]);
    let recording = recording.to_str().unwrap();
    let replayed = learn(&config("hallway.toml"), &folder, &["--from", recording]);
    assert_exit(&replayed, 0, &["places learned"]);
    assert_eq!(text("learned.toml"), driven);
    let both = learn(&config("hallway.toml"), &folder, &["--from", recording, "--live"]);
    assert_exit(&both, 2, &["--live"]);
}

#[test]
fn no_table_is_written_where_nothing_was_learned() {
    let folder = TestFolder::new("thresholds-nothing");
    let unlocalized = ["--set", "behaviors.map-localizer.method=\"dead-reckoning\""];
    let output = learn(&config("hallway.toml"), &folder, &[&unlocalized[..], &SHORT[..]].concat());
    assert_exit(&output, 1, &["no table is written", "no frame"]);
    assert!(!folder.file("learned.toml").exists() && !folder.file("learned.png").exists());
}

#[test]
fn a_table_without_places_is_accepted_and_noted() {
    let folder = TestFolder::new("thresholds-empty");
    std::fs::write(
        folder.file("empty.toml"),
        "width = 256\nheight = 240\nregions = 5\nexposure = 1\nplace = []\n",
    )
    .unwrap();
    let key = "behaviors.stationary-obstacle-avoider.thresholds";
    let check = |table: &Path| {
        let set = format!("{key}={:?}", table.display().to_string());
        let mut command = yamabico();
        command
            .arg("check")
            .arg(config("hallway.toml"))
            .args(PASSAGES)
            .args(["--set", &set])
            .output()
            .unwrap()
    };
    assert_exit(&check(&folder.file("empty.toml")), 0, &["note: ", "holds no place", "learn thresholds"]);
    let full = check(&config("maps/hallway-thresholds.toml"));
    assert_exit(&full, 0, &["has no errors"]);
    assert!(!crate::program::text(&full).contains("note:"));
}

#[test]
fn unsuitable_tasks_and_arguments_are_refused() {
    let folder = TestFolder::new("thresholds-refused");
    assert_exit(&learn(&config("no-such-task.toml"), &folder, &[]), 2, &["no-such-task.toml"]);
    assert_exit(&learn(&config("office.toml"), &folder, &[]), 2, &["add a map-localizer"]);
    let output = learn(&config("hallway.toml"), &folder, &["--every", "0"]);
    assert_exit(&output, 2, &["distance between places", "0.05 to 10 m"]);
    assert!(!folder.file("learned.toml").exists());
}
