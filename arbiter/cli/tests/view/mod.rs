//! `yamabico view` in a browser: every panel of a running robot and of a recording, and its commands.

mod browser;
mod foxglove;
mod layout;
mod overlays;

use std::io::{BufRead, BufReader};
use std::process::{Child, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde_json::Value;
use yamabico_core::message::{DecisionHeader, Mode, Twist};
use yamabico_core::time::Time;
use yamabico_host::bus::Bus;
use yamabico_host::topics;
use yamabico_testkit::config;
use yamabico_view::recording::Recording;

use crate::live_control::Robot;
use crate::program::{TIMEOUT, TestFolder, assert_exit, yamabico};
use browser::Browser;

/// A running view.
struct View {
    process: Child,
    url: String,
    foxglove: String,
}

impl View {
    fn start(source: &str, folder: &TestFolder) -> View {
        let mut command = yamabico();
        command.args(["view", source, "--port", "0", "--foxglove", "0", "--json"]).current_dir(folder.path());
        let mut process = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let mut text = String::new();
        let mut output = BufReader::new(process.stdout.take().unwrap());
        // The JSON ends with a line of its own.
        while !text.trim_end().ends_with('}') {
            assert_ne!(output.read_line(&mut text).unwrap(), 0, "{text}");
        }
        let answer: Value = serde_json::from_str(&text).unwrap();
        let text = |key: &str| answer[key].as_str().unwrap_or_default().to_owned();
        View { process, url: text("url"), foxglove: text("foxglove") }
    }
}

impl Drop for View {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Observer of an emergency stop, on a thread of its own.
struct StopWatch(JoinHandle<[Time; 2]>);

impl StopWatch {
    fn start(robot: &str) -> StopWatch {
        let decisions = Bus::join(robot).unwrap().subscriber::<DecisionHeader>(topics::DECISION).unwrap();
        StopWatch(std::thread::spawn(move || {
            let (begun, mut latched) = (Instant::now(), None);
            while begun.elapsed() < TIMEOUT {
                while let Some(decision) = decisions.receive().unwrap() {
                    let decision = decision.header();
                    if decision.mode() == Some(Mode::EmergencyStop) {
                        let since = *latched.get_or_insert(Time(decision.stamp_ns));
                        if decision.commanded == Twist::ZERO {
                            return [since, Time(decision.stamp_ns)];
                        }
                    }
                }
                std::thread::sleep(Duration::from_millis(2));
            }
            panic!("no emergency stop");
        }))
    }

    /// Times after `since` at which the stop was latched, and at which the robot was commanded to stand, s.
    fn read(self, since: Time) -> [f64; 2] {
        self.0.join().unwrap().map(|time| time.seconds_after(since))
    }
}

/// Panels with the condition that they show something.
const PANELS: [(&str, &str); 10] = [
    ("camera", "document.querySelector('#camera').dataset.stamp > 0"),
    ("map", "document.querySelector('#map-note').textContent.includes('pose')"),
    ("axes", "document.querySelectorAll('#axes b').length >= 2"),
    ("behaviors", "document.querySelectorAll('#behaviors tbody .badge').length >= 2"),
    ("reasons", "document.querySelector('#behaviors .why').textContent.length > 3"),
    (
        "strips",
        "document.querySelectorAll('.u-wrap canvas').length == 2 && yamabico.memory.samples.length > 5",
    ),
    ("owners", "document.querySelectorAll('#strip-legend .swatch').length >= 2"),
    ("log", "document.querySelectorAll('#log li').length >= 1"),
    ("latency", "document.querySelectorAll('#latency .stages i').length == 4"),
    ("sensors", "document.querySelectorAll('#sensors tbody tr').length >= 3"),
];

#[test]
fn a_running_robot_is_shown_and_obeys() {
    let Some(mut browser) = Browser::start("a_running_robot_is_shown_and_obeys") else { return };
    // On a busy machine late pictures make the avoider halt.
    let robot = Robot::start("view", &["--set", "behaviors.stationary-obstacle-avoider.enabled=false"]);
    let folder = TestFolder::new("view");
    let view = View::start(robot.name(), &folder);
    browser.resize(1400, 1000);
    browser.open(&view.url);
    for (panel, condition) in PANELS {
        let took = browser.await_true(condition);
        println!("{panel} after {:.1} s", took.as_secs_f64());
    }
    browser
        .await_true("yamabico.memory.setup.map.length > 10 && yamabico.memory.state.scene.scans.length > 0");

    browser.evaluate(
        "(() => { const s = document.querySelector('#parameter-behavior'); s.value = 'map-localizer'; s.onchange(); return true; })()",
    );
    browser.enter("[data-key=\"map-localizer.speed_mps\"] .entry", "0.35");
    let speed = "yamabico.memory.setup.parameters.find(b => b.behavior == 'map-localizer').parameters\
        .find(p => p.key == 'speed_mps').value";
    browser.await_true(&format!("{speed} == 0.35"));

    let toggle = "#behaviors tr[data-behavior=wall-follower] input";
    browser.click(toggle);
    let enabled = "yamabico.memory.state.behaviors.find(b => b.name == 'wall-follower').enabled";
    browser.await_true(&format!("!{enabled}"));
    browser.click(toggle);
    browser.await_true(enabled);

    browser.await_true("yamabico.memory.state.axes.some(axis => axis.commanded > 0.1)");
    let watch = StopWatch::start(robot.name());
    let clicked = Time::monotonic_now();
    browser.click("#estop");
    let [latched, stopped] = watch.read(clicked);
    println!("after the click: emergency stop {latched:.3} s, commanded to stand {stopped:.3} s");
    // On an idle machine 0.2 s at most; other tests run beside this one.
    assert!(latched < 2.0 && stopped < 3.0);
    browser.await_true("yamabico.memory.state.mode == 'emergency stop'");
    browser.await_true("yamabico.memory.state.axes.every(axis => axis.commanded == 0)");
    browser.await_true("document.querySelector('#mode').textContent == 'emergency stop'");

    // A point ahead of the robot, in the middle of the hallway.
    let x_m = browser.evaluate("yamabico.memory.state.scene.truth.x").as_f64().unwrap() + 1.5;
    browser.evaluate("document.querySelector('#map').scrollIntoView({ block: 'center' })");
    let at = browser.evaluate(&format!(
        "(() => {{ const r = document.querySelector('#map').getBoundingClientRect(); \
         const [x, y] = yamabico.map.toScreen({x_m}, 0); return [r.x + x, r.y + y]; }})()"
    ));
    browser.click_at(at[0].as_f64().unwrap(), at[1].as_f64().unwrap());
    browser.await_true(&format!(
        "Math.hypot(yamabico.memory.state.scene.goal[0] - {x_m}, yamabico.memory.state.scene.goal[1]) < 0.1"
    ));
    browser.click("#reset");
    browser.await_true("yamabico.memory.state.mode != 'emergency stop'");
    browser.await_true(&format!("Math.abs(yamabico.memory.state.scene.truth.x - {x_m}) < 0.5"));

    browser.click("#save");
    browser.await_true("document.querySelector('#toast').textContent.includes('saved the last 60 s')");
    let files: Vec<_> =
        std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
    let saved = Recording::open(&files[0]).unwrap();
    assert!(saved.duration_s() > 1.0 && saved.left_out() == 0, "{files:?}: {} s", saved.duration_s());

    browser.resize(390, 844);
    let wide = browser.evaluate("document.documentElement.scrollWidth");
    assert!(wide.as_f64().unwrap() <= 390.0, "the page is {wide} pixels wide on a phone");
    browser.evaluate("window.scrollTo(0, 1e6)");
    let top = browser.evaluate("document.querySelector('#estop').getBoundingClientRect().top");
    assert!((0.0..200.0).contains(&top.as_f64().unwrap()), "the emergency stop is always in sight: {top}");
}

#[test]
fn a_recording_is_shown_and_played() {
    let Some(mut browser) = Browser::start("a_recording_is_shown_and_played") else { return };
    let folder = TestFolder::new("view-recording");
    let mut run = yamabico();
    run.arg("run")
        .arg(config("corridor.toml"))
        .args(["--set", "run.duration_s=6"])
        .arg("--out")
        .arg(folder.path());
    assert_exit(&run.output().unwrap(), 1, &["recording"]);
    let recording = find_recording(folder.path()).expect("a recording");
    let view = View::start(recording.to_str().unwrap(), &folder);
    browser.resize(1400, 1000);
    browser.open(&view.url);
    browser.await_true("yamabico.memory.state.source.source == 'recording'");
    browser.evaluate("yamabico.command({ command: 'seek', at_s: 4 })");
    browser.await_true("Math.abs(yamabico.memory.state.time_s - 4) < 0.1");
    for (panel, condition) in PANELS {
        let took = browser.await_true(condition);
        println!("{panel} after {:.1} s", took.as_secs_f64());
    }
    assert_eq!(browser.evaluate("getComputedStyle(document.querySelector('#estop')).display"), "none");
    browser.click("#play");
    browser.await_true("yamabico.memory.state.source.position_s > 4.5");
    browser.click("#play");
    browser.await_true("!yamabico.memory.state.source.is_playing");
    browser.click("#back");
    browser.await_true("yamabico.memory.state.source.position_s < 4.5");
    // The keys of a slider drag it, too.
    browser.evaluate("(() => { const s = document.querySelector('#position'); s.value = 2; s.oninput(); s.onchange(); })()");
    browser.await_true("Math.abs(yamabico.memory.state.source.position_s - 2) < 0.1");
}

#[test]
fn a_recording_is_explained() {
    let folder = TestFolder::new("why-recording");
    let mut run = yamabico();
    run.arg("run")
        .arg(config("corridor.toml"))
        .args(["--set", "run.duration_s=4"])
        .arg("--out")
        .arg(folder.path());
    assert_exit(&run.output().unwrap(), 1, &["recording"]);
    let recording = find_recording(folder.path()).expect("a recording");
    let why = |arguments: &[&str]| yamabico().arg("why").arg(&recording).args(arguments).output().unwrap();
    assert_exit(&why(&["--at", "3"]), 0, &["[    3.0", "driving", "wall-follower (10)"]);
    let changes = why(&["--every-change"]);
    assert_exit(&changes, 0, &["driving"]);
    let count = String::from_utf8_lossy(&changes.stdout).matches(" s] ").count();
    assert!((2..80).contains(&count), "{count} changes");
    let json: Value = serde_json::from_slice(&why(&["--at", "2", "--json"]).stdout).unwrap();
    assert_eq!(
        (json["mode"].as_str(), json["verdicts"].as_array().map(Vec::len)),
        (Some("driving"), Some(3))
    );
    assert_exit(&why(&["--at", "3", "--every-change"]), 2, &[]);
    assert_exit(&yamabico().args(["why", "missing.mcap"]).output().unwrap(), 3, &["cannot be read"]);
}

/// The recording of a run, in whichever folder below `folder`.
fn find_recording(folder: &std::path::Path) -> Option<std::path::PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.into_iter().find_map(|path| match path.is_dir() {
        true => find_recording(&path),
        false => path.extension().is_some_and(|extension| extension == "mcap").then_some(path),
    })
}
