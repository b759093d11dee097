//! Failures of a client.

use yamabico_host::MAX_PARAMETER_BYTES;
use yamabico_host::bus::BusError;

use super::{goal, parameters, request};

/// Failure of a request to a running robot, or of reading from it.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// No such robot is running, or the bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The robot publishes no manifest.
    #[error("the robot does not publish its manifest: it is starting, stopping, or hung")]
    NoManifest,
    /// The manifest has another format.
    #[error(
        "the robot's manifest has another version: build this program and the robot from one version ({0})"
    )]
    ManifestVersion(#[from] serde_json::Error),
    /// The robot publishes no decisions.
    #[error(
        "the robot publishes no decisions: it is starting or stopping, or it is hung and its drive has stopped"
    )]
    NoDecision,
    /// The robot has no such behavior.
    #[error("the robot has no behavior `{name}`: {instead}")]
    NoSuchBehavior {
        /// Name that was given.
        name: String,
        /// Similar or available names.
        instead: String,
    },
    /// The robot has no such topic.
    #[error("the robot has no topic `{topic}`: {instead}")]
    NoSuchTopic {
        /// Topic that was given.
        topic: String,
        /// Similar or available topics.
        instead: String,
    },
    /// This program does not know the message type of a topic.
    #[error("cannot read `{topic}`: {problem}")]
    UnknownMessage {
        /// Topic.
        topic: String,
        /// Cause.
        problem: String,
    },
    /// A request had no effect.
    #[error(
        "the robot did not carry out the request within {} s: check that no other operator requests the opposite",
        request::TIMEOUT.as_secs()
    )]
    NotCarriedOut,
    /// The robot did not stop in time.
    #[error(
        "the emergency stop is latched, but the robot did not stop within {} s: cut the power of the drive",
        request::STOPPING_TIMEOUT.as_secs()
    )]
    StillMoving,
    /// No behavior of the robot plans paths.
    #[error("no behavior of the robot plans paths to goals: add one to the task, such as `map-localizer`")]
    NoPlanner,
    /// The behavior plans no paths.
    #[error("behavior `{name}` plans no paths: choose another with --behavior: {planners}")]
    NotAPlanner {
        /// Behavior that was given.
        name: String,
        /// Behaviors that plan paths.
        planners: String,
    },
    /// Several behaviors plan paths.
    #[error("several behaviors plan paths: choose one with --behavior: {planners}")]
    AmbiguousPlanner {
        /// Behaviors that plan paths.
        planners: String,
    },
    /// The goal lies far outside the robot's map.
    #[error(
        "the goal ({x_m}, {y_m}) is far outside the robot's map: give meters, at most {max_m:.0} from its origin"
    )]
    FarGoal {
        /// X, m.
        x_m: f64,
        /// Y, m.
        y_m: f64,
        /// Maximum absolute coordinate, m.
        max_m: f64,
    },
    /// The arbiter did not publish the goal.
    #[error("the robot did not accept the goal within {} s: it is hung, or the goal is not finite", goal::TIMEOUT.as_secs())]
    GoalNotAccepted,
    /// The behavior found no path to the goal.
    #[error(
        "`{planner}` found no path to the goal: the goal lies off the map or behind a wall, the robot is not localized, or \
         the input `goal` of `{planner}` is not wired to \"operator\""
    )]
    NoPath {
        /// Behavior that plans.
        planner: String,
    },
    /// The new parameters do not fit into one message.
    #[error("the parameters take more than {MAX_PARAMETER_BYTES} bytes: change fewer at once")]
    ParametersTooLong,
    /// The robot refused the new parameters; nothing was changed.
    #[error("nothing was changed: {}{problem}", if key.is_empty() { String::new() } else { format!("`{key}`: ") })]
    ParametersRefused {
        /// Key to change, dotted; empty if no single key is wrong.
        key: String,
        /// Cause.
        problem: String,
    },
    /// The robot did not answer.
    #[error("the robot did not answer within {} s: it is starting, or it is hung", parameters::TIMEOUT.as_secs())]
    NoAnswer,
}

impl ClientError {
    /// Returns true if the request itself is wrong: it names a robot, behavior, topic or parameter that does not exist.
    /// Otherwise the robot could not carry it out.
    pub fn is_wrong_request(&self) -> bool {
        !matches!(
            self,
            ClientError::NoManifest
                | ClientError::NoDecision
                | ClientError::NotCarriedOut
                | ClientError::StillMoving
                | ClientError::GoalNotAccepted
                | ClientError::NoPath { .. }
                | ClientError::ParametersTooLong
                | ClientError::NoAnswer
        )
    }
}
