//! Loading and running of the shipped tasks.

use std::sync::atomic::AtomicBool;

use yamabico::plugins::plugins;
use yamabico_host::config::{Overrides, Task, load};
use yamabico_runtime::record::Tap;
use yamabico_runtime::run::{Options, RunResult, run};

/// Loads `configs/NAME.toml` with changed keys, `key=value` each.
pub fn task(name: &str, set: &[&str]) -> Task {
    let overrides = Overrides { robot: None, set: set.iter().map(ToString::to_string).collect() };
    load(&yamabico_testkit::config(&format!("{name}.toml")), &overrides, &plugins())
        .unwrap_or_else(|problems| panic!("{problems}"))
}

/// Runs a task in lockstep with one thread; `tap` receives every message.
pub fn run_seed(task: &Task, seed: u64, tap: &mut dyn Tap) -> RunResult {
    let options = Options { seed, ..Options::default() };
    run(task, &options, &AtomicBool::new(false), tap, &mut |_| {}).unwrap()
}
