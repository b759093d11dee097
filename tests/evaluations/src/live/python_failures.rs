//! Recovery from failures of a behavior in Python.

use std::time::Duration;

use clap::Args;
use yamabico_live_robot::python_failures::{Failure, FragileRobot};
use yamabico_live_robot::venv;

use super::{TIMES, program, times_row};
use crate::report::{Report, Table, number};

/// Time until a behavior in Python is restarted after an exception, an exit, a hang, a kill, and misuse of a frame.
///
/// Needs `cargo build --release` first.
#[derive(Args)]
pub struct Arguments {
    /// Number of failures of each kind.
    #[arg(long, default_value_t = 20)]
    times: usize,
}

impl Arguments {
    pub fn run(&self) -> Result<Report, String> {
        let program = program()?;
        let Some(python) = venv::interpreter(&program) else { return Ok(Report::default()) };
        let name = format!("python-failures-{}", std::process::id());
        let mut fragile = FragileRobot::start(&program, &python, &name);
        fragile.robot.observe(Duration::from_secs(2));
        // In turns: after five exceptions of one process it would not be restarted.
        let mut recoveries = vec![Vec::new(); Failure::ALL.len()];
        for _ in 0..self.times {
            for (failure, recoveries) in Failure::ALL.into_iter().zip(&mut recoveries) {
                let time = fragile.provoke(failure).ok_or(format!("{failure:?}: no restart"))?;
                recoveries.push(time);
                fragile.robot.observe(Duration::from_millis(800));
            }
        }
        let mut table = Table::new("Failure to next proposal", &TIMES);
        for (failure, recoveries) in Failure::ALL.iter().zip(&recoveries) {
            table.row(times_row(format!("{failure:?}"), recoveries));
        }
        table.row(times_row("all", &recoveries.concat()));
        let ended = fragile.interrupt();
        let report: serde_json::Value =
            serde_json::from_slice(&ended.stdout).map_err(|error| error.to_string())?;
        let mut run = Table::new("Run", &["contacts", "distance, m"]);
        run.row([
            report["contacts"].as_u64().unwrap_or(0).into(),
            number(report["distance_m"].as_f64().unwrap_or(f64::NAN), 1),
        ]);
        Ok(Report::new([table, run]))
    }
}
