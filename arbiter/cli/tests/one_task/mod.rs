//! One task file on five robots: the simulator, a recording, a Create 2 with a network camera and a lidar, a TurtleBot3, and a robot on
//! ROS 2. The devices are played, the corridor around them is simulated, and no line of the task changes.

mod robots;
mod ros2;
mod world;

use std::time::{Duration, Instant};

use world::World;

/// The task.
const TASK: &str = "corridor.toml";
/// Distance along the corridor that each base must drive, m.
const DISTANCE_M: f64 = 2.0;
/// Longest drive; a busy machine halts the robot now and then.
const LONGEST: Duration = Duration::from_secs(300);

/// Commands that reached a base.
#[derive(Debug)]
struct Reached {
    /// Number of commands, or of periods in which the base was looked at.
    count: usize,
    /// Share of them that are not zero.
    moving: f64,
    /// Median forward speed of these, m/s.
    speed_mps: f64,
    /// Largest turn rate, rad/s.
    turn_radps: f64,
}

impl Reached {
    /// Returns the figures of commands, each a forward speed and a turn rate.
    fn of(commands: &[[f64; 2]]) -> Reached {
        let moving: Vec<&[f64; 2]> = commands.iter().filter(|command| **command != [0.0; 2]).collect();
        let mut speeds: Vec<f64> = moving.iter().map(|[speed, _]| *speed).collect();
        speeds.sort_by(f64::total_cmp);
        Reached {
            count: commands.len(),
            moving: moving.len() as f64 / commands.len().max(1) as f64,
            speed_mps: speeds.get(speeds.len() / 2).copied().unwrap_or(0.0),
            turn_radps: commands.iter().map(|[_, turn]| turn.abs()).fold(0.0, f64::max),
        }
    }

    /// Prints a row of the table, and asserts that the commands are those of a robot that follows a corridor at up to `max_mps`.
    fn check(&self, robot: &str, max_mps: f64, outcome: &str) {
        let Reached { count, moving, speed_mps, turn_radps } = self;
        println!(
            "| {robot} | {count} | {:.0} % | {speed_mps:.2} m/s | {turn_radps:.2} rad/s | {outcome} |",
            100.0 * moving
        );
        assert!(*count > 50 && *moving > 0.1, "{robot}: {self:?}");
        assert!(*speed_mps > 0.1 && *speed_mps < max_mps + 0.01, "{robot}: {self:?}");
        assert!(*turn_radps < 1.6, "{robot}: {self:?}");
    }
}

/// Waits until the robot in `world` has driven down the corridor, and asserts that it did so between the walls. Returns the outcome in
/// words.
fn driven_down(world: &World, robot: &str, is_running: &mut dyn FnMut() -> bool) -> String {
    let begun = Instant::now();
    while world.sensed().pose[0] < DISTANCE_M {
        let sensed = world.sensed().clone();
        assert!(begun.elapsed() < LONGEST, "{robot} stands: {:?}", sensed.pose);
        assert!(is_running(), "{robot}: the run ended at {:?}", sensed.pose);
        std::thread::sleep(Duration::from_millis(50));
    }
    let sensed = world.sensed().clone();
    let [x, y, heading] = sensed.pose;
    assert!(y.abs() < 0.7 && heading.abs() < 0.7 && sensed.clearance_m > 0.05, "{robot}: {sensed:?}");
    format!("{x:.1} m driven, {:.0} cm from the walls at least", 100.0 * sensed.clearance_m)
}
