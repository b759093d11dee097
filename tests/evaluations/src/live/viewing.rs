//! Cost of viewers: lateness of the arbiter, computing time, and memory of the view.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use clap::Args;
use serde_json::Value;
use yamabico_live_robot::robot::LiveRobot;

use super::process_use::ProcessUse;
use super::viewers::{Addresses, Viewers, deaf, send_nonsense};
use super::{PLUGINS, program, start_slow_hallway};
use crate::report::{Cell, Report, Table, number};
use crate::statistics::nearest_rank;

/// Time before a measurement, for buffers to fill and behaviors to begin drawing.
const SETTLING: Duration = Duration::from_secs(3);
/// Clients beside nonsense: those that look, and those that never read.
const CROWD: (usize, usize) = (40, 10);
/// Number of malformed messages.
const NONSENSE: usize = 10_000;
/// Tolerated growth of the view's memory between the two halves of a long measurement: share, and KiB.
const TOLERANCE: (f64, f64) = (0.02, 512.0);

/// Cost of viewers beside a live run of the hallway: lateness of the commands and computing time with no view, and with a view that 0,
/// 1 and 5 clients follow; then with 50 clients, of which 10 never read, and 10,000 malformed messages.
///
/// Every second client is the page with its pictures, the others subscribe to every channel as Foxglove. With `--minutes`, the view's
/// memory and computing time with 2 clients follow; fails if its memory grows. Needs `cargo build --release --features yamabico/view`.
#[derive(Args)]
pub struct Arguments {
    /// Duration of each measurement, s.
    #[arg(long, default_value_t = 60.0)]
    seconds: f64,
    /// Duration of the measurement of memory, minutes; zero leaves it out.
    #[arg(long, default_value_t = 0.0)]
    minutes: f64,
}

/// A running view.
struct View {
    process: Child,
    addresses: Addresses,
}

impl View {
    fn start(program: &Path, robot: &str) -> Result<View, String> {
        let mut command = Command::new(program);
        command.args(["view", robot, "--port", "0", "--foxglove", "0", "--json"]);
        let mut process =
            command.stdout(Stdio::piped()).spawn().map_err(|error| format!("no view: {error}"))?;
        let lines = BufReader::new(process.stdout.take().ok_or("no output")?).lines();
        let mut text = String::new();
        for line in lines.map_while(Result::ok) {
            text += &line;
            if let Ok(answer) = serde_json::from_str::<Value>(&text) {
                let address = |key: &str| answer[key].as_str().unwrap_or_default().to_owned();
                let page = address("url").trim_start_matches("http://").trim_end_matches('/').to_owned();
                return Ok(View { process, addresses: Addresses { page, foxglove: address("foxglove") } });
            }
        }
        Err(format!("the view did not start: {text}"))
    }

    fn usage(&self) -> Result<ProcessUse, String> {
        ProcessUse::read(self.process.id()).ok_or_else(|| "the view has ended".to_owned())
    }
}

impl Drop for View {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

impl Arguments {
    pub fn run(&self) -> Result<Report, String> {
        let program = program()?;
        let mut table = Table::new(
            format!("Viewers beside the hallway, a run of {} s each", self.seconds),
            &[
                "clients",
                "tick late p50, ms",
                "p99, ms",
                "max, ms",
                "arbiter, %",
                "behaviors, %",
                "view, %",
                "view, MB",
                "messages",
            ],
        );
        table.row(self.measure(&program, "no view", None, |_| {})?);
        for count in [0, 1, 5] {
            table.row(self.measure(&program, &count.to_string(), Some((count, 0)), |_| {})?);
        }
        let mut sent = 0;
        let (looking, deaf) = CROWD;
        let title = format!("{looking}, {deaf} that never read, {NONSENSE} malformed messages");
        table.row(self.measure(&program, &title, Some(CROWD), |addresses| {
            sent = send_nonsense(addresses, NONSENSE);
        })?);
        let mut tables = vec![table];
        let mut is_flat = true;
        if self.minutes > 0.0 {
            let (memory, flat) = self.memory(&program)?;
            tables.push(memory);
            is_flat = flat;
        }
        Ok(Report::new(tables)
            .require(sent == NONSENSE, format!("only {sent} malformed messages were sent"))
            .require(is_flat, "the memory of the view grows"))
    }

    /// Row about one run: `clients` are the number of those that look and of those that never read, `disturb` runs beside them.
    fn measure(
        &self,
        program: &Path,
        title: &str,
        clients: Option<(usize, usize)>,
        disturb: impl FnOnce(&Addresses) + Send,
    ) -> Result<[Cell; 9], String> {
        let (mut robot, name) = start_slow_hallway(program, "viewing");
        let view = clients.map(|_| View::start(program, &name)).transpose()?;
        let followed = view.as_ref().zip(clients);
        let viewers = followed.map(|(view, (looking, _))| Viewers::start(&view.addresses, looking));
        let deaf = followed.map(|(view, (_, count))| deaf(&view.addresses, count));
        robot.observe(SETTLING);
        let read = |robot: &LiveRobot| -> Result<[f64; 3], String> {
            let computed = |pid: u32| ProcessUse::read(pid).map_or(0.0, |usage| usage.computed_s);
            let behaviors = PLUGINS.iter().filter_map(|plugin| robot.process_of(plugin)).map(computed).sum();
            let view = view.as_ref().map(View::usage).transpose()?;
            Ok([computed(robot.supervisor()), behaviors, view.map_or(f64::NAN, |usage| usage.computed_s)])
        };
        let (begun, before) = (Instant::now(), read(&robot)?);
        std::thread::scope(|scope| {
            if let Some(view) = &view {
                scope.spawn(|| disturb(&view.addresses));
            }
            robot.observe(Duration::from_secs_f64(self.seconds));
        });
        let (after, lasted_s) = (read(&robot)?, begun.elapsed().as_secs_f64());
        let memory = view.as_ref().map(View::usage).transpose()?;
        let messages = viewers.map_or(0, Viewers::stop);
        drop((deaf, view));
        if !robot.is_running() {
            return Err("the run ended early".to_owned());
        }
        let ended = robot.interrupt();
        let report: Value = serde_json::from_slice(&ended.stdout).map_err(|error| error.to_string())?;
        let late = |key: &str| number(report["tick_lateness"][key].as_f64().unwrap_or(f64::NAN), 2);
        let share = |part: usize| number(100.0 * (after[part] - before[part]) / lasted_s, 1);
        Ok([
            title.into(),
            late("p50_ms"),
            late("p99_ms"),
            late("max_ms"),
            share(0),
            share(1),
            share(2),
            number(memory.map_or(f64::NAN, |usage| usage.resident_kib / 1024.0), 0),
            messages.into(),
        ])
    }

    /// Memory and computing time of the view with two clients, and true if its memory does not grow.
    fn memory(&self, program: &Path) -> Result<(Table, bool), String> {
        let (mut robot, name) = start_slow_hallway(program, "viewing");
        let view = View::start(program, &name)?;
        let viewers = Viewers::start(&view.addresses, 2);
        let (begun, mut samples) = (Instant::now(), vec![view.usage()?]);
        while begun.elapsed().as_secs_f64() < 60.0 * self.minutes {
            robot.observe(Duration::from_secs(1));
            robot.commands.clear();
            robot.truth.clear();
            samples.push(view.usage()?);
        }
        let messages = viewers.stop();
        // The first fifth is warm-up.
        let warm = &samples[samples.len() / 5..];
        let (first, second) = warm.split_at(warm.len() / 2);
        let mut table = Table::new(
            format!("The view with 2 clients, {} minutes, {messages} messages", self.minutes),
            &["part", "CPU, %", "private, KiB", "descriptors", "threads"],
        );
        let median = |part: &[ProcessUse], value: fn(&ProcessUse) -> f64| {
            nearest_rank(&part.iter().map(value).collect::<Vec<_>>(), 0.5)
        };
        for (name, part) in [("first half", first), ("second half", second)] {
            let (Some(from), Some(to)) = (part.first(), part.last()) else { continue };
            let lasted_s = to.at.duration_since(from.at).as_secs_f64();
            table.row([
                name.into(),
                number(100.0 * (to.computed_s - from.computed_s) / lasted_s, 1),
                number(median(part, |sample| sample.private_kib), 0),
                number(median(part, |sample| sample.descriptors as f64), 0),
                number(median(part, |sample| sample.threads as f64), 0),
            ]);
        }
        let [before, after] = [first, second].map(|part| median(part, |sample| sample.private_kib));
        Ok((table, after <= before * (1.0 + TOLERANCE.0) + TOLERANCE.1))
    }
}
