//! Deadlines that suit a machine, from measured durations of the plugins' calls.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use serde::Serialize;
use yamabico_core::message::{Heartbeat, Message, MessageType, RawMessage, View};
use yamabico_core::time::Time;
use yamabico_host::config::{Run, Task};
use yamabico_host::{Deadline, DurationHistogram};

use crate::execution::{Live, Plan};
use crate::record::Tap;
use crate::run::RunError;
use crate::supervisor::Program;

/// Factor from the 99th percentile of the calls to a deadline that suits them: a heartbeat period, a quarter of the deadline, and such a
/// call are then less than half of the silence after which a process is killed.
const P99_FACTOR: u32 = 8;
/// Factor from the longest call to a deadline that suits it.
const MAX_FACTOR: u32 = 2;
/// Deadlines are proposed in steps of this length, ms.
const STEP_MS: f64 = 10.0;

/// Durations of a plugin's calls, and the deadline that they need.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeasuredPlugin {
    /// Name in the task or robot file.
    pub name: String,
    /// Set for a device, with a table in the robot file.
    pub is_device: bool,
    /// Set for a behavior without which the robot must not move.
    pub is_critical: bool,
    /// Number of measured calls. For a device, turns of its loop that a heartbeat was due in.
    pub calls: u64,
    /// Median duration of a call, ms. A turn of a device includes a wait of up to 10 ms.
    pub p50_ms: f64,
    /// 99th percentile, ms.
    pub p99_ms: f64,
    /// Maximum, ms.
    pub max_ms: f64,
    /// Silence after which its process counts as hung, by the task or by default, ms.
    pub deadline_ms: f64,
    /// Deadline to state instead, ms; `None` if this one suits the machine.
    pub proposed_ms: Option<f64>,
}

impl MeasuredPlugin {
    fn new(name: &str, deadline: Deadline, calls: &DurationHistogram) -> MeasuredPlugin {
        let ms = |duration: Duration| duration.as_secs_f64() * 1e3;
        let needed = (calls.quantile(0.99) * P99_FACTOR).max(calls.max() * MAX_FACTOR);
        MeasuredPlugin {
            name: name.to_owned(),
            is_device: false,
            is_critical: false,
            calls: calls.count(),
            p50_ms: ms(calls.quantile(0.5)),
            p99_ms: ms(calls.quantile(0.99)),
            max_ms: ms(calls.max()),
            deadline_ms: ms(deadline.hang_timeout()),
            proposed_ms: (needed > deadline.hang_timeout()).then(|| (ms(needed) / STEP_MS).ceil() * STEP_MS),
        }
    }
}

/// Runs `task` live for `duration` with every behavior disabled, so that the robot stands, and measures its plugins. They count as
/// hung only after forty times their deadlines. Without `program`, every plugin gets a thread.
///
/// # Errors
/// A part does not open, or a device fails during the run.
pub fn measure(
    task: &Task,
    duration: Duration,
    program: Option<Program>,
    interrupt: &AtomicBool,
) -> Result<Vec<MeasuredPlugin>, RunError> {
    let mut still = task.clone();
    for behavior in &mut still.behaviors {
        behavior.settings.enabled = false;
        behavior.settings.host.deadline = behavior.settings.host.deadline.patient();
    }
    for device in &mut still.robot.devices {
        device.settings.deadline = device.settings.deadline.patient();
    }
    let mut live = Live::open(Plan::new(&still, 1), &task.robot.robot.name, program)?;
    let run = Run { duration: Some(duration), goal: None, ..still.run };
    let mut turns = DeviceTurns::new(task);
    live.run(&run, interrupt, &mut turns, &mut |_| {})?;
    let calls: BTreeMap<String, DurationHistogram> =
        live.finish().behaviors.into_iter().map(|(name, stats)| (name, stats.calls)).collect();
    let none = DurationHistogram::default();
    let devices = task.robot.devices.iter().map(|device| {
        let turns = turns.of(&device.name).unwrap_or(&none);
        MeasuredPlugin {
            is_device: true,
            ..MeasuredPlugin::new(&device.name, device.settings.deadline, turns)
        }
    });
    let behaviors = task.behaviors.iter().map(|behavior| {
        let (settings, calls) = (&behavior.settings, calls.get(&behavior.name).unwrap_or(&none));
        let is_critical = settings.critical;
        MeasuredPlugin { is_critical, ..MeasuredPlugin::new(&behavior.name, settings.host.deadline, calls) }
    });
    Ok(devices.chain(behaviors).collect())
}

/// The proposed deadlines as keys of the task and the robot file, TOML; empty if there are none.
pub fn proposed_keys(measured: &[MeasuredPlugin]) -> String {
    let mut text = String::new();
    for (is_device, file, group) in [(false, "task", "behaviors"), (true, "robot", "devices")] {
        let of_file = measured.iter().filter(|plugin| plugin.is_device == is_device);
        let mut proposals = of_file.filter_map(|plugin| Some((plugin, plugin.proposed_ms?))).peekable();
        if proposals.peek().is_some() {
            // Writing to a `String` cannot fail.
            let _ = writeln!(text, "# For the {file} file:");
        }
        for (plugin, proposed_ms) in proposals {
            let _ = writeln!(text, "[{group}.{}]", plugin.name);
            if plugin.is_critical {
                let _ = writeln!(text, "# Critical: only after this silence the robot stops.");
            }
            let _ = writeln!(text, "deadline_ms = {proposed_ms:.0}");
        }
    }
    text
}

/// Durations of the devices' turns, from their heartbeats: each comes with the first turn after its period, late by at most one turn.
struct DeviceTurns {
    devices: BTreeMap<String, Turns>,
}

struct Turns {
    period: Duration,
    last: Option<Heartbeat>,
    late: DurationHistogram,
}

impl DeviceTurns {
    fn new(task: &Task) -> DeviceTurns {
        let devices = task.robot.devices.iter().map(|device| {
            let period = device.settings.deadline.heartbeat_period();
            (device.name.clone(), Turns { period, last: None, late: DurationHistogram::default() })
        });
        DeviceTurns { devices: devices.collect() }
    }

    fn of(&self, device: &str) -> Option<&DurationHistogram> {
        self.devices.get(device).map(|turns| &turns.late)
    }
}

impl Tap for DeviceTurns {
    fn message(&mut self, _: &str, message: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        if message.name != Heartbeat::NAME {
            return;
        }
        let Some(View { header: beat, .. }) = View::<Heartbeat>::of(RawMessage { header, items }) else {
            return;
        };
        let Some(turns) = self.devices.get_mut(beat.plugin.as_str()) else { return };
        // A change of state comes early, and a lost heartbeat would look like a long turn.
        if let Some(last) = turns.last.replace(*beat)
            && (last.restarts, last.state, last.sequence + 1) == (beat.restarts, beat.state, beat.sequence)
        {
            let silent = Time(beat.stamp_ns).since(Time(last.stamp_ns));
            turns.late.add(silent.saturating_sub(turns.period));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::Name;

    fn calls(millis: &[u64]) -> DurationHistogram {
        let mut calls = DurationHistogram::default();
        millis.iter().for_each(|millis| calls.add(Duration::from_millis(*millis)));
        calls
    }

    #[test]
    fn a_deadline_is_proposed_where_calls_take_too_long() {
        let of = |deadline_ms: u64, millis: &[u64]| {
            let deadline = Deadline::new(Duration::from_millis(deadline_ms));
            MeasuredPlugin::new("walker", deadline, &calls(millis)).proposed_ms
        };
        assert_eq!(of(250, &[]), None, "not called");
        assert_eq!(of(250, &[20; 100]), None);
        // A p99 is exact to 1/32.
        let proposed = of(250, &[60; 100]).unwrap();
        assert!((480.0..=500.0).contains(&proposed) && proposed % 10.0 == 0.0, "{proposed}");
        assert_eq!(of(4000, &[60; 100]), None, "deadlines are never shortened");
        // One call of 1,000.
        let mut rare = vec![20; 999];
        rare.push(300);
        assert_eq!(of(250, &rare), Some(600.0));
    }

    #[test]
    fn the_keys_can_be_pasted() {
        let plugin = |name: &str, is_device, is_critical, proposed_ms| MeasuredPlugin {
            is_device,
            is_critical,
            proposed_ms,
            ..MeasuredPlugin::new(name, Deadline::default(), &calls(&[]))
        };
        let measured = [
            plugin("sim", true, false, Some(800.0)),
            plugin("sonar-halt", false, true, Some(480.0)),
            plugin("wall-follower", false, false, None),
        ];
        let keys = proposed_keys(&measured);
        let tables: toml::Table = keys.parse().unwrap();
        assert_eq!(tables["behaviors"]["sonar-halt"]["deadline_ms"].as_integer(), Some(480));
        assert_eq!(tables["devices"]["sim"]["deadline_ms"].as_integer(), Some(800));
        assert!(!keys.contains("wall-follower") && keys.contains("# Critical"), "{keys}");
        assert_eq!(proposed_keys(&measured[2..]), "");
    }

    #[test]
    fn a_turn_lasts_as_long_as_a_heartbeat_is_late() {
        let turns = Turns { period: Duration::from_millis(100), last: None, late: calls(&[]) };
        let mut tap = DeviceTurns { devices: [("sim".to_owned(), turns)].into() };
        for (sequence, millis, state) in
            [(1, 0, 0), (2, 100, 1), (3, 240, 1), (4, 345, 1), (6, 900, 1), (7, 1000, 1)]
        {
            let beat = Heartbeat {
                stamp_ns: millis * 1_000_000,
                sequence,
                plugin: Name::new("sim"),
                state,
                restarts: 0,
            };
            tap.message("any", &MessageType::of::<Heartbeat>(), Time::ZERO, bytemuck::bytes_of(&beat), &[]);
        }
        let turns = tap.of("sim").unwrap();
        assert_eq!((turns.count(), turns.max()), (3, Duration::from_millis(40)));
    }
}
