//! A behavior in Python raises, ends, hangs, is killed and keeps what it must not, so many times each: how soon it is back.
//!
//!     cargo build --release && cargo run --release --example python_falls -- [TIMES]

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "what fails here is the claim")]

#[allow(dead_code, reason = "shared with the tests, which ask for more")]
#[path = "../tests/python/falls.rs"]
mod falls;
#[path = "../tests/chaos/robot.rs"]
#[allow(dead_code, reason = "not all that share this file ask for everything")]
mod robot;
#[path = "../tests/python/venv.rs"]
mod venv;

use std::path::Path;
use std::time::Duration;

use falls::{Fall, FragileRobot};

fn main() {
    let times = std::env::args().nth(1).map_or(20, |text| text.parse().expect("a number"));
    let here = std::env::current_exe().unwrap();
    let program = here.parent().and_then(Path::parent).unwrap().join("yamabico");
    let Some(python) = venv::interpreter(&program) else { return };
    let name = format!("python-falls-{}", std::process::id());
    let mut fragile = FragileRobot::start(&program, &python, &name);
    fragile.robot.watch(Duration::from_secs(2));
    // In turns: after five exceptions of one process it would stay out.
    let mut back = vec![Vec::new(); Fall::ALL.len()];
    for _ in 0..times {
        for (fall, back) in Fall::ALL.into_iter().zip(&mut back) {
            back.push(fragile.fall(fall).expect("it comes back"));
            fragile.robot.watch(Duration::from_millis(800));
        }
    }
    let mut all = back.concat();
    for (fall, back) in Fall::ALL.iter().zip(&mut back) {
        tell(&format!("{fall:?}"), back);
    }
    tell("all", &mut all);
    let ended = fragile.interrupt();
    let report: serde_json::Value = serde_json::from_slice(&ended.stdout).unwrap();
    println!("contacts {}, {} m driven", report["contacts"], report["distance_m"]);
}

fn tell(what: &str, back: &mut [Duration]) {
    back.sort_unstable();
    let at = |share: f64| back[((share * back.len() as f64).ceil() as usize).max(1) - 1];
    println!(
        "{what}: back after {:.2?} p50, {:.2?} p99, {:.2?} max of {}",
        at(0.5),
        at(0.99),
        at(1.0),
        back.len()
    );
}
