//! Minutes of the hallway live at 100 Hz with all its behaviors: does anything grow, how late are the ticks, what does it cost?
//!
//!     cargo build --release && cargo run --release --example soak -- [MINUTES]
//!
//! Every second it looks at the memory of its own, the file descriptors and the threads of each process, and at the shared
//! memory and the files of the bus. What is in the last two fifths of the time is held against what is in the two before; the
//! first fifth is for warming up. Exit code 1 where something grows, or somebody had to be started again.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "what fails here is the claim")]

#[allow(dead_code, reason = "shared with the tests of chaos, which ask for more")]
#[path = "../tests/chaos/robot.rs"]
mod robot;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use robot::{BareTimer, Holdings, Robot};

/// The hallway's behaviors and the simulator.
const PLUGINS: [&str; 5] =
    ["sim", "sonar-halt", "stationary-obstacle-avoider", "map-localizer", "wall-follower"];
const SUPERVISOR: &str = "arbiter and supervisor";
const PERIOD: Duration = Duration::from_millis(10);
/// The kernel's unit of computing time, seconds.
const JIFFY_S: f64 = 0.01;
/// Memory may grow by this share and by this much, KiB, from one two fifths to the next.
const GROWTH: (f64, f64) = (0.01, 256.0);
/// The recording keeps an index and the picture a way for as long as the run goes on, KiB a second.
const INDEX_KIB_S: f64 = 1.5;

/// What one process holds.
#[derive(Clone, Copy, Debug)]
struct Sample {
    at: Instant,
    /// Memory of its own, shared segments and mapped files aside, KiB.
    anonymous_kib: f64,
    resident_kib: f64,
    descriptors: usize,
    threads: usize,
    computed_s: f64,
}

impl Sample {
    /// `None` while the process is not there.
    fn of(pid: u32) -> Option<Sample> {
        let folder = PathBuf::from(format!("/proc/{pid}"));
        let status = std::fs::read_to_string(folder.join("status")).ok()?;
        let number = |key: &str| {
            let line = status.lines().find_map(|line| line.strip_prefix(key))?;
            line.split_whitespace().next()?.parse::<f64>().ok()
        };
        let stat = std::fs::read_to_string(folder.join("stat")).ok()?;
        let fields: Vec<&str> = stat[stat.rfind(')')? + 2..].split_whitespace().collect();
        let jiffies = |field: usize| fields.get(field - 3)?.parse::<f64>().ok();
        Some(Sample {
            at: Instant::now(),
            anonymous_kib: number("RssAnon:")?,
            resident_kib: number("VmRSS:")?,
            descriptors: std::fs::read_dir(folder.join("fd")).ok()?.count(),
            threads: number("Threads:")? as usize,
            computed_s: (jiffies(14)? + jiffies(15)?) * JIFFY_S,
        })
    }
}

fn main() -> ExitCode {
    let minutes: f64 = std::env::args().nth(1).map_or(10.0, |minutes| minutes.parse().expect("minutes"));
    let here = std::env::current_exe().unwrap();
    let program = here.parent().and_then(Path::parent).unwrap().join("yamabico");
    let name = format!("soak-{}", std::process::id());
    // Slow enough for the hallway to last; the goal is beyond its end.
    let speed_mps = (10.0 / (60.0 * minutes)).clamp(0.02, 0.4);
    let speed = |behavior: &str| format!("behaviors.{behavior}.speed_mps={speed_mps}");
    let (localizer, follower) = (speed("map-localizer"), speed("wall-follower"));
    let duration = format!("run.duration_s={}", 120.0 * minutes);
    let set = ["arbiter.rate_hz=100", "run.goal.x_m=1000", &duration, &localizer, &follower];
    let mut robot = Robot::start(&program, "hallway.toml", &name, PLUGINS.len(), &set);
    let timer = BareTimer::start(PERIOD);
    let begun = Instant::now();
    let mut samples: BTreeMap<&str, Vec<Sample>> = BTreeMap::new();
    let mut held: Vec<Holdings> = Vec::new();
    while begun.elapsed().as_secs_f64() < 60.0 * minutes {
        robot.watch(Duration::from_secs(1));
        // What is watched here must not grow either.
        robot.told.clear();
        robot.truth.clear();
        held.push(robot.holdings());
        let plugins = PLUGINS.iter().map(|plugin| (*plugin, robot.process_of(plugin)));
        for (name, pid) in plugins.chain([(SUPERVISOR, Some(robot.supervisor()))]) {
            samples.entry(name).or_default().extend(pid.and_then(Sample::of));
        }
    }
    let bare = timer.stop().most;
    assert!(robot.runs(), "the run ended by itself");
    let ended = robot.interrupt();
    let report: serde_json::Value = serde_json::from_slice(&ended.stdout).expect("a report");
    report_lateness(&report, minutes, bare);
    let flat = is_flat(&samples) & holds_the_same(&held) & nobody_began_again(&report);
    println!("{}", if flat { "nothing grows" } else { "SOMETHING GROWS" });
    ExitCode::from(u8::from(!flat))
}

fn report_lateness(report: &serde_json::Value, minutes: f64, bare: Duration) {
    let late = |key: &str| report["tick_lateness"][key].as_f64().unwrap();
    println!(
        "{minutes} minutes at 100 Hz: {} ticks, late by {:.2} ms p50, {:.2} ms p99, {:.1} ms at most (a bare timer {:.1} ms); \
         {:.1} m, {} contacts",
        late("count"),
        late("p50_ms"),
        late("p99_ms"),
        late("max_ms"),
        bare.as_secs_f64() * 1e3,
        report["distance_m"].as_f64().unwrap(),
        report["contacts"]
    );
}

/// Prints what each process holds; whether none holds more and more.
fn is_flat(samples: &BTreeMap<&str, Vec<Sample>>) -> bool {
    println!(
        "{:>28} {:>7} {:>10} {:>10} {:>10} {:>11} {:>8}",
        "", "CPU", "resident", "own, KiB", "later", "descriptors", "threads"
    );
    let mut flat = true;
    for (name, samples) in samples {
        let (Some(first), Some(last)) = (samples.first(), samples.last()) else {
            println!("{name:>28} was never there");
            flat = false;
            continue;
        };
        let (before, after) = halves(samples);
        let median = |part: &[Sample], of: fn(&Sample) -> f64| {
            let mut values: Vec<f64> = part.iter().map(of).collect();
            values.sort_by(f64::total_cmp);
            values.get(values.len() / 2).copied().unwrap_or_default()
        };
        // A folder that the supervisor looks into is open for an instant: the most that was ever seen is chance.
        let both = |of| (median(before, of), median(after, of));
        let (memory, later) = both(|sample| sample.anonymous_kib);
        let (descriptors, threads) =
            (both(|sample| sample.descriptors as f64), both(|sample| sample.threads as f64));
        let lasted_s = last.at.duration_since(first.at).as_secs_f64().max(1.0);
        let index = if *name == SUPERVISOR { INDEX_KIB_S * 0.4 * lasted_s } else { 0.0 };
        let grows = later > memory * (1.0 + GROWTH.0) + GROWTH.1 + index
            || descriptors.1 > descriptors.0
            || threads.1 > threads.0;
        flat &= !grows;
        let share = (last.computed_s - first.computed_s) / lasted_s;
        println!(
            "{name:>28} {:>6.1}% {:>10.0} {memory:>10.0} {later:>10.0} {:>11} {:>8}{}",
            100.0 * share,
            last.resident_kib,
            descriptors.1,
            threads.1,
            if grows { "  GROWS" } else { "" }
        );
    }
    flat
}

/// Whether the bus holds no more than before.
fn holds_the_same(held: &[Holdings]) -> bool {
    let (before, after) = halves(held);
    let most = |part: &[Holdings]| {
        part.iter().fold((0, 0), |(segments, files), now| (segments.max(now.segments), files.max(now.files)))
    };
    let (before, after) = (most(before), most(after));
    println!("segments of shared memory and files of the bus: {before:?}, later {after:?}");
    after.0 <= before.0 && after.1 <= before.1
}

fn nobody_began_again(report: &serde_json::Value) -> bool {
    let restarts = report["restarts"].as_object().expect("restarts");
    println!("started again: {}", report["restarts"]);
    restarts.values().all(|times| times.as_u64() == Some(0))
}

/// The second and third fifth of `all`, and the last two.
fn halves<T>(all: &[T]) -> (&[T], &[T]) {
    let warm = &all[all.len() / 5..];
    warm.split_at(warm.len() / 2)
}
