//! Live robots in processes of their own.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a failure here is the result")]

pub mod busy;
pub mod chaos;
mod process_use;
pub mod python_failures;
pub mod soak;
mod viewers;
pub mod viewing;

use std::path::{Path, PathBuf};
use std::time::Duration;

use yamabico_live_robot::campaign::quantile;
use yamabico_live_robot::robot::LiveRobot;

use crate::report::{Cell, number};

/// Settings by which neither goal nor time ends a run.
const ENDLESS: [&str; 2] = ["run.goal.y_m=15", "run.duration_s=100000"];

/// Plugins of the hallway task.
const PLUGINS: [&str; 6] =
    ["sim", "sonar-halt", "stuck-recovery", "stationary-obstacle-avoider", "map-localizer", "wall-follower"];

/// Starts a robot that is too slow to reach the end of the hallway; returns its name, too.
fn start_slow_hallway(program: &Path, evaluation: &str) -> (LiveRobot, String) {
    let name = format!("{evaluation}-{}", std::process::id());
    let speed = |behavior: &str| format!("behaviors.{behavior}.speed_mps=0.02");
    let (localizer, follower) = (speed("map-localizer"), speed("wall-follower"));
    let set = ["run.goal.x_m=60", "run.duration_s=100000", &localizer, &follower];
    (LiveRobot::start(program, "hallway.toml", &name, PLUGINS.len(), &set), name)
}

/// Returns the program `yamabico` beside this one: build it first, in the same profile.
pub fn program() -> Result<PathBuf, String> {
    let own = std::env::current_exe().map_err(|error| error.to_string())?;
    let program = own.with_file_name("yamabico");
    if program.is_file() {
        Ok(program)
    } else {
        Err(format!("{} does not exist: build it first, `cargo build --release`", program.display()))
    }
}

/// Returns a row with 50 %, 99 % and maximum (ms) and the number of the times.
fn times_row(name: impl Into<Cell>, times: &[Duration]) -> [Cell; 5] {
    let ms = |share: f64| number(1e3 * quantile(times, share).as_secs_f64(), 1);
    [name.into(), times.len().into(), ms(0.5), ms(0.99), ms(1.0)]
}

/// Columns of [`times_row`].
const TIMES: [&str; 5] = ["duration", "count", "p50, ms", "p99, ms", "max, ms"];
