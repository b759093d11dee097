//! How well a robot knows where it is while it drives: runs a task for some seeds, each with several latencies of its camera, with
//! and without retroactive correction, and compares the pose with the truth.
//!
//!     cargo run --release -p yamabico --example localization_table -- TASK [--seeds 5] [--json]
//!
//! With a latency the camera takes a picture as soon as the one before has been worked on, as slow vision does. The task file's
//! `map-localizer` drives; its `max_evidence_age_ms` has to let it (`configs/localization.toml`).

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

use clap::Parser;
use comfy_table::Table;
use comfy_table::presets::UTF8_FULL_CONDENSED;
use serde::Serialize;
use yamabico::plugins::plugins;
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_core::message::{MessageType, Pose, PoseStatus, Truth};
use yamabico_core::time::Time;
use yamabico_host::config::{Overrides, load};
use yamabico_runtime::execution::{End, topics};
use yamabico_runtime::record::{Tap, Tee};
use yamabico_runtime::run::{Options, run};

#[derive(Parser)]
struct Arguments {
    /// The task file.
    file: PathBuf,
    /// How many seeds.
    #[arg(long, default_value_t = 5)]
    seeds: u64,
    /// The first of them.
    #[arg(long, default_value_t = 1)]
    first: u64,
    /// Latencies of the camera, ms.
    #[arg(long, value_delimiter = ',', default_value = "40,100,1000,10000")]
    latencies: Vec<u32>,
    /// Name of the camera.
    #[arg(long, default_value = "front")]
    camera: String,
    /// Change a key.
    #[arg(long)]
    set: Vec<String>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// Print a line for each pose of the first run, for drawing.
    #[arg(long)]
    trace: bool,
}

/// One row of the table.
#[derive(Serialize)]
struct Row {
    latency_ms: u32,
    retroactive: bool,
    runs: u64,
    arrived: usize,
    poses: usize,
    /// 95 % of the errors are smaller.
    across_m: f64,
    along_m: f64,
    heading_deg: f64,
    /// Mean over all poses, three degrees of freedom.
    nees: f64,
    /// Share of the poses within the 95 % ellipsoid.
    within: f64,
    /// Share of the poses that were said to be good.
    tracking: f64,
    /// As `nees`, of those.
    nees_tracking: f64,
}

/// One pose against the truth.
#[derive(Clone, Copy)]
struct Sample {
    along_m: f64,
    across_m: f64,
    heading_rad: f64,
    nees: f64,
    is_tracking: bool,
}

/// Keeps poses and truths.
#[derive(Default)]
struct Judge {
    truth: Vec<(u64, Pose2)>,
    poses: Vec<Pose>,
}

/// 95 % of the chi-square distribution with three degrees of freedom.
const NEES_95: f64 = 7.815;

impl Tap for Judge {
    fn message(&mut self, topic: &str, _: &MessageType, _: Time, header: &[u8], _: &[u8]) {
        if topic == topics::TRUTH
            && let Ok(truth) = bytemuck::try_from_bytes::<Truth>(header)
        {
            self.truth.push((truth.stamp_ns, Pose2::new(truth.x, truth.y, truth.theta)));
        } else if topic == topics::output("map-localizer", "pose")
            && let Ok(pose) = bytemuck::try_from_bytes::<Pose>(header)
        {
            self.poses.push(*pose);
        }
    }
}

impl Judge {
    /// The poses against the truths of their instants.
    fn samples(&self, traces: bool) -> Vec<Sample> {
        self.poses.iter().filter_map(|pose| self.compare(pose, traces)).collect()
    }

    fn compare(&self, pose: &Pose, traces: bool) -> Option<Sample> {
        let found = self.truth.binary_search_by_key(&pose.stamp_ns, |(stamp, _)| *stamp).ok()?;
        let truth = self.truth[found].1;
        let error = [pose.x - truth.x, pose.y - truth.y, angle_difference(pose.theta, truth.theta)];
        // The hallway runs along x.
        let sample = Sample {
            along_m: error[0],
            across_m: error[1],
            heading_rad: error[2],
            nees: nees(&pose.covariance, &error),
            is_tracking: pose.status() == Some(PoseStatus::Tracking),
        };
        if traces {
            println!(
                "{:.2} {:.3} {:.3} {:.2} {:+.3} {:+.3} {:+.2} sigma {:.3} {:.3} {:.2} nees {:.1} {:?} age {:.2}",
                pose.stamp_ns as f64 * 1e-9,
                truth.x,
                truth.y,
                truth.theta.to_degrees(),
                error[0],
                error[1],
                error[2].to_degrees(),
                pose.covariance[0].sqrt(),
                pose.covariance[4].sqrt(),
                pose.covariance[8].sqrt().to_degrees(),
                sample.nees,
                pose.status(),
                pose.stamp_ns.saturating_sub(pose.evidence_ns) as f64 * 1e-9,
            );
        }
        Some(sample)
    }
}

/// The squared error in units of the covariance.
fn nees(covariance: &[f64; 9], error: &[f64; 3]) -> f64 {
    let matrix = nalgebra::Matrix3::from_row_slice(covariance);
    let error = nalgebra::Vector3::from(*error);
    matrix.try_inverse().map_or(f64::INFINITY, |inverse| error.dot(&(inverse * error)))
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let mut rows = Vec::new();
    for &latency_ms in &arguments.latencies {
        for retroactive in [true, false] {
            match row(&arguments, latency_ms, retroactive) {
                Ok(row) => rows.push(row),
                Err(error) => {
                    eprintln!("{error}");
                    return ExitCode::from(2);
                }
            }
        }
    }
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&rows).unwrap_or_default());
    } else {
        println!("{}", text(&rows));
    }
    ExitCode::SUCCESS
}

fn row(arguments: &Arguments, latency_ms: u32, retroactive: bool) -> Result<Row, String> {
    let camera = &arguments.camera;
    let mut set = vec![
        format!("robot.sensors.{camera}.latency_ms={latency_ms}"),
        format!("robot.sensors.{camera}.period_ms={}", latency_ms.clamp(100, 10_000)),
        format!("behaviors.map-localizer.retroactive={retroactive}"),
    ];
    set.extend_from_slice(&arguments.set);
    let overrides = Overrides { robot: None, set };
    let task = load(&arguments.file, &overrides, &plugins()).map_err(|problems| problems.to_string())?;
    let (mut samples, mut arrived) = (Vec::new(), 0);
    for seed in arguments.first..arguments.first + arguments.seeds {
        let mut judge = Judge::default();
        let options = Options { seed, ..Options::default() };
        let mut tee = Tee(vec![&mut judge]);
        let ran = run(&task, &options, &AtomicBool::new(false), &mut tee, &mut |_| {})
            .map_err(|error| format!("seed {seed}: {error}"))?;
        arrived += usize::from(ran.end == End::Arrived);
        eprintln!(
            "{latency_ms} ms, retroactive {retroactive}, seed {seed}: {:?} after {:.1} s",
            ran.end, ran.summary.time_s
        );
        samples.append(&mut judge.samples(arguments.trace && seed == arguments.first));
    }
    let part = |is_in: fn(&Sample) -> bool| samples.iter().filter(|s| is_in(s)).count() as f64;
    let good: Vec<f64> = samples.iter().filter(|s| s.is_tracking).map(|s| s.nees).collect();
    let all: Vec<f64> = samples.iter().map(|s| s.nees).collect();
    let count = samples.len() as f64;
    Ok(Row {
        latency_ms,
        retroactive,
        runs: arguments.seeds,
        arrived,
        poses: samples.len(),
        across_m: percentile(samples.iter().map(|s| s.across_m.abs())),
        along_m: percentile(samples.iter().map(|s| s.along_m.abs())),
        heading_deg: percentile(samples.iter().map(|s| s.heading_rad.abs().to_degrees())),
        nees: mean(&all),
        within: part(|s| s.nees <= NEES_95) / count,
        tracking: part(|s| s.is_tracking) / count,
        nees_tracking: mean(&good),
    })
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// 95 % of the values are at most this.
fn percentile(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    values.get((0.95 * last as f64).round() as usize).copied().unwrap_or(f64::NAN)
}

fn text(rows: &[Row]) -> String {
    let mut table = Table::new();
    table.load_style(UTF8_FULL_CONDENSED).set_header([
        "latency",
        "retroactive",
        "arrived",
        "across, 95 %",
        "along, 95 %",
        "heading, 95 %",
        "NEES (3)",
        "in 95 %",
        "tracking",
        "NEES tracking",
    ]);
    for row in rows {
        table.add_row([
            format!("{} ms", row.latency_ms),
            if row.retroactive { "yes" } else { "no" }.into(),
            format!("{} of {}", row.arrived, row.runs),
            format!("{:.1} cm", 100.0 * row.across_m),
            format!("{:.1} cm", 100.0 * row.along_m),
            format!("{:.2} deg", row.heading_deg),
            format!("{:.2}", row.nees),
            format!("{:.1} %", 100.0 * row.within),
            format!("{:.1} %", 100.0 * row.tracking),
            format!("{:.2}", row.nees_tracking),
        ]);
    }
    table.to_string()
}
