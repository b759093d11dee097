//! Resources of a long live run.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use clap::Args;
use serde_json::Value;
use yamabico_live_robot::robot::{BareTimer, LiveRobot, Resources};

use super::process_use::ProcessUse;
use super::{PLUGINS, program};
use crate::report::{Report, Table, number};

const SUPERVISOR: &str = "arbiter and supervisor";
const PERIOD: Duration = Duration::from_millis(10);
/// Tolerated growth of memory between the two parts of a run: share, and KiB.
const TOLERANCE: (f64, f64) = (0.01, 256.0);
/// Growth of the supervisor's memory by the index of the recording and the plotted path, KiB/s.
const INDEX_KIB_S: f64 = 1.5;

/// Memory, descriptors, threads and lateness of a live run of the hallway at 100 Hz with all its behaviors.
///
/// Samples each process and the bus every second. The last two fifths of the run are compared with the two before; the first fifth is
/// warm-up. Fails if something grows or a plugin is restarted. Needs `cargo build --release` first.
#[derive(Args)]
pub struct Arguments {
    /// Duration, minutes.
    #[arg(long, default_value_t = 10.0)]
    minutes: f64,
}

impl Arguments {
    pub fn run(&self) -> Result<Report, String> {
        let program = program()?;
        let name = format!("soak-{}", std::process::id());
        // Slow enough not to reach the end of the hallway; the goal is beyond it.
        let speed_mps = (10.0 / (60.0 * self.minutes)).clamp(0.02, 0.4);
        let speed = |behavior: &str| format!("behaviors.{behavior}.speed_mps={speed_mps}");
        let (localizer, follower) = (speed("map-localizer"), speed("wall-follower"));
        let duration = format!("run.duration_s={}", 120.0 * self.minutes);
        let set = ["arbiter.rate_hz=100", "run.goal.x_m=60", &duration, &localizer, &follower];
        let mut robot = LiveRobot::start(&program, "hallway.toml", &name, PLUGINS.len(), &set);
        let timer = BareTimer::start(PERIOD);
        let begun = Instant::now();
        let mut samples: BTreeMap<&str, Vec<ProcessUse>> = BTreeMap::new();
        let mut resources: Vec<Resources> = Vec::new();
        while begun.elapsed().as_secs_f64() < 60.0 * self.minutes {
            robot.observe(Duration::from_secs(1));
            // The records of this program must not grow either.
            robot.commands.clear();
            robot.truth.clear();
            resources.push(robot.resources());
            let plugins = PLUGINS.iter().map(|plugin| (*plugin, robot.process_of(plugin)));
            for (name, pid) in plugins.chain([(SUPERVISOR, Some(robot.supervisor()))]) {
                samples.entry(name).or_default().extend(pid.and_then(ProcessUse::read));
            }
        }
        let timer = timer.stop().max;
        if !robot.is_running() {
            return Err("the run ended early".to_owned());
        }
        let ended = robot.interrupt();
        let report: Value = serde_json::from_slice(&ended.stdout).map_err(|error| error.to_string())?;
        let (processes, is_flat) = processes(&samples);
        let (bus, is_constant) = bus(&resources);
        let restarts = report["restarts"].as_object().map(|restarts| restarts.values().collect::<Vec<_>>());
        let has_restarts = restarts.is_none_or(|counts| counts.iter().any(|count| count.as_u64() != Some(0)));
        let tables = [self.lateness(&report, timer), processes, bus];
        Ok(Report::new(tables)
            .require(is_flat && is_constant, "the use of resources grows")
            .require(!has_restarts, format!("plugins were restarted: {}", report["restarts"])))
    }

    fn lateness(&self, report: &Value, timer: Duration) -> Table {
        let late = |key: &str| report["tick_lateness"][key].as_f64().unwrap_or(f64::NAN);
        let mut table = Table::new(
            format!("{} minutes at 100 Hz", self.minutes),
            &["ticks", "late p50, ms", "p99, ms", "max, ms", "bare timer max, ms", "distance, m", "contacts"],
        );
        table.row([
            number(late("count"), 0),
            number(late("p50_ms"), 2),
            number(late("p99_ms"), 2),
            number(late("max_ms"), 1),
            number(timer.as_secs_f64() * 1e3, 1),
            number(report["distance_m"].as_f64().unwrap_or(f64::NAN), 1),
            report["contacts"].as_u64().unwrap_or(0).into(),
        ]);
        table
    }
}

/// Returns the resources of each process, and true if none grows.
fn processes(samples: &BTreeMap<&str, Vec<ProcessUse>>) -> (Table, bool) {
    let mut table = Table::new(
        "Processes (medians of two parts of the run)",
        &[
            "process",
            "CPU, %",
            "resident, KiB",
            "private, KiB",
            "later, KiB",
            "descriptors",
            "threads",
            "trend",
        ],
    );
    let mut is_flat = true;
    for name in PLUGINS.into_iter().chain([SUPERVISOR]) {
        let samples = samples.get(name).map_or(&[] as &[ProcessUse], Vec::as_slice);
        let (Some(first), Some(last)) = (samples.first(), samples.last()) else {
            is_flat = false;
            continue;
        };
        let (before, after) = halves(samples);
        let median = |part: &[ProcessUse], value: fn(&ProcessUse) -> f64| {
            let mut values: Vec<f64> = part.iter().map(value).collect();
            values.sort_by(f64::total_cmp);
            values.get(values.len() / 2).copied().unwrap_or_default()
        };
        // Medians, since a folder that the supervisor reads is open for an instant.
        let both = |value| (median(before, value), median(after, value));
        let memory = both(|sample| sample.private_kib);
        let descriptors = both(|sample| sample.descriptors as f64);
        let threads = both(|sample| sample.threads as f64);
        let lasted_s = last.at.duration_since(first.at).as_secs_f64().max(1.0);
        let index_kib = if name == SUPERVISOR { INDEX_KIB_S * 0.4 * lasted_s } else { 0.0 };
        let grows = memory.1 > memory.0 * (1.0 + TOLERANCE.0) + TOLERANCE.1 + index_kib
            || descriptors.1 > descriptors.0
            || threads.1 > threads.0;
        is_flat &= !grows;
        table.row([
            name.into(),
            number(100.0 * (last.computed_s - first.computed_s) / lasted_s, 1),
            number(last.resident_kib, 0),
            number(memory.0, 0),
            number(memory.1, 0),
            number(descriptors.1, 0),
            number(threads.1, 0),
            if grows { "grows" } else { "constant" }.into(),
        ]);
    }
    (table, is_flat)
}

/// Returns the maximum resources of the bus in both parts of the run, and true if they do not grow.
fn bus(resources: &[Resources]) -> (Table, bool) {
    let (before, after) = halves(resources);
    let max = |part: &[Resources]| {
        let start = (0, 0);
        part.iter().fold(start, |(segments, files), now| (segments.max(now.segments), files.max(now.files)))
    };
    let (before, after) = (max(before), max(after));
    let mut table = Table::new("Bus", &["part", "shared memory segments", "files"]);
    for (part, (segments, files)) in [("before", before), ("later", after)] {
        table.row([part.into(), segments.into(), files.into()]);
    }
    (table, after.0 <= before.0 && after.1 <= before.1)
}

/// Returns the second and third fifth of `all`, and the last two.
fn halves<T>(all: &[T]) -> (&[T], &[T]) {
    let warm = &all[all.len() / 5..];
    warm.split_at(warm.len() / 2)
}
