//! `yamabico new behavior`, and plugins that are external programs: described, composed in TOML, run live, refused.

use std::process::{Command, Output};

use serde_json::Value;
use yamabico_testkit::{config, config_text, configs, workspace};

use crate::program::{TestFolder, assert_exit, example, text, yamabico};

/// The crate that `yamabico new behavior creeper` writes.
struct Crate {
    folder: TestFolder,
    name: String,
}

impl Crate {
    fn new(test: &str) -> Crate {
        let name = format!("new-{test}-{}", std::process::id());
        let new = Crate { folder: TestFolder::new(&format!("new-{test}")), name };
        assert_exit(&new.yamabico(&["new", "behavior", "creeper"]), 0, &["created creeper"]);
        new
    }

    fn yamabico(&self, arguments: &[&str]) -> Output {
        yamabico().args(arguments).current_dir(self.folder.path()).output().unwrap()
    }

    /// Writes the task with `exec` as the program of its behavior; returns its path.
    fn with_exec(&self, exec: &str) -> String {
        let task = std::fs::read_to_string(self.folder.file("creeper/task.toml")).unwrap();
        let task = task.replace("\"target/debug/creeper\"", exec);
        let path = self.folder.file("creeper/other.toml");
        std::fs::write(&path, task).unwrap();
        path.to_str().unwrap().to_owned()
    }
}

/// The behavior of the template, built as an example of this crate, as a TOML string.
fn program() -> String {
    format!("\"{}\"", example("new-behavior").display())
}

#[test]
fn a_program_is_composed_by_exec_and_drives() {
    let new = Crate::new("drives");
    let task = new.with_exec(&program());
    let checked = new.yamabico(&["check", &task]);
    assert_exit(&checked, 0, &["programs to start", "creeper ("]);
    let robot = format!("robot.name={}", new.name);
    let ran = new.yamabico(&["run", &task, "--live", "--json", "--set", &robot, "--set", "run.duration_s=4"]);
    assert!(ran.status.success(), "{}", text(&ran));
    let report: Value = serde_json::from_slice(&ran.stdout).unwrap();
    assert!(report["distance_m"].as_f64() > Some(0.3), "{report}");
    assert!(report["behaviors"]["creeper"]["calls"].as_u64() > Some(20), "{report}");
    assert_eq!(report["contacts"].as_u64(), Some(0));
}

#[test]
fn its_parameters_and_inputs_are_checked_like_those_of_a_built_in_behavior() {
    let new = Crate::new("checked");
    let task = new.with_exec(&program());
    for (set, part) in [
        ("behaviors.creeper.speed_mps=20", "speed_mps"),
        ("behaviors.creeper.sped_mps=0.2", "did you mean `speed_mps`"),
        ("behaviors.creeper.inputs.sonar=front", "yamabico.RangeScanHeader.v1"),
    ] {
        let checked = new.yamabico(&["check", &task, "--set", set]);
        assert_eq!(checked.status.code(), Some(2), "{set}");
        assert!(text(&checked).contains(part), "{set}: {}", text(&checked));
    }
}

#[test]
fn the_schema_of_tasks_has_the_keys_of_a_program() {
    let new = Crate::new("schema");
    let task = new.with_exec(&program());
    let printed = new.yamabico(&["schema", "task", "--task", &task]);
    assert!(printed.status.success(), "{}", text(&printed));
    let schema: Value = serde_json::from_slice(&printed.stdout).unwrap();
    let creeper = &schema["properties"]["behaviors"]["properties"]["creeper"];
    assert_eq!(creeper["unevaluatedProperties"], false);
    let keys = &schema["$defs"]["program.creeper"]["properties"];
    assert_eq!(keys["speed_mps"]["type"], "number", "{keys}");
    assert!(keys["inputs"]["properties"]["sonar"].is_object(), "{keys}");
    let missing = new.yamabico(&["schema", "--task", "missing.toml"]);
    assert_exit(&missing, 2, &["file missing.toml does not exist"]);
}

#[test]
fn a_program_that_is_not_a_behavior_is_refused_before_anything_opens() {
    let new = Crate::new("refused");
    let description = |message: &str| {
        format!(
            r#"{{"protocol": 2, "name": "x", "summary": "", "claims": "linear", "outputs": [], "parameters": {{}},
            "inputs": [{{"name": "sonar", "summary": "", "required": true, "message": "{message}"}}]}}"#
        )
    };
    let script = new.folder.file("creeper/plugin.sh");
    std::fs::write(&script, format!("echo '{}'", description("yamabico.RangeScanHeader.v9"))).unwrap();
    for (exec, part) in [
        ("\"/bin/true\"", "answer to --describe is invalid"),
        ("\"sh\", \"-c\", \"echo no such luck >&2; exit 3\"", "no such luck"),
        ("\"no-such-program-anywhere\"", "cannot be started"),
        ("\"sh\", \"./plugin.sh\"", "RangeScanHeader.v9"),
        ("\"sh\", \"./plugin.sh\"", "RangeScanHeader.v1"),
    ] {
        let task = new.with_exec(exec);
        let checked = new.yamabico(&["check", &task]);
        assert_eq!(checked.status.code(), Some(2), "{exec}: {}", text(&checked));
        assert!(text(&checked).contains(part), "{exec}: {}", text(&checked));
    }
}

#[test]
fn a_program_in_lockstep_has_a_digest_and_replays() {
    let new = Crate::new("lockstep");
    let task = new.with_exec(&program());
    let run = |name: &str, threads: &str| {
        let ran = new.yamabico(&[
            "run",
            &task,
            "--json",
            "--out",
            name,
            "--threads",
            threads,
            "--set",
            "run.duration_s=4",
        ]);
        assert!(ran.status.success(), "{}", text(&ran));
        serde_json::from_slice::<Value>(&ran.stdout).unwrap()
    };
    let (first, second) = (run("a", "1"), run("b", "2"));
    assert_eq!(first["digest"], second["digest"]);
    assert!(first["distance_m"].as_f64() > Some(0.3), "{first}");
    assert!(first["behaviors"]["creeper"]["calls"].as_u64() > Some(20), "{first}");
    // Loading the recorded task starts the program, which needs consent.
    assert_exit(&new.yamabico(&["replay", "a/run.mcap"]), 2, &["new-behavior", "--programs"]);
    let replay = |arguments: &[&str]| {
        let replay = new.yamabico(&[&["replay", "a/run.mcap", "--programs", "--json"], arguments].concat());
        serde_json::from_slice::<Value>(&replay.stdout).unwrap_or_else(|_| panic!("{}", text(&replay)))
    };
    let report = replay(&[]);
    assert!(report["first"].is_null(), "{report:#}");
    assert!(report["topics"]["behaviors/creeper/proposal"]["compared"].as_u64() > Some(20), "{report:#}");
    let slower = replay(&["--set", "creeper.speed_mps=0.1"]);
    assert_eq!(slower["first"]["author"], "creeper", "{slower:#}");
}

#[test]
#[ignore = "builds all dependencies of the crate: takes minutes"]
fn a_new_crate_builds_passes_its_tests_and_runs() {
    let new = Crate::new("built");
    let folder = new.folder.file("creeper");
    for command in ["test", "build"] {
        let mut cargo = Command::new(env!("CARGO"));
        let cargo = cargo.arg(command).current_dir(&folder).env_remove("CARGO_TARGET_DIR").output().unwrap();
        assert!(cargo.status.success(), "{}", text(&cargo));
    }
    let (task, robot) = (folder.join("task.toml"), format!("robot.name={}", new.name));
    let set = ["--set", &robot, "--set", "run.duration_s=4"];
    let ran = new.yamabico(&[&["run", task.to_str().unwrap(), "--live", "--json"], &set[..]].concat());
    assert!(ran.status.success(), "{}", text(&ran));
    let report: Value = serde_json::from_slice(&ran.stdout).unwrap();
    assert!(report["distance_m"].as_f64() > Some(0.3), "{report}");
}

#[test]
fn wrong_names_existing_folders_and_wrong_repositories_are_refused() {
    let new = Crate::new("named");
    for (name, part) in [
        ("creeper", "already exists"),
        ("No Name", "did you mean `no-name`?"),
        ("../x", "is not a valid name"),
    ] {
        assert_exit(&new.yamabico(&["new", "behavior", name]), 2, &[part]);
    }
    let lost = new.yamabico(&["new", "behavior", "other", "--repository", "creeper"]);
    assert_exit(&lost, 2, &["creeper does not contain Yamabico's sources", "--repository"]);
    assert!(!new.folder.file("other").exists());
    let found = new.yamabico(&["new", "behavior", "other", "--repository", workspace().to_str().unwrap()]);
    assert_exit(&found, 0, &["created other"]);
}

/// Writes the corridor task with the simulator as an external program, under `clock`; returns its path.
fn with_external_simulator(new: &Crate, clock: &str) -> String {
    let configs = configs().canonicalize().unwrap();
    let robot = config_text("robots/sim-corridor.toml");
    let exec = format!("exec = [\"{}\"]", example("sim_program").display());
    let world = format!("world = \"{}/worlds", configs.display());
    let parts = format!("\"{}/robots/parts/", configs.display());
    let robot = robot.replace("driver = \"sim\"", &exec).replace("world = \"../worlds", &world);
    let robot = robot.replace("\"parts/", &parts);
    let robot = robot.replacen("name = ", &format!("clock = \"{clock}\"\nname = "), 1);
    std::fs::write(new.folder.file("robot.toml"), robot).unwrap();
    let task = config_text("corridor.toml");
    let path = new.folder.file("task.toml");
    std::fs::write(&path, task.replace("robots/sim-corridor.toml", "robot.toml")).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn an_external_driver_runs_on_the_machines_clock_or_its_own() {
    for clock in ["machine", "driver"] {
        let new = Crate::new(&format!("driver-{clock}"));
        let task = with_external_simulator(&new, clock);
        let checked = new.yamabico(&["check", &task]);
        assert_exit(&checked, 0, &["programs to start", "sim ("]);
        let wrong = new.yamabico(&["check", &task, "--set", "robot.sensors.front.period_ms=1"]);
        assert_eq!(wrong.status.code(), Some(2), "{}", text(&wrong));
        assert!(text(&wrong).contains("period_ms"), "{}", text(&wrong));
        let robot = format!("robot.name={}", new.name);
        // A busy machine must not look like a hanging simulator.
        let deadline = "robot.devices.sim.deadline_ms=20000";
        let set = ["--set", &robot, "--set", "run.goal.x_m=1.6", "--set", deadline];
        let ran = new.yamabico(&[&["run", &task, "--live", "--json"], &set[..]].concat());
        assert_eq!(ran.status.code(), Some(0), "{clock}: {}", text(&ran));
        let report: Value = serde_json::from_slice(&ran.stdout).unwrap();
        assert!(report["distance_m"].as_f64() > Some(0.8), "{report}");
        assert_eq!(report["contacts"].as_u64(), Some(0), "{report}");
    }
}

#[test]
fn a_new_driver_is_checked_and_driven() {
    let new = Crate::new("new-driver");
    assert_exit(
        &new.yamabico(&["new", "driver", "wheels"]),
        0,
        &["created wheels", "src/main.rs", "robot.toml"],
    );
    let robot = new.folder.file("wheels/robot.toml");
    let exec = format!("\"{}\"", example("new-driver").display());
    let toml = std::fs::read_to_string(&robot).unwrap();
    std::fs::write(&robot, toml.replace("\"target/debug/wheels\"", &exec)).unwrap();
    let task = new.folder.file("wheels/task.toml");
    let task = task.to_str().unwrap();
    assert_exit(&new.yamabico(&["check", task]), 0, &["programs to start", "base ("]);
    let wrong = new.yamabico(&["check", task, "--set", "robot.sensors.wheels.period_ms=0"]);
    assert_exit(&wrong, 2, &["period_ms"]);
    let name = format!("robot.name={}", new.name);
    let ran = new.yamabico(&["run", task, "--live", "--json", "--set", &name, "--set", "run.duration_s=2"]);
    assert!(ran.status.success(), "{}", text(&ran));
}

#[test]
fn clock_driver_needs_a_driver_with_a_clock() {
    let new = Crate::new("clock");
    let task = config("corridor.toml");
    let checked = new.yamabico(&["check", task.to_str().unwrap(), "--set", "robot.clock=\"driver\""]);
    assert_eq!(checked.status.code(), Some(2), "{}", text(&checked));
    assert!(text(&checked).contains("no driver provides the clock"), "{}", text(&checked));
}
