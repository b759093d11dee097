//! Judges a run from its messages: where the robot is, whether it stands, whether it has arrived.

use yamabico_core::behavior::{RawMessage, View};
use yamabico_core::config::GoalArea;
use yamabico_core::message::{Message, MessageType, Odometry, Truth};
use yamabico_core::time::Time;

use crate::record::Tap;

/// Slower than this the robot stands: m/s and rad/s.
const STANDING: f64 = 0.01;

/// Follows the robot: by a simulator's truth where there is one, else by odometry.
#[derive(Debug, Default)]
pub struct Referee {
    goal: Option<GoalArea>,
    has_truth: bool,
    position: Option<[f64; 2]>,
    speed: f64,
    arrived: Option<Time>,
}

impl Referee {
    /// One that waits for the robot to reach `goal`.
    pub fn new(goal: Option<GoalArea>) -> Referee {
        Referee { goal, ..Referee::default() }
    }

    /// When the goal was first reached.
    pub fn arrived(&self) -> Option<Time> {
        self.arrived
    }

    /// Whether the robot stands, as far as is known.
    pub fn stands(&self) -> bool {
        self.speed < STANDING
    }

    /// From the centre of the robot to the goal, metres; `None` without a goal or before the first position.
    pub fn to_go_m(&self) -> Option<f64> {
        let ([x, y], goal) = (self.position?, self.goal?);
        Some((goal.x_m - x).hypot(goal.y_m - y))
    }

    fn is_at(&mut self, time: Time, x: f64, y: f64, speed: f64) {
        self.position = Some([x, y]);
        self.speed = speed;
        let near = self.goal.zip(self.to_go_m()).is_some_and(|(goal, to_go)| to_go <= goal.tolerance_m);
        if near && self.arrived.is_none() {
            self.arrived = Some(time);
        }
    }
}

impl Tap for Referee {
    fn message(&mut self, _: &str, message: &MessageType, time: Time, header: &[u8], items: &[u8]) {
        let raw = RawMessage { header, items };
        match message.name {
            Truth::NAME => {
                let Some(truth) = View::<Truth>::of(raw) else { return };
                self.has_truth = true;
                let speed = truth.header.vx.hypot(truth.header.vy).max(truth.header.omega.abs());
                self.is_at(time, truth.header.x, truth.header.y, speed);
            }
            Odometry::NAME if !self.has_truth => {
                let Some(odometry) = View::<Odometry>::of(raw) else { return };
                let speed = odometry.header.vx.hypot(odometry.header.vy).max(odometry.header.omega.abs());
                self.is_at(time, odometry.header.x, odometry.header.y, speed);
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn see<M: Message>(referee: &mut Referee, seconds: f64, header: &M) {
        let time = Time::from_secs_f64(seconds);
        referee.message("any", &MessageType::of::<M>(), time, bytemuck::bytes_of(header), &[]);
    }

    #[test]
    fn truth_outranks_odometry_and_arrival_is_kept() {
        let mut referee = Referee::new(Some(GoalArea { x_m: 2.0, y_m: 0.0, tolerance_m: 0.3 }));
        see(&mut referee, 0.5, &Odometry { x: 1.0, vx: 0.4, ..Default::default() });
        assert!(!referee.stands() && referee.to_go_m() == Some(1.0));
        see(&mut referee, 1.0, &Truth { x: 1.8, vx: 0.4, ..Default::default() });
        see(&mut referee, 2.0, &Odometry { x: 9.0, ..Default::default() });
        see(&mut referee, 3.0, &Truth { x: 2.5, ..Default::default() });
        assert_eq!(referee.arrived(), Some(Time::from_secs_f64(1.0)));
        assert!(referee.stands() && referee.to_go_m() == Some(0.5));
    }
}
