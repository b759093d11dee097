//! `--set` and `--robot`.

use std::path::{Path, PathBuf};
use std::time::Duration;

use yamabico_host::config::{Overrides, Policy, Task, load};
use yamabico_parameters::Problems;

use super::fakes::plugins;

fn with(set: &[&str]) -> Result<Task, Problems> {
    let set = set.iter().map(|&text| text.to_owned()).collect();
    load(Path::new("tests/valid/hallway.toml"), &Overrides { robot: None, set }, &plugins())
}

#[test]
fn values_of_both_files_change() {
    let task = with(&[
        "behaviors.sonar-halt.gate_m=0.7",
        "behaviors.wall-follower.side = right",
        "arbiter.policy=blend",
        "run.goal={ x_m = 3, y_m = 1, tolerance_m = 0.5 }",
        "run.duration_s = 5",
        "behaviors.cruise.inputs.camera=front",
        "robot.sensors.front.rate_hz=20",
        "robot.name=\"other\"",
    ])
    .unwrap_or_else(|problems| panic!("{problems}"));
    assert_eq!(task.behavior("sonar-halt").unwrap().table["gate_m"].as_float(), Some(0.7));
    assert_eq!(task.behavior("wall-follower").unwrap().table["side"].as_str(), Some("right"));
    assert_eq!(task.arbiter.policy, Policy::Blend);
    assert_eq!(task.run.goal.unwrap().x_m, 3.0);
    assert_eq!(task.run.duration, Some(Duration::from_secs(5)));
    assert_eq!(task.robot.robot.name, "other");
    assert_eq!(task.robot.sensor("front").unwrap().info.period_s, 0.05);
}

#[test]
fn a_path_on_the_command_line_starts_at_the_working_directory() {
    let task = with(&["robot.devices.sim.world=tests/valid/worlds/hallway.toml"]).unwrap();
    let world = task.robot.devices[0].table["world"].as_str().unwrap();
    assert!(Path::new(world).is_absolute() && Path::new(world).is_file(), "{world}");
}

#[test]
fn another_robot_replaces_the_one_of_the_task() {
    let overrides = Overrides { robot: Some(PathBuf::from("tests/valid/robots/sim.toml")), set: Vec::new() };
    let task = load(Path::new("tests/broken/robot_file_missing.toml"), &overrides, &plugins());
    assert_eq!(task.unwrap().robot.path, Path::new("tests/valid/robots/sim.toml"));
}

/// The task of another laboratory on the robot file `robot`.
fn on_another_robot(robot: &str, set: &[&str]) -> Result<Task, Problems> {
    let set = set.iter().map(|&text| text.to_owned()).collect();
    let overrides = Overrides { robot: Some(PathBuf::from(robot)), set };
    load(Path::new("tests/valid/for-another-robot.toml"), &overrides, &plugins())
}

#[test]
fn on_another_robot_inputs_take_the_only_sensor_of_their_kind() {
    let task =
        on_another_robot("tests/valid/robots/sim.toml", &[]).unwrap_or_else(|problems| panic!("{problems}"));
    let source =
        |behavior: &str, input: usize| task.behavior(behavior).unwrap().inputs[input].source.to_string();
    assert_eq!((source("sonar-halt", 0), source("wall-follower", 0)), ("front-sonar".into(), "front".into()));
    // No sensor of the robot publishes poses, and the behavior works without.
    assert_eq!(task.behavior("wall-follower").unwrap().inputs.len(), 1);
    insta::assert_snapshot!(task.notes().join("\n"));
    // The same names in the robot of the task are mistakes.
    let own = with(&["behaviors.sonar-halt.inputs.sonar=laser"]).unwrap_err().to_string();
    assert!(own.contains("no sensor `laser`"), "{own}");
    // A name on the command line is meant for this robot.
    let set = on_another_robot("tests/valid/robots/sim.toml", &["behaviors.sonar-halt.inputs.sonar=lazer"]);
    assert!(set.unwrap_err().to_string().contains("no sensor `lazer`"));
}

#[test]
fn another_robot_without_or_with_several_sensors_of_a_kind_is_refused_with_its_sensors() {
    for robot in ["several", "blind"] {
        let path = match robot {
            "several" => "tests/broken/robots/two_of_each.toml",
            _ => "tests/valid/robots/blind.toml",
        };
        let problems = on_another_robot(path, &[]).unwrap_err();
        insta::assert_snapshot!(robot, problems.to_string());
    }
}

#[test]
fn invalid_overrides_are_reported_like_invalid_files() {
    let problems = with(&[
        "behaviors.sonar-halt.gate_m",
        "behaviors.sonar-halt.gate_m=far",
        "behaviors.sonar-hault.gate_m=0.5",
        "behaviors..gate_m=0.5",
        "robot.limits.max_linear_mps=1000",
        "run.goal.x_m.y=1",
        "arbiter.policy.kind=strict",
        "arbitre.rate_hz=50",
        "inhibit=[{ by = \"cruise\" }]",
        "robot.devices.sim.world=tests/valid/worlds/halway.toml",
        "run.duration_s=[1",
        "run.duration_s=",
    ])
    .unwrap_err();
    insta::assert_snapshot!(problems.to_string());
    let overrides = Overrides { robot: Some(PathBuf::from("tests/valid/robots/sin.toml")), set: Vec::new() };
    let problems = load(Path::new("tests/valid/hallway.toml"), &overrides, &plugins()).unwrap_err();
    insta::assert_snapshot!(problems.to_string());
}

#[test]
fn an_integer_out_of_range_is_an_error() {
    let problems = with(&["behaviors.wall-follower.patience=99999999999999999999"]).unwrap_err();
    insta::assert_snapshot!(problems.to_string());
}

#[test]
fn every_invalid_override_is_reported() {
    let problems = with(&["behaviors.sonar-halt.gate_m", "run.duration_s=1\narbiter.rate_hz=5"]).unwrap_err();
    let columns: Vec<(usize, String)> =
        problems.entries().into_iter().map(|entry| (entry.column, entry.label)).collect();
    assert_eq!(columns, [(1, "no `=` after the key".to_owned()), (16, "not one value".to_owned())]);
}

/// Keys of every kind of table; what they are set to is a program that leaves a mark.
const KEYS: [&str; 20] = [
    "robot",
    "run.duration_s",
    "run.goal",
    "arbiter.policy",
    "arbiter.scheduling",
    "behaviors.cruise.type",
    "behaviors.cruise.inputs.camera",
    "behaviors.cruise.isolation",
    "behaviors.wall-follower.side",
    "behaviors.sonar-halt.gate_m",
    "inhibit",
    "suppress",
    "robot.name",
    "robot.devices.sim.driver",
    "robot.devices.sim.world",
    "robot.devices.sim.isolation",
    "robot.sensors.front.device",
    "robot.sensors.front.kind",
    "robot.drive.device",
    "robot.drive.kind",
];

#[test]
fn no_key_but_exec_starts_a_program() {
    let folder = std::env::temp_dir().join(format!("yamabico-exec-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let (program, mark) = (folder.join("program.sh"), folder.join("started"));
    std::fs::write(&program, format!("#!/bin/sh\ntouch '{}'\n", mark.display())).unwrap();
    std::fs::set_permissions(&program, std::os::unix::fs::PermissionsExt::from_mode(0o755)).unwrap();
    let path = program.display();
    for key in KEYS {
        for text in [
            format!("\"{path}\""),
            format!("[\"{path}\"]"),
            format!("\"| {path}\""),
            format!("\"$({path})\""),
            format!("\"`{path}`\""),
            format!("{{ exec = [\"{path}\"], program = \"{path}\", command = \"{path}\" }}"),
        ] {
            let _ = with(&[&format!("{key}={text}")]);
            assert!(!mark.exists(), "{key} = {text} started it");
        }
    }
    assert!(with(&[&format!("behaviors.cruise.exec=[\"{path}\"]")]).is_err(), "it is no behavior");
    assert!(mark.exists(), "exec starts it, and asks what it is");
    std::fs::remove_dir_all(folder).unwrap();
}
