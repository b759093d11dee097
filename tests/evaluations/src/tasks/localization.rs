//! Pose error of a driving robot for several camera latencies.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::Args;
use nalgebra::{Matrix3, Vector3};
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_core::message::{MessageType, Pose, PoseStatus, Truth};
use yamabico_core::time::Time;
use yamabico_host::topics;
use yamabico_runtime::execution::RunEnd;
use yamabico_runtime::record::Tap;
use yamabico_runtime::run::{Options, run};

use super::load_task;
use crate::arguments::Seeds;
use crate::report::{Report, Table, number, percent};
use crate::statistics::{mean, percentile};

/// 95 % quantile of the chi-square distribution with three degrees of freedom.
const NEES_95: f64 = 7.815;

/// Pose error of a driving robot for several camera latencies, with and without retroactive correction.
///
/// With a long latency the camera captures a frame as soon as the previous one is processed, as slow vision does. The task's
/// `map-localizer` drives; its `max_evidence_age_ms` must allow the latency (configs/localization.toml).
#[derive(Args)]
pub struct Arguments {
    /// Task file, such as configs/localization.toml.
    task: PathBuf,
    #[command(flatten)]
    seeds: Seeds,
    /// Latencies of the camera, ms.
    #[arg(long, value_delimiter = ',', default_value = "40,100,1000,10000")]
    latencies_ms: Vec<u32>,
    /// Name of the camera.
    #[arg(long, default_value = "front")]
    camera: String,
    /// Change a key of the task; may be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Print each pose of the first seed.
    #[arg(long)]
    trace: bool,
}

/// One pose compared with the ground truth.
#[derive(Clone, Copy)]
struct Sample {
    along_m: f64,
    across_m: f64,
    heading_rad: f64,
    nees: f64,
    is_tracking: bool,
}

/// Records poses and ground truth.
#[derive(Default)]
struct PoseTap {
    truth: Vec<(u64, Pose2)>,
    poses: Vec<Pose>,
}

impl Tap for PoseTap {
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

impl PoseTap {
    /// Compares each pose with the ground truth of its stamp.
    fn samples(&self, is_traced: bool) -> Vec<Sample> {
        self.poses.iter().filter_map(|pose| self.compare(pose, is_traced)).collect()
    }

    fn compare(&self, pose: &Pose, is_traced: bool) -> Option<Sample> {
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
        if is_traced {
            eprintln!(
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

/// Returns the normalized estimation error squared.
fn nees(covariance: &[f64; 9], error: &[f64; 3]) -> f64 {
    let error = Vector3::from(*error);
    let inverse = Matrix3::from_row_slice(covariance).try_inverse();
    inverse.map_or(f64::INFINITY, |inverse| error.dot(&(inverse * error)))
}

impl Arguments {
    pub fn run(&self) -> Result<Report, String> {
        let mut table = Table::new(
            "Pose error (95 % quantiles; NEES: mean, 3 if the covariance is right)",
            &[
                "latency, ms",
                "retroactive",
                "runs",
                "arrived",
                "poses",
                "across, cm",
                "along, cm",
                "heading, deg",
                "NEES",
                "in 95 % ellipsoid, %",
                "tracking, %",
                "NEES tracking",
            ],
        );
        for &latency_ms in &self.latencies_ms {
            for retroactive in [true, false] {
                self.row(&mut table, latency_ms, retroactive)?;
            }
        }
        Ok(Report::new([table]))
    }

    fn row(&self, table: &mut Table, latency_ms: u32, retroactive: bool) -> Result<(), String> {
        let camera = &self.camera;
        let mut set = vec![
            format!("robot.sensors.{camera}.latency_ms={latency_ms}"),
            format!("robot.sensors.{camera}.period_ms={}", latency_ms.clamp(100, 10_000)),
            format!("behaviors.map-localizer.retroactive={retroactive}"),
        ];
        set.extend_from_slice(&self.set);
        let task = load_task(&self.task, &set)?;
        let seeds = self.seeds.or(1..6);
        let (mut samples, mut arrived) = (Vec::new(), 0_usize);
        for seed in seeds.clone() {
            let mut tap = PoseTap::default();
            let options = Options { seed, ..Options::default() };
            let result = run(&task, &options, &AtomicBool::new(false), &mut tap, &mut |_| {})
                .map_err(|error| format!("seed {seed}: {error}"))?;
            arrived += usize::from(result.end == RunEnd::Arrived);
            eprintln!(
                "{latency_ms} ms, retroactive {retroactive}, seed {seed}: {:?} after {:.1} s",
                result.end, result.summary.time_s
            );
            samples.append(&mut tap.samples(self.trace && seed == seeds.start));
        }
        let p95 =
            |error: fn(&Sample) -> f64| percentile(&samples.iter().map(error).collect::<Vec<_>>(), 0.95);
        let count = |is_in: fn(&Sample) -> bool| samples.iter().filter(|s| is_in(s)).count() as f64;
        let nees: Vec<f64> = samples.iter().map(|s| s.nees).collect();
        let nees_tracking: Vec<f64> = samples.iter().filter(|s| s.is_tracking).map(|s| s.nees).collect();
        table.row([
            latency_ms.into(),
            if retroactive { "yes" } else { "no" }.into(),
            (seeds.end - seeds.start).into(),
            arrived.into(),
            samples.len().into(),
            number(100.0 * p95(|s| s.across_m.abs()), 1),
            number(100.0 * p95(|s| s.along_m.abs()), 1),
            number(p95(|s| s.heading_rad.abs().to_degrees()), 2),
            number(mean(&nees), 2),
            percent(count(|s| s.nees <= NEES_95), samples.len() as f64),
            percent(count(|s| s.is_tracking), samples.len() as f64),
            number(mean(&nees_tracking), 2),
        ]);
        Ok(())
    }
}
