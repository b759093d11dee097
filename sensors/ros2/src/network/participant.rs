//! Needs of the network: participants, writers and readers of a middleware.

use std::task::Waker;
use std::time::Duration;

use crate::config::Reliability;
use crate::graph::{Endpoint, EndpointId, Qos};

/// Something that has happened on the network.
pub(super) enum Event {
    /// An endpoint of another program was found.
    Found(EndpointId, Endpoint),
    /// An endpoint is gone.
    Lost(EndpointId),
    /// All endpoints are gone whose identities begin so.
    #[cfg_attr(not(feature = "dds"), expect(dead_code, reason = "Zenoh loses endpoints one by one"))]
    ParticipantLost([u8; 12]),
    /// A publisher of another program sends to a reader of this one.
    #[cfg_attr(not(feature = "dds"), expect(dead_code, reason = "with Zenoh, all of one type match"))]
    Matched {
        /// The reader.
        reader: EndpointId,
        /// The publisher.
        publisher: EndpointId,
    },
    /// It does not send, since their qualities of service do not fit.
    #[cfg_attr(not(feature = "dds"), expect(dead_code, reason = "with Zenoh, all of one type match"))]
    ReaderMismatched {
        /// The reader.
        reader: EndpointId,
        /// The publisher.
        publisher: EndpointId,
        /// Quality of service that the reader asks for.
        requested: Qos,
        /// Quality of service that the publisher offers.
        offered: Qos,
    },
    /// A subscriber of another program gets nothing from a writer of this one, for the same reason.
    #[cfg_attr(not(feature = "dds"), expect(dead_code, reason = "with Zenoh, all of one type match"))]
    WriterMismatched {
        /// The writer.
        writer: EndpointId,
        /// Quality of service that the subscriber asks for.
        requested: Qos,
        /// Quality of service that the writer offers.
        offered: Qos,
    },
    /// Something to put on the log.
    #[cfg_attr(not(feature = "zenoh"), expect(dead_code, reason = "DDS has no router"))]
    Notice(String),
}

/// A topic to read, with one type of messages.
pub(super) struct Reading<'a> {
    /// Name, such as `/scan`.
    pub topic: &'a str,
    /// Type in ROS.
    pub message_type: &'a str,
    /// Reliability that is asked for.
    pub reliability: Reliability,
    /// True to get what was published before.
    pub transient_local: bool,
}

/// A participant in a domain.
pub(super) trait Participant: Send + Sync {
    /// Creates a writer of messages of the type `message_type` on `topic`: reliable and volatile.
    ///
    /// # Errors
    /// The cause in words.
    fn writer(&self, topic: &str, message_type: &str) -> Result<Box<dyn Writer>, String>;

    /// Creates a reader.
    ///
    /// # Errors
    /// The cause in words.
    fn reader(&self, reading: &Reading<'_>) -> Result<Box<dyn Reader>, String>;
}

/// A participant, and what it hears of others.
pub(super) struct Joined {
    /// The participant.
    pub participant: std::sync::Arc<dyn Participant>,
    /// News of others.
    pub events: Box<dyn Events>,
}

/// News that a participant hears of others.
pub(super) trait Events: Send {
    /// Takes the next event; `None` if there is none yet.
    fn next(&mut self) -> Option<Event>;
}

/// Sends the messages of a topic.
pub(super) trait Writer: Send + Sync {
    /// Identity.
    fn id(&self) -> EndpointId;

    /// Sends a message, little-endian and without its encapsulation header; false if it was dropped.
    fn write(&self, message: Vec<u8>) -> bool;

    /// Waits until what was sent has arrived, as far as the middleware knows, at most for `timeout`.
    fn flush(&self, timeout: Duration);
}

/// Receives the messages of a topic.
pub(super) trait Reader: Send {
    /// Identity.
    fn id(&self) -> EndpointId;

    /// Gives `take` all that has arrived, each behind its encapsulation header, and wakes `waker` when more arrives.
    fn read(&mut self, waker: &Waker, take: &mut dyn FnMut(&[u8]));
}
