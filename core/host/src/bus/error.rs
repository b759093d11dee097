//! What can go wrong on the bus.

use std::path::PathBuf;

/// A bus that refused; every message says what to do about it.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// The name would not do for folders and segments.
    #[error("`{name}` cannot name a {what}: {problem}")]
    BadName {
        /// What was to be named.
        what: &'static str,
        /// The name.
        name: String,
        /// What would be right.
        problem: String,
    },
    /// There is no folder for what a running robot keeps.
    #[error(
        "/dev/shm cannot be written, and neither XDG_RUNTIME_DIR nor HOME is set: set one to an absolute path outside the temporary folder"
    )]
    NoPlace,
    /// A folder or file of the robot cannot be used.
    #[error("cannot {doing} {}: {source}", path.display())]
    Files {
        /// What was tried.
        doing: &'static str,
        /// On what.
        path: PathBuf,
        /// Why it failed.
        source: std::io::Error,
    },
    /// Another process runs a robot of this name.
    #[error("robot `{robot}` is already running as process {pid}: stop it, or give this one another name")]
    AlreadyRunning {
        /// The robot.
        robot: String,
        /// Who runs it; zero where it has not written its number yet.
        pid: u32,
    },
    /// A plugin was started without its robot.
    #[error("robot `{robot}` is not running: start it first")]
    NotRunning {
        /// The robot.
        robot: String,
    },
    /// The topic was created before.
    #[error("topic `{topic}` exists already: create each topic once, with one type")]
    Exists {
        /// The topic.
        topic: String,
    },
    /// Nobody created the topic.
    #[error("there is no topic `{topic}`: the supervisor creates every topic before a plugin opens it")]
    NoSuchTopic {
        /// The topic.
        topic: String,
    },
    /// The topic carries another type.
    #[error("topic `{topic}` carries {carries}, not {asked}: plug it into a slot of its own type")]
    WrongType {
        /// The topic.
        topic: String,
        /// What it carries.
        carries: String,
        /// What was asked for.
        asked: &'static str,
    },
    /// Every publisher's place is taken; on commands and proposals there is only one.
    #[error("topic `{topic}` takes at most {most} publisher(s) and has them: stop the other one first")]
    TooManyPublishers {
        /// The topic.
        topic: String,
        /// Places that it has.
        most: usize,
    },
    /// Every subscriber's place is taken.
    #[error("topic `{topic}` takes at most {most} subscribers and has them: create it with more")]
    TooManySubscribers {
        /// The topic.
        topic: String,
        /// Places that it has.
        most: usize,
    },
    /// The list is longer than the topic was created for.
    #[error("topic `{topic}` holds lists of at most {most} bytes, not {len}: create it with more")]
    TooLong {
        /// The topic.
        topic: String,
        /// What fits, bytes.
        most: usize,
        /// What was to be sent, bytes.
        len: usize,
    },
    /// The bytes are no message of the topic's type.
    #[error("topic `{topic}` carries {message}: {problem}")]
    Malformed {
        /// The topic.
        topic: String,
        /// What it carries.
        message: &'static str,
        /// What does not fit.
        problem: String,
    },
    /// The subscriber holds as many samples as it may.
    #[error("a subscriber of `{topic}` may hold {most} samples and does: let some go before receiving more")]
    HoldsTooMany {
        /// The topic.
        topic: String,
        /// Samples that it may hold.
        most: usize,
    },
    /// The topic was created without a bell, or not at all.
    #[error("topic `{topic}` does not ring: create it with `Bell::Rings` to wait for it")]
    Silent {
        /// The topic.
        topic: String,
    },
    /// A waiter can tell only so many topics apart.
    #[error("a waiter hears at most {most} topics, not {asked}: use a second one on another thread")]
    TooManyBells {
        /// What it can tell apart.
        most: usize,
        /// What was asked for.
        asked: usize,
    },
    /// The transport failed.
    #[error("{doing} `{name}`: the transport says {reason}")]
    Transport {
        /// What was tried.
        doing: &'static str,
        /// On what.
        name: String,
        /// In its own words.
        reason: String,
    },
}

impl BusError {
    pub(super) fn transport(doing: &'static str, name: &str, reason: impl std::fmt::Debug) -> BusError {
        BusError::Transport { doing, name: name.into(), reason: format!("{reason:?}") }
    }
}
