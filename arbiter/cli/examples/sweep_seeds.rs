//! Runs a task for many seeds and prints a row for each. Exits with 1 unless the robot arrives for each of them (or for
//! as many as `--least` says) and touches nothing.
//!
//!     cargo run --release --example sweep_seeds -- configs/hallway.toml 20 [--first 1] [--jobs 2] [--least 19] [--json]

use std::ops::Range;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use clap::Parser;
use comfy_table::Table;
use comfy_table::presets::UTF8_FULL_CONDENSED;
use serde::Serialize;
use yamabico::plugins::plugins;
use yamabico_core::message::{Message, MessageType, RawMessage, Truth, View};
use yamabico_core::time::Time;
use yamabico_host::config::{Overrides, Task, load};
use yamabico_runtime::execution::End;
use yamabico_runtime::record::Tap;
use yamabico_runtime::run::{Options, Ran, run};

/// The first meters of a run, in which a robot that starts beside its line comes to it, meters.
const SETTLING_M: f64 = 5.0;

#[derive(Parser)]
struct Arguments {
    /// The task file.
    file: PathBuf,
    /// So many seeds.
    seeds: u64,
    /// The first of them.
    #[arg(long, default_value_t = 1)]
    first: u64,
    /// So many runs at a time.
    #[arg(long, default_value_t = 1)]
    jobs: usize,
    /// So many must arrive without contact; without it, all.
    #[arg(long)]
    least: Option<u64>,
    /// Change a key.
    #[arg(long)]
    set: Vec<String>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Row {
    seed: u64,
    end: End,
    time_s: f64,
    contacts: Option<u32>,
    struck: Option<u32>,
    rms_offset_m: Option<f64>,
    /// The same without the first 5 m.
    settled_rms_offset_m: Option<f64>,
    clearance_m: Option<f64>,
    /// Each time that the robot came to stand near a person: how near.
    stood_at_m: Vec<f64>,
    real_time_factor: f64,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let overrides = Overrides { robot: None, set: arguments.set };
    let task = match load(&arguments.file, &overrides, &plugins()) {
        Ok(task) => task,
        Err(problems) => {
            eprint!("{problems}");
            return ExitCode::from(2);
        }
    };
    let rows = match sweep(
        &task,
        arguments.first..arguments.first.saturating_add(arguments.seeds),
        arguments.jobs,
    ) {
        Ok(rows) => rows,
        Err(problem) => {
            eprintln!("{problem}");
            return ExitCode::from(3);
        }
    };
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&rows).unwrap_or_default());
    } else {
        println!("{}", text(&rows));
    }
    let clean = rows.iter().filter(|row| row.is_clean()).count() as u64;
    if clean >= arguments.least.unwrap_or(arguments.seeds) { ExitCode::SUCCESS } else { ExitCode::from(1) }
}

impl Row {
    fn of(ran: Ran, settled: &Settled) -> Row {
        let summary = ran.summary;
        Row {
            seed: ran.seed,
            end: ran.end,
            time_s: summary.time_s,
            contacts: summary.contacts,
            struck: summary.struck,
            rms_offset_m: summary.rms_offset_m,
            settled_rms_offset_m: settled.rms_offset_m(),
            clearance_m: summary.smallest_clearance_m,
            stood_at_m: summary.encounters.into_iter().flat_map(|met| met.stood_at_m).collect(),
            real_time_factor: summary.real_time_factor,
        }
    }

    fn is_clean(&self) -> bool {
        self.end == End::Arrived && self.contacts.is_none_or(|contacts| contacts == 0)
    }
}

/// Offsets from the reference line, the map's x axis, after the first meters.
#[derive(Default)]
struct Settled {
    square_sum: f64,
    path_m: f64,
    before_m: f64,
}

impl Settled {
    fn rms_offset_m(&self) -> Option<f64> {
        (self.path_m > 0.0).then(|| (self.square_sum / self.path_m).sqrt())
    }
}

impl Tap for Settled {
    fn message(&mut self, _: &str, message: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        if message.name != Truth::NAME {
            return;
        }
        let Some(truth) = View::<Truth>::of(RawMessage { header, items }) else { return };
        let moved_m = truth.header.distance_m - self.before_m;
        self.before_m = truth.header.distance_m;
        if truth.header.distance_m > SETTLING_M && moved_m > 0.0 {
            self.square_sum += moved_m * truth.header.y.powi(2);
            self.path_m += moved_m;
        }
    }
}

/// The runs of `seeds`, up to `jobs` of them at a time, in the order of the seeds.
fn sweep(task: &Task, seeds: Range<u64>, jobs: usize) -> Result<Vec<Row>, String> {
    let next = AtomicU64::new(seeds.start);
    let work = || {
        let mut rows = Vec::new();
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed >= seeds.end {
                return Ok(rows);
            }
            let options = Options { seed, ..Options::default() };
            let mut settled = Settled::default();
            let ran = run(task, &options, &AtomicBool::new(false), &mut settled, &mut |_| {});
            rows.push(Row::of(ran.map_err(|error| format!("seed {seed}: {error}"))?, &settled));
        }
    };
    let parts: Vec<Result<Vec<Row>, String>> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..jobs.max(1)).map(|_| scope.spawn(work)).collect();
        let joined = threads.into_iter().map(std::thread::ScopedJoinHandle::join);
        joined.map(|rows| rows.unwrap_or_else(|_| Err("a run panicked".into()))).collect()
    });
    let mut rows: Vec<Row> =
        parts.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect();
    rows.sort_by_key(|row| row.seed);
    Ok(rows)
}

fn text(rows: &[Row]) -> String {
    let mut table = Table::new();
    let head = [
        "seed",
        "end",
        "time",
        "contacts",
        "struck",
        "RMS offset",
        "after 5 m",
        "clearance",
        "stood from people",
        "x real time",
    ];
    table.load_style(UTF8_FULL_CONDENSED).set_header(head);
    let meters = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:.3} m"));
    let count = |value: Option<u32>| value.map_or("-".into(), |value| value.to_string());
    for row in rows {
        table.add_row([
            row.seed.to_string(),
            format!("{:?}", row.end),
            format!("{:.1} s", row.time_s),
            count(row.contacts),
            count(row.struck),
            meters(row.rms_offset_m),
            meters(row.settled_rms_offset_m),
            meters(row.clearance_m),
            row.stood_at_m.iter().map(|meters| format!("{meters:.2} m")).collect::<Vec<_>>().join(", "),
            format!("{:.1}", row.real_time_factor),
        ]);
    }
    let arrived = rows.iter().filter(|row| row.end == End::Arrived).count();
    let clean = rows.iter().filter(|row| row.is_clean()).count();
    let contacts: u32 = rows.iter().filter_map(|row| row.contacts).sum();
    let worst = rows.iter().filter_map(|row| row.rms_offset_m).fold(0.0, f64::max);
    format!(
        "{table}\n{arrived} of {} arrived, {clean} of them without contact, {contacts} contacts, largest RMS offset {worst:.3} m",
        rows.len()
    )
}
