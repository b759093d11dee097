//! The hallway: past a crossing person and around a box to the goal; equal seeds give equal digests.

use std::sync::atomic::{AtomicBool, Ordering};

use yamabico_arbiter::kinematics::Kinematics;
use yamabico_core::message::{Message, MessageType, RawMessage, Truth, View};
use yamabico_core::time::Time;
use yamabico_host::config::Task;
use yamabico_runtime::execution::{Plan, RunEnd};
use yamabico_runtime::record::{Tap, Tee};
use yamabico_runtime::run::{Options, RunResult, run};

use crate::support::task;

fn hallway() -> Task {
    task("hallway", &[])
}

fn drive(seed: u64, threads: usize) -> RunResult {
    let options = Options { seed, threads, ..Options::default() };
    run(&hallway(), &options, &AtomicBool::new(false), &mut Tee::default(), &mut |_| {}).unwrap()
}

#[test]
fn the_robot_passes_a_person_and_a_box_and_arrives() {
    for seed in [1, 4] {
        let summary = drive(seed, 1).summary;
        assert!(summary.arrived, "seed {seed}: not arrived");
        assert_eq!((summary.contacts, summary.struck), (Some(0), Some(0)), "seed {seed}");
        assert!(!summary.encounters.is_empty(), "seed {seed}: no person was met");
        let avoiding_s = summary.control_s.get("stationary-obstacle-avoider").copied().unwrap_or(0.0);
        assert!(avoiding_s > 2.0, "seed {seed}: {avoiding_s} s around the box");
        let following_s = summary.control_s.get("map-localizer").copied().unwrap_or(0.0);
        assert!(following_s > 10.0, "seed {seed}: {following_s} s along the path");
    }
}

#[test]
fn the_wheels_of_the_robot_file_limit_the_commands() {
    let kinematics = Plan::new(&hallway(), 1).policy.kinematics;
    let wheels = Kinematics::Differential { base_m: 0.32, wheel_radius_m: 0.05, max_wheel_radps: 14.0 };
    assert_eq!(kinematics, wheels);
}

#[test]
fn one_seed_gives_one_run_on_any_number_of_threads() {
    let first = drive(7, 1);
    let second = drive(7, 2);
    assert_eq!(first.summary.digest, second.summary.digest);
    assert_eq!(first.summary.topics, second.summary.topics);
    assert_ne!(first.summary.digest, drive(8, 1).summary.digest, "another seed must give another run");
}

/// Interrupts the run at a time and records the speed.
struct Interrupter<'a> {
    flag: &'a AtomicBool,
    at: Time,
    speed: Vec<f64>,
}

impl Tap for Interrupter<'_> {
    fn message(&mut self, _: &str, message: &MessageType, time: Time, header: &[u8], items: &[u8]) {
        if time >= self.at {
            self.flag.store(true, Ordering::Relaxed);
        }
        if message.name == Truth::NAME {
            self.speed.extend(View::<Truth>::of(RawMessage { header, items }).map(|truth| truth.header.vx));
        }
    }
}

#[test]
fn an_interrupt_stops_the_robot_before_the_run_ends() {
    let flag = AtomicBool::new(false);
    let mut tap = Interrupter { flag: &flag, at: Time::from_secs_f64(4.0), speed: Vec::new() };
    let result = run(&hallway(), &Options::default(), &flag, &mut tap, &mut |_| {}).unwrap();
    assert_eq!(result.end, RunEnd::Interrupted);
    let max_mps = tap.speed.iter().copied().fold(0.0, f64::max);
    assert!(max_mps > 0.3, "only {max_mps} m/s");
    assert!(
        tap.speed.last().is_some_and(|speed| speed.abs() < 0.01),
        "{:?} m/s at the end",
        tap.speed.last()
    );
}
