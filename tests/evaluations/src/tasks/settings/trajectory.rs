//! Trajectory of one run, and its smoothness.

use nalgebra::Vector2;
use yamabico_core::message::{Command, Message, MessageType, RawMessage, Truth, View};
use yamabico_core::time::Time;
use yamabico_runtime::record::Tap;
use yamabico_runtime::report::RunSummary;

/// Commanded speed below which the robot is at rest, m/s.
const REST_MPS: f64 = 1e-3;

/// Position at an instant.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    /// Time since the first motion, s.
    pub time_s: f64,
    /// True position, m.
    pub at_m: Vector2<f64>,
}

/// A trajectory from its first to its last moving command.
#[derive(Clone, Debug, Default)]
pub struct Trajectory {
    /// True if it ended at the goal.
    pub has_arrived: bool,
    /// Number of contacts.
    pub contacts: u32,
    /// Time from the first to the last moving command, s.
    pub time_s: f64,
    /// Length, m.
    pub length_m: f64,
    /// Minimum distance from the robot to an obstacle, m; infinite without obstacles.
    pub clearance_m: f64,
    /// Integral of the squared acceleration of the commanded velocity, m^2/s^3.
    pub square_acceleration: f64,
    /// Mean magnitude of the jerk of the commanded velocity, m/s^3.
    pub mean_jerk: f64,
    /// Integral of the squared jerk of the commanded velocity, times the cubed duration, divided by the squared maximum speed: independent
    /// of duration and speed (Hogan & Sternad, 2009).
    pub dimensionless_jerk: f64,
    /// Positions.
    pub moments: Vec<Moment>,
    /// Time, s, and magnitude of the acceleration of the commanded velocity, m/s^2.
    pub accelerations: Vec<(f64, f64)>,
}

impl Trajectory {
    /// Returns true if it ended at the goal without contact.
    pub fn is_clean(&self) -> bool {
        self.has_arrived && self.contacts == 0
    }
}

/// Records a trajectory from the messages of a run.
#[derive(Debug, Default)]
pub struct TrajectoryTap {
    began: Option<Time>,
    commands: Vec<(f64, Vector2<f64>)>,
    moments: Vec<Moment>,
}

impl TrajectoryTap {
    /// Returns the trajectory of the finished run.
    pub fn finish(mut self, has_arrived: bool, summary: &RunSummary) -> Trajectory {
        let moving = self.commands.iter().rposition(|(_, velocity)| velocity.norm() > REST_MPS);
        self.commands.truncate(moving.map_or(0, |last| last + 2));
        let mut trajectory = Trajectory {
            has_arrived,
            contacts: summary.contacts.unwrap_or(0),
            time_s: self.commands.last().map_or(0.0, |(time_s, _)| *time_s),
            length_m: summary.distance_m,
            clearance_m: summary.smallest_clearance_m.unwrap_or(f64::INFINITY),
            moments: self.moments,
            ..Trajectory::default()
        };
        let (mut last, mut jerk, mut square_jerk) = (Vector2::zeros(), 0.0, 0.0);
        for pair in self.commands.windows(2) {
            let step_s = pair[1].0 - pair[0].0;
            let acceleration = (pair[1].1 - pair[0].1) / step_s;
            trajectory.square_acceleration += acceleration.norm_squared() * step_s;
            jerk += (acceleration - last).norm();
            square_jerk += (acceleration - last).norm_squared() / step_s;
            trajectory.accelerations.push((pair[1].0, acceleration.norm()));
            last = acceleration;
        }
        let fastest_mps = self.commands.iter().map(|(_, velocity)| velocity.norm()).fold(0.0, f64::max);
        if trajectory.time_s > 0.0 {
            trajectory.mean_jerk = jerk / trajectory.time_s;
            trajectory.dimensionless_jerk = square_jerk * trajectory.time_s.powi(3) / fastest_mps.powi(2);
        }
        trajectory
    }

    fn time_s(&self, stamp: Time) -> Option<f64> {
        self.began.map(|began| stamp.seconds_after(began))
    }
}

impl Tap for TrajectoryTap {
    fn message(&mut self, _: &str, message: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        let raw = RawMessage { header, items };
        match message.name {
            Command::NAME => {
                let Some(View { header: command, .. }) = View::<Command>::of(raw) else { return };
                let velocity = Vector2::new(command.twist.linear, command.twist.lateral);
                let stamp = Time(command.stamp_ns);
                if self.began.is_none() && velocity.norm() > REST_MPS {
                    self.began = Some(stamp);
                }
                if let Some(time_s) = self.time_s(stamp) {
                    self.commands.push((time_s, velocity));
                }
            }
            Truth::NAME => {
                let Some(View { header: truth, .. }) = View::<Truth>::of(raw) else { return };
                let time_s = self.time_s(Time(truth.stamp_ns)).unwrap_or(0.0);
                self.moments.push(Moment { time_s, at_m: Vector2::new(truth.x, truth.y) });
            }
            _ => {}
        }
    }
}
