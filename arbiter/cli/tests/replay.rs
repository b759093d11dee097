//! `yamabico replay` and `repair`: recordings that hold up, compared to the byte, and "what if".

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use serde_json::Value;
use yamabico_core::message::{FrameHeader, Message, MessageType};
use yamabico_core::time::Time;
use yamabico_runtime::record::{Contents, McapRecorder, Pace, Recording, Tap, play};
use yamabico_testkit::config;

use crate::program::{TestFolder, assert_exit, await_true, text, yamabico};

/// Duration of the recorded runs.
const SHORT: [&str; 2] = ["--set", "run.duration_s=3"];

/// Records a run of `task` to `name` in the folder.
fn record(folder: &TestFolder, name: &str, task: &str, arguments: &[&str]) -> PathBuf {
    let file = folder.file(name);
    let mut run = yamabico();
    run.arg("run").arg(config(task)).arg("--out").arg(folder.path()).arg("--record").arg(&file);
    let output = run.args(arguments).output().unwrap();
    assert!(matches!(output.status.code(), Some(0 | 1)), "{output:?}");
    file
}

fn replay(file: &Path, arguments: &[&str]) -> Output {
    yamabico().arg("replay").arg(file).args(arguments).output().unwrap()
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {output:?}"))
}

#[test]
fn a_recording_replays_to_the_byte_without_its_configuration() {
    let folder = TestFolder::new("replay-equal");
    let file = record(&folder, "run.mcap", "hallway.toml", &SHORT);
    // Neither the working directory nor the configuration is needed.
    let elsewhere = folder.file("elsewhere");
    std::fs::create_dir(&elsewhere).unwrap();
    let output = yamabico().arg("replay").arg(&file).current_dir(&elsewhere).output().unwrap();
    assert_exit(&output, 0, &["messages are equal to the byte", "map-localizer", "decision", "command"]);
    let report = json(&replay(&file, &["--json", "--threads", "1"]));
    let notes = report["notes"].as_array().unwrap();
    assert!(notes.len() == 1 && notes[0].as_str().unwrap().contains("--overlays"), "{report}");
    assert!(report["first"].is_null(), "{report}");
    assert!(report["topics"]["decision"]["compared"].as_u64() >= Some(150), "{report}");
    assert!(report["topics"]["behaviors/map-localizer/pose"]["compared"].as_u64() >= Some(20), "{report}");
    let report = json(&replay(&file, &["--json", "--overlays"]));
    assert!(report["first"].is_null() && report["notes"].as_array().unwrap().is_empty(), "{report}");
    assert!(report["topics"]["behaviors/wall-follower/overlay"]["compared"].as_u64() > Some(20), "{report}");
    let report = json(&replay(&file, &["--json", "--decisions"]));
    assert!(report["first"].is_null(), "{report}");
    let topics = report["topics"].as_object().unwrap();
    assert!(topics["decision"]["compared"].as_u64() >= Some(150), "{report}");
    assert!(topics.keys().all(|topic| !topic.starts_with("behaviors/")), "{report}");
}

#[test]
fn a_replay_begins_in_the_middle_and_says_what_is_exact() {
    let folder = TestFolder::new("replay-from");
    let file = record(&folder, "run.mcap", "hallway.toml", &["--set", "run.duration_s=6"]);
    let report = json(&replay(&file, &["--json", "--from", "4"]));
    let notes: Vec<&str> = report["notes"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    let of = |name: &str| {
        let note = notes.iter().find(|note| note.starts_with(name));
        note.copied().unwrap_or_else(|| panic!("{name}: {notes:#?}"))
    };
    assert!(of("map-localizer").contains("continues from its saved state"), "{notes:#?}");
    assert!(of("sonar-halt").contains("begins without a saved state"), "{notes:#?}");
    let compared = |topic: &str| report["topics"][topic]["compared"].as_u64().unwrap();
    assert!((100..=160).contains(&compared("behaviors/sonar-halt/proposal")), "{report:#}");
    // The arbiter is replayed from the beginning.
    assert!(compared("decision") >= 300, "{report:#}");
    let late = replay(&file, &["--from", "100"]);
    assert_exit(&late, 0, &["no behavior is replayed: the recording ends at"]);
}

#[test]
fn a_gain_changed_by_a_billionth_is_found_where_it_first_matters() {
    let folder = TestFolder::new("replay-gain");
    let file = record(&folder, "run.mcap", "corridor.toml", &SHORT);
    let same = replay(&file, &["--set", "wall-follower.speed_mps=0.4"]);
    assert_exit(&same, 0, &["open loop", "0 of"]);
    let output = replay(&file, &["--set", "wall-follower.speed_mps=0.400000001", "--json"]);
    assert_exit(&output, 0, &[]);
    let report = json(&output);
    let first = &report["first"];
    assert_eq!(
        (first["author"].as_str(), report["open_loop"].as_bool()),
        (Some("wall-follower"), Some(true))
    );
    let field = &first["fields"][0];
    let difference = field["replayed"].as_f64().unwrap() - field["recorded"].as_f64().unwrap();
    assert!(difference != 0.0 && difference.abs() < 2e-9, "{field}");
    assert!(field["field"].as_str().unwrap().starts_with("twist."), "{first}");
    let axes = first["axes"].as_array().unwrap();
    assert!(axes.contains(&"linear".into()) && axes.contains(&"angular".into()), "{first}");
    assert!(first["recorded_why"].as_str().unwrap().contains("wall-follower"), "{first}");
    assert!(report["differing_decisions"].as_u64() > Some(50), "{report}");
}

/// Number of the image that is damaged, from 1; images come at 10 Hz.
const DAMAGED: u32 = 9;

/// Copies messages to another recording and flips one bit of one image, at the `rank`-th sharpest vertical edge.
struct Flipper {
    recorder: McapRecorder,
    rank: usize,
    images: u32,
}

impl Tap for Flipper {
    fn message(&mut self, topic: &str, message: &MessageType, time: Time, header: &[u8], items: &[u8]) {
        let mut items = items.to_vec();
        if message.name == FrameHeader::NAME {
            self.images += 1;
            if self.images == DAMAGED {
                let mut edges: Vec<usize> = (1..items.len() - 1).collect();
                edges.sort_by_key(|&at| std::cmp::Reverse(items[at - 1].abs_diff(items[at + 1])));
                items[edges[self.rank]] ^= 0x80;
            }
        }
        self.recorder.message(topic, message, time, header, &items);
    }
}

#[test]
fn one_flipped_bit_in_an_image_is_found_in_the_behavior_that_saw_it() {
    let folder = TestFolder::new("replay-bit");
    let file = record(&folder, "run.mcap", "corridor.toml", &SHORT);
    let contents = Contents::read(&file).unwrap();
    let found = (0..8).map(|rank| {
        let flipped = folder.file(&format!("flipped-{rank}.mcap"));
        let Contents { facts, files } = contents.clone();
        let recording = Recording { facts, files, ..Recording::new(&flipped, Pace::Lockstep) };
        let recorder = McapRecorder::create(recording).unwrap();
        let mut flipper = Flipper { recorder, rank: 50 * rank, images: 0 };
        play(&file, &mut flipper).unwrap();
        assert!(flipper.images > DAMAGED, "{} images", flipper.images);
        assert!(flipper.recorder.finish(BTreeMap::new()).error.is_none());
        (json(&replay(&flipped, &["--json"])), flipped)
    });
    // The median filter of the edge detector removes a bit here and there; the others are found.
    let differing: Vec<(Value, PathBuf)> = found.filter(|(report, _)| !report["first"].is_null()).collect();
    assert!(!differing.is_empty(), "no flipped bit is found");
    for (report, _) in &differing {
        assert_eq!(report["first"]["author"], "wall-follower", "{report}");
        let time_s = report["first"]["time_s"].as_f64().unwrap();
        assert!((0.8..1.0).contains(&time_s), "{time_s} s");
    }
    let output = replay(&differing[0].1, &[]);
    assert_exit(&output, 1, &["first difference: wall-follower", "recorded:", "replayed:"]);
}

#[test]
fn what_if_answers_by_behavior_and_closes_the_loop() {
    let folder = TestFolder::new("replay-what-if");
    let file = record(&folder, "run.mcap", "corridor.toml", &SHORT);
    let both = folder.file("what-if.mcap");
    let output = replay(&file, &["--without", "wall-follower", "--out", both.to_str().unwrap()]);
    assert_exit(&output, 0, &["open loop", "wall-follower", "no behavior", "/what-if/"]);
    let bytes = std::fs::read(&both).unwrap();
    let mut topics: BTreeMap<String, u64> = BTreeMap::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        *topics.entry(message.unwrap().channel.topic.clone()).or_default() += 1;
    }
    assert_eq!(topics["decision"], topics["/what-if/decision"], "{topics:?}");
    assert!(!topics.contains_key("/what-if/behaviors/wall-follower/proposal"), "{topics:?}");
    assert_exit(&replay(&file, &["--without", "wall-folower"]), 2, &["did you mean `wall-follower`"]);

    let faster = ["--set", "wall-follower.speed_mps=0.3", "--closed"];
    assert_exit(&replay(&file, &faster), 0, &["closed loop", "largest distance between both"]);
    let sweep = replay(&file, &["--sweep", "wall-follower.speed_mps=0.2,0.4"]);
    assert_exit(&sweep, 0, &["open loop", "0.2", "0 of"]);
    let refused = replay(&file, &["--set", "wall-follower.speed_mps=99"]);
    assert_exit(&refused, 2, &["exceeds the robot's maximum"]);
}

#[test]
fn a_killed_run_is_repaired_and_replays() {
    let folder = TestFolder::new("replay-killed");
    let file = folder.file("run.mcap");
    let mut run = yamabico();
    run.arg("run").arg(config("corridor.toml")).arg("--out").arg(folder.path());
    let mut run = run.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    // More than one chunk: the first may be cut.
    await_true("nothing is recorded", || file.metadata().is_ok_and(|data| data.len() > 1 << 22));
    run.kill().unwrap();
    run.wait().unwrap();
    assert_exit(&replay(&file, &[]), 0, &["equal to the byte", "the recording breaks off"]);
    let repair = || yamabico().arg("repair").arg(&file).output().unwrap();
    assert_exit(&repair(), 0, &["with an index now", "run.mcap.broken"]);
    let bytes = std::fs::read(&file).unwrap();
    assert!(mcap::Summary::read(&bytes).unwrap().unwrap().stats.unwrap().message_count > 100);
    assert_exit(&replay(&file, &[]), 0, &["equal to the byte", "the recording breaks off"]);
    assert_exit(&repair(), 0, &["nothing was changed"]);
}

#[test]
fn runs_do_not_replace_each_other() {
    let folder = TestFolder::new("replay-folders");
    let run = |arguments: &[&str]| {
        let mut run = yamabico();
        run.arg("run").arg(config("corridor.toml")).args(["--set", "run.duration_s=0.5"]).args(arguments);
        run.current_dir(folder.path()).output().unwrap()
    };
    assert_exit(&run(&[]), 1, &["run.mcap"]);
    let latest = folder.file("out/corridor/latest");
    let first = latest.canonicalize().unwrap();
    std::thread::sleep(Duration::from_millis(10));
    assert_exit(&run(&[]), 1, &[]);
    let second = latest.canonicalize().unwrap();
    assert!(first != second && first.join("run.mcap").is_file() && second.join("trajectory.png").is_file());
    assert_exit(&run(&["--set", "run.nothing=1"]), 2, &[]);
    assert_eq!(std::fs::read_dir(folder.file("out/corridor")).unwrap().count(), 3, "two runs and a link");
    assert_exit(&run(&["--out", "x"]), 1, &[]);
    assert_exit(&run(&["--out", "x"]), 2, &["it exists", "--overwrite"]);
    assert_exit(&run(&["--out", "x", "--overwrite"]), 1, &[]);
}

#[test]
fn what_is_no_recording_of_a_run_is_refused() {
    let folder = TestFolder::new("replay-refused");
    let file = folder.file("run.mcap");
    for bytes in [&b""[..], b"no recording", b"\x89MCAP0\r\n"] {
        std::fs::write(&file, bytes).unwrap();
        let output = replay(&file, &[]);
        assert_exit(&output, 2, &["run.mcap"]);
    }
    assert_exit(&replay(&folder.file("missing.mcap"), &[]), 2, &["cannot be opened"]);
    let plain = McapRecorder::create(Recording::new(folder.file("plain.mcap"), Pace::Lockstep)).unwrap();
    plain.finish(BTreeMap::new());
    assert_exit(&replay(&folder.file("plain.mcap"), &[]), 2, &["the fact `execution`"]);
}

#[test]
fn several_runs_in_one_file_are_several_replays() {
    let folder = TestFolder::new("replay-several");
    let set = ["--set", "run.duration_s=1"];
    let first = record(&folder, "a.mcap", "corridor.toml", &set);
    let second = record(&folder, "b.mcap", "office.toml", &[&set[..], &["--overwrite"]].concat());
    let both = folder.file("both.mcap");
    std::fs::write(&both, [std::fs::read(first).unwrap(), std::fs::read(second).unwrap()].concat()).unwrap();
    assert_exit(&replay(&both, &[]), 0, &["run 1 of 2", "corridor: all", "run 2 of 2", "office: all"]);
    let reports = json(&replay(&both, &["--json"]));
    let tasks: Vec<_> = reports.as_array().unwrap().iter().map(|report| &report["task"]).collect();
    assert_eq!(tasks, ["corridor", "office"]);
    let refused = replay(&both, &["--set", "run.duration_s=2", "--out", "x.mcap"]);
    assert_exit(&refused, 2, &["it holds 2 runs"]);
}

#[test]
fn topics_of_a_recording_are_listed_printed_and_measured() {
    let folder = TestFolder::new("replay-topics");
    let file = record(&folder, "run.mcap", "corridor.toml", &SHORT);
    let topic = |arguments: &[&str]| {
        let mut topic = yamabico();
        topic.arg("topic").args(arguments).arg("--recording").arg(&file).output().unwrap()
    };
    assert_exit(&topic(&["list"]), 0, &["sensors/front", "yamabico.FrameHeader.v1", "50.0 Hz"]);
    let echoed = topic(&["echo", "behaviors/wall-follower/proposal", "-n", "2"]);
    assert_exit(&echoed, 0, &["kind: abstain", "before arrival"]);
    assert_eq!(text(&echoed).matches("---").count(), 2);
    assert_exit(&topic(&["hz", "decision"]), 0, &["50.00 Hz", "interval min 20.00 ms"]);
    let rate = json(&topic(&["hz", "sensors/front", "--json"]));
    assert!((rate["rate_hz"].as_f64().unwrap() - 10.0).abs() < 0.1 && rate["lost"] == 0, "{rate}");
    assert_exit(&topic(&["echo", "sensors/frnt"]), 2, &["did you mean `sensors/front`"]);
}

/// A live run in a folder; killed when dropped.
struct LiveRun {
    robot: String,
    run: Child,
}

impl LiveRun {
    fn start(folder: &TestFolder, task: &str, set: &[&str]) -> LiveRun {
        let robot = format!("replay-{}-{task}", std::process::id()).replace('.', "-");
        let mut run = yamabico();
        run.args(["run", "--live"]).arg(config(task)).arg("--out").arg(folder.path());
        run.args(["--set", &format!("robot.name={robot}")]).args(["--set", "run.duration_s=100000"]);
        // A busy machine must not look like a hanging plugin.
        for behavior in ["map-localizer", "wall-follower", "sonar-halt", "stationary-obstacle-avoider"] {
            run.args(["--set", &format!("behaviors.{behavior}.deadline_ms=20000")]);
        }
        for set in set {
            run.args(["--set", set]);
        }
        let run = run.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let live = LiveRun { robot, run };
        await_true("the robot does not start", || live.call(&["ps"]).status.success());
        live
    }

    fn call(&self, arguments: &[&str]) -> Output {
        yamabico().args(arguments).args(["--robot", &self.robot]).output().unwrap()
    }

    fn pid(&self, plugin: &str) -> Option<u64> {
        let plugins: Value = serde_json::from_slice(&self.call(&["ps", "--json"]).stdout).ok()?;
        plugins.as_array()?.iter().find(|status| status["name"] == plugin)?["pid"].as_u64()
    }

    /// Kills the process of a plugin and waits for the next one.
    fn kill(&self, plugin: &str) {
        let pid = self.pid(plugin).unwrap();
        assert!(Command::new("kill").args(["-9", &pid.to_string()]).status().unwrap().success());
        let is_next = || self.pid(plugin).is_some_and(|next| next != pid);
        await_true("the plugin is not restarted", is_next);
    }

    /// Ends the run as Ctrl-C does.
    fn interrupt(&mut self) {
        let pid = self.run.id().to_string();
        assert!(Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
        self.run.wait().unwrap();
    }
}

impl Drop for LiveRun {
    fn drop(&mut self) {
        let _ = self.run.kill();
        let _ = self.run.wait();
    }
}

#[test]
fn a_live_run_with_requests_and_kills_replays_to_the_byte() {
    let folder = TestFolder::new("replay-live");
    let mut live = LiveRun::start(&folder, "hallway.toml", &["run.goal.y_m=15"]);
    let pause = || std::thread::sleep(Duration::from_millis(700));
    let ask = |arguments: &[&str]| {
        await_true("a request is not answered", || live.call(arguments).status.success());
        pause();
    };
    pause();
    ask(&["set", "wall-follower.speed_mps=0.3"]);
    ask(&["disable", "wall-follower"]);
    for plugin in ["map-localizer", "wall-follower", "sonar-halt"] {
        live.kill(plugin);
        pause();
    }
    ask(&["enable", "wall-follower"]);
    ask(&["estop"]);
    ask(&["reset"]);
    pause();
    live.interrupt();
    let file = folder.file("run.mcap");
    let report = json(&replay(&file, &["--json"]));
    assert!(report["first"].is_null(), "{report:#}");
    let compared = |topic: &str| report["topics"][topic]["compared"].as_u64().unwrap_or(0);
    for (topic, count) in [
        ("decision", 200),
        ("command", 200),
        ("behaviors/map-localizer/proposal", 20),
        ("behaviors/map-localizer/pose", 20),
        ("behaviors/wall-follower/proposal", 20),
        ("behaviors/sonar-halt/proposal", 50),
    ] {
        assert!(compared(topic) >= count, "{topic}: {report:#}");
    }
    let output = replay(&file, &["--set", "wall-follower.speed_mps=0.1"]);
    assert_exit(&output, 0, &["open loop", "decisions differ"]);
    let without = replay(&file, &["--without", "wall-follower"]);
    assert_exit(&without, 0, &["open loop"]);
    // From the middle on, stuck-recovery is handed a recorded decision first: with the verdict about the behavior left out.
    let from = replay(&file, &["--without", "wall-follower", "--from", "2"]);
    assert_exit(&from, 0, &["open loop"]);
}
