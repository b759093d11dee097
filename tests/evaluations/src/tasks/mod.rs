//! Runs of whole tasks over many seeds.

pub mod localization;
pub mod runs;
pub mod settings;

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::ScopedJoinHandle;

use clap::Args;
use yamabico::plugins::plugins;
use yamabico_host::config::{Overrides, Task, load};

use crate::arguments::Seeds;

/// A task, and the seeds for which it runs.
#[derive(Args)]
struct TaskRuns {
    /// Task file, such as configs/hallway.toml.
    task: PathBuf,
    #[command(flatten)]
    seeds: Seeds,
    /// Number of runs at a time.
    #[arg(long, default_value_t = 1)]
    jobs: usize,
    /// Change a key of the task; may be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
}

/// Loads a task file with changed keys.
pub fn load_task(file: &Path, set: &[String]) -> Result<Task, String> {
    let overrides = Overrides { robot: None, set: set.to_vec() };
    load(file, &overrides, &plugins()).map_err(|problems| problems.to_string())
}

/// Runs `work` for each seed, up to `jobs` at a time; returns the results in the order of the seeds.
pub fn sweep<T: Send>(
    seeds: Range<u64>,
    jobs: usize,
    work: impl Fn(u64) -> Result<T, String> + Sync,
) -> Result<Vec<T>, String> {
    let progress = indicatif::ProgressBar::new(seeds.end - seeds.start);
    let next = AtomicU64::new(seeds.start);
    let worker = || {
        let mut results = Vec::new();
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed >= seeds.end {
                return Ok(results);
            }
            results.push((seed, work(seed).map_err(|error| format!("seed {seed}: {error}"))?));
            progress.inc(1);
        }
    };
    let parts: Vec<Result<Vec<(u64, T)>, String>> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..jobs.max(1)).map(|_| scope.spawn(worker)).collect();
        let joined = threads.into_iter().map(ScopedJoinHandle::join);
        joined.map(|results| results.unwrap_or_else(|_| Err("a run panicked".to_owned()))).collect()
    });
    progress.finish_and_clear();
    let mut results: Vec<(u64, T)> =
        parts.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect();
    results.sort_by_key(|(seed, _)| *seed);
    Ok(results.into_iter().map(|(_, result)| result).collect())
}
