//! Message types that programs outside this repository declare, one in Rust and one in Python.

use std::collections::BTreeMap;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use yamabico_core::message::MessageType;
use yamabico_core::time::Time;
use yamabico_live_robot::venv;
use yamabico_runtime::record::{Tap, play};

use super::yamabico;
use crate::program::{TestFolder, assert_exit, binary, example, text};

/// A behavior that takes the wind of the program in Rust, and publishes a message of its own.
const SAIL: &str = r#"
import ctypes

from yamabico import Axes, Behavior, Output, Reason, Slot, abstain, main
from yamabico.structure import Item, Message


class Gust(Item):
    _fields_ = [("speed_mps", ctypes.c_double), ("azimuth_rad", ctypes.c_double)]


class Wind(Message):
    NAME, CHANNEL, ITEM = "acme.Wind.v1", "stream", Gust
    _fields_ = [
        ("stamp_ns", ctypes.c_uint64),
        ("sequence", ctypes.c_uint64),
        ("mean_mps", ctypes.c_double),
        ("gusts", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
    ]


class Sail(Message):
    NAME, CHANNEL = "acme.Sail.v1", "latest"
    _fields_ = [("stamp_ns", ctypes.c_uint64), ("sequence", ctypes.c_uint64), ("angles", ctypes.c_double * 2), ("state", ctypes.c_char * 16)]


class Sailor(Behavior):
    """Trims the sail to the wind."""

    name = "sailor"
    claims = Axes(0)
    wind = Slot(Wind, "wind at the robot")
    sail = Output(Sail, "state of the sail")

    def propose(self, inputs):
        wind = inputs[self.wind].latest
        if wind is None:
            return abstain(Reason.NO_INPUT)
        gusts = [gust.azimuth_rad for gust in wind.items]
        sail = Sail(stamp_ns=wind.header.stamp_ns, sequence=wind.header.sequence, state=b"trimmed")
        sail.angles[:] = gusts
        self.publish(self.sail, sail)
        return abstain(Reason.CLEAR)


main(Sailor)
"#;

/// Counts the messages of each topic and keeps the newest as JSON.
#[derive(Default)]
struct Newest(BTreeMap<String, (u64, serde_json::Value)>);

impl Tap for Newest {
    fn message(&mut self, topic: &str, message: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        let entry = self.0.entry(topic.to_owned()).or_default();
        *entry = (entry.0 + 1, message.to_json(header, items));
    }
}

struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn messages_of_other_programs_are_checked_shown_recorded_and_played() {
    let Some(python) = venv::interpreter(binary()) else { return };
    let folder = TestFolder::new("own-messages");
    let sail = folder.file("sail.py");
    std::fs::write(&sail, SAIL).unwrap();
    let robot = format!("own-messages-{}", std::process::id());
    let task = folder.file("task.toml");
    let text_of = |inputs: &str| {
        format!(
            "robot = {:?}\n[run]\nduration_s = 600\n[arbiter]\nrate_hz = 50\n\
             [behaviors.wind-vane]\nexec = [{:?}]\npriority = 20\n\
             [behaviors.sailor]\nexec = [{:?}, {:?}]\npriority = 10\n{inputs}",
            yamabico_testkit::config("robots/sim-corridor.toml"),
            example("wind_program"),
            python,
            sail
        )
    };
    // The only source of this type is connected by itself, and another one is refused.
    std::fs::write(&task, text_of("inputs = { wind = \"wheels\" }\n")).unwrap();
    let task_text = task.to_str().unwrap();
    assert_exit(&yamabico(&python, &["check", task_text]), 2, &["acme.Wind.v1", "yamabico.Odometry.v1"]);
    std::fs::write(&task, text_of("")).unwrap();
    assert_exit(&yamabico(&python, &["check", task_text]), 0, &["sailor"]);

    let recording = folder.file("run.mcap");
    let name = format!("robot.name={robot}");
    let run = ["run", task_text, "--live", "--record", recording.to_str().unwrap(), "--set", &name];
    let run = Command::new(binary()).args(run).stdin(Stdio::null()).stdout(Stdio::null()).spawn().unwrap();
    let mut running = Running(run);
    let echo = |topic: &str| yamabico(&python, &["topic", "echo", topic, "--once", "--robot", &robot]);
    let begun = Instant::now();
    let shown = loop {
        let echoed = echo("behaviors/sailor/sail");
        if echoed.status.success() {
            break text(&echoed);
        }
        assert!(begun.elapsed() < Duration::from_secs(60), "{}", text(&echoed));
        std::thread::sleep(Duration::from_millis(200));
    };
    assert!(shown.contains("trimmed") && shown.contains("angles"), "{shown}");
    let wind = text(&echo("behaviors/wind-vane/wind"));
    assert!(wind.contains("mean_mps") && wind.contains("azimuth_rad"), "{wind}");
    std::thread::sleep(Duration::from_secs(1));
    let stop = Command::new("kill").args(["-INT", &running.0.id().to_string()]).status().unwrap();
    assert!(stop.success() && running.0.wait().is_ok());

    // This program learns both types from the recording.
    assert!(MessageType::find("acme.Wind.v1").is_none());
    let mut newest = Newest::default();
    let played = play(&recording, &mut newest).unwrap();
    assert!(played.left_out.is_empty(), "{:?}", played.left_out);
    let (count, wind) = &newest.0["behaviors/wind-vane/wind"];
    assert!(
        *count > 10 && wind["items"][1]["azimuth_rad"] == -1.0 && wind["sequence"].is_u64(),
        "{count}: {wind}"
    );
    let (count, sail) = &newest.0["behaviors/sailor/sail"];
    assert!(
        *count > 10 && sail["angles"] == serde_json::json!([1.0, -1.0]) && sail["state"] == "trimmed",
        "{sail}"
    );
}
