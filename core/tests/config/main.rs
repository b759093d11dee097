//! The configuration: what a right one means, and what is said about a wrong one.

mod fakes;

use std::time::Duration;

use fakes::check;

const HALLWAY: &str = "tests/valid/hallway.toml";

#[test]
fn a_right_configuration_is_read_in_si_units() {
    let task = check(HALLWAY).unwrap();
    let names: Vec<&str> = task.behaviors.iter().map(|behavior| behavior.name.as_str()).collect();
    assert_eq!(names, ["sonar-halt", "wall-follower", "cruise", "map"]);
    let halt = task.behavior("sonar-halt").unwrap();
    assert!(halt.critical);
    assert_eq!(halt.deadline, Duration::from_millis(150));
    assert_eq!(halt.max_age, Duration::from_millis(200));
    assert_eq!(halt.table.to_string(), "gate_m = 0.5\n");
    assert_eq!(halt.setup.sensors[0].1.name, "front-sonar");
    assert_eq!(task.behavior("wall-follower").unwrap().inputs[1].source.to_string(), "map.pose");
    assert_eq!(task.arbiter.period, Duration::from_millis(20));
    assert_eq!(task.run.step, Duration::from_millis(20));
    assert_eq!(task.suppress[0].hold, Duration::from_millis(500));
    assert_eq!(task.robot.robot.limits.speed, [0.6, 0.0, 1.2]);
    let specs = task.robot.specs(7);
    assert_eq!(specs.len(), 1);
    assert_eq!(specs[0].1.sensors.len(), 4);
    assert_eq!(specs[0].1.drive.as_ref().unwrap().kind, "differential");
    assert_eq!(specs[0].1.table.to_string(), "world = \"hallway.toml\"\n");
}
