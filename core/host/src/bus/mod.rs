//! The bus: zero-copy channels over iceoryx2, and the only module that names it.
//!
//! A topic carries one type of message. On the wire every message has one form: an iceoryx2 publish-subscribe service with
//! the message's header as user header, under its versioned type name, and its items as a slice of bytes aligned to eight.
//!
//! - [`Bus::local`] lives within the process: lockstep runs, replays and tests. [`Bus::ipc`] is the supervisor of a running
//!   robot in shared memory, [`Bus::join`] a plugin of it in another process.
//! - The supervisor creates every topic; everybody else only opens them.
//! - A [`Bus`] is cheap to clone and can be used by any thread. Ports can be moved to the thread that uses them and are not
//!   shared: they count without locks. Received samples stay with their port.
//! - A `Latest` channel keeps the newest value, also for late subscribers: a publisher hands it over when it publishes
//!   next or is told to [`welcome`](RawPublisher::welcome) them. A `Stream` keeps [`STREAM_DEPTH`] messages; the
//!   oldest are overwritten, and the gap in the sequence numbers tells how many.
//! - A publisher's messages go with it: what nobody received before it was dropped is gone.
//! - iceoryx2's own clean-up switches are off. After dead processes of a running robot the supervisor cleans up, with a
//!   [`Cleaner`] and a [`Janitor`]; after a dead supervisor, the wipe at the next start.

mod bell;
mod clean_up;
mod error;
mod inbox;
mod place;
mod process;
mod publisher;
mod sample;
mod subscriber;
mod world;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

pub use bell::{Bell, Rang, Waiter};
pub use clean_up::{CleanedUp, Cleaner, Janitor};
pub use error::BusError;
pub use inbox::Inbox;
pub use process::{keep_files_from_children, run_first_come_first_served};
pub use publisher::{Publisher, RawPublisher};
pub use sample::{RawSample, Sample};
pub use subscriber::{RawSubscriber, Subscriber};

use iceoryx2::prelude::{ipc, local};
use place::{Lock, Place};
use subscriber::Depth;
use world::{Patience, World};
use yamabico_core::message::{Message, MessageType};

/// Messages that an ordinary subscriber of a stream can fall behind before it loses some.
pub const STREAM_DEPTH: usize = 64;

/// What a topic makes room for. Everything is fixed when the topic is created.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Spec {
    /// Publishers at once; exactly one on commands and proposals, so that a second one is refused. Elsewhere twice the live
    /// ones: a dead one keeps its place until it is cleaned up.
    pub publishers: usize,
    /// Subscribers at once, taps included; twice the live ones.
    pub subscribers: usize,
    /// The longest list of items, bytes; zero for a message without a list.
    pub list_bytes: usize,
    /// Messages that a tap can fall behind; at least that of an ordinary subscriber.
    pub depth: usize,
    /// Whether publishing wakes those who wait.
    pub bell: Bell,
}

impl Default for Spec {
    /// One publisher, eight subscribers, no list, no more depth than an ordinary subscriber has, no bell.
    fn default() -> Spec {
        Spec { publishers: 1, subscribers: 8, list_bytes: 0, depth: 1, bell: Bell::Silent }
    }
}

/// A handle of one bus. Clones are handles of the same one, which ends with its last handle and port.
#[derive(Clone)]
pub struct Bus(Arc<Inside>);

struct Inside {
    // In front of the guard: the wipe comes after the node is gone.
    kind: Kind,
    guard: Option<Guard>,
    place: Option<Place>,
    name: String,
}

enum Kind {
    Local(World<local::Service>),
    Ipc(World<ipc::Service>),
}

impl Bus {
    /// A bus within this process. Each call makes a new one, also under the same name; nothing is left on disk.
    ///
    /// # Errors
    /// The transport failed.
    pub fn local(name: &str) -> Result<Bus, BusError> {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        let prefix = format!("yb{}_", NEXT.fetch_add(1, Ordering::Relaxed));
        let world = World::new(name, "/yamabico", &prefix, Patience::None)?;
        Ok(Bus(Arc::new(Inside { kind: Kind::Local(world), guard: None, place: None, name: name.into() })))
    }

    /// The supervisor's bus of the robot of this name, in shared memory. Clears what an earlier run left behind, and keeps
    /// the name until the last handle and port of it are gone; then nothing is left.
    ///
    /// The files are in `$XDG_RUNTIME_DIR/yamabico`, else in `/dev/shm/yamabico-UID`, else in `$HOME/.yamabico`, private to the
    /// user. Sockets among them limit the length of the path, and so that of the robot's name. A bus takes many file
    /// descriptors: the process's soft limit is raised to its hard one.
    ///
    /// # Errors
    /// [`BusError::AlreadyRunning`] where another process runs a robot of this name; [`BusError::BadName`]; folders that
    /// cannot be used; the transport failed.
    pub fn ipc(robot: &str) -> Result<Bus, BusError> {
        let place = Place::of(robot)?;
        place::allow_many_files();
        let lock = place.lock()?;
        let guard = Guard { place: place.clone(), lock: Some(lock) };
        place.wipe()?;
        let world = World::new(robot, &place.root.to_string_lossy(), &place.prefix, Patience::None)?;
        place.close_to_others()?;
        Ok(Bus(Arc::new(Inside {
            kind: Kind::Ipc(world),
            guard: Some(guard),
            place: Some(place),
            name: robot.into(),
        })))
    }

    /// A plugin's bus of the robot of this name, which another process runs. Opens only, and waits half a second at most
    /// for what is not there yet.
    ///
    /// # Errors
    /// [`BusError::NotRunning`]; [`BusError::BadName`]; the transport failed.
    pub fn join(robot: &str) -> Result<Bus, BusError> {
        let place = Place::of(robot)?;
        place.check_running()?;
        let world = World::new(robot, &place.root.to_string_lossy(), &place.prefix, Patience::Bounded)?;
        Ok(Bus(Arc::new(Inside {
            kind: Kind::Ipc(world),
            guard: None,
            place: Some(place),
            name: robot.into(),
        })))
    }

    /// Removes what a supervisor that died left of the robot of this name; whether nobody else was about to run it.
    ///
    /// # Errors
    /// [`BusError::BadName`]; files that cannot be removed.
    pub fn bury(robot: &str) -> Result<bool, BusError> {
        let place = Place::of(robot)?;
        let Ok(lock) = place.lock() else { return Ok(false) };
        let wiped = place.wipe();
        lock.release();
        wiped.map(|()| true)
    }

    /// The names of this user's running robots, in alphabetical order.
    pub fn running() -> Vec<String> {
        Place::running()
    }

    /// The folder and the prefix under which the transport keeps the robot's files: for programs in other languages.
    ///
    /// # Errors
    /// [`BusError::NotRunning`] where the bus lives within this process.
    pub fn files(&self) -> Result<(PathBuf, String), BusError> {
        let place = self.0.place.clone().ok_or_else(|| self.not_running())?;
        Ok((place.root, place.prefix))
    }

    /// The supervisor's place.
    fn place(&self) -> Result<Place, BusError> {
        self.0.guard.as_ref().map(|guard| guard.place.clone()).ok_or_else(|| self.not_running())
    }

    fn not_running(&self) -> BusError {
        BusError::NotRunning { robot: self.0.name.clone() }
    }

    /// The name that it was opened with.
    pub fn name(&self) -> &str {
        &self.0.name
    }

    /// Creates the topic for messages of type `M`.
    ///
    /// # Errors
    /// [`BusError::Exists`]; [`BusError::BadName`]; the transport failed.
    pub fn create<M: Message>(&self, topic: &str, spec: &Spec) -> Result<(), BusError> {
        self.create_raw(topic, &MessageType::of::<M>(), spec)
    }

    /// Opens the sending end of a topic.
    ///
    /// # Errors
    /// [`BusError::TooManyPublishers`], [`BusError::NoSuchTopic`], [`BusError::WrongType`], or the transport failed.
    pub fn publisher<M: Message>(&self, topic: &str) -> Result<Publisher<M>, BusError> {
        Ok(Publisher::new(self.publisher_raw(topic, &MessageType::of::<M>())?))
    }

    /// Opens a receiving end of a topic: the newest value of a latest channel, also one sent before,
    /// once its publisher publishes again or welcomes; the
    /// [`STREAM_DEPTH`] newest messages of a stream from now on.
    ///
    /// # Errors
    /// [`BusError::TooManySubscribers`], [`BusError::NoSuchTopic`], [`BusError::WrongType`], or the transport failed.
    pub fn subscriber<M: Message>(&self, topic: &str) -> Result<Subscriber<M>, BusError> {
        Ok(Subscriber::new(self.subscriber_raw(topic, &MessageType::of::<M>())?))
    }

    /// As [`Bus::create`], for a type that is known as a [`MessageType`] only.
    ///
    /// # Errors
    /// See [`Bus::create`].
    pub fn create_raw(&self, topic: &str, message: &MessageType, spec: &Spec) -> Result<(), BusError> {
        match &self.0.kind {
            Kind::Local(world) => world.create(topic, message, spec),
            Kind::Ipc(world) => world.create(topic, message, spec),
        }
    }

    /// As [`Bus::publisher`], for a type that is known as a [`MessageType`] only.
    ///
    /// # Errors
    /// See [`Bus::publisher`].
    pub fn publisher_raw(&self, topic: &str, message: &MessageType) -> Result<RawPublisher, BusError> {
        RawPublisher::open(self, topic, message)
    }

    /// As [`Bus::subscriber`], for a type that is known as a [`MessageType`] only. An [`Inbox`] makes a slot of it.
    ///
    /// # Errors
    /// See [`Bus::subscriber`].
    pub fn subscriber_raw(&self, topic: &str, message: &MessageType) -> Result<RawSubscriber, BusError> {
        RawSubscriber::open(self, topic, message, Depth::Ordinary)
    }

    /// A waiter for messages on these topics, which were created with [`Bell::Rings`]; at most 64.
    ///
    /// # Errors
    /// [`BusError::Silent`], [`BusError::TooManyBells`], or the transport failed.
    pub fn waiter(&self, topics: &[&str]) -> Result<Waiter, BusError> {
        Waiter::open(self, topics)
    }

    /// A receiving end as deep as the topic was created for: for a recorder, which wants every message of every channel.
    ///
    /// # Errors
    /// See [`Bus::subscriber`].
    pub fn tap(&self, topic: &str, message: &MessageType) -> Result<RawSubscriber, BusError> {
        RawSubscriber::open(self, topic, message, Depth::Deepest)
    }
}

impl std::fmt::Debug for Bus {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Bus").field(&self.0.name).finish()
    }
}

/// Clears the robot's files and gives its name back.
struct Guard {
    place: Place,
    lock: Option<Lock>,
}

impl Drop for Guard {
    fn drop(&mut self) {
        if let Err(error) = self.place.wipe() {
            tracing::warn!(%error, "files of the bus stay behind");
        }
        if let Some(lock) = self.lock.take() {
            lock.release();
        }
    }
}
