//! Live runs with small test doubles for devices and behaviors: whatever happens, the robot ends at a standstill.

mod behaviors;
mod devices;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use behaviors::{COMPUTING_TIME, plugins};
use devices::{FLOOD, GIVEN};
use yamabico_core::message::{Command, DecisionHeader, Message, MessageType};
use yamabico_core::time::Time;
use yamabico_host::config::{Overrides, Task, load};
use yamabico_runtime::execution::{Live, Plan, Progress, RunEnd};
use yamabico_runtime::record::{Pace, Tap, Tee};
use yamabico_runtime::run::{Options, RunError, RunResult, run};

const BODY: &str =
    "devices.body = { driver = \"stand-in\" }\ndrive = { device = \"body\", kind = \"motor\" }\n";
const WHEELS: &str = "sensors.wheels = { device = \"body\", kind = \"lasting\" }\n";
/// Speed above which the robot counts as driving, m/s.
const DRIVING_MPS: f64 = 0.05;
const RUNNER: &str = "[behaviors.runner]\npriority = 10\n";

/// A task with a robot and a folder of its own.
struct Test {
    folder: PathBuf,
    robot: String,
    task: Task,
}

impl Test {
    fn new(name: &str, robot: &str, task: &str) -> Test {
        let name = format!("l{}-{name}", std::process::id());
        let folder = std::env::temp_dir().join(format!("yamabico-{name}"));
        std::fs::create_dir_all(&folder).unwrap();
        let robot = format!("name = \"{name}\"\nfootprint = {{ radius_m = 0.2 }}\n{robot}");
        std::fs::write(folder.join("robot.toml"), robot).unwrap();
        std::fs::write(folder.join("task.toml"), format!("robot = \"robot.toml\"\n{task}")).unwrap();
        let task = load(&folder.join("task.toml"), &Overrides::default(), &plugins());
        let task = task.unwrap_or_else(|problems| panic!("{problems}"));
        Test { folder, robot: name, task }
    }

    fn recording(&self) -> PathBuf {
        self.folder.join("run.mcap")
    }

    fn options(&self) -> Options {
        Options { pace: Pace::Live, recording: Some(self.recording()), overwrite: true, ..Options::default() }
    }

    fn run(&self) -> Result<RunResult, RunError> {
        self.run_at(Pace::Live)
    }

    fn run_at(&self, pace: Pace) -> Result<RunResult, RunError> {
        let (flag, options) = (AtomicBool::new(false), Options { pace, ..self.options() });
        run(&self.task, &options, &flag, &mut Tee::default(), &mut |_| {})
    }

    /// Runs, and interrupts once the robot has driven and its drive has received more than `commands`.
    fn run_and_interrupt(&self, commands: usize) -> Result<RunResult, RunError> {
        let flag = AtomicBool::new(false);
        let mut press = |_: Progress| {
            let given = self.given();
            flag.store(given.len() > commands && fastest(&given) > DRIVING_MPS, Ordering::Relaxed);
        };
        run(&self.task, &self.options(), &flag, &mut Tee::default(), &mut press)
    }

    /// Speeds commanded to its drive, m/s.
    fn given(&self) -> Vec<f64> {
        GIVEN.lock().unwrap().get(&self.robot).cloned().unwrap_or_default()
    }

    /// Asserts that the robot drove, and that its last command is a stop.
    fn assert_left_at_rest(&self) {
        let given = self.given();
        let fastest = fastest(&given);
        assert!(fastest > DRIVING_MPS, "it drove at {fastest} m/s");
        assert_eq!(given.last(), Some(&0.0), "its last speed");
    }
}

fn fastest(given: &[f64]) -> f64 {
    given.iter().copied().fold(0.0, f64::max)
}

impl Drop for Test {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

#[test]
fn ctrl_c_ends_at_rest() {
    let test = Test::new("ctrl-c", &format!("{BODY}{WHEELS}"), RUNNER);
    let result = test.run_and_interrupt(25).unwrap();
    assert_eq!((result.end, result.is_done()), (RunEnd::Interrupted, false));
    test.assert_left_at_rest();
    let recording = result.recording.unwrap();
    assert_eq!((recording.problem, recording.missing, result.lost_messages), (None, 0, 0));
    assert!(recording.messages["command"] > 25, "{:?}", recording.messages);
}

#[test]
fn a_robot_without_sensors_runs_and_is_stopped() {
    let test = Test::new("blind", BODY, RUNNER);
    assert_eq!(test.run_and_interrupt(25).unwrap().end, RunEnd::Interrupted);
    test.assert_left_at_rest();
}

#[test]
fn a_sensor_that_dies_leaves_the_drive_at_rest() {
    for (kind, text) in [("failing", "the cable is off"), ("panicking", "panicked: the cable is off")] {
        let side = format!("sensors.side = {{ device = \"body\", kind = \"{kind}\" }}\n");
        for pace in [Pace::Live, Pace::Lockstep] {
            let test = Test::new(&format!("{kind}-{pace:?}"), &format!("{BODY}{WHEELS}{side}"), RUNNER);
            let error = test.run_at(pace).unwrap_err();
            assert!(error.is_of_a_device(), "{error}");
            let error = error.to_string();
            assert!(error.contains("`side`") && error.contains(text), "{error}");
            test.assert_left_at_rest();
        }
    }
}

#[test]
fn speeds_that_are_not_finite_move_nothing() {
    let not_finite = "[behaviors.not-finite]\npriority = 20\n";
    let robot = format!("{BODY}{}", WHEELS.replace("lasting", "not-finite"));
    let test = Test::new("not-finite", &robot, &format!("[run]\nduration_s = 0.5\n{not_finite}"));
    let result = test.run_at(Pace::Lockstep).unwrap();
    assert_eq!((result.end, result.summary.distance_m), (RunEnd::TimeOver, 0.0));
    let given = test.given();
    assert!(given.len() > 20 && given.iter().all(|&speed| speed == 0.0), "{given:?}");
}

#[test]
fn lost_messages_are_reported() {
    let robot = format!("{BODY}{}", WHEELS.replace("lasting", "flooding"));
    let test = Test::new("flood", &robot, &format!("[run]\nduration_s = 0.5\n{RUNNER}"));
    let result = test.run_at(Pace::Lockstep).unwrap();
    assert_eq!((result.lost_messages, result.recording.unwrap().missing), (FLOOD - 1024, FLOOD - 1024));
}

#[test]
fn a_drive_that_panics_is_a_failure() {
    let test = Test::new("motor", &BODY.replace("\"motor\"", "\"panicking\""), RUNNER);
    let error = test.run().unwrap_err().to_string();
    assert!(error.contains("panicked: the motor is off"), "{error}");
}

#[test]
fn the_run_ends_with_its_last_sensor_and_not_with_the_first() {
    let other = "devices.other = { driver = \"stand-in\" }\nsensors.other = { device = \"other\", kind = \"ending\" }\n";
    let run = "[run]\nduration_s = 3\n";
    let test = Test::new("one-ends", &format!("{BODY}{WHEELS}{other}"), &format!("{run}{RUNNER}"));
    let result = test.run().unwrap();
    assert_eq!(
        (result.end, result.is_done()),
        (RunEnd::TimeOver, true),
        "without a goal, the task ends with its time"
    );
    test.assert_left_at_rest();

    let goal = "[run]\nduration_s = 9\ngoal = { x_m = 100, y_m = 0, tolerance_m = 0.3 }\n";
    let wheels = WHEELS.replace("lasting", "ending");
    let test = Test::new("all-end", &format!("{BODY}{wheels}{other}"), &format!("{goal}{RUNNER}"));
    let result = test.run().unwrap();
    assert_eq!((result.end, result.is_done()), (RunEnd::SensorsEnded, false), "it did not arrive");
}

#[test]
fn a_second_robot_of_the_same_name_is_refused_and_leaves_the_recording_alone() {
    let test = Test::new("twice", &format!("{BODY}{WHEELS}"), RUNNER);
    let flag = AtomicBool::new(false);
    let mut refused = None;
    let mut again = |progress: Progress| {
        if progress.elapsed.as_secs_f64() > 0.3 {
            refused.get_or_insert_with(|| test.run().unwrap_err());
            flag.store(true, Ordering::Relaxed);
        }
    };
    let result = run(&test.task, &test.options(), &flag, &mut Tee::default(), &mut again).unwrap();
    let refused = refused.unwrap();
    assert!(refused.to_string().contains("already running") && !refused.is_of_a_device(), "{refused}");
    let bytes = std::fs::read(test.recording()).unwrap();
    assert!(bytes.starts_with(b"\x89MCAP0\r\n"), "the recording has lost its header");
    assert_eq!(bytes.len() as u64, result.recording.unwrap().bytes);
}

#[test]
fn a_device_that_does_not_open_leaves_an_earlier_recording_alone() {
    let test = Test::new("closed", &format!("{BODY}{}", WHEELS.replace("lasting", "unplugged")), RUNNER);
    std::fs::write(test.recording(), "an earlier run").unwrap();
    let error = test.run().unwrap_err();
    assert!(error.is_of_a_device() && error.to_string().contains("cannot open device `body`"), "{error}");
    assert_eq!(std::fs::read(test.recording()).unwrap(), b"an earlier run");
}

#[test]
fn commands_are_published_even_if_decisions_cannot_be() {
    let test = Test::new("mute", &format!("{BODY}{WHEELS}"), &format!("[run]\nduration_s = 2\n{RUNNER}"));
    let mut plan = Plan::new(&test.task, 1);
    let decision = plan.topics.iter_mut().find(|topic| topic.message.name == DecisionHeader::NAME).unwrap();
    decision.spec.list_bytes = 0;
    let mut live = Live::open(plan, &test.robot, None).unwrap();
    let end = live.run(&test.task.run, &AtomicBool::new(false), &mut Tee::default(), &mut |_| {}).unwrap();
    assert_eq!(end, RunEnd::TimeOver);
    test.assert_left_at_rest();
}

#[test]
fn more_behaviors_than_one_thread_can_wait_for_are_received() {
    let idle: String = (0..66)
        .map(|i| format!("[behaviors.idle-{i}]\ntype = \"broken\"\npriority = {}\n", 100 + i))
        .collect();
    let test =
        Test::new("many", &format!("{BODY}{WHEELS}"), &format!("[run]\nduration_s = 3\n{RUNNER}{idle}"));
    let result = test.run().unwrap();
    assert_eq!(result.end, RunEnd::TimeOver);
    test.assert_left_at_rest();
}

#[test]
fn a_behavior_that_panics_is_called_five_times_and_reported() {
    let broken = "[behaviors.broken]\npriority = 20\n";
    let test =
        Test::new("broken", &format!("{BODY}{WHEELS}"), &format!("[run]\nduration_s = 2\n{RUNNER}{broken}"));
    let result = test.run().unwrap();
    let timing = result.summary.behaviors["broken"].timing;
    assert_eq!((timing.calls, timing.panics), (5, 5));
    test.assert_left_at_rest();
}

#[test]
fn the_folder_of_the_recording_is_created_before_anything_opens() {
    let test = Test::new("folder", &format!("{BODY}{WHEELS}"), RUNNER);
    std::fs::write(test.folder.join("file"), "").unwrap();
    let options = Options { recording: Some(test.folder.join("file/run.mcap")), ..test.options() };
    let error =
        run(&test.task, &options, &AtomicBool::new(false), &mut Tee::default(), &mut |_| {}).unwrap_err();
    assert!(
        matches!(&error, RunError::Folder { folder, .. } if folder.ends_with(Path::new("file"))),
        "{error}"
    );
    assert!(!GIVEN.lock().unwrap().contains_key(&test.robot));
}

/// Records every command.
#[derive(Default)]
struct Commands(Vec<Command>);

impl Tap for Commands {
    fn message(&mut self, _: &str, message: &MessageType, _: Time, header: &[u8], _: &[u8]) {
        if message.name == Command::NAME {
            self.0.push(bytemuck::pod_read_unaligned(header));
        }
    }
}

#[test]
fn commands_stamp_their_stages_and_the_summary_counts_late_ones() {
    let slow = "[behaviors.slow]\npriority = 20\ninputs = { wheels = \"wheels\" }\nlatency_budget_ms = 5\n";
    let run_for = "[run]\nduration_s = 2\n";
    let test = Test::new("stages", &format!("{BODY}{WHEELS}"), &format!("{run_for}{RUNNER}{slow}"));
    for pace in [Pace::Live, Pace::Lockstep] {
        let (mut commands, options) = (Commands::default(), Options { pace, ..test.options() });
        let flag = AtomicBool::new(false);
        let result = run(&test.task, &options, &flag, &mut commands, &mut |_| {}).unwrap();
        let ages = commands.0.iter().filter(|command| command.source[0].as_str() == "slow").map(|command| {
            let Command { evidence_ns, received_ns, proposed_ns, accepted_ns, sent_ns, .. } = *command;
            let stages = [evidence_ns, received_ns, proposed_ns, accepted_ns, sent_ns];
            assert!(stages.is_sorted() && accepted_ns <= command.stamp_ns, "{stages:?}");
            proposed_ns - received_ns
        });
        let ages: Vec<u64> = ages.collect();
        let latency = result.summary.behaviors["slow"].latency.unwrap();
        assert!(ages.len() > 10, "{} commands of it", ages.len());
        match pace {
            Pace::Live => {
                assert!(ages.iter().all(|&age| age >= COMPUTING_TIME.as_nanos() as u64));
                let late = commands.0.iter().filter(|command| {
                    command.source[0].as_str() == "slow" && command.stamp_ns - command.evidence_ns > 5_000_000
                });
                assert_eq!(latency.late_commands, late.count() as u64);
                assert!(latency.received_to_proposed.p50_ms >= 8.0, "{latency:?}");
                assert!(result.summary.tick_lateness.count > 20 && result.summary.restarts["slow"] == 0);
            }
            Pace::Lockstep => {
                assert!(ages.iter().all(|&age| age == 0), "computing takes no time in lockstep");
                assert_eq!((result.summary.tick_lateness.count, result.summary.restarts.len()), (0, 0));
            }
        }
    }
}
