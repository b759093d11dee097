//! One task, run for many seeds.

use std::sync::atomic::AtomicBool;

use clap::Args;
use yamabico_core::message::{Message, MessageType, RawMessage, Truth, View};
use yamabico_core::time::Time;
use yamabico_runtime::execution::RunEnd;
use yamabico_runtime::record::Tap;
use yamabico_runtime::run::{Options, RunResult, run};

use super::{TaskRuns, load_task, sweep};
use crate::report::{Cell, Report, Table, number, optional};

/// Distance in which a robot that starts beside its reference line reaches it, m.
const SETTLING_M: f64 = 5.0;

/// Run a task for many seeds, with a row for each; fails unless the robot arrives without contact.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    runs: TaskRuns,
    /// Number of runs that must arrive without contact [default: all].
    #[arg(long, value_name = "COUNT")]
    min_clean: Option<usize>,
}

impl Arguments {
    pub fn run(&self) -> Result<Report, String> {
        let task = load_task(&self.runs.task, &self.runs.set)?;
        let results = sweep(self.runs.seeds.or(1..21), self.runs.jobs, |seed| {
            let options = Options { seed, ..Options::default() };
            let mut settled = SettledOffset::default();
            let result = run(&task, &options, &AtomicBool::new(false), &mut settled, &mut |_| {});
            Ok((result.map_err(|error| error.to_string())?, settled.rms_m()))
        })?;
        let mut runs = Table::new(
            format!("{}", self.runs.task.display()),
            &[
                "seed",
                "end",
                "time, s",
                "contacts",
                "struck",
                "RMS offset, m",
                "after 5 m, m",
                "clearance, m",
                "stopped from people, m",
                "x real time",
            ],
        );
        for (result, settled_m) in &results {
            runs.row(row(result, *settled_m));
        }
        let arrived = results.iter().filter(|(result, _)| result.end == RunEnd::Arrived).count();
        let clean = results.iter().filter(|(result, _)| is_clean(result)).count();
        let contacts: u32 = results.iter().filter_map(|(result, _)| result.summary.contacts).sum();
        let max_m = results.iter().filter_map(|(result, _)| result.summary.rms_offset_m).fold(0.0, f64::max);
        let mut summary =
            Table::new("Summary", &["runs", "arrived", "without contact", "contacts", "max RMS offset, m"]);
        summary.row([results.len().into(), arrived.into(), clean.into(), contacts.into(), number(max_m, 3)]);
        let min_clean = self.min_clean.unwrap_or(results.len());
        let problem = format!("{clean} runs arrived without contact, but {min_clean} must");
        Ok(Report::new([runs, summary]).require(clean >= min_clean, problem))
    }
}

fn is_clean(result: &RunResult) -> bool {
    result.end == RunEnd::Arrived && result.summary.contacts.is_none_or(|contacts| contacts == 0)
}

fn row(result: &RunResult, settled_m: Option<f64>) -> [Cell; 10] {
    let summary = &result.summary;
    let count = |value: Option<u32>| value.map_or(Cell::None, Cell::from);
    let stops = summary.encounters.iter().flat_map(|encounter| &encounter.stood_at_m);
    let stops: Vec<String> = stops.map(|meters| format!("{meters:.2}")).collect();
    [
        result.seed.into(),
        format!("{:?}", result.end).into(),
        number(summary.time_s, 1),
        count(summary.contacts),
        count(summary.struck),
        optional(summary.rms_offset_m, 3),
        optional(settled_m, 3),
        optional(summary.smallest_clearance_m, 3),
        stops.join(", ").into(),
        number(summary.real_time_factor, 1),
    ]
}

/// RMS offset from the reference line, the x axis of the map, after the first meters.
#[derive(Default)]
struct SettledOffset {
    square_sum: f64,
    path_m: f64,
    distance_m: f64,
}

impl SettledOffset {
    fn rms_m(&self) -> Option<f64> {
        (self.path_m > 0.0).then(|| (self.square_sum / self.path_m).sqrt())
    }
}

impl Tap for SettledOffset {
    fn message(&mut self, _: &str, message: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        if message.name != Truth::NAME {
            return;
        }
        let Some(truth) = View::<Truth>::of(RawMessage { header, items }) else { return };
        let moved_m = truth.header.distance_m - self.distance_m;
        self.distance_m = truth.header.distance_m;
        if truth.header.distance_m > SETTLING_M && moved_m > 0.0 {
            self.square_sum += moved_m * truth.header.y.powi(2);
            self.path_m += moved_m;
        }
    }
}
