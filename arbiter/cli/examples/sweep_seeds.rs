//! Runs a task for many seeds and prints a row for each. Exits with 1 unless the robot arrives for each of them and touches
//! nothing.
//!
//!     cargo run --release --example sweep_seeds -- configs/hallway.toml 20 [--json]

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

use clap::Parser;
use comfy_table::Table;
use comfy_table::presets::UTF8_FULL_CONDENSED;
use serde::Serialize;
use yamabico::plugins::PLUGINS;
use yamabico_arbiter::execution::End;
use yamabico_arbiter::record::Tee;
use yamabico_arbiter::run::{Options, run};
use yamabico_core::config::{Overrides, load};

#[derive(Parser)]
struct Arguments {
    /// The task file.
    file: PathBuf,
    /// Seeds 1 to this.
    seeds: u64,
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
    clearance_m: Option<f64>,
    /// Each time that the robot came to stand near a person: how near.
    stood_at_m: Vec<f64>,
    real_time_factor: f64,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let overrides = Overrides { robot: None, set: arguments.set };
    let task = match load(&arguments.file, &overrides, &PLUGINS) {
        Ok(task) => task,
        Err(problems) => {
            eprint!("{problems}");
            return ExitCode::from(2);
        }
    };
    let mut rows = Vec::new();
    for seed in 1..=arguments.seeds {
        let options = Options { seed, ..Options::default() };
        match run(&task, &options, &AtomicBool::new(false), &mut Tee::default(), &mut |_| {}) {
            Ok(ran) => rows.push(Row {
                seed,
                end: ran.end,
                time_s: ran.summary.time_s,
                contacts: ran.summary.contacts,
                struck: ran.summary.struck,
                rms_offset_m: ran.summary.rms_offset_m,
                clearance_m: ran.summary.smallest_clearance_m,
                stood_at_m: ran.summary.encounters.iter().flat_map(|met| met.stood_at_m.clone()).collect(),
                real_time_factor: ran.summary.real_time_factor,
            }),
            Err(error) => {
                eprintln!("seed {seed}: {error}");
                return ExitCode::from(3);
            }
        }
    }
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&rows).unwrap_or_default());
    } else {
        println!("{}", text(&rows));
    }
    let is_clean = |row: &Row| row.end == End::Arrived && row.contacts.is_none_or(|contacts| contacts == 0);
    if rows.iter().all(is_clean) { ExitCode::SUCCESS } else { ExitCode::from(1) }
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
        "clearance",
        "stood from people",
        "x real time",
    ];
    table.load_style(UTF8_FULL_CONDENSED).set_header(head);
    let metres = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:.3} m"));
    let count = |value: Option<u32>| value.map_or("-".into(), |value| value.to_string());
    for row in rows {
        table.add_row([
            row.seed.to_string(),
            format!("{:?}", row.end),
            format!("{:.1} s", row.time_s),
            count(row.contacts),
            count(row.struck),
            metres(row.rms_offset_m),
            metres(row.clearance_m),
            row.stood_at_m.iter().map(|metres| format!("{metres:.2} m")).collect::<Vec<_>>().join(", "),
            format!("{:.1}", row.real_time_factor),
        ]);
    }
    let arrived = rows.iter().filter(|row| row.end == End::Arrived).count();
    let contacts: u32 = rows.iter().filter_map(|row| row.contacts).sum();
    let worst = rows.iter().filter_map(|row| row.rms_offset_m).fold(0.0, f64::max);
    format!(
        "{table}\n{arrived} of {} arrived, {contacts} contacts, largest RMS offset {worst:.3} m",
        rows.len()
    )
}
