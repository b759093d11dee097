//! Five hundred kills at random times over all behaviors of the hallway, hangs, and deaths of the supervisor; figures.
//!
//!     cargo build --release && cargo run --release --example chaos -- [--blind] [KILLS] [SECONDS OF A RUN] [PYTHON]
//!
//! With an interpreter that has the package `core/python`, the wall-follower is the one in Python. The person in the hallway
//! waits for a robot that is in the way; with `--blind`, as the world file has it, they walk on into whatever is there, which
//! no robot can always prevent. The recording of a run with a contact is kept.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "what fails here is the claim")]

#[path = "../tests/chaos/campaign.rs"]
mod campaign;
#[path = "../tests/chaos/robot.rs"]
mod robot;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use campaign::{Chance, Figures, PERIOD, VICTIMS, quantile};
use robot::{BareTimer, Robot, Segments, config, signal};
use yamabico_core::message::Truth;
use yamabico_core::time::Time;

/// Behaviors and the simulator.
const PLUGINS: usize = VICTIMS.len() + 1;
/// Who is a program in Python where there is an interpreter.
const IN_PYTHON: &str = "wall-follower";
/// Neither the goal nor the time ends a run.
const ENDLESS: [&str; 2] = ["run.goal.x_m=1000", "run.duration_s=100000"];
/// How near a person lets a robot come that is in their way, meters.
const GIVES_WAY_M: f64 = 0.4;
/// Supervisors that are killed.
const ORPHANS: usize = 10;

fn main() {
    let (options, arguments): (Vec<String>, Vec<String>) =
        std::env::args().skip(1).partition(|argument| argument.starts_with("--"));
    let (blind, mut arguments) = (options.iter().any(|option| option == "--blind"), arguments.into_iter());
    let mut number = |usual| arguments.next().map_or(usual, |text| text.parse().expect("a number"));
    let (kills, seconds) = (number(500), number(40));
    let python = arguments.next();
    let in_python = python.iter().flat_map(|python| {
        [
            format!("behaviors.{IN_PYTHON}.exec=[\"{python}\", \"-m\", \"yamabico.examples.wall_follower\"]"),
            format!("behaviors.{IN_PYTHON}.inputs={{ camera = \"front\" }}"),
        ]
    });
    let world = (!blind).then(world_of_people_who_look);
    let settings =
        world.iter().map(|path| format!("robot.devices.sim.world={:?}", path.display().to_string()));
    let set: Vec<String> = in_python.chain(settings).chain(ENDLESS.map(str::to_owned)).collect();
    let here = std::env::current_exe().unwrap();
    let program = here.parent().and_then(Path::parent).unwrap().join("yamabico");
    let mut chance = Chance(Time::monotonic_now().0 | 1);
    let (mut figures, mut contacts, mut walked_into, mut runs) = (Figures::default(), 0, 0, 0);
    let begun = Instant::now();
    while figures.kills < kills {
        let mut robot = start(&program, runs, &set);
        let before = figures.kill_each_once(&mut robot);
        let segments = robot.segments();
        let until = Instant::now() + Duration::from_secs(seconds as u64);
        while Instant::now() < until && figures.kills < kills {
            figures.kill(&mut robot, 5.min(kills - figures.kills), &mut chance);
        }
        robot.watch(Duration::from_secs(3));
        // What somebody left unfinished who died while coming up is cleared within ten seconds.
        robot.watch_until(Duration::from_secs(15), |robot| robot.holdings() == before);
        let after = robot.holdings();
        if after != before {
            tell_difference(&segments, &robot.segments());
        }
        walked_into += tell_contacts(&mut robot);
        let report: serde_json::Value = serde_json::from_slice(&robot.interrupt().stdout).unwrap();
        contacts += report["contacts"].as_u64().unwrap();
        runs += 1;
        println!(
            "run {runs}: {:.1} m, {} kills so far, held before {before:?}, after {after:?}",
            report["distance_m"].as_f64().unwrap(),
            figures.kills
        );
    }
    let Figures { late, late_bare, .. } = &figures;
    println!(
        "{} kills, {} of them at start-up, in {runs} runs and {:.0} s; contacts {contacts}, of them {walked_into} with \
         somebody who walks, not back {:?}",
        figures.kills,
        figures.kills_at_start,
        begun.elapsed().as_secs_f64(),
        figures.lost
    );
    tell("killed to back", &figures.back_of(|victim| python.is_none() || victim != IN_PYTHON));
    if python.is_some() {
        tell("killed to back, in Python", &figures.back_of(|victim| victim == IN_PYTHON));
    }
    println!("latest command {:?} after its tick; a bare timer {:?}", late.most, late_bare.most);
    hang(&program, &set, &mut figures);
    take_over(&program, &set);
    orphan(&program, &set);
    let _ = world.map(std::fs::remove_file);
}

/// Tells which segments are more, or fewer, than they were.
fn tell_difference(before: &Segments, after: &Segments) {
    let of = |segments: &Segments, which| segments.get(which).copied().unwrap_or(0);
    let both: BTreeSet<_> = before.keys().chain(after.keys()).collect();
    for which in both.into_iter().filter(|which| of(before, which) != of(after, which)) {
        println!("  {which:?}: {} before, {} after", of(before, which), of(after, which));
    }
}

/// Tells where the robot touched something, and who drove it there; how often that was somebody who walks.
fn tell_contacts(robot: &mut Robot) -> usize {
    let mut with_people = 0;
    let is_contact = |pair: &&[Truth]| pair[1].contacts > pair[0].contacts;
    robot.keep = robot.truth.windows(2).any(|pair| is_contact(&pair));
    for pair in robot.truth.windows(2).filter(is_contact) {
        let at = &pair[1];
        let before = robot.told.iter().filter(|command| command.stamp_ns <= at.stamp_ns);
        let drivers: Vec<_> =
            before.rev().step_by(10).take(10).map(|c| (c.source[0], c.twist.linear)).collect();
        println!(
            "  contact at ({:.2}, {:.2}) m, {:.0} deg, {:.2} m/s, {:.2} m from a person; every 0.2 s before: {drivers:?}; {}",
            at.x,
            at.y,
            at.theta.to_degrees(),
            pair[0].vx,
            at.person_m,
            robot.folder.display()
        );
        with_people += usize::from(at.person_m < 0.0);
    }
    with_people
}

/// The hallway's world, written anew, where everybody looks where they go.
fn world_of_people_who_look() -> PathBuf {
    let text = std::fs::read_to_string(config("worlds/hallway.toml")).unwrap();
    let mut world: toml::Table = text.parse().unwrap();
    for person in world["person"].as_array_mut().unwrap() {
        person.as_table_mut().unwrap().insert("gives_way_m".to_owned(), GIVES_WAY_M.into());
    }
    let path = std::env::temp_dir().join(format!("yamabico-chaos-world-{}.toml", std::process::id()));
    std::fs::write(&path, world.to_string()).unwrap();
    path
}

fn start(program: &Path, number: usize, set: &[String]) -> Robot {
    let name = format!("chaos-{}-{number}", std::process::id());
    let set: Vec<&str> = set.iter().map(String::as_str).collect();
    Robot::start(program, "hallway.toml", &name, PLUGINS, &set)
}

/// `set` with one more change.
fn with(set: &[String], change: &str) -> Vec<String> {
    [set, &[change.to_owned()]].concat()
}

fn tell(what: &str, times: &[Duration]) {
    let [p50, p99, max] = [0.5, 0.99, 1.0].map(|share| quantile(times, share));
    println!("{what}: p50 {p50:.1?}, p99 {p99:.1?}, max {max:.1?} of {}", times.len());
}

/// Hangs, with the deadline that the task gives by itself: 250 ms.
fn hang(program: &Path, set: &[String], figures: &mut Figures) {
    let mut robot = start(program, 1000, set);
    for victim in VICTIMS.iter().cycle().take(12) {
        robot.watch(Duration::from_millis(700));
        figures.hang(&mut robot, victim);
    }
    tell("stopped to dead", &figures.noticed);
}

/// The behavior in control is killed: when the next command comes, and when the last one that it is behind is over.
fn take_over(program: &Path, set: &[String]) {
    let mut robot = start(program, 2000, &with(set, "robot.devices.sim.clutter=\"none\""));
    let (mut next, mut other, timer) = (Vec::new(), Vec::new(), BareTimer::start(PERIOD));
    for _ in 0..20 {
        robot.watch(Duration::from_millis(700));
        let Some(last) = robot.told.last().copied() else { continue };
        let in_control = last.source[0];
        let Some(pid) = robot.process_of(in_control.as_str()) else { continue };
        let starts = robot.newest[in_control.as_str()].restarts;
        let killed = Time::monotonic_now();
        signal(pid, "KILL");
        robot
            .watch_until(Duration::from_secs(5), |robot| robot.newest[in_control.as_str()].restarts > starts);
        robot.watch(Duration::from_millis(300));
        let after = robot.told.iter().filter(|command| command.stamp_ns > killed.0);
        let since = |stamp_ns: u64| Time(stamp_ns).since(killed);
        next.extend(after.clone().next().map(|command| since(command.stamp_ns)));
        // Its own last proposal is good until it is too old, its successor's counts as anew.
        let back = robot.newest[in_control.as_str()];
        let new = |command: &&yamabico_core::message::Command| {
            command.source[0] != in_control
                || command.evidence_ns > killed.0
                || command.stamp_ns > back.stamp_ns
        };
        other.extend(after.clone().find(new).map(|command| since(command.stamp_ns)));
    }
    tell("behavior in control killed, to the next command", &next);
    tell("behavior in control killed, to a command without it", &other);
    println!("a bare timer was {:.1?} late at most", timer.stop().most);
}

/// The supervisor is killed: when the drive begins to brake, to the period of the truth, 5 ms.
fn orphan(program: &Path, set: &[String]) {
    let (mut began, mut hung) = (Vec::new(), Vec::new());
    for round in 0..ORPHANS {
        for (how, times) in [("KILL", &mut began), ("STOP", &mut hung)] {
            let mut robot = start(program, 3000 + round, &with(set, "robot.devices.sim.truth_period_ms=5"));
            let fast = |robot: &Robot| robot.truth.last().is_some_and(|truth| truth.vx > 0.3);
            if !robot.watch_until(Duration::from_secs(30), fast) {
                continue;
            }
            let speed = robot.truth.last().unwrap().vx;
            let killed = Time::monotonic_now();
            signal(robot.supervisor(), how);
            robot.watch(Duration::from_millis(1000));
            let mut after = robot.truth.iter().filter(|truth| truth.stamp_ns > killed.0);
            times.extend(
                after.find(|truth| truth.vx < speed - 0.01).map(|truth| Time(truth.stamp_ns).since(killed)),
            );
        }
    }
    tell("arbiter killed, to braking", &began);
    tell("arbiter hangs, to braking", &hung);
}
