//! Monitors a run from its messages: where the robot is, whether it stands, whether it has reached the goal.

use yamabico_core::geometry::Hypotenuse;
use yamabico_core::message::{Command, Message, MessageType, Odometry, RawMessage, Truth, Twist, View};
use yamabico_core::time::Time;
use yamabico_host::config::GoalArea;

use crate::record::Tap;

/// Speed below which the robot stands, m/s and rad/s.
const STANDING: f64 = 0.01;

/// Monitor of the robot's motion: by the simulator's truth if there is one, else by odometry, else by the commands.
#[derive(Debug, Default)]
pub(super) struct GoalMonitor {
    goal: Option<GoalArea>,
    has_truth: bool,
    position: Option<[f64; 2]>,
    commanded: Option<Twist>,
    /// Speed, the larger of m/s and rad/s; infinite if it is not finite.
    speed: f64,
    arrived: Option<Time>,
}

impl GoalMonitor {
    /// A monitor that waits for the robot to reach `goal`.
    pub fn new(goal: Option<GoalArea>) -> GoalMonitor {
        GoalMonitor { goal, ..GoalMonitor::default() }
    }

    /// Time at which the goal was first reached.
    pub fn arrived(&self) -> Option<Time> {
        self.arrived
    }

    /// Returns true if the robot is commanded to stand and, as far as it is known, stands.
    pub fn stands(&self) -> bool {
        self.commanded == Some(Twist::ZERO) && self.speed < STANDING
    }

    /// Distance from the center of the robot to the goal, m; `None` without a goal or before the first position.
    pub fn to_go_m(&self) -> Option<f64> {
        let ([x, y], goal) = (self.position?, self.goal?);
        Some((goal.x_m - x).hypotenuse(goal.y_m - y))
    }

    fn is_at(&mut self, time: Time, [x, y]: [f64; 2], [vx, vy, omega]: [f64; 3]) {
        self.position = Some([x, y]);
        let speeds = [vx.hypotenuse(vy), omega.abs()];
        self.speed = if speeds.iter().all(|speed| speed.is_finite()) {
            speeds[0].max(speeds[1])
        } else {
            f64::INFINITY
        };
        let near = self.goal.zip(self.to_go_m()).is_some_and(|(goal, to_go)| to_go <= goal.tolerance_m);
        if near && self.arrived.is_none() {
            self.arrived = Some(time);
        }
    }
}

impl Tap for GoalMonitor {
    fn message(&mut self, _: &str, message: &MessageType, time: Time, header: &[u8], items: &[u8]) {
        let raw = RawMessage { header, items };
        match message.name {
            Truth::NAME => {
                let Some(View { header: truth, .. }) = View::<Truth>::of(raw) else { return };
                self.has_truth = true;
                self.is_at(time, [truth.x, truth.y], [truth.vx, truth.vy, truth.omega]);
            }
            Odometry::NAME if !self.has_truth => {
                let Some(View { header: wheels, .. }) = View::<Odometry>::of(raw) else { return };
                self.is_at(time, [wheels.x, wheels.y], [wheels.vx, wheels.vy, wheels.omega]);
            }
            Command::NAME => {
                let Some(command) = View::<Command>::of(raw) else { return };
                self.commanded = Some(command.header.twist);
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn see<M: Message>(monitor: &mut GoalMonitor, seconds: f64, header: &M) {
        let time = Time::from_secs_f64(seconds);
        monitor.message("any", &MessageType::of::<M>(), time, bytemuck::bytes_of(header), &[]);
    }

    #[test]
    fn truth_outranks_odometry_and_arrival_is_kept() {
        let mut monitor = GoalMonitor::new(Some(GoalArea { x_m: 2.0, y_m: 0.0, tolerance_m: 0.3 }));
        see(&mut monitor, 0.5, &Odometry { x: 1.0, vx: 0.4, ..Default::default() });
        assert!(!monitor.stands() && monitor.to_go_m() == Some(1.0));
        see(&mut monitor, 1.0, &Truth { x: 1.8, vx: 0.4, ..Default::default() });
        see(&mut monitor, 2.0, &Odometry { x: 9.0, ..Default::default() });
        see(&mut monitor, 3.0, &Truth { x: 2.5, ..Default::default() });
        assert_eq!(monitor.arrived(), Some(Time::from_secs_f64(1.0)));
        see(&mut monitor, 3.0, &Command::default());
        assert!(monitor.stands() && monitor.to_go_m() == Some(0.5));
    }

    #[test]
    fn without_odometry_the_robot_stands_when_it_is_commanded_to() {
        let mut monitor = GoalMonitor::new(None);
        assert!(!monitor.stands(), "nothing is known");
        see(&mut monitor, 0.1, &Command { twist: Twist::planar(0.2, 0.0), ..Default::default() });
        assert!(!monitor.stands());
        see(&mut monitor, 0.2, &Command::default());
        assert!(monitor.stands());
    }

    #[test]
    fn a_speed_that_is_no_number_is_not_standing() {
        let mut monitor = GoalMonitor::new(None);
        see(&mut monitor, 0.1, &Command::default());
        for (vx, omega) in [(f64::NAN, 0.0), (0.0, f64::NAN), (f64::INFINITY, 0.0), (0.0, 0.1)] {
            see(&mut monitor, 0.2, &Odometry { vx, omega, ..Default::default() });
            assert!(!monitor.stands(), "{vx} m/s, {omega} rad/s");
        }
        see(&mut monitor, 0.3, &Odometry::default());
        assert!(monitor.stands());
    }
}
