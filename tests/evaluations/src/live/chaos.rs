//! Kills, hangs and deaths of the supervisor in live runs of the hallway.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use yamabico_core::message::{Command as MotorCommand, Truth};
use yamabico_core::time::Time;
use yamabico_live_robot::campaign::{Campaign, PERIOD, Random, VICTIMS};
use yamabico_live_robot::robot::{BareTimer, LiveRobot, Segments, signal};

use super::{ENDLESS, TIMES, program, times_row};
use crate::report::{Report, Table, number};

/// Number of plugins: behaviors and simulator.
const PLUGINS: usize = VICTIMS.len() + 1;
/// Behavior that is a program in Python with `--python`.
const IN_PYTHON: &str = "wall-follower";
/// Distance from a robot in their way at which people wait, m.
const GIVE_WAY_M: f64 = 0.4;
/// Number of supervisors that are killed, and of those that are stopped.
const SUPERVISORS: usize = 10;

/// Kills at random times over all behaviors of the hallway, hangs, and deaths of the supervisor, in live runs.
///
/// People in the hallway wait for a robot in their way; with `--blind`, as in the world file, they walk into it, which no robot can
/// always prevent. The recording of a run with a contact is kept. Needs `cargo build --release` first.
#[derive(Args)]
pub struct Arguments {
    /// Number of kills.
    #[arg(long, default_value_t = 500)]
    kills: usize,
    /// Duration of a run, s.
    #[arg(long, default_value_t = 40)]
    run_s: u64,
    /// Let people walk into the robot.
    #[arg(long)]
    blind: bool,
    /// Python interpreter with the package core/python: the wall-follower is then the one in Python.
    #[arg(long, value_name = "PROGRAM")]
    python: Option<String>,
}

impl Arguments {
    pub fn run(&self) -> Result<Report, String> {
        let program = program()?;
        let world = (!self.blind).then(world_with_careful_people);
        let set = self.settings(world.as_deref());
        let mut random = Random(Time::monotonic_now().0 | 1);
        let (mut campaign, mut contacts, mut with_people, mut runs) = (Campaign::default(), 0, 0, 0);
        let begun = Instant::now();
        while campaign.kills < self.kills {
            let mut robot = start(&program, runs, &set);
            let before = campaign.kill_each_once(&mut robot);
            let segments = robot.segments();
            let until = Instant::now() + Duration::from_secs(self.run_s);
            while Instant::now() < until && campaign.kills < self.kills {
                let kills = 5.min(self.kills - campaign.kills);
                campaign.kill(&mut robot, kills, &mut random);
            }
            robot.observe(Duration::from_secs(3));
            // Unfinished files of a process that died during startup are removed within ten seconds.
            robot.wait_until(Duration::from_secs(15), |robot| robot.resources() == before);
            let after = robot.resources();
            if after != before {
                print_difference(&segments, &robot.segments());
            }
            with_people += print_contacts(&mut robot);
            let report: serde_json::Value =
                serde_json::from_slice(&robot.interrupt().stdout).expect("a report");
            contacts += report["contacts"].as_u64().expect("a number");
            runs += 1;
            eprintln!(
                "run {runs}: {:.1} m, {} kills so far, resources before {before:?}, after {after:?}",
                report["distance_m"].as_f64().expect("a number"),
                campaign.kills
            );
        }
        let mut kills = Table::new(
            "Kills",
            &[
                "kills",
                "during startup",
                "runs",
                "time, s",
                "contacts",
                "with people",
                "not restarted",
                "latest command, ms",
                "bare timer, ms",
            ],
        );
        kills.row([
            campaign.kills.into(),
            campaign.kills_during_startup.into(),
            runs.into(),
            number(begun.elapsed().as_secs_f64(), 0),
            contacts.into(),
            with_people.into(),
            campaign.not_recovered.join(" ").into(),
            number(1e3 * campaign.lateness.max.as_secs_f64(), 1),
            number(1e3 * campaign.timer_lateness.max.as_secs_f64(), 1),
        ]);
        let mut times = Table::new("Durations", &TIMES);
        let is_native = |victim: &str| self.python.is_none() || victim != IN_PYTHON;
        times.row(times_row("kill to heartbeat", &campaign.recovery_times(is_native)));
        if self.python.is_some() {
            times.row(times_row("kill to heartbeat, Python", &campaign.recovery_times(|v| v == IN_PYTHON)));
        }
        hang(&program, &set, &mut campaign);
        times.row(times_row("stop to replacement", &campaign.hang_durations));
        take_over(&program, &set, &mut times);
        orphan(&program, &set, &mut times);
        let _ = world.map(std::fs::remove_file);
        let is_complete = campaign.not_recovered.is_empty();
        Ok(Report::new([kills, times]).require(is_complete, "a behavior was not restarted"))
    }

    fn settings(&self, world: Option<&Path>) -> Vec<String> {
        let python = self.python.iter().flat_map(|python| {
            [
                format!(
                    "behaviors.{IN_PYTHON}.exec=[\"{python}\", \"-m\", \"yamabico.examples.wall_follower\"]"
                ),
                format!("behaviors.{IN_PYTHON}.inputs={{ camera = \"front\" }}"),
            ]
        });
        let world =
            world.iter().map(|path| format!("robot.devices.sim.world={:?}", path.display().to_string()));
        python.chain(world).chain(ENDLESS.map(str::to_owned)).collect()
    }
}

/// Prints the kinds of shared memory segments whose number changed.
fn print_difference(before: &Segments, after: &Segments) {
    let count = |segments: &Segments, kind| segments.get(kind).copied().unwrap_or(0);
    let kinds: BTreeSet<_> = before.keys().chain(after.keys()).collect();
    for kind in kinds.into_iter().filter(|kind| count(before, kind) != count(after, kind)) {
        eprintln!("  {kind:?}: {} before, {} after", count(before, kind), count(after, kind));
    }
}

/// Prints each contact and the behaviors that drove before it; returns the number of contacts with people.
fn print_contacts(robot: &mut LiveRobot) -> usize {
    let mut with_people = 0;
    let is_contact = |pair: &&[Truth]| pair[1].contacts > pair[0].contacts;
    robot.keep = robot.truth.windows(2).any(|pair| is_contact(&pair));
    for pair in robot.truth.windows(2).filter(is_contact) {
        let at = &pair[1];
        let before = robot.commands.iter().filter(|command| command.stamp_ns <= at.stamp_ns);
        let drivers: Vec<_> =
            before.rev().step_by(10).take(10).map(|c| (c.source[0], c.twist.linear)).collect();
        eprintln!(
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

/// Writes a copy of the hallway in which people wait for a robot in their way.
fn world_with_careful_people() -> PathBuf {
    let mut world: toml::Table = yamabico_testkit::config_text("worlds/hallway.toml").parse().expect("TOML");
    for person in world["person"].as_array_mut().expect("people") {
        person.as_table_mut().expect("a person").insert("gives_way_m".to_owned(), GIVE_WAY_M.into());
    }
    let path = std::env::temp_dir().join(format!("yamabico-chaos-world-{}.toml", std::process::id()));
    std::fs::write(&path, world.to_string()).expect("a writable temporary folder");
    path
}

fn start(program: &Path, number: usize, set: &[String]) -> LiveRobot {
    let name = format!("chaos-{}-{number}", std::process::id());
    let set: Vec<&str> = set.iter().map(String::as_str).collect();
    LiveRobot::start(program, "hallway.toml", &name, PLUGINS, &set)
}

/// Returns `set` with one more setting.
fn with(set: &[String], setting: &str) -> Vec<String> {
    [set, &[setting.to_owned()]].concat()
}

/// Stops processes, with the default deadline of the task: 250 ms.
fn hang(program: &Path, set: &[String], campaign: &mut Campaign) {
    let mut robot = start(program, 1000, set);
    for victim in VICTIMS.iter().cycle().take(12) {
        robot.observe(Duration::from_millis(700));
        campaign.hang(&mut robot, victim);
    }
}

/// Kills the behavior in control; measures the time to the next command and to a command that is not based on it.
fn take_over(program: &Path, set: &[String], times: &mut Table) {
    let mut robot = start(program, 2000, &with(set, "robot.devices.sim.clutter=\"none\""));
    let (mut next, mut other, timer) = (Vec::new(), Vec::new(), BareTimer::start(PERIOD));
    for _ in 0..20 {
        robot.observe(Duration::from_millis(700));
        let Some(last) = robot.commands.last().copied() else { continue };
        let in_control = last.source[0];
        let Some(pid) = robot.process_of(in_control.as_str()) else { continue };
        let starts = robot.heartbeats[in_control.as_str()].restarts;
        let killed = Time::monotonic_now();
        signal(pid, "KILL");
        robot.wait_until(Duration::from_secs(5), |robot| {
            robot.heartbeats[in_control.as_str()].restarts > starts
        });
        robot.observe(Duration::from_millis(300));
        let after = robot.commands.iter().filter(|command| command.stamp_ns > killed.0);
        let since = |stamp_ns: u64| Time(stamp_ns).since(killed);
        next.extend(after.clone().next().map(|command| since(command.stamp_ns)));
        // Its own last proposal is valid until it is too old; that of its successor counts as new.
        let heartbeat = robot.heartbeats[in_control.as_str()];
        let is_new = |command: &&MotorCommand| {
            command.source[0] != in_control
                || command.evidence_ns > killed.0
                || command.stamp_ns > heartbeat.stamp_ns
        };
        other.extend(after.clone().find(is_new).map(|command| since(command.stamp_ns)));
    }
    times.row(times_row("kill in control to next command", &next));
    times.row(times_row("kill in control to command without it", &other));
    times.row(times_row("... a bare timer, lateness", &[timer.stop().max]));
}

/// Kills or stops the supervisor; measures the time until the drive brakes, with the resolution of the ground truth, 5 ms.
fn orphan(program: &Path, set: &[String], times: &mut Table) {
    let (mut killed_times, mut stopped_times) = (Vec::new(), Vec::new());
    for round in 0..SUPERVISORS {
        for (name, times) in [("KILL", &mut killed_times), ("STOP", &mut stopped_times)] {
            let mut robot = start(program, 3000 + round, &with(set, "robot.devices.sim.truth_period_ms=5"));
            let is_fast = |robot: &LiveRobot| robot.truth.last().is_some_and(|truth| truth.vx > 0.3);
            if !robot.wait_until(Duration::from_secs(30), is_fast) {
                continue;
            }
            let speed = robot.truth.last().expect("ground truth").vx;
            let killed = Time::monotonic_now();
            signal(robot.supervisor(), name);
            robot.observe(Duration::from_millis(1000));
            let mut after = robot.truth.iter().filter(|truth| truth.stamp_ns > killed.0);
            let braking = after.find(|truth| truth.vx < speed - 0.01);
            times.extend(braking.map(|truth| Time(truth.stamp_ns).since(killed)));
        }
    }
    times.row(times_row("supervisor killed to braking", &killed_times));
    times.row(times_row("supervisor hangs to braking", &stopped_times));
}
