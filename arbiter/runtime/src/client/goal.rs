//! Goals for a running robot, and the progress towards them.

use std::time::{Duration, Instant};

use yamabico_core::geometry::Hypotenuse;
use yamabico_core::message::{Control, ControlKind, Goal, Message, PathHeader};
use yamabico_core::time::Time;
use yamabico_host::bus::{BusError, Subscriber};
use yamabico_parameters::instead;

use super::{ClientError, RobotClient, control};
use crate::execution::{RobotManifest, topics};

/// Time within which the robot accepts a goal, and within which it plans a path to it.
pub(super) const TIMEOUT: Duration = Duration::from_secs(5);
/// Period after which a goal that was not accepted is sent again: a robot that is starting has topics before it receives.
const RETRY_PERIOD: Duration = Duration::from_secs(1);
/// Pause between two attempts to receive an answer.
const PAUSE: Duration = Duration::from_millis(20);
/// Maximum distance between a goal and the end of the path to it, m.
const SAME_POINT_M: f64 = 1e-3;

/// A goal in the map frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GoalRequest {
    /// X, m.
    pub x_m: f64,
    /// Y, m.
    pub y_m: f64,
    /// Heading, rad, left positive; `None` accepts any heading.
    pub heading_rad: Option<f64>,
    /// Distance at which the goal counts as reached, m.
    pub tolerance_m: f64,
}

impl GoalRequest {
    /// Checks that the goal does not lie far outside the map.
    fn check(&self, max_goal_m: Option<f64>) -> Result<(), ClientError> {
        match max_goal_m.filter(|max_m| self.x_m.abs().max(self.y_m.abs()) > *max_m) {
            Some(max_m) => Err(ClientError::FarGoal { x_m: self.x_m, y_m: self.y_m, max_m }),
            None => Ok(()),
        }
    }
}

/// Progress of a robot towards its goals, from the paths that a behavior plans.
pub struct GoalProgress {
    paths: Subscriber<PathHeader>,
    goals: Subscriber<Goal>,
    planner: String,
    /// Maximum absolute coordinate of a goal, m; `None` without a map.
    max_goal_m: Option<f64>,
}

impl RobotClient {
    /// Follows the paths of the behavior `planner`; without a name, of the only behavior that plans paths.
    ///
    /// # Errors
    /// The robot has no such behavior, it plans no paths, or several behaviors do.
    pub fn goal_progress(&mut self, planner: Option<&str>) -> Result<GoalProgress, ClientError> {
        let manifest = self.manifest()?;
        let (planner, max_goal_m) = (choose_planner(manifest, planner)?, manifest.max_goal_m);
        Ok(GoalProgress {
            paths: self.bus.subscriber(&path_topic(&planner))?,
            goals: self.bus.subscriber(topics::GOAL)?,
            planner,
            max_goal_m,
        })
    }

    /// Sends the robot to `goal` and waits until it has a path there; returns the length of the path, m.
    ///
    /// # Errors
    /// The goal lies far outside the robot's map, the robot did not accept it, or found no path.
    pub fn send_goal(&mut self, goal: &GoalRequest, progress: &GoalProgress) -> Result<f64, ClientError> {
        goal.check(progress.max_goal_m)?;
        let sent = Time::monotonic_now();
        let theta = goal.heading_rad.unwrap_or(f64::NAN);
        let request =
            Control { goal: [goal.x_m, goal.y_m, theta, goal.tolerance_m], ..control(ControlKind::Goal) };
        let began = Instant::now();
        let mut sent_at = None;
        while !progress.is_accepted(goal, sent)? {
            if began.elapsed() > TIMEOUT {
                return Err(ClientError::GoalNotAccepted);
            }
            if sent_at.is_none_or(|at: Instant| at.elapsed() > RETRY_PERIOD) {
                self.send(request, sent, &[])?;
                sent_at = Some(Instant::now());
            }
            std::thread::sleep(PAUSE);
        }
        let began = Instant::now();
        loop {
            if let Some(to_go_m) = progress.to_go_m(goal)? {
                return Ok(to_go_m);
            }
            if began.elapsed() > TIMEOUT {
                return Err(ClientError::NoPath { planner: progress.planner.clone() });
            }
            std::thread::sleep(PAUSE);
        }
    }
}

impl GoalProgress {
    /// Distance along the path to `goal`, m, from the newest path; `None` if there is no new path, or it leads elsewhere.
    ///
    /// # Errors
    /// The bus fails.
    pub fn to_go_m(&self, goal: &GoalRequest) -> Result<Option<f64>, ClientError> {
        let Some(path) = self.paths.newest()? else { return Ok(None) };
        let Some(end) = path.items().last() else { return Ok(None) };
        if (end.x - goal.x_m).hypotenuse(end.y - goal.y_m) > SAME_POINT_M {
            return Ok(None);
        }
        let length: f64 = path
            .items()
            .windows(2)
            .map(|pair| (pair[1].x - pair[0].x).hypotenuse(pair[1].y - pair[0].y))
            .sum();
        Ok(Some((length - path.header().progress_m).max(0.0)))
    }

    fn is_accepted(&self, request: &GoalRequest, sent: Time) -> Result<bool, BusError> {
        while let Some(goal) = self.goals.receive()? {
            let goal = goal.header();
            if goal.stamp_ns >= sent.0 && goal.x == request.x_m && goal.y == request.y_m {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

fn path_topic(behavior: &str) -> String {
    topics::output(behavior, "path")
}

fn choose_planner(manifest: &RobotManifest, name: Option<&str>) -> Result<String, ClientError> {
    let behaviors = || {
        manifest.plugins.iter().filter(|plugin| plugin.behavior.is_some()).map(|plugin| plugin.name.as_str())
    };
    let plans = |behavior: &str| {
        let topic = path_topic(behavior);
        manifest.topics.iter().any(|entry| entry.name == topic && entry.message == PathHeader::NAME)
    };
    let planners: Vec<&str> = behaviors().filter(|behavior| plans(behavior)).collect();
    match (name, planners.as_slice()) {
        (Some(name), planners) if planners.contains(&name) => Ok(name.to_owned()),
        (None, [only]) => Ok((*only).to_owned()),
        (_, []) => Err(ClientError::NoPlanner),
        (None, several) => Err(ClientError::AmbiguousPlanner { planners: several.join(", ") }),
        (Some(name), planners) if behaviors().any(|behavior| behavior == name) => {
            Err(ClientError::NotAPlanner { name: name.to_owned(), planners: planners.join(", ") })
        }
        (Some(name), planners) => {
            let instead = instead(name, planners.iter().copied(), "behavior that plans paths");
            Err(ClientError::NoSuchBehavior { name: name.to_owned(), instead })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::execution::{BehaviorEntry, PluginEntry, TopicEntry};

    fn robot(behaviors: &[&str], planners: &[&str]) -> RobotManifest {
        let entry = BehaviorEntry {
            priority: 1,
            max_age_s: 0.2,
            max_evidence_age_s: 1.0,
            deadline_s: None,
            latency_budget_s: None,
            budget_s: None,
        };
        let plugin = |name: &&str| PluginEntry {
            name: (*name).to_owned(),
            plugin: (*name).to_owned(),
            own_process: false,
            exec: Vec::new(),
            hang_timeout_s: 1.0,
            behavior: Some(entry),
            parameters: Vec::new(),
            folder: std::path::PathBuf::new(),
            inputs: Vec::new(),
        };
        let topic = |name: &&str| TopicEntry {
            declares: None,
            name: path_topic(name),
            message: PathHeader::NAME.to_owned(),
            publisher: (*name).to_owned(),
        };
        RobotManifest {
            plugins: behaviors.iter().map(plugin).collect(),
            topics: planners.iter().map(topic).collect(),
            ..RobotManifest::default()
        }
    }

    #[test]
    fn a_goal_far_outside_the_map_is_refused() {
        let goal = |x_m| GoalRequest { x_m, y_m: -1.0, heading_rad: None, tolerance_m: 0.3 };
        let error = goal(1250.0).check(Some(90.0)).unwrap_err();
        assert!(error.is_wrong_request() && error.to_string().contains("(1250, -1)"), "{error}");
        assert!(goal(12.5).check(Some(90.0)).is_ok() && goal(1250.0).check(None).is_ok());
    }

    #[test]
    fn the_planner_need_not_be_named_if_it_is_the_only_one() {
        let one = robot(&["localizer", "teleop"], &["localizer"]);
        assert_eq!(choose_planner(&one, None).unwrap(), "localizer");
        assert_eq!(choose_planner(&one, Some("localizer")).unwrap(), "localizer");
        let message = |name| choose_planner(&one, name).unwrap_err().to_string();
        assert!(message(Some("teleop")).contains("--behavior: localizer"), "{}", message(Some("teleop")));
        assert!(
            message(Some("localzer")).contains("did you mean `localizer`?"),
            "{}",
            message(Some("localzer"))
        );
        let none = choose_planner(&robot(&["teleop"], &[]), Some("map-localizer")).unwrap_err();
        assert!(matches!(none, ClientError::NoPlanner));
        let two = choose_planner(&robot(&["a", "b"], &["a", "b"]), None).unwrap_err();
        assert!(two.to_string().contains("--behavior: a, b"), "{two}");
    }
}
