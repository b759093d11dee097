//! Runs a task for many seeds with each of several settings, prints how smooth and how quick the ways were, and draws them.
//! Exits with 1 unless every run arrives without contact.
//!
//!     cargo run --release -p yamabico --example compare_ways -- configs/corner.toml 100 [--first 1] [--jobs 2] \
//!         --with 'behaviors.free-space-avoider.velocity="considered"' \
//!         --with 'behaviors.free-space-avoider.velocity="ignored"' [--out corner.png]
//!
//! Of the commanded velocity, from the first command that moves the robot to the last: the integral of its squared acceleration
//! (m^2/s^3), the mean magnitude of its jerk (m/s^3), and its dimensionless squared jerk.

mod plot;
mod way;

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use clap::Parser;
use comfy_table::Table;
use comfy_table::presets::UTF8_FULL_CONDENSED;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use yamabico::plugins::plugins;
use yamabico_host::config::{Overrides, Task, load};
use yamabico_runtime::execution::{End, Lockstep, Plan};
use yamabico_runtime::run::{Options, run};

use plot::{Setting, draw};
use way::{Way, WayTap};

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
    /// A key and its value: a setting.
    #[arg(long, required = true)]
    with: Vec<String>,
    /// Change a key in every setting.
    #[arg(long)]
    set: Vec<String>,
    /// Where the picture goes.
    #[arg(long)]
    out: Option<PathBuf>,
}

fn main() -> ExitCode {
    match compare(&Arguments::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(problem) => {
            eprintln!("{problem}");
            ExitCode::from(2)
        }
    }
}

/// Whether every run arrived without contact.
fn compare(arguments: &Arguments) -> Result<bool, String> {
    let (mut settings, mut walls) = (Vec::new(), Vec::new());
    for with in &arguments.with {
        let set = [with].into_iter().chain(&arguments.set).cloned().collect();
        let overrides = Overrides { robot: None, set };
        let task = load(&arguments.file, &overrides, &plugins()).map_err(|problems| problems.to_string())?;
        let plan = Plan::new(&task, arguments.first);
        let robot = Lockstep::open(plan, task.run.step, 1).map_err(|error| error.to_string())?;
        walls = robot.walls();
        let ways = sweep(&task, arguments)?;
        let (key, value) = with.split_once('=').unwrap_or(("", with));
        let name = format!("{} {}", key.rsplit('.').next().unwrap_or(key), value.trim_matches('"'));
        settings.push(Setting { name, ways });
    }
    println!("{}", text(&settings));
    if let Some(path) = &arguments.out {
        let picture = draw(&settings, &walls).map_err(|error| error.to_string())?;
        let cannot = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
        let file = std::fs::File::create(path).map_err(|error| cannot(&error))?;
        let encoder = PngEncoder::new_with_quality(file, CompressionType::Best, FilterType::Sub);
        picture.write_with_encoder(encoder).map_err(|error| cannot(&error))?;
    }
    Ok(settings.iter().flat_map(|setting| &setting.ways).all(Way::is_clean))
}

/// The ways of all seeds, in their order.
fn sweep(task: &Task, arguments: &Arguments) -> Result<Vec<Way>, String> {
    let next = AtomicU64::new(arguments.first);
    let end = arguments.first.saturating_add(arguments.seeds);
    let work = || {
        let mut ways = Vec::new();
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed >= end {
                return Ok(ways);
            }
            let options = Options { seed, ..Options::default() };
            let mut tap = WayTap::default();
            let ran = run(task, &options, &AtomicBool::new(false), &mut tap, &mut |_| {})
                .map_err(|error| format!("seed {seed}: {error}"))?;
            ways.push((seed, tap.finish(ran.end == End::Arrived, &ran.summary)));
        }
    };
    let parts: Vec<Result<Vec<(u64, Way)>, String>> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..arguments.jobs.max(1)).map(|_| scope.spawn(work)).collect();
        let joined = threads.into_iter().map(std::thread::ScopedJoinHandle::join);
        joined.map(|ways| ways.unwrap_or_else(|_| Err("a run panicked".into()))).collect()
    });
    let mut ways: Vec<_> = parts.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect();
    ways.sort_by_key(|(seed, _)| *seed);
    Ok(ways.into_iter().map(|(_, way)| way).collect())
}

fn text(settings: &[Setting]) -> String {
    let mut table = Table::new();
    table.load_style(UTF8_FULL_CONDENSED).set_header([
        "setting",
        "arrived",
        "contacts",
        "time: mean (most)",
        "way",
        "least clearance",
        "squared acceleration",
        "jerk",
        "dimensionless",
    ]);
    for Setting { name, ways } in settings {
        let mean = |of: fn(&Way) -> f64| ways.iter().map(of).sum::<f64>() / ways.len() as f64;
        let most = |of: fn(&Way) -> f64| ways.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
        table.add_row([
            name.clone(),
            format!("{} of {}", ways.iter().filter(|way| way.has_arrived).count(), ways.len()),
            ways.iter().map(|way| way.contacts).sum::<u32>().to_string(),
            format!("{:.2} s ({:.2})", mean(|way| way.time_s), most(|way| way.time_s)),
            format!("{:.2} m", mean(|way| way.length_m)),
            format!("{:.3} m", -most(|way| -way.clearance_m)),
            format!("{:.3} m^2/s^3", mean(|way| way.square_acceleration)),
            format!("{:.2} m/s^3", mean(|way| way.mean_jerk)),
            format!("{:.3e}", mean(|way| way.dimensionless_jerk)),
        ]);
    }
    let mut lines = vec![table.to_string()];
    if let [first, others @ ..] = settings {
        for other in others {
            let wins = |of: fn(&Way) -> f64| {
                first.ways.iter().zip(&other.ways).filter(|(a, b)| of(a) < of(b)).count()
            };
            lines.push(format!(
                "of {} seeds, {} is quicker than {} in {}, has less squared acceleration in {}, less jerk in {}, \
                 less of the dimensionless one in {}",
                first.ways.len(),
                first.name,
                other.name,
                wins(|way| way.time_s),
                wins(|way| way.square_acceleration),
                wins(|way| way.mean_jerk),
                wins(|way| way.dimensionless_jerk),
            ));
        }
    }
    lines.join("\n")
}
