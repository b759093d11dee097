//! `yamabico learn map` from outside: the map is right, and serves the localizer.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use nalgebra::Point2;
use serde_json::Value;
use yamabico_sim::World;
use yamabico_vision::azimuth_map::{EdgeMap, SurfaceState};
use yamabico_vision::polygon::nearest_on_segment;

fn configs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs")
}

struct Folder(PathBuf);

impl Folder {
    fn new(test: &str) -> Self {
        let path = std::env::temp_dir().join(format!("yamabico-map-{}-{test}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn map(&self) -> PathBuf {
        self.0.join("map.toml")
    }

    fn yamabico(&self, words: &[&str], task: &str, settings: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_yamabico"));
        command.args(words).arg(configs().join(task)).args(["--json"]);
        for setting in settings {
            command.args(["--set", setting]);
        }
        command.current_dir(&self.0).output().unwrap()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn json(output: &Output) -> Value {
    let told = String::from_utf8_lossy(&output.stderr);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {told}"))
}

/// Distances (m) of the edges that were seen in more pictures than this from the nearest corner of a wall, which are `corners` as
/// well as the backs of walls 5 cm thick.
fn errors(map: &EdgeMap, corners: &[[f64; 2]], seen: u32) -> Vec<f64> {
    let nearest = |at: [f64; 2]| {
        let distances = corners.iter().map(|corner| (corner[0] - at[0]).hypot(corner[1] - at[1]));
        distances.fold(f64::INFINITY, f64::min)
    };
    map.edges.iter().filter(|edge| edge.seen > seen).map(|edge| nearest(edge.at_m)).collect()
}

fn corners(world: &str) -> Vec<[f64; 2]> {
    let text = std::fs::read_to_string(configs().join("worlds").join(world)).unwrap();
    World::from_toml(&text).unwrap().walls.iter().map(|wall| wall.from_m).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[test]
fn edges_are_where_they_stand() {
    let folder = Folder::new("mapping");
    let learned = json(&folder.yamabico(&["learn", "map", "--out", "map.toml"], "mapping.toml", &[]));
    assert_eq!(learned["end"], "arrived", "{learned}");
    assert!(folder.0.join("map.png").metadata().unwrap().len() > 1000);
    let map = EdgeMap::read(&folder.map()).unwrap();
    let corners = corners("mapping.toml");
    for (seen, max_m) in [(15, 0.02), (4, 0.04)] {
        let errors = errors(&map, &corners, seen);
        let worst = errors.iter().copied().fold(0.0, f64::max);
        println!(
            "{} of {} edges in more than {seen} pictures: {:.1} mm on average, {:.1} at most",
            errors.len(),
            corners.len(),
            1e3 * mean(&errors),
            1e3 * worst
        );
        assert!(errors.len() >= 11 && mean(&errors) <= max_m);
    }
}

#[test]
fn a_recording_gives_the_map_that_the_drive_gave() {
    let folder = Folder::new("recording");
    let driven = json(&folder.yamabico(&["learn", "map", "--out", "map.toml"], "mapping.toml", &[]));
    json(&folder.yamabico(&["run", "--record", "run.mcap"], "mapping.toml", &[]));
    let words = ["learn", "map", "--from", "run.mcap", "--out", "again.toml"];
    let heard = json(&folder.yamabico(&words, "mapping.toml", &[]));
    assert_eq!(heard["end"], "sensors-ended", "{heard}");
    assert_eq!(heard["edges"], driven["edges"]);
    let text = |file: &str| std::fs::read_to_string(folder.0.join(file)).unwrap();
    assert_eq!(text("again.toml"), text("map.toml"));

    let words = ["learn", "map", "--from", "map.toml"];
    let refused = folder.yamabico(&words, "mapping.toml", &[]);
    let told = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(!refused.status.success() && told.contains("no MCAP recording"), "{told}");
}

#[test]
fn a_second_drive_tells_which_surfaces_are_solid() {
    let folder = Folder::new("verify");
    let words = ["learn", "map", "--out", "map.toml", "--verify"];
    let learned = json(&folder.yamabico(&words, "mapping.toml", &[]));
    let map = EdgeMap::read(&folder.map()).unwrap();
    assert!(map.surfaces.len() >= 6, "{learned}");
    assert_eq!(learned["verified"].as_u64(), Some(map.surfaces.len() as u64), "{learned}");
    let text = std::fs::read_to_string(configs().join("worlds/mapping.toml")).unwrap();
    let walls = World::from_toml(&text).unwrap().walls;
    for surface in &map.surfaces {
        let end = |number| Point2::from(map.edge(number).unwrap().at_m);
        let middle = nalgebra::center(&end(surface.right), &end(surface.left));
        let from_wall = walls
            .iter()
            .map(|wall| (nearest_on_segment([wall.from_m.into(), wall.to_m.into()], middle) - middle).norm());
        assert!(from_wall.fold(f64::INFINITY, f64::min) < 0.02, "{surface:?} at {middle} is no wall");
        assert_eq!(surface.state, SurfaceState::Solid, "{surface:?}");
    }
}

#[test]
fn a_map_that_was_made_serves_the_localizer() {
    let folder = Folder::new("room");
    let empty = [
        "behaviors.map-localizer.method=\"dead-reckoning\"",
        "behaviors.map-localizer.route=[[0.9, -1.2], [1.3, -0.6], [1.3, 1.3]]",
        "robot.devices.sim.clutter=\"none\"",
        "robot.devices.sim.start.jitter_m=0",
        "robot.devices.sim.start.jitter_deg=0",
        "robot.sensors.wheels.scale_error=0",
        "run.goal.tolerance_m=0.3",
    ];
    let words = ["learn", "map", "--out", "map.toml", "--sway-deg", "1"];
    let learned = json(&folder.yamabico(&words, "room.toml", &empty));
    assert_eq!(learned["end"], "arrived", "{learned}");
    let map = EdgeMap::read(&folder.map()).unwrap();
    let errors = errors(&map, &corners("room.toml"), 15);
    println!("{} edges, {:.1} mm on average", errors.len(), 1e3 * mean(&errors));
    assert!(errors.len() >= 9 && mean(&errors) <= 0.02, "{errors:?}");

    let map = format!("behaviors.map-localizer.edge_map={:?}", folder.map().display().to_string());
    let ran = json(&folder.yamabico(&["run"], "room.toml", &[&map]));
    assert_eq!((&ran["end"], ran["contacts"].as_u64()), (&Value::from("arrived"), Some(0)), "{ran}");
}
