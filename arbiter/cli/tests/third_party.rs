//! Behaviors that are programs of their own: asked what they are, composed in TOML, run live, killed, refused.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value;

/// A folder with the crate that `yamabico new behavior creeper` writes, and a task with another program in its place.
struct Crate {
    folder: PathBuf,
    name: String,
}

impl Crate {
    fn new(test: &str) -> Crate {
        let name = format!("new-{test}-{}", std::process::id());
        let folder = std::env::temp_dir().join(format!("yamabico-{name}"));
        std::fs::create_dir_all(&folder).unwrap();
        let place = Crate { folder, name };
        let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let begun =
            place.yamabico(&["new", "behavior", "creeper", "--repository", repository.to_str().unwrap()]);
        assert!(begun.status.success(), "{}", said(&begun));
        place
    }

    fn yamabico(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_yamabico"));
        command.args(arguments).env("NO_COLOR", "1").current_dir(&self.folder).stdin(Stdio::null());
        command.output().unwrap()
    }

    /// The task with `exec` as the program of its behavior.
    fn with_exec(&self, exec: &str) -> String {
        let task = std::fs::read_to_string(self.folder.join("creeper/task.toml")).unwrap();
        let task = task.replace("\"target/debug/creeper\"", exec);
        let path = self.folder.join("creeper/other.toml");
        std::fs::write(&path, task).unwrap();
        path.to_str().unwrap().to_owned()
    }
}

impl Drop for Crate {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

fn said(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

/// What `new behavior` writes, built as an example of this crate.
fn program() -> String {
    let target = Path::new(env!("CARGO_BIN_EXE_yamabico")).parent().unwrap();
    // Cargo builds an example with tests of its own as a test only.
    let mut build = Command::new(env!("CARGO"));
    build.args(["build", "--quiet", "--offline", "--package", "yamabico", "--example", "new-behavior"]);
    if target.ends_with("release") {
        build.arg("--release");
    }
    assert!(build.status().unwrap().success());
    format!("\"{}\"", target.join("examples/new-behavior").display())
}

#[test]
fn a_program_is_composed_by_exec_and_drives() {
    let place = Crate::new("drives");
    let task = place.with_exec(&program());
    let checked = place.yamabico(&["check", &task]);
    assert!(checked.status.success(), "{}", said(&checked));
    assert!(said(&checked).contains("starts creeper ("), "{}", said(&checked));
    let robot = format!("robot.name={}", place.name);
    let ran =
        place.yamabico(&["run", &task, "--live", "--json", "--set", &robot, "--set", "run.duration_s=4"]);
    assert!(ran.status.success(), "{}", said(&ran));
    let report: Value = serde_json::from_slice(&ran.stdout).unwrap();
    assert!(report["distance_m"].as_f64() > Some(0.3), "{report}");
    assert!(report["behaviors"]["creeper"]["calls"].as_u64() > Some(20), "{report}");
    assert_eq!(report["contacts"].as_u64(), Some(0));
}

#[test]
fn its_parameters_and_inputs_are_checked_like_those_of_any_other() {
    let place = Crate::new("checked");
    let task = place.with_exec(&program());
    for (set, words) in [
        ("behaviors.creeper.speed_mps=20", "speed_mps"),
        ("behaviors.creeper.sped_mps=0.2", "did you mean `speed_mps`"),
        ("behaviors.creeper.inputs.sonar=front", "yamabico.RangeScanHeader.v1"),
    ] {
        let checked = place.yamabico(&["check", &task, "--set", set]);
        assert_eq!(checked.status.code(), Some(2), "{set}");
        assert!(said(&checked).contains(words), "{set}: {}", said(&checked));
    }
}

#[test]
fn what_is_no_behavior_is_refused_before_anything_opens() {
    let place = Crate::new("refused");
    let description = |message: &str| {
        format!(
            r#"{{"protocol": 1, "name": "x", "summary": "", "claims": "linear", "outputs": [], "parameters": {{}},
            "inputs": [{{"name": "sonar", "summary": "", "required": true, "message": "{message}"}}]}}"#
        )
    };
    let script = place.folder.join("creeper/plugin.sh");
    std::fs::write(&script, format!("echo '{}'", description("yamabico.RangeScanHeader.v9"))).unwrap();
    for (exec, words) in [
        ("\"/bin/true\"", "is not what is asked for"),
        ("\"sh\", \"-c\", \"echo no such luck >&2; exit 3\"", "it complains: no such luck"),
        ("\"no-such-program-anywhere\"", "cannot be started"),
        ("\"sh\", \"./plugin.sh\"", "RangeScanHeader.v9"),
        ("\"sh\", \"./plugin.sh\"", "RangeScanHeader.v1"),
    ] {
        let task = place.with_exec(exec);
        let checked = place.yamabico(&["check", &task]);
        assert_eq!(checked.status.code(), Some(2), "{exec}: {}", said(&checked));
        assert!(said(&checked).contains(words), "{exec}: {}", said(&checked));
    }
    let task = place.with_exec(&program());
    let lockstep = place.yamabico(&["run", &task]);
    assert_eq!(lockstep.status.code(), Some(2), "{}", said(&lockstep));
    assert!(said(&lockstep).contains("run it with --live"), "{}", said(&lockstep));
}

#[test]
#[ignore = "builds everything that the crate depends on: minutes"]
fn what_is_begun_builds_passes_its_test_and_runs() {
    let place = Crate::new("built");
    let folder = place.folder.join("creeper");
    for what in ["test", "build"] {
        let mut cargo = Command::new(env!("CARGO"));
        let cargo = cargo.arg(what).current_dir(&folder).env_remove("CARGO_TARGET_DIR").output().unwrap();
        assert!(cargo.status.success(), "{}", said(&cargo));
    }
    let (task, robot) = (folder.join("task.toml"), format!("robot.name={}", place.name));
    let set = ["--set", &robot, "--set", "run.duration_s=4"];
    let ran = place.yamabico(&[&["run", task.to_str().unwrap(), "--live", "--json"], &set[..]].concat());
    assert!(ran.status.success(), "{}", said(&ran));
    let report: Value = serde_json::from_slice(&ran.stdout).unwrap();
    assert!(report["distance_m"].as_f64() > Some(0.3), "{report}");
}

#[test]
fn a_crate_is_begun_once_and_by_a_good_name() {
    let place = Crate::new("named");
    for (name, words) in
        [("creeper", "exists already"), ("No Name", "cannot be a name"), ("../x", "cannot be a name")]
    {
        let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let begun = place.yamabico(&["new", "behavior", name, "--repository", repository.to_str().unwrap()]);
        assert_eq!(begun.status.code(), Some(2));
        assert!(said(&begun).contains(words), "{}", said(&begun));
    }
    let lost = place.yamabico(&["new", "behavior", "other"]);
    assert!(said(&lost).contains("--repository"), "{}", said(&lost));
}

/// The corridor with the simulator as a program of its own, under `clock`.
fn with_program_for_a_device(place: &Crate, clock: &str) -> String {
    let target = Path::new(env!("CARGO_BIN_EXE_yamabico")).parent().unwrap();
    let mut build = Command::new(env!("CARGO"));
    build.args(["build", "--quiet", "--offline", "--package", "yamabico-sim", "--example", "sim_program"]);
    if target.ends_with("release") {
        build.arg("--release");
    }
    assert!(build.status().unwrap().success());
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs").canonicalize().unwrap();
    let robot = std::fs::read_to_string(configs.join("robots/sim-corridor.toml")).unwrap();
    let exec = format!("exec = [\"{}\"]", target.join("examples/sim_program").display());
    let world = format!("world = \"{}/worlds", configs.display());
    let robot = robot.replace("driver = \"sim\"", &exec).replace("world = \"../worlds", &world);
    let robot = robot.replacen("[footprint]", &format!("clock = \"{clock}\"\n\n[footprint]"), 1);
    std::fs::write(place.folder.join("robot.toml"), robot).unwrap();
    let task = std::fs::read_to_string(configs.join("corridor.toml")).unwrap();
    let path = place.folder.join("task.toml");
    std::fs::write(&path, task.replace("robots/sim-corridor.toml", "robot.toml")).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn a_driver_is_a_program_too_by_the_machines_clock_or_its_own() {
    for clock in ["machine", "driver"] {
        let place = Crate::new(&format!("driver-{clock}"));
        let task = with_program_for_a_device(&place, clock);
        let checked = place.yamabico(&["check", &task]);
        assert!(checked.status.success(), "{}", said(&checked));
        assert!(said(&checked).contains("starts sim ("), "{}", said(&checked));
        let wrong = place.yamabico(&["check", &task, "--set", "robot.sensors.front.period_ms=1"]);
        assert_eq!(wrong.status.code(), Some(2), "{}", said(&wrong));
        assert!(said(&wrong).contains("period_ms"), "{}", said(&wrong));
        let robot = format!("robot.name={}", place.name);
        // It does not hang, whatever else the machine has to do.
        let patient = "robot.devices.sim.deadline_ms=20000";
        let set = ["--set", &robot, "--set", "run.goal.x_m=1.6", "--set", patient];
        let ran = place.yamabico(&[&["run", &task, "--live", "--json"], &set[..]].concat());
        assert_eq!(ran.status.code(), Some(0), "{clock}: {}", said(&ran));
        let report: Value = serde_json::from_slice(&ran.stdout).unwrap();
        assert!(report["distance_m"].as_f64() > Some(0.8), "{report}");
        assert_eq!(report["contacts"].as_u64(), Some(0), "{report}");
    }
}

#[test]
fn a_clock_needs_a_driver_that_owns_it() {
    let place = Crate::new("clock");
    let task = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/corridor.toml");
    let checked = place.yamabico(&["check", task.to_str().unwrap(), "--set", "robot.clock=\"driver\""]);
    assert_eq!(checked.status.code(), Some(2), "{}", said(&checked));
    assert!(said(&checked).contains("no driver owns the clock"), "{}", said(&checked));
}
