//! Frame published to command received, across three processes: a live robot whose behavior does nothing, against bare
//! iceoryx2 with events over the same hops in the same run.
//!
//!     cargo bench -p yamabico-runtime --bench latency -- [FRAMES]
//!
//! Device, behavior and arbiter are a process each; a 640x480 frame is written in place every 20 ms. The bare ones only
//! receive, send and notify, with messages of the same sizes, half a period later. Prints p50 and p99 in
//! microseconds and the ratio of ours to bare; the bar is 1.5.

#![allow(clippy::unwrap_used, missing_docs, reason = "a benchmark")]

mod bare;
mod robot;

use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use yamabico_host::process::{OnParentDeath, ParentProcess, serve};
use yamabico_runtime::record::{Pace, Tee};
use yamabico_runtime::run::{Options, run};
use yamabico_runtime::supervisor::Program;

/// Period of the frames.
pub const PERIOD: Duration = Duration::from_millis(20);
/// Size of a frame, bytes.
pub const FRAME: usize = 640 * 480;
/// Number of first frames that do not count: their caches and connections are cold.
const COLD: usize = 25;
const BAR: f64 = 1.5;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    match arguments.first().map(String::as_str) {
        Some("plugin") => plugin(&arguments),
        Some("bare") => bare::relay(&arguments[1], &arguments[2]),
        frames => measure(frames.map_or(1500, |frames| frames.parse().unwrap())),
    }
}

/// Runs a plugin of the live robot, as the supervisor starts it.
fn plugin(arguments: &[String]) {
    let after = |key: &str| {
        let at = arguments.iter().position(|argument| argument == key).unwrap();
        arguments[at + 1].as_str()
    };
    let on_death = if after("--on-death") == "die" { OnParentDeath::Die } else { OnParentDeath::Brake };
    if (ParentProcess { pid: after("--guardian").parse().unwrap(), on_death }).follow().unwrap() {
        serve(&robot::plugins());
    }
}

fn measure(frames: usize) {
    let folder = std::env::temp_dir().join(format!("yamabico-latency-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let task = robot::task(&folder, frames + COLD);
    let program = Program { path: std::env::current_exe().unwrap(), arguments: vec!["plugin".into()] };
    let options = Options { pace: Pace::Live, program: Some(program), ..Options::default() };
    let root = bare::Root::new();
    let chain = bare::Chain::open(&root);
    let relays = ["behavior", "arbiter"].map(|role| Relay::start(role, root.path()));
    let over = AtomicBool::new(false);
    let (ours, bare) = std::thread::scope(|scope| {
        let bare = scope.spawn(move || chain.measure(frames + COLD));
        let result = robot::figures(&folder);
        let mut look = |_| over.store(over.load(Ordering::Relaxed) || result.exists(), Ordering::Relaxed);
        run(&task, &options, &over, &mut Tee::default(), &mut look).unwrap();
        (robot::read(&result), bare.join().unwrap())
    });
    drop(relays);
    let _ = std::fs::remove_dir_all(&folder);
    report(ours, bare);
}

fn report(ours: Vec<u64>, bare: Vec<u64>) {
    let frames = ours.len() - COLD;
    println!("frame published to command received over three processes, {frames} frames, microseconds");
    println!("{:>14} {:>9} {:>9} {:>9} {:>9}", "", "p50", "p90", "p99", "max");
    let [ours, bare] = [("yamabico", ours), ("bare iceoryx2", bare)].map(|(name, mut latencies)| {
        let kept = &mut latencies[COLD..];
        kept.sort_unstable();
        let at = |share: f64| kept[((kept.len() - 1) as f64 * share) as usize] as f64 / 1e3;
        let shares = [0.5, 0.9, 0.99, 1.0].map(at);
        let [p50, p90, p99, max] = shares;
        println!("{name:>14} {p50:>9.1} {p90:>9.1} {p99:>9.1} {max:>9.1}");
        shares
    });
    let (p50, p99) = (ours[0] / bare[0], ours[2] / bare[2]);
    let held = if p50.max(p99) <= BAR { "held" } else { "MISSED" };
    println!("ratio: p50 {p50:.2}, p99 {p99:.2}; bar {BAR}: {held}");
}

/// Process of the bare chain; killed when dropped.
struct Relay(Child);

impl Relay {
    fn start(role: &str, root: &str) -> Relay {
        let mut command = Command::new(std::env::current_exe().unwrap());
        Relay(command.args(["bare", role, root]).stdout(Stdio::null()).spawn().unwrap())
    }
}

impl Drop for Relay {
    fn drop(&mut self) {
        // Fails if it has ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
