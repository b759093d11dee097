//! Publishers of a topic, one for each definition of its messages that is subscribed.

use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use ::zenoh::bytes::ZBytes;
use ::zenoh::liveliness::LivelinessToken;
use ::zenoh::pubsub::Publisher;
use ::zenoh::qos::CongestionControl;
use ::zenoh::{Session, Wait};

use super::attachment::attachment;
use super::token::{Node, data_key, id_of};
use crate::graph::{Endpoint, EndpointId, Qos};
use crate::network::locked;
use crate::network::participant::Writer;
use crate::ros_clock::calendar_now_ns;

/// Depth of the history that is announced. Nothing is kept here.
const DEPTH: usize = 10;
/// Encapsulation header of little-endian CDR.
const HEADER: [u8; 4] = [0, 1, 0, 0];
/// Time in which the threads of Zenoh send what was put.
const SENDING: Duration = Duration::from_millis(50);

/// A publisher of messages with one definition.
pub(super) struct Publication {
    hash: String,
    id: EndpointId,
    publisher: Publisher<'static>,
    sent: AtomicI64,
    _token: LivelinessToken,
}

impl Publication {
    /// Declares a publisher of the messages of `endpoint` with the definition `hash`, and announces it.
    ///
    /// # Errors
    /// That of Zenoh.
    pub fn new(
        session: &Session,
        node: &Node,
        entity: u32,
        endpoint: &Endpoint,
        hash: &str,
    ) -> ::zenoh::Result<Publication> {
        let key = data_key(node.domain, &endpoint.topic, &endpoint.message_type, hash);
        // Like rmw_zenoh for a history that is bounded: what a slow subscriber does not take is dropped. A command is sent at once, and not
        // together with others.
        let publisher = session
            .declare_publisher(key)
            .congestion_control(CongestionControl::Drop)
            .express(true)
            .wait()?;
        let token = node.endpoint_token(entity, endpoint, hash, DEPTH);
        let id = id_of(&token);
        let token = session.liveliness().declare_token(token).wait()?;
        Ok(Publication { hash: hash.to_owned(), id, publisher, sent: AtomicI64::new(0), _token: token })
    }

    fn put(&self, payload: ZBytes) -> ::zenoh::Result<()> {
        let sequence = 1 + self.sent.fetch_add(1, Ordering::Relaxed);
        let attachment = attachment(sequence, calendar_now_ns(), &self.id);
        self.publisher.put(payload).attachment(attachment).wait()
    }
}

/// Sends the messages of a topic.
pub(super) struct TopicWriter {
    /// Topic, type and quality of service.
    pub endpoint: Endpoint,
    publications: Mutex<Vec<Publication>>,
}

impl TopicWriter {
    pub fn new(topic: &str, message_type: &str) -> TopicWriter {
        let endpoint = Endpoint {
            topic: topic.to_owned(),
            message_type: message_type.to_owned(),
            publishes: true,
            qos: Qos { reliable: true, transient_local: false },
        };
        TopicWriter { endpoint, publications: Mutex::default() }
    }

    /// Adds a publisher; a second one for a definition would send each message twice.
    pub fn add(&self, publication: Publication) {
        let mut publications = locked(&self.publications);
        if publications.iter().all(|known| known.hash != publication.hash) {
            publications.push(publication);
        }
    }

    /// True if `other` is of this topic and type, but its definition `hash` has no publisher yet.
    pub fn lacks(&self, other: &Endpoint, hash: &str) -> bool {
        other.topic == self.endpoint.topic
            && other.message_type == self.endpoint.message_type
            && !locked(&self.publications).iter().any(|publication| publication.hash == hash)
    }

    /// True if there is a publisher.
    pub fn is_open(&self) -> bool {
        !locked(&self.publications).is_empty()
    }
}

impl Writer for Arc<TopicWriter> {
    fn id(&self) -> EndpointId {
        locked(&self.publications).first().map(|publication| publication.id).unwrap_or_default()
    }

    fn write(&self, message: Vec<u8>) -> bool {
        let payload = ZBytes::from([&HEADER[..], &message].concat());
        let publications = locked(&self.publications);
        publications.iter().all(|publication| publication.put(payload.clone()).is_ok())
    }

    fn flush(&self, timeout: Duration) {
        // Zenoh acknowledges nothing.
        std::thread::sleep(SENDING.min(timeout));
    }
}
