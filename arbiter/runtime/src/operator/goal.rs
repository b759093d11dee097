//! Somebody outside who sends a running robot to a goal.

use std::time::{Duration, Instant};

use yamabico_core::message::{Control, ControlKind, Goal, PathHeader};
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, BusError, Publisher, Subscriber};

use crate::execution::topics;

/// How long the robot may take to hear a request, and to plan a path to a goal.
const PATIENCE: Duration = Duration::from_secs(5);
/// A request that has not been heard for so long is made again.
const AGAIN: Duration = Duration::from_secs(1);
/// From one look at what the robot answered to the next.
const PAUSE: Duration = Duration::from_millis(20);
/// A path that ends this near to a goal (m) leads to it.
const SAME_PLACE_M: f64 = 1e-3;

/// A connection to a running robot.
pub struct Operator {
    controls: Publisher<Control>,
    goals: Subscriber<Goal>,
    paths: Subscriber<PathHeader>,
    follower: String,
    sequence: u64,
}

/// A place to go to, map frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Meters.
    pub x_m: f64,
    /// Meters.
    pub y_m: f64,
    /// Radians, left positive; `None` where any heading will do.
    pub heading: Option<f64>,
    /// How near is there, meters.
    pub tolerance_m: f64,
}

/// Why a robot is not on its way to a goal.
#[derive(Debug, thiserror::Error)]
pub enum GoalError {
    /// No such robot runs, or it has no such behavior.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The request was not handed on.
    #[error(
        "the robot did not hear the goal within {} s: it hangs, or the numbers are no place",
        PATIENCE.as_secs()
    )]
    NotHeard,
    /// There is no path to it.
    #[error(
        "`{follower}` planned no path to the goal: it lies off the map, behind a wall, or the pose is lost; is its input \
         `goal` plugged into \"operator\"?"
    )]
    NoPath {
        /// The behavior that plans.
        follower: String,
    },
}

impl Operator {
    /// Joins the running robot of this name, whose behavior `follower` plans paths.
    ///
    /// # Errors
    /// No such robot runs, or it has no such behavior.
    pub fn join(robot: &str, follower: &str) -> Result<Operator, BusError> {
        let bus = Bus::join(robot)?;
        Ok(Operator {
            controls: bus.publisher(topics::CONTROL)?,
            goals: bus.subscriber(topics::GOAL)?,
            paths: bus.subscriber(&topics::output(follower, "path"))?,
            follower: follower.to_owned(),
            sequence: 0,
        })
    }

    /// Sends the robot to `place` and waits until it has a path there; meters that it has to go.
    ///
    /// # Errors
    /// It did not hear, or found no path.
    pub fn go_to(&mut self, place: &Place) -> Result<f64, GoalError> {
        self.sequence += 1;
        let asked = Time::monotonic_now();
        let theta = place.heading.unwrap_or(f64::NAN);
        let request = Control {
            stamp_ns: asked.0,
            sequence: self.sequence,
            kind: ControlKind::Goal.code(),
            goal: [place.x_m, place.y_m, theta, place.tolerance_m],
            ..Control::default()
        };
        let began = Instant::now();
        let mut asked_again = None;
        while !self.was_handed_on(place, asked.0)? {
            if began.elapsed() > PATIENCE {
                return Err(GoalError::NotHeard);
            }
            // A robot that is just coming up has topics before it has ears.
            if asked_again.is_none_or(|at: Instant| at.elapsed() > AGAIN) {
                self.controls.publish(&request, &[])?;
                asked_again = Some(Instant::now());
            }
            std::thread::sleep(PAUSE);
        }
        let began = Instant::now();
        loop {
            if let Some(to_go_m) = self.to_go_m(place)? {
                return Ok(to_go_m);
            }
            if began.elapsed() > PATIENCE {
                return Err(GoalError::NoPath { follower: self.follower.clone() });
            }
            std::thread::sleep(PAUSE);
        }
    }

    /// Meters along the path to `place` by the newest news; `None` without news, or while the path leads elsewhere.
    ///
    /// # Errors
    /// The transport failed.
    pub fn to_go_m(&self, place: &Place) -> Result<Option<f64>, BusError> {
        let Some(path) = self.paths.newest()? else { return Ok(None) };
        let Some(end) = path.items().last() else { return Ok(None) };
        if (end.x - place.x_m).hypot(end.y - place.y_m) > SAME_PLACE_M {
            return Ok(None);
        }
        let length: f64 =
            path.items().windows(2).map(|pair| (pair[1].x - pair[0].x).hypot(pair[1].y - pair[0].y)).sum();
        Ok(Some((length - path.header().progress_m).max(0.0)))
    }

    /// Whether a robot of this name still runs.
    #[must_use]
    pub fn is_running(robot: &str) -> bool {
        Bus::running().iter().any(|name| name == robot)
    }

    fn was_handed_on(&self, place: &Place, asked_ns: u64) -> Result<bool, BusError> {
        while let Some(goal) = self.goals.receive()? {
            let goal = goal.header();
            if goal.stamp_ns >= asked_ns && goal.x == place.x_m && goal.y == place.y_m {
                return Ok(true);
            }
        }
        Ok(false)
    }
}
