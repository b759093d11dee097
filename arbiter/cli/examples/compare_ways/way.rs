//! What one run's way was like.

use nalgebra::Vector2;
use yamabico_core::message::{Command, Message, MessageType, RawMessage, Truth, View};
use yamabico_core::time::Time;
use yamabico_runtime::record::Tap;
use yamabico_runtime::report::RunSummary;

/// A slower command lets the robot stand, m/s.
const STANDING_MPS: f64 = 1e-3;

/// The robot at an instant.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    /// Since it began to move, seconds.
    pub time_s: f64,
    /// Where it truly was, meters.
    pub at_m: Vector2<f64>,
}

/// A way from the start to its end.
#[derive(Clone, Debug, Default)]
pub struct Way {
    /// Whether it ended at the goal.
    pub has_arrived: bool,
    /// Times that the robot touched something.
    pub contacts: u32,
    /// From the first command that moves to the last, seconds.
    pub time_s: f64,
    /// Its length, meters.
    pub length_m: f64,
    /// From the robot to the nearest thing, meters; infinite where nothing is.
    pub clearance_m: f64,
    /// Integral of the squared acceleration of the commanded velocity, m^2/s^3.
    pub square_acceleration: f64,
    /// Mean magnitude of the jerk of the commanded velocity, m/s^3.
    pub mean_jerk: f64,
    /// Integral of the squared jerk of the commanded velocity, times the cubed duration, by the squared greatest speed: what does
    /// not depend on how long and how fast a way was (Hogan & Sternad, 2009).
    pub dimensionless_jerk: f64,
    /// Where it led.
    pub moments: Vec<Moment>,
    /// Magnitude of the acceleration of the commanded velocity, m/s^2, with its time, seconds.
    pub accelerations: Vec<(f64, f64)>,
}

impl Way {
    /// Whether it arrived and touched nothing.
    pub fn is_clean(&self) -> bool {
        self.has_arrived && self.contacts == 0
    }
}

/// Gathers a way message by message.
#[derive(Debug, Default)]
pub struct WayTap {
    began: Option<Time>,
    commands: Vec<(f64, Vector2<f64>)>,
    moments: Vec<Moment>,
}

impl WayTap {
    /// The way of the run that ended so.
    pub fn finish(mut self, has_arrived: bool, summary: &RunSummary) -> Way {
        let moving = self.commands.iter().rposition(|(_, velocity)| velocity.norm() > STANDING_MPS);
        self.commands.truncate(moving.map_or(0, |last| last + 2));
        let mut way = Way {
            has_arrived,
            contacts: summary.contacts.unwrap_or(0),
            time_s: self.commands.last().map_or(0.0, |(time_s, _)| *time_s),
            length_m: summary.distance_m,
            clearance_m: summary.smallest_clearance_m.unwrap_or(f64::INFINITY),
            moments: self.moments,
            ..Way::default()
        };
        let (mut last, mut jerk, mut square_jerk) = (Vector2::zeros(), 0.0, 0.0);
        for pair in self.commands.windows(2) {
            let step_s = pair[1].0 - pair[0].0;
            let acceleration = (pair[1].1 - pair[0].1) / step_s;
            way.square_acceleration += acceleration.norm_squared() * step_s;
            jerk += (acceleration - last).norm();
            square_jerk += (acceleration - last).norm_squared() / step_s;
            way.accelerations.push((pair[1].0, acceleration.norm()));
            last = acceleration;
        }
        let fastest_mps = self.commands.iter().map(|(_, velocity)| velocity.norm()).fold(0.0, f64::max);
        if way.time_s > 0.0 {
            way.mean_jerk = jerk / way.time_s;
            way.dimensionless_jerk = square_jerk * way.time_s.powi(3) / fastest_mps.powi(2);
        }
        way
    }

    fn time_s(&self, stamp: Time) -> Option<f64> {
        self.began.map(|began| stamp.seconds_after(began))
    }
}

impl Tap for WayTap {
    fn message(&mut self, _: &str, message: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        let raw = RawMessage { header, items };
        match message.name {
            Command::NAME => {
                let Some(View { header: command, .. }) = View::<Command>::of(raw) else { return };
                let velocity = Vector2::new(command.twist.linear, command.twist.lateral);
                let stamp = Time(command.stamp_ns);
                if self.began.is_none() && velocity.norm() > STANDING_MPS {
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
