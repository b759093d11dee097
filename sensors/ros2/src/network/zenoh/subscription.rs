//! Readers of a topic.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use std::task::Waker;
use std::time::Duration;

use ::zenoh::bytes::ZBytes;
use ::zenoh::liveliness::LivelinessToken;
use ::zenoh::pubsub::Subscriber;
use ::zenoh::query::{ConsolidationMode, QueryTarget, ReplyKeyExpr};
use ::zenoh::{Session, Wait};

use super::token::{Node, id_of};
use crate::config::Reliability;
use crate::graph::{Endpoint, EndpointId, Qos};
use crate::network::locked;
use crate::network::participant::{Reader, Reading};

/// Number of received messages that wait for the thread; the oldest are dropped.
const DEPTH: usize = 16;
/// Longest wait for messages that were published before.
const PAST_TIMEOUT: Duration = Duration::from_secs(10);

/// Received messages that wait.
#[derive(Default)]
struct Inbox {
    waiting: VecDeque<ZBytes>,
    waker: Option<Waker>,
}

fn put(inbox: &Mutex<Inbox>, message: ZBytes) {
    let mut inbox = locked(inbox);
    if inbox.waiting.len() >= DEPTH {
        inbox.waiting.pop_front();
    }
    inbox.waiting.push_back(message);
    if let Some(waker) = &inbox.waker {
        waker.wake_by_ref();
    }
}

/// Asks transient-local publishers for what they published before.
pub(super) struct Past {
    topic: String,
    message_type: String,
    key: String,
    inbox: Arc<Mutex<Inbox>>,
}

impl Past {
    /// True if `publisher` is of this topic and type.
    pub fn is_of(&self, publisher: &Endpoint) -> bool {
        publisher.topic == self.topic && publisher.message_type == self.message_type
    }

    /// Asks all publishers; the answers come as messages.
    pub fn ask(&self, session: &Session) {
        let inbox = Arc::clone(&self.inbox);
        // The caches of Zenoh's advanced publishers, which rmw_zenoh uses, answer below the key of their messages.
        let asked = session
            .get(format!("{}/@adv/**", self.key))
            .target(QueryTarget::All)
            .consolidation(ConsolidationMode::None)
            .accept_replies(ReplyKeyExpr::Any)
            .timeout(PAST_TIMEOUT)
            .callback(move |reply| {
                if let Ok(sample) = reply.result() {
                    put(&inbox, sample.payload().clone());
                }
            })
            .wait();
        if let Err(error) = asked {
            tracing::warn!("cannot ask for what was published on `{}` before: {error}", self.topic);
        }
    }
}

/// Receives the messages of a topic.
pub(super) struct TopicReader {
    id: EndpointId,
    inbox: Arc<Mutex<Inbox>>,
    past: Option<Arc<Past>>,
    _subscriber: Subscriber<()>,
    _token: LivelinessToken,
}

impl TopicReader {
    /// Subscribes the key `key`, and announces that with the definition `hash`.
    ///
    /// # Errors
    /// That of Zenoh.
    pub fn new(
        session: &Session,
        node: &Node,
        entity: u32,
        reading: &Reading<'_>,
        key: String,
        hash: &str,
    ) -> ::zenoh::Result<TopicReader> {
        let (topic, message_type) = (reading.topic.to_owned(), reading.message_type.to_owned());
        let inbox = Arc::<Mutex<Inbox>>::default();
        let of_callback = Arc::clone(&inbox);
        let subscriber = session
            .declare_subscriber(key.clone())
            .callback(move |sample| put(&of_callback, sample.payload().clone()))
            .wait()?;
        let reliable = reading.reliability == Reliability::Reliable || reading.transient_local;
        let endpoint = Endpoint {
            topic: topic.clone(),
            message_type: message_type.clone(),
            publishes: false,
            qos: Qos { reliable, transient_local: reading.transient_local },
        };
        let token = node.endpoint_token(entity, &endpoint, hash, DEPTH);
        let id = id_of(&token);
        let token = session.liveliness().declare_token(token).wait()?;
        let past = Past { topic, message_type, key, inbox: Arc::clone(&inbox) };
        let past = reading.transient_local.then(|| Arc::new(past));
        Ok(TopicReader { id, inbox, past, _subscriber: subscriber, _token: token })
    }

    /// Questions to transient-local publishers, if it wants past messages.
    pub fn past(&self) -> Option<&Arc<Past>> {
        self.past.as_ref()
    }
}

impl Reader for TopicReader {
    fn id(&self) -> EndpointId {
        self.id
    }

    fn read(&mut self, waker: &Waker, take: &mut dyn FnMut(&[u8])) {
        let waiting = {
            let mut inbox = locked(&self.inbox);
            if !inbox.waker.as_ref().is_some_and(|known| known.will_wake(waker)) {
                inbox.waker = Some(waker.clone());
            }
            std::mem::take(&mut inbox.waiting)
        };
        for message in waiting {
            take(&message.to_bytes());
        }
    }
}
