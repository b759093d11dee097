//! Publish-subscribe bus: zero-copy topics over iceoryx2. No other module names the transport.
//!
//! A topic carries one message type. On the wire every message has the same form: an iceoryx2 publish-subscribe
//! service with the message's header as user header, under its versioned type name, and its items as a slice of bytes
//! aligned to eight.
//!
//! - [`Bus::local`] is a bus within the process, for lockstep runs, replays and tests. [`Bus::ipc`] is the
//!   supervisor's bus of a live robot, in shared memory; [`Bus::join`] connects another process to it.
//! - The supervisor creates every topic; other processes only open them.
//! - A [`Bus`] is cheap to clone and may be used by any thread. A port may move to another thread, but is used by one
//!   at a time. A received sample stays with its port.
//! - A `Latest` topic keeps its newest message for late subscribers; they receive it when the publisher publishes
//!   again or calls [`RawPublisher::resend_to_new_subscribers`]. A `Stream` buffers [`STREAM_DEPTH`] messages for each
//!   subscriber. On overflow the oldest are overwritten, and the gap in the sequence numbers gives their number.
//! - Messages that nothing received before their publisher was dropped are lost.
//! - iceoryx2's automatic clean-up is switched off. The supervisor cleans up after dead processes with a [`Cleaner`]
//!   and a [`Janitor`]; the next start of the robot cleans up after a dead supervisor.
//!
//! ```
//! use yamabico_core::message::Odometry;
//! use yamabico_host::bus::{Bus, TopicSpec};
//!
//! let bus = Bus::local("example")?;
//! bus.create::<Odometry>("sensors/wheels", &TopicSpec::default())?;
//! let subscriber = bus.subscriber::<Odometry>("sensors/wheels")?;
//! let publisher = bus.publisher::<Odometry>("sensors/wheels")?;
//! publisher.publish(&Odometry { sequence: 1, x: 0.5, ..Odometry::default() }, &[])?;
//! let sample = subscriber.receive()?.expect("one message is waiting");
//! assert_eq!(sample.header().x, 0.5);
//! # Ok::<(), yamabico_host::bus::BusError>(())
//! ```

mod audience;
mod clean_up;
mod error;
mod inbox;
mod node;
mod notification;
mod publisher;
mod retry;
mod robot_files;
mod sample;
mod service;
mod subscriber;
mod system;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

pub use audience::Audience;
pub use clean_up::{CleanUpReport, Cleaner, Janitor};
pub use error::BusError;
pub use inbox::Inbox;
pub use notification::{MAX_WAIT_TOPICS, Notification, Notified, WaitSet};
pub use publisher::{Publisher, RawPublisher};
pub use sample::{RawSample, Sample};
pub use subscriber::{RawSubscriber, Subscriber};
pub use system::close_files_in_children;
pub(crate) use system::set_fifo_priority;

use node::{AnyNode, Node};
use retry::Retry;
use robot_files::{RobotFiles, RobotLock};
use service::{Either, either};
use subscriber::Depth;
use yamabico_core::message::{Message, MessageType};

/// Buffer depth of an ordinary subscriber of a stream, messages.
pub const STREAM_DEPTH: usize = 64;

/// Capacity of a topic. Everything is fixed when the topic is created.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TopicSpec {
    /// Maximum number of publishers: one for commands and proposals, so that a second one is refused; elsewhere twice
    /// the number of live ones, since a dead one keeps its slot until it is cleaned up.
    pub publishers: usize,
    /// Maximum number of subscribers, taps included: twice the number of live ones.
    pub subscribers: usize,
    /// Longest list of items, bytes; zero for a message type without a list.
    pub list_bytes: usize,
    /// Buffer depth of a tap, messages; at least that of an ordinary subscriber.
    pub depth: usize,
    /// Notification of the wait sets that listen to the topic.
    pub notification: Notification,
}

impl Default for TopicSpec {
    /// One publisher, eight subscribers, no list, taps as deep as ordinary subscribers, no notification.
    fn default() -> TopicSpec {
        TopicSpec { publishers: 1, subscribers: 8, list_bytes: 0, depth: 1, notification: Notification::Off }
    }
}

/// Handle of a bus. Its clones are handles of the same bus, which ends with its last handle and port.
#[derive(Clone)]
pub struct Bus(Arc<Inner>);

struct Inner {
    // Dropped before the guard: the files are removed after the node is gone.
    node: AnyNode,
    guard: Option<Guard>,
    files: Option<RobotFiles>,
    name: String,
}

impl Bus {
    /// Makes a bus within this process. Each call makes a new one, even for the same name; nothing is left on disk.
    ///
    /// # Errors
    /// The transport failed.
    pub fn local(name: &str) -> Result<Bus, BusError> {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        let prefix = format!("yb{}_", NEXT.fetch_add(1, Ordering::Relaxed));
        let node = Either::Local(Node::new(name, "/yamabico", &prefix, Retry::Never)?);
        Ok(Bus(Arc::new(Inner { node, guard: None, files: None, name: name.into() })))
    }

    /// Makes the supervisor's bus of the robot `robot`, in shared memory. Removes the files of an earlier run, and
    /// reserves the name until its last handle and port are dropped; then no file is left.
    ///
    /// The files are in `$XDG_RUNTIME_DIR/yamabico`, else in `/dev/shm/yamabico-UID`, else in `$HOME/.yamabico`,
    /// private to the user. Sockets among them limit the length of the path, and so of the robot's name. A bus needs
    /// many file descriptors: the process's soft limit is raised to its hard limit.
    ///
    /// # Errors
    /// [`BusError::AlreadyRunning`] if another process runs a robot of this name; [`BusError::BadName`]; folders that
    /// cannot be used; the transport failed.
    pub fn ipc(robot: &str) -> Result<Bus, BusError> {
        let files = RobotFiles::of(robot)?;
        robot_files::raise_file_limit();
        let lock = files.lock()?;
        let guard = Guard { files: files.clone(), lock: Some(lock) };
        files.remove_all()?;
        let node = Either::Ipc(Node::new(robot, &files.root.to_string_lossy(), &files.prefix, Retry::Never)?);
        files.make_private()?;
        Ok(Bus(Arc::new(Inner { node, guard: Some(guard), files: Some(files), name: robot.into() })))
    }

    /// Makes a bus in shared memory for the programs of one process, such as the behaviors of a run in lockstep. It has the
    /// first free name of its own, and is no running robot; otherwise like [`Bus::ipc`].
    ///
    /// # Errors
    /// See [`Bus::ipc`].
    pub fn private() -> Result<Bus, BusError> {
        let mut number = 0_u32;
        loop {
            match Bus::ipc(&format!("{}{number}", robot_files::PRIVATE)) {
                Err(BusError::AlreadyRunning { .. }) => number += 1,
                opened => return opened,
            }
        }
    }

    /// Joins the bus of the robot `robot`, which another process runs. Topics are opened only, never created; an open
    /// waits for half a second at most for a topic that does not exist yet.
    ///
    /// # Errors
    /// [`BusError::NotRunning`]; [`BusError::BadName`]; the transport failed.
    pub fn join(robot: &str) -> Result<Bus, BusError> {
        let files = RobotFiles::of(robot)?;
        files.check_running()?;
        let node =
            Either::Ipc(Node::new(robot, &files.root.to_string_lossy(), &files.prefix, Retry::Bounded)?);
        Ok(Bus(Arc::new(Inner { node, guard: None, files: Some(files), name: robot.into() })))
    }

    /// Removes the files that a dead supervisor of the robot `robot` left. Returns false if another process runs it
    /// again.
    ///
    /// # Errors
    /// [`BusError::BadName`]; files that cannot be removed.
    pub fn remove_stale_files(robot: &str) -> Result<bool, BusError> {
        let files = RobotFiles::of(robot)?;
        let Ok(lock) = files.lock() else { return Ok(false) };
        let removed = files.remove_all();
        lock.release();
        removed.map(|()| true)
    }

    /// Returns the names of this user's running robots in alphabetical order.
    pub fn running() -> Vec<String> {
        RobotFiles::running()
    }

    /// Returns the folder of the transport's files and the prefix of their names, for programs in other languages.
    ///
    /// # Errors
    /// [`BusError::NotRunning`] for a bus within this process.
    pub fn files(&self) -> Result<(PathBuf, String), BusError> {
        let files = self.0.files.clone().ok_or_else(|| self.not_running())?;
        Ok((files.root, files.prefix))
    }

    /// Files of a supervisor's bus.
    fn supervised_files(&self) -> Result<RobotFiles, BusError> {
        self.0.guard.as_ref().map(|guard| guard.files.clone()).ok_or_else(|| self.not_running())
    }

    fn not_running(&self) -> BusError {
        BusError::NotRunning { robot: self.0.name.clone() }
    }

    /// Name that the bus was opened with.
    pub fn name(&self) -> &str {
        &self.0.name
    }

    /// Creates a topic for messages of type `M`.
    ///
    /// # Errors
    /// [`BusError::Exists`]; [`BusError::BadName`]; the transport failed.
    pub fn create<M: Message>(&self, topic: &str, spec: &TopicSpec) -> Result<(), BusError> {
        self.create_raw(topic, &MessageType::of::<M>(), spec)
    }

    /// Opens a publisher of a topic.
    ///
    /// # Errors
    /// [`BusError::TooManyPublishers`]; [`BusError::NoSuchTopic`]; [`BusError::WrongType`]; the transport failed.
    pub fn publisher<M: Message>(&self, topic: &str) -> Result<Publisher<M>, BusError> {
        Ok(Publisher::new(self.publisher_raw(topic, &MessageType::of::<M>())?))
    }

    /// Opens a subscriber of a topic. On a latest channel it receives the newest message, even one sent before (see
    /// [`RawPublisher::resend_to_new_subscribers`]); on a stream the newest [`STREAM_DEPTH`] messages from now on.
    ///
    /// # Errors
    /// [`BusError::TooManySubscribers`]; [`BusError::NoSuchTopic`]; [`BusError::WrongType`]; the transport failed.
    pub fn subscriber<M: Message>(&self, topic: &str) -> Result<Subscriber<M>, BusError> {
        Ok(Subscriber::new(self.subscriber_raw(topic, &MessageType::of::<M>())?))
    }

    /// Like [`Bus::create`], for a type that is known only as a [`MessageType`].
    ///
    /// # Errors
    /// See [`Bus::create`].
    pub fn create_raw(&self, topic: &str, message: &MessageType, spec: &TopicSpec) -> Result<(), BusError> {
        either!(&self.0.node, node => node.create(topic, message, spec))
    }

    /// Like [`Bus::publisher`], for a type that is known only as a [`MessageType`].
    ///
    /// # Errors
    /// See [`Bus::publisher`].
    pub fn publisher_raw(&self, topic: &str, message: &MessageType) -> Result<RawPublisher, BusError> {
        RawPublisher::open(self, topic, message)
    }

    /// Like [`Bus::subscriber`], for a type that is known only as a [`MessageType`]; for an [`Inbox`].
    ///
    /// # Errors
    /// See [`Bus::subscriber`].
    pub fn subscriber_raw(&self, topic: &str, message: &MessageType) -> Result<RawSubscriber, BusError> {
        RawSubscriber::open(self, topic, message, Depth::Default)
    }

    /// Opens the [`Audience`] of a topic.
    ///
    /// # Errors
    /// See [`Bus::subscriber`].
    pub fn audience(&self, topic: &str, message: &MessageType) -> Result<Audience, BusError> {
        Audience::open(self, topic, message)
    }

    /// Opens a wait set for at most [`MAX_WAIT_TOPICS`] topics that were created with [`Notification::On`].
    ///
    /// # Errors
    /// [`BusError::NoNotification`]; [`BusError::TooManyTopics`]; the transport failed.
    pub fn wait_set(&self, topics: &[&str]) -> Result<WaitSet, BusError> {
        WaitSet::open(self, topics)
    }

    /// Opens a subscriber with the depth that the topic was created for, for a recorder that must not lose a message.
    ///
    /// # Errors
    /// See [`Bus::subscriber`].
    pub fn tap(&self, topic: &str, message: &MessageType) -> Result<RawSubscriber, BusError> {
        RawSubscriber::open(self, topic, message, Depth::Maximum)
    }
}

impl std::fmt::Debug for Bus {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Bus").field(&self.0.name).finish()
    }
}

/// Removes the robot's files and releases its name when dropped.
struct Guard {
    files: RobotFiles,
    lock: Option<RobotLock>,
}

impl Drop for Guard {
    fn drop(&mut self) {
        if let Err(error) = self.files.remove_all() {
            tracing::warn!(%error, "could not remove files of the bus");
        }
        if let Some(lock) = self.lock.take() {
            lock.release();
        }
    }
}
