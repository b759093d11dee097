//! A behaviour in Python raises, ends, hangs, is killed and keeps what it must not, so many times each: how soon it is back.
//!
//!     cargo build --release && cargo run --release --example python_falls -- [TIMES]

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "what fails here is the claim")]

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
    let mut all = Vec::new();
    for fall in Fall::ALL {
        let mut back = Vec::new();
        for _ in 0..times {
            back.push(fragile.fall(fall).expect("it comes back"));
            fragile.robot.watch(Duration::from_millis(800));
        }
        all.extend(back.iter().copied());
        tell(&format!("{fall:?}"), &mut back);
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
        "{what}: back after {:.0?} p50, {:.0?} p99, {:.0?} max of {}",
        at(0.5),
        at(0.99),
        at(1.0),
        back.len()
    );
}
