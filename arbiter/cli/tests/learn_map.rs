//! `yamabico learn map`: the map is accurate, and the localizer can use it.

use std::process::Output;

use nalgebra::Point2;
use serde_json::Value;
use yamabico_sim::World;
use yamabico_testkit::{config, config_text};
use yamabico_vision::azimuth_map::{EdgeMap, SurfaceState};
use yamabico_vision::polygon::nearest_on_segment;

use crate::program::{TestFolder, yamabico};
use yamabico_core::geometry::Hypotenuse;

/// Runs `yamabico COMMAND TASK --json` in `folder`.
fn run(folder: &TestFolder, command: &[&str], task: &str, settings: &[&str]) -> Output {
    let mut program = yamabico();
    program.args(command).arg(config(task)).arg("--json");
    for setting in settings {
        program.args(["--set", setting]);
    }
    program.current_dir(folder.path()).output().unwrap()
}

fn json(output: &Output) -> Value {
    let errors = String::from_utf8_lossy(&output.stderr);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {errors}"))
}

/// Distances (m) from the edges observed in more than `seen` frames to the nearest of `corners`.
fn errors(map: &EdgeMap, corners: &[[f64; 2]], seen: u32) -> Vec<f64> {
    let nearest = |at: [f64; 2]| {
        let distances = corners.iter().map(|corner| (corner[0] - at[0]).hypotenuse(corner[1] - at[1]));
        distances.fold(f64::INFINITY, f64::min)
    };
    map.edges.iter().filter(|edge| edge.seen > seen).map(|edge| nearest(edge.at_m)).collect()
}

fn corners(world: &str) -> Vec<[f64; 2]> {
    World::from_toml(&config_text(&format!("worlds/{world}")))
        .unwrap()
        .walls
        .iter()
        .map(|wall| wall.from_m)
        .collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[test]
fn edges_are_accurate() {
    let folder = TestFolder::new("map-mapping");
    let learned = json(&run(&folder, &["learn", "map", "--out", "map.toml"], "mapping.toml", &[]));
    assert_eq!(learned["end"], "arrived", "{learned}");
    assert!(folder.file("map.png").metadata().unwrap().len() > 1000);
    let map = EdgeMap::read(&folder.file("map.toml")).unwrap();
    let corners = corners("mapping.toml");
    for (seen, max_m) in [(15, 0.02), (4, 0.04)] {
        let errors = errors(&map, &corners, seen);
        let worst = errors.iter().copied().fold(0.0, f64::max);
        println!(
            "{} of {} edges in more than {seen} frames: {:.1} mm on average, {:.1} mm at most",
            errors.len(),
            corners.len(),
            1e3 * mean(&errors),
            1e3 * worst
        );
        assert!(errors.len() >= 11 && mean(&errors) <= max_m);
    }
}

#[test]
fn a_recording_gives_the_same_map_as_the_drive() {
    let folder = TestFolder::new("map-recording");
    let driven = json(&run(&folder, &["learn", "map", "--out", "map.toml"], "mapping.toml", &[]));
    json(&run(&folder, &["run", "--record", "run.mcap"], "mapping.toml", &[]));
    let command = ["learn", "map", "--from", "run.mcap", "--out", "again.toml"];
    let replayed = json(&run(&folder, &command, "mapping.toml", &[]));
    assert_eq!(replayed["end"], "sensors-ended", "{replayed}");
    assert_eq!(replayed["edges"], driven["edges"]);
    let text = |file: &str| std::fs::read_to_string(folder.file(file)).unwrap();
    assert_eq!(text("again.toml"), text("map.toml"));

    let command = ["learn", "map", "--from", "map.toml"];
    let refused = run(&folder, &command, "mapping.toml", &[]);
    let errors = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(!refused.status.success() && errors.contains("MCAP recording"), "{errors}");
}

#[test]
fn a_second_drive_verifies_which_surfaces_are_solid() {
    let folder = TestFolder::new("map-verify");
    let command = ["learn", "map", "--out", "map.toml", "--verify"];
    let learned = json(&run(&folder, &command, "mapping.toml", &[]));
    let map = EdgeMap::read(&folder.file("map.toml")).unwrap();
    assert!(map.surfaces.len() >= 6, "{learned}");
    assert_eq!(learned["verified"].as_u64(), Some(map.surfaces.len() as u64), "{learned}");
    let walls = World::from_toml(&config_text("worlds/mapping.toml")).unwrap().walls;
    for surface in &map.surfaces {
        let end = |number| Point2::from(map.edge(number).unwrap().at_m);
        let center = nalgebra::center(&end(surface.right), &end(surface.left));
        let from_wall = walls
            .iter()
            .map(|wall| (nearest_on_segment([wall.from_m.into(), wall.to_m.into()], center) - center).norm());
        assert!(from_wall.fold(f64::INFINITY, f64::min) < 0.02, "{surface:?} at {center} is not a wall");
        assert_eq!(surface.state, SurfaceState::Solid, "{surface:?}");
    }
}

#[test]
fn the_localizer_can_use_a_learned_map() {
    let folder = TestFolder::new("map-room");
    let empty = [
        "behaviors.map-localizer.method=\"dead-reckoning\"",
        "behaviors.map-localizer.route=[[0.9, -1.2], [1.3, -0.6], [1.3, 1.3]]",
        "robot.devices.sim.clutter=\"none\"",
        "robot.devices.sim.start.jitter_m=0",
        "robot.devices.sim.start.jitter_deg=0",
        "robot.sensors.wheels.scale_error=0",
        "run.goal.tolerance_m=0.3",
    ];
    let command = ["learn", "map", "--out", "map.toml", "--sway-deg", "1"];
    let learned = json(&run(&folder, &command, "room.toml", &empty));
    assert_eq!(learned["end"], "arrived", "{learned}");
    let map = EdgeMap::read(&folder.file("map.toml")).unwrap();
    let errors = errors(&map, &corners("room.toml"), 15);
    println!("{} edges, {:.1} mm on average", errors.len(), 1e3 * mean(&errors));
    assert!(errors.len() >= 9 && mean(&errors) <= 0.02, "{errors:?}");

    let map = format!("behaviors.map-localizer.edge_map={:?}", folder.file("map.toml").display().to_string());
    let ran = json(&run(&folder, &["run"], "room.toml", &[&map]));
    assert_eq!((&ran["end"], ran["contacts"].as_u64()), (&Value::from("arrived"), Some(0)), "{ran}");
}
