//! `yamabico info`: the contents of a recording, and the robot file that it gives.

use crate::program::{TestFolder, assert_exit, text, yamabico};
use yamabico_testkit::config;

#[test]
fn the_robot_file_of_a_recording_has_the_cameras_of_its_robot_and_drives_a_behavior() {
    let folder = TestFolder::new("info-robot");
    let file = folder.file("run.mcap");
    let mut run = yamabico();
    run.args(["run", "--no-report", "--set", "run.duration_s=3"]).arg(config("corridor.toml"));
    assert_exit(&run.arg("--out").arg(folder.path()).output().unwrap(), 1, &[]);
    let info = |arguments: &[&str]| yamabico().arg("info").arg(&file).args(arguments).output().unwrap();
    let frames = ["sensors/front", "yamabico.FrameHeader.v1", "frame: sensors/front on base", "seed: "];
    assert_exit(&info(&[]), 0, &frames);

    let given = info(&["--robot-toml"]);
    // A field of view of 60 degrees in 256 columns, and the mount of the file of this robot.
    assert_exit(&given, 0, &["fx = 221.7", "calibration = \"measured\"", "tilt_deg = ", "[sensors.wheels]"]);
    let robot = folder.file("robot.toml");
    let given = text(&given);
    assert_eq!(given.matches("a guess").count(), 2, "the radius, and what a guess is: {given}");
    std::fs::write(&robot, given).unwrap();
    let mut run = yamabico();
    run.args(["run", "--no-report", "--robot"]).arg(&robot).arg(config("corridor.toml"));
    let ran = run.arg("--out").arg(folder.file("again")).arg("--json").output().unwrap();
    let report: serde_json::Value = serde_json::from_slice(&ran.stdout).unwrap();
    assert_eq!(report["end"], "sensors-ended", "{report}");
    let control_s = report["control_s"]["wall-follower"].as_f64();
    assert!(control_s > Some(1.0), "{report}");
}
