//! Errors of the bus.

use std::path::PathBuf;

/// Failure of an operation on the bus. Every message names the remedy.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// The name cannot be part of file names.
    #[error("`{name}` cannot be the name of a {what}: {problem}")]
    BadName {
        /// Kind of thing to be named: `robot` or `topic`.
        what: &'static str,
        /// The rejected name.
        name: String,
        /// Rule that the name breaks.
        problem: String,
    },
    /// No folder can hold the files of a running robot.
    #[error(
        "/dev/shm is not writable, and neither XDG_RUNTIME_DIR nor HOME is set: set one to an absolute \
         path outside the temporary folder"
    )]
    NoFolder,
    /// A folder or file of the robot cannot be used.
    #[error("cannot {doing} {}: {source}", path.display())]
    Files {
        /// Failed operation, such as `open`.
        doing: &'static str,
        /// Path of the folder or file.
        path: PathBuf,
        /// Reason given by the operating system.
        source: std::io::Error,
    },
    /// Another process runs a robot of this name.
    #[error("robot `{robot}` is already running in process {pid}: stop it, or give this robot another name")]
    AlreadyRunning {
        /// Name of the robot.
        robot: String,
        /// Process id of its supervisor; zero if it has not written it yet.
        pid: u32,
    },
    /// No process runs a robot of this name.
    #[error("robot `{robot}` is not running: start it first")]
    NotRunning {
        /// Name of the robot.
        robot: String,
    },
    /// The topic exists already.
    #[error("topic `{topic}` already exists: create each topic once, with one message type")]
    Exists {
        /// Name of the topic.
        topic: String,
    },
    /// The topic does not exist.
    #[error("topic `{topic}` does not exist: the supervisor creates every topic before a plugin opens it")]
    NoSuchTopic {
        /// Name of the topic.
        topic: String,
    },
    /// The topic carries another message type.
    #[error("topic `{topic}` carries {carries}, not {requested}: connect it to a slot of its own type")]
    WrongType {
        /// Name of the topic.
        topic: String,
        /// Its message type.
        carries: String,
        /// The requested message type.
        requested: &'static str,
    },
    /// The topic has its maximum number of publishers; one for commands and proposals.
    #[error("topic `{topic}` already has its maximum of {max} publisher(s): stop another publisher first")]
    TooManyPublishers {
        /// Name of the topic.
        topic: String,
        /// Maximum number of publishers.
        max: usize,
    },
    /// The topic has its maximum number of subscribers.
    #[error("topic `{topic}` already has its maximum of {max} subscribers: create it for more")]
    TooManySubscribers {
        /// Name of the topic.
        topic: String,
        /// Maximum number of subscribers.
        max: usize,
    },
    /// The list is longer than the topic was created for.
    #[error(
        "a list on topic `{topic}` must have at most {max} bytes, but has {len}: create the topic for longer lists"
    )]
    TooLong {
        /// Name of the topic.
        topic: String,
        /// Maximum length, bytes.
        max: usize,
        /// Length of the refused list, bytes.
        len: usize,
    },
    /// The bytes are not a message of the topic's type.
    #[error("malformed {message} for topic `{topic}`: {problem}")]
    Malformed {
        /// Name of the topic.
        topic: String,
        /// Its message type.
        message: &'static str,
        /// Mismatch of sizes.
        problem: String,
    },
    /// The subscriber holds its maximum number of samples.
    #[error(
        "a subscriber of topic `{topic}` already holds its maximum of {max} samples: drop some before receiving more"
    )]
    TooManySamples {
        /// Name of the topic.
        topic: String,
        /// Maximum number of samples held.
        max: usize,
    },
    /// The topic does not exist, or was created without notification.
    #[error("topic `{topic}` does not notify: create it with `Notification::On` to wait for its messages")]
    NoNotification {
        /// Name of the topic.
        topic: String,
    },
    /// A wait set for more topics than it can distinguish.
    #[error(
        "a wait set must have at most {max} topics, but has {requested}: use a second one on another thread"
    )]
    TooManyTopics {
        /// Maximum number of topics.
        max: usize,
        /// Requested number of topics.
        requested: usize,
    },
    /// The transport failed.
    #[error("cannot {doing} `{name}`: iceoryx2 reports {reason}")]
    Transport {
        /// Failed operation, such as `publish on`.
        doing: &'static str,
        /// Name of the topic or robot.
        name: String,
        /// Reason given by the transport.
        reason: String,
    },
}

impl BusError {
    pub(super) fn transport(doing: &'static str, name: &str, reason: impl std::fmt::Debug) -> BusError {
        BusError::Transport { doing, name: name.into(), reason: format!("{reason:?}") }
    }
}
