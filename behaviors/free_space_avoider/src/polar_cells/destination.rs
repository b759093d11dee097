//! Goal of the robot, relative to its current pose.

use nalgebra::Point2;
use yamabico_core::geometry::{Pose2, wrap_angle};
use yamabico_core::message::{Goal, Pose, PoseStatus};
use yamabico_core::odometry_track::OdometryTrack;
use yamabico_core::time::Time;

/// Current objective of the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Objective {
    /// Drive in a direction.
    Toward {
        /// Direction in the robot frame, rad.
        direction_rad: f64,
        /// Remaining distance, m; infinite without a goal.
        distance_m: f64,
    },
    /// The goal is reached.
    Arrived,
    /// The pose on the map is unknown, and with it the direction of the goal.
    Lost,
}

/// A goal in the map frame or, without a pose, in the odometry frame.
#[derive(Clone, Debug)]
pub struct Destination {
    goal: Option<Point2<f64>>,
    tolerance_m: f64,
    has_arrived: bool,
    goal_sequence: Option<u64>,
    /// Pose of the robot on the map, with its time and status.
    pose: Option<(Time, Pose2, PoseStatus)>,
    /// Heading at the start, odometry frame: the direction to drive in without a goal.
    heading_rad: Option<f64>,
}

impl Destination {
    /// Creates a destination with an optional goal (m) and the distance at which it is reached.
    #[must_use]
    pub fn new(goal_m: Option<[f64; 2]>, tolerance_m: f64) -> Self {
        let goal = goal_m.map(Point2::from);
        Self { goal, tolerance_m, has_arrived: false, goal_sequence: None, pose: None, heading_rad: None }
    }

    /// Updates the goal. Ignores a goal with the same sequence number, without a finite position, or without a
    /// tolerance.
    pub fn take_goal(&mut self, goal: &Goal) {
        let is_new = self.goal_sequence.is_none_or(|last| last != goal.sequence);
        if is_new && goal.x.is_finite() && goal.y.is_finite() && goal.tolerance_m > 0.0 {
            self.goal_sequence = Some(goal.sequence);
            self.goal = Some(Point2::new(goal.x, goal.y));
            self.tolerance_m = goal.tolerance_m;
            self.has_arrived = false;
        }
    }

    /// Updates the pose of the robot on the map. A pose that is not finite counts as lost.
    pub fn take_pose(&mut self, pose: &Pose) {
        let robot = Pose2::new(pose.x, pose.y, pose.theta);
        let status = pose.status().filter(|_| robot.is_finite()).unwrap_or(PoseStatus::Lost);
        self.pose = Some((Time(pose.stamp_ns), robot, status));
    }

    /// Returns the objective for the robot's current pose in the odometry frame.
    pub fn objective(&mut self, odometry: &OdometryTrack, robot_in_odometry: &Pose2) -> Objective {
        let heading_rad = *self.heading_rad.get_or_insert(robot_in_odometry.theta);
        let Some(goal) = self.goal else {
            let direction_rad = wrap_angle(heading_rad - robot_in_odometry.theta);
            return Objective::Toward { direction_rad, distance_m: f64::INFINITY };
        };
        let robot = match self.pose {
            None => *robot_in_odometry,
            Some((.., PoseStatus::Lost | PoseStatus::Unknown)) => return Objective::Lost,
            Some((stamp, pose, _)) => match odometry.pose_at(stamp) {
                Some(then) => pose * then.relative(robot_in_odometry),
                None => return Objective::Lost,
            },
        };
        let to_goal = robot.inverse().transform_point(goal);
        let distance_m = to_goal.coords.norm();
        self.has_arrived |= distance_m <= self.tolerance_m;
        if self.has_arrived {
            return Objective::Arrived;
        }
        Objective::Toward { direction_rad: to_goal.y.atan2(to_goal.x), distance_m }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::Odometry;

    fn toward(objective: Objective) -> (f64, f64) {
        match objective {
            Objective::Toward { direction_rad, distance_m } => (direction_rad, distance_m),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn goals_are_in_the_map_frame_if_there_is_a_pose() {
        let mut odometry = OdometryTrack::default();
        let here = Pose2::new(1.0, 0.0, 0.5);
        let reading = Odometry { x: here.x, theta: here.theta, stamp_ns: 1, ..Odometry::default() };
        assert!(odometry.push(&reading, Time(1)));
        let mut destination = Destination::new(None, 0.1);
        assert_eq!(toward(destination.objective(&odometry, &here)), (0.0, f64::INFINITY));
        let turned = Pose2::new(1.0, 0.0, 1.5);
        assert!((toward(destination.objective(&odometry, &turned)).0 + 1.0).abs() < 1e-12);

        let goal = Goal { x: 1.0, y: 2.0, theta: f64::NAN, tolerance_m: 0.2, sequence: 4, ..Goal::default() };
        destination.take_goal(&goal);
        let (direction, distance) = toward(destination.objective(&odometry, &here));
        assert!((direction - (std::f64::consts::FRAC_PI_2 - 0.5)).abs() < 1e-12 && distance == 2.0);
        let tracking = PoseStatus::Tracking.code();
        let pose = Pose { x: 1.0, y: 1.9, stamp_ns: 1, status: tracking, ..Pose::default() };
        destination.take_pose(&Pose { status: PoseStatus::Lost.code(), ..pose });
        assert_eq!(destination.objective(&odometry, &here), Objective::Lost);
        destination.take_pose(&pose);
        assert_eq!(destination.objective(&odometry, &here), Objective::Arrived);
        destination.take_goal(&goal);
        assert_eq!(destination.objective(&odometry, &here), Objective::Arrived, "the same goal again");
        destination.take_goal(&Goal { x: 5.0, sequence: 5, ..goal });
        assert!(toward(destination.objective(&odometry, &here)).1 > 3.9);
        destination.take_goal(&Goal { x: f64::NAN, sequence: 6, ..goal });
        assert!(toward(destination.objective(&odometry, &here)).1 > 3.9);
    }
}
