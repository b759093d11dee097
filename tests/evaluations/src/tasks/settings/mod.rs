//! One task with several settings: smoothness and duration of the trajectories.

mod plot;
mod trajectory;

use std::sync::atomic::AtomicBool;

use clap::Args;
use yamabico_runtime::execution::{Lockstep, Plan, RunEnd};
use yamabico_runtime::run::{Options, run};

use self::plot::{Setting, draw};
use self::trajectory::{Trajectory, TrajectoryTap};
use super::{TaskRuns, load_task, sweep};
use crate::images::Output;
use crate::report::{Report, Table, number};
use crate::statistics::mean;

/// Run a task with each of several settings and compare smoothness and duration of the trajectories.
///
/// Smoothness is that of the commanded velocity, from the first moving command to the last: the integral of the squared acceleration,
/// the mean magnitude of the jerk, and the dimensionless squared jerk. Image: `settings.png`. Fails unless every run arrives without
/// contact. Example: settings configs/corner.toml --seeds 100 --with 'behaviors.free-space-avoider.velocity="considered"' --with
/// 'behaviors.free-space-avoider.velocity="ignored"'
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    runs: TaskRuns,
    /// Setting: a key and its value; repeat for each setting.
    #[arg(long, required = true, value_name = "KEY=VALUE")]
    with: Vec<String>,
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        let seeds = self.runs.seeds.or(1..21);
        let (mut settings, mut walls) = (Vec::new(), Vec::new());
        for with in &self.with {
            let set: Vec<String> = [with].into_iter().chain(&self.runs.set).cloned().collect();
            let task = load_task(&self.runs.task, &set)?;
            let plan = Plan::new(&task, seeds.start);
            let robot = Lockstep::open(plan, task.run.step, 1, None).map_err(|error| error.to_string())?;
            walls = robot.walls();
            let trajectories = sweep(seeds.clone(), self.runs.jobs, |seed| {
                let options = Options { seed, ..Options::default() };
                let mut tap = TrajectoryTap::default();
                let result = run(&task, &options, &AtomicBool::new(false), &mut tap, &mut |_| {})
                    .map_err(|error| error.to_string())?;
                Ok(tap.finish(result.end == RunEnd::Arrived, &result.summary))
            })?;
            let (key, value) = with.split_once('=').unwrap_or(("", with));
            let name = format!("{} {}", key.rsplit('.').next().unwrap_or(key), value.trim_matches('"'));
            settings.push(Setting { name, trajectories });
        }
        if out.is_on() {
            let image = draw(&settings, &walls).map_err(|error| error.to_string())?;
            out.rgb("settings", image.as_raw(), image.width(), image.height())?;
        }
        let is_clean = settings.iter().flat_map(|setting| &setting.trajectories).all(Trajectory::is_clean);
        let report = Report::new([summary(&settings), wins(&settings)]);
        Ok(report.require(is_clean, "a run did not arrive, or had a contact"))
    }
}

fn values(setting: &Setting, value: fn(&Trajectory) -> f64) -> Vec<f64> {
    setting.trajectories.iter().map(value).collect()
}

fn summary(settings: &[Setting]) -> Table {
    let mut table = Table::new(
        "Settings",
        &[
            "setting",
            "runs",
            "arrived",
            "contacts",
            "time, s",
            "max, s",
            "length, m",
            "min clearance, m",
            "squared acceleration, m^2/s^3",
            "jerk, m/s^3",
            "dimensionless jerk",
        ],
    );
    for setting in settings {
        let average = |value: fn(&Trajectory) -> f64| mean(&values(setting, value));
        let arrived = setting.trajectories.iter().filter(|trajectory| trajectory.has_arrived).count();
        let contacts: u32 = setting.trajectories.iter().map(|trajectory| trajectory.contacts).sum();
        let max_s = values(setting, |t| t.time_s).into_iter().fold(f64::NEG_INFINITY, f64::max);
        let clearance_m = values(setting, |t| t.clearance_m).into_iter().fold(f64::INFINITY, f64::min);
        table.row([
            setting.name.clone().into(),
            setting.trajectories.len().into(),
            arrived.into(),
            contacts.into(),
            number(average(|t| t.time_s), 2),
            number(max_s, 2),
            number(average(|t| t.length_m), 2),
            number(clearance_m, 3),
            number(average(|t| t.square_acceleration), 3),
            number(average(|t| t.mean_jerk), 2),
            number(average(|t| t.dimensionless_jerk), 0),
        ]);
    }
    table
}

/// Returns the number of seeds in which the first setting is better than each other one.
fn wins(settings: &[Setting]) -> Table {
    let mut table = Table::new(
        "Seeds in which the first setting is better than",
        &["setting", "seeds", "time", "squared acceleration", "jerk", "dimensionless jerk"],
    );
    if let [first, others @ ..] = settings {
        for other in others {
            let wins = |value: fn(&Trajectory) -> f64| {
                let pairs = first.trajectories.iter().zip(&other.trajectories);
                pairs.filter(|(a, b)| value(a) < value(b)).count()
            };
            table.row([
                other.name.clone().into(),
                first.trajectories.len().into(),
                wins(|t| t.time_s).into(),
                wins(|t| t.square_acceleration).into(),
                wins(|t| t.mean_jerk).into(),
                wins(|t| t.dimensionless_jerk).into(),
            ]);
        }
    }
    table
}
