//! Valid configurations and the errors of broken ones.

mod fakes;
mod fuzz;
mod overrides;
mod tools;

use std::path::Path;
use std::time::Duration;

use fakes::check;
use yamabico_core::drive::Wheels;
use yamabico_host::config::InputSource;

const HALLWAY: &str = "tests/valid/hallway.toml";

#[test]
fn a_valid_configuration_is_read_in_si_units() {
    let task = check(HALLWAY).unwrap();
    let names: Vec<&str> = task.behaviors.iter().map(|behavior| behavior.name.as_str()).collect();
    assert_eq!(names, ["sonar-halt", "wall-follower", "cruise", "map"]);
    let halt = task.behavior("sonar-halt").unwrap();
    assert!(halt.settings.critical);
    assert_eq!(halt.settings.host.deadline.proposal_timeout(), Duration::from_millis(150));
    assert_eq!(halt.settings.max_age, Duration::from_millis(200));
    assert_eq!(halt.table.to_string(), "gate_m = 0.5\n");
    assert_eq!(halt.setup.sensors[0].1.name, "front-sonar");
    assert_eq!(task.behavior("wall-follower").unwrap().inputs[1].source.to_string(), "map.pose");
    assert_eq!(task.behavior("map").unwrap().inputs[1].source, InputSource::Operator);
    assert_eq!(task.behavior("map").unwrap().setup.folder, Path::new("tests/valid"));
    assert_eq!(task.arbiter.period, Duration::from_millis(20));
    assert_eq!(task.run.step, Duration::from_millis(20));
    assert_eq!(task.suppress[0].hold, Duration::from_millis(500));
    let sonar = task.robot.sensor("front-sonar").unwrap();
    assert!(sonar.critical);
    assert_eq!(sonar.max_age, Duration::from_millis(150));
    assert_eq!(task.robot.robot.limits.speed, [0.6, 0.0, 1.2]);
    let wheels = Wheels { count: 2, from_center_m: 0.2, radius_m: 0.1, max_radps: 10.0 };
    assert_eq!(task.robot.drive.wheels, Some(wheels));
    let specs = task.robot.specs(7);
    assert_eq!(specs.len(), 1);
    assert_eq!(specs[0].1.sensors.len(), 4);
    assert_eq!(specs[0].1.drive.as_ref().unwrap().kind, "differential");
    assert_eq!(specs[0].1.table.to_string(), "world = \"../worlds/hallway.toml\"\n");
}

/// Every file in `tests/broken`, each against the text that is kept for it.
#[test]
fn every_broken_configuration_is_refused() {
    let mut names: Vec<String> = std::fs::read_dir("tests/broken")
        .unwrap()
        .filter_map(|file| {
            file.unwrap().file_name().into_string().unwrap().strip_suffix(".toml").map(str::to_owned)
        })
        .collect();
    names.sort();
    assert!(names.len() >= 25, "{names:?}");
    for name in names {
        let problems = check(&format!("tests/broken/{name}.toml")).expect_err(&name);
        assert!(!problems.is_empty(), "{name}: refused without a reason");
        insta::with_settings!({ prepend_module_to_snapshot => false, omit_expression => true, snapshot_path => "../broken/errors" }, {
            insta::assert_snapshot!(name, problems.to_string());
        });
    }
}

#[test]
fn a_missing_file_is_reported_with_similar_names() {
    let problems = check("tests/valid/halway.toml").unwrap_err();
    insta::assert_snapshot!(problems.to_string());
    insta::assert_snapshot!(check("tests/nowhere/hallway.toml").unwrap_err().to_string());
    insta::assert_snapshot!(check("tests/valid").unwrap_err().to_string());
    let unlike = check("tests/valid/missing.toml").unwrap_err().to_string();
    assert!(!unlike.contains("did you mean") && unlike.contains("tests/valid contains: "), "{unlike}");
}

#[test]
fn errors_are_data_too() {
    let entries = check("tests/broken/unknown_key.toml").unwrap_err().entries();
    insta::assert_snapshot!(serde_json::to_string_pretty(&entries).unwrap());
}
