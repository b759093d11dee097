//! A live run beside busy loops: what is killed, and what hangs.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use clap::Args;
use serde_json::Value;
use yamabico_core::message::{Heartbeat, Process, ProcessesHeader};
use yamabico_core::time::Time;
use yamabico_host::bus::Subscriber;
use yamabico_host::{Scheduling, topics};
use yamabico_live_robot::laggard::{Hang, LaggardRobot};
use yamabico_live_robot::load::{Load, Probe};
use yamabico_live_robot::robot::{LiveRobot, signal};
use yamabico_runtime::client::RobotClient;

use super::{PLUGINS, program, quantile, start_slow_hallway};
use crate::report::{Cell, Report, Table, number};

/// Time between two hangs.
const PAUSE: Duration = Duration::from_secs(1);
/// Timeout for the restart of a plugin that hung.
const RESTART_TIMEOUT: Duration = Duration::from_secs(30);
/// Part of its deadline after which a hung process that is idle is dead, and a bit.
const DEADLINES: f64 = 1.5;
/// Deadline of the behavior that sleeps or loops for ever.
const LAGGARD_DEADLINE: Duration = Duration::from_millis(400);

/// Kills, restarts and longest silences of a live run of the hallway beside busy loops; then each plugin is stopped, and the time until
/// it is killed is measured, as for a behavior that sleeps or loops for ever.
///
/// Fails if a plugin was killed that did not hang, or if one that hung lived longer than one and a half deadlines. A loop has longer where
/// it waits for a processor, and is judged without the busy loops, by the share of a processor that a thread gets. Needs `cargo build --release --workspace --example laggard_program` and `cargo build --release` first.
#[derive(Args)]
pub struct Arguments {
    /// Number of busy loops.
    #[arg(long, default_value_t = 4)]
    loops: usize,
    /// Duration, minutes.
    #[arg(long, default_value_t = 10.0)]
    minutes: f64,
    /// Number of hangs of each plugin.
    #[arg(long, default_value_t = 3)]
    hangs: usize,
}

/// Observations of one plugin.
#[derive(Default)]
struct Seen {
    deadline: Duration,
    last: Option<Heartbeat>,
    longest: Duration,
    /// Silences of more than seven eighths of the deadline.
    late: u64,
    process: Option<Process>,
    kills: u64,
    hangs: Vec<Duration>,
}

/// Heartbeats and processes of a running robot.
struct Observer {
    beats: Subscriber<Heartbeat>,
    processes: Subscriber<ProcessesHeader>,
    plugins: BTreeMap<String, Seen>,
}

impl Arguments {
    pub fn run(&self) -> Result<Report, String> {
        let program = program()?;
        let (mut robot, name) = start_slow_hallway(&program, "busy");
        let mut observer = Observer::open(&robot, &name)?;
        let load = Load::start(self.loops, Scheduling::default());
        let begun = Instant::now();
        while begun.elapsed().as_secs_f64() < 60.0 * self.minutes && robot.is_running() {
            robot.observe(Duration::from_millis(5));
            observer.receive();
            robot.commands.clear();
            robot.truth.clear();
        }
        if !robot.is_running() {
            return Err("the run ended early".to_owned());
        }
        let kills: u64 = observer.plugins.values().map(|seen| seen.kills).sum();
        let quiet = observer.table(self);
        for plugin in PLUGINS.iter().cycle().take(self.hangs * PLUGINS.len()) {
            observer.hang(&mut robot, plugin)?;
        }
        let mut hangs = Table::new(
            format!("Last heartbeat to death of a plugin that hangs, beside {} busy loops", self.loops),
            &[
                "plugin",
                "deadline, ms",
                "hangs",
                "p50, ms",
                "max, ms",
                "max, deadlines",
                "a busy thread got, CPUs",
            ],
        );
        let mut longest = 0.0_f64;
        for (name, seen) in &observer.plugins {
            longest =
                longest.max(seen.hangs.iter().max().map_or(0.0, |max| in_deadlines(*max, seen.deadline)));
            hangs.row(hang_row(format!("{name}, stopped"), seen.deadline, &seen.hangs, Cell::None));
        }
        let ended = robot.interrupt();
        let report: Value = serde_json::from_slice(&ended.stdout).map_err(|error| error.to_string())?;
        if let Some(laggard) = laggard(&program) {
            let mut of = |title: &str, hang| -> Result<f64, String> {
                let probe = Probe::start();
                let times = self.hang_laggard(&program, &laggard, hang)?;
                let share = probe.stop();
                let row = hang_row(format!("laggard, {title}"), LAGGARD_DEADLINE, &times, number(share, 2));
                hangs.row(row);
                let longest = times.iter().max().map_or(0.0, |max| in_deadlines(*max, LAGGARD_DEADLINE));
                // A loop has longer where it waits for a processor.
                Ok(if hang == Hang::Loop { longest * share } else { longest })
            };
            longest = longest.max(of("sleeps", Hang::Sleep)?);
            of("loops", Hang::Loop)?;
            drop(load);
            longest = longest.max(of("loops, without the load", Hang::Loop)?);
        }
        Ok(Report::new([quiet, run_table(&report), hangs])
            .require(kills == 0, format!("{kills} processes were killed that did not hang"))
            .require(longest <= DEADLINES, format!("a hang lasted {longest:.2} deadlines")))
    }

    /// Times from the last heartbeat to the end of a behavior that hangs.
    fn hang_laggard(&self, program: &Path, laggard: &Path, hang: Hang) -> Result<Vec<Duration>, String> {
        let name = format!("busy-laggard-{}", std::process::id());
        let keys = format!("deadline_ms = {}", LAGGARD_DEADLINE.as_millis());
        let mut robot = LaggardRobot::start(program, laggard, &name, &keys);
        let times = (0..self.hangs).map(|_| {
            robot.robot.observe(PAUSE);
            robot.hang(hang).map(|end| end.silent).ok_or_else(|| "the laggard was not restarted".to_owned())
        });
        let times = times.collect();
        robot.interrupt();
        times
    }
}

impl Observer {
    fn open(robot: &LiveRobot, name: &str) -> Result<Observer, String> {
        let mut client = RobotClient::join(name).map_err(|error| error.to_string())?;
        let manifest = client.manifest().map_err(|error| error.to_string())?;
        let seen = |timeout_s: f64| Seen { deadline: Duration::from_secs_f64(timeout_s), ..Seen::default() };
        let plugins = manifest.plugins.iter();
        Ok(Observer {
            beats: robot.bus().subscriber(topics::HEARTBEATS).map_err(|error| error.to_string())?,
            processes: robot.bus().subscriber(topics::PROCESSES).map_err(|error| error.to_string())?,
            plugins: plugins.map(|plugin| (plugin.name.clone(), seen(plugin.hang_timeout_s))).collect(),
        })
    }

    fn receive(&mut self) {
        while let Ok(Some(beat)) = self.beats.receive() {
            let beat = *beat.header();
            let Some(seen) = self.plugins.get_mut(beat.plugin.as_str()) else { continue };
            if let Some(last) = seen.last.replace(beat)
                && (last.restarts, last.sequence + 1) == (beat.restarts, beat.sequence)
            {
                let silent = Time(beat.stamp_ns).since(Time(last.stamp_ns));
                seen.longest = seen.longest.max(silent);
                seen.late += u64::from(silent > seen.deadline * 7 / 8);
            }
        }
        while let Ok(Some(report)) = self.processes.receive() {
            for process in report.items() {
                let Some(seen) = self.plugins.get_mut(process.plugin.as_str()) else { continue };
                let before = seen.process.replace(*process);
                let is_new = before.is_none_or(|before| before.ended_ns != process.ended_ns);
                let is_kill = process.ended.as_str().starts_with("was killed after");
                seen.kills += u64::from(is_new && is_kill);
            }
        }
    }

    fn table(&self, arguments: &Arguments) -> Table {
        let title = format!("{} minutes beside {} busy loops", arguments.minutes, arguments.loops);
        let columns = [
            "plugin",
            "deadline, ms",
            "killed",
            "restarts",
            "longest silence, ms",
            "silences above 7/8 deadline",
        ];
        let mut table = Table::new(title, &columns);
        for (name, seen) in &self.plugins {
            table.row([
                name.as_str().into(),
                milliseconds(seen.deadline),
                seen.kills.into(),
                seen.process.map_or(0, |process| process.restarts).into(),
                milliseconds(seen.longest),
                seen.late.into(),
            ]);
        }
        table
    }

    /// Stops the process of a plugin, and waits until it is replaced.
    fn hang(&mut self, robot: &mut LiveRobot, plugin: &str) -> Result<(), String> {
        robot.observe(PAUSE);
        self.receive();
        let newest = |observer: &Observer| observer.plugins.get(plugin).and_then(|seen| seen.last);
        let pid = robot.process_of(plugin).ok_or_else(|| format!("{plugin} is not running"))?;
        let restarts = newest(self).map_or(0, |beat| beat.restarts);
        signal(pid, "STOP");
        let (begun, mut last) = (Instant::now(), Time::ZERO);
        loop {
            robot.observe(Duration::from_millis(2));
            self.receive();
            match newest(self) {
                Some(beat) if beat.restarts == restarts => last = Time(beat.stamp_ns),
                Some(_) => break,
                None => {}
            }
            if begun.elapsed() > RESTART_TIMEOUT {
                return Err(format!("{plugin} was stopped and not replaced"));
            }
        }
        if let Some(seen) = self.plugins.get_mut(plugin)
            && let Some(process) = seen.process
        {
            seen.hangs.push(Time(process.ended_ns).since(last));
        }
        Ok(())
    }
}

/// The program of the behavior that hangs, if it was built.
fn laggard(program: &Path) -> Option<std::path::PathBuf> {
    let path = program.with_file_name("examples").join("laggard_program");
    if !path.is_file() {
        eprintln!("{} does not exist: a behavior that sleeps or loops for ever is left out", path.display());
    }
    path.is_file().then_some(path)
}

fn milliseconds(time: Duration) -> Cell {
    number(1e3 * time.as_secs_f64(), 0)
}

fn in_deadlines(time: Duration, deadline: Duration) -> f64 {
    time.as_secs_f64() / deadline.as_secs_f64()
}

fn hang_row(name: String, deadline: Duration, times: &[Duration], share: Cell) -> [Cell; 7] {
    let max = quantile(times, 1.0);
    [
        name.into(),
        milliseconds(deadline),
        times.len().into(),
        milliseconds(quantile(times, 0.5)),
        milliseconds(max),
        number(in_deadlines(max, deadline), 2),
        share,
    ]
}

/// Figures of the whole run, hangs included.
fn run_table(report: &Value) -> Table {
    let late = |key: &str| number(report["tick_lateness"][key].as_f64().unwrap_or(f64::NAN), 2);
    let mut table = Table::new(
        "The run, hangs included",
        &["tick late p50, ms", "p99, ms", "max, ms", "distance, m", "contacts"],
    );
    table.row([
        late("p50_ms"),
        late("p99_ms"),
        late("max_ms"),
        number(report["distance_m"].as_f64().unwrap_or(f64::NAN), 1),
        report["contacts"].as_u64().unwrap_or(0).into(),
    ]);
    table
}
