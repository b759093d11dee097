//! Zenoh, as rmw_zenoh uses it: the only module that names its library.
//!
//! A message is put on the key `DOMAIN/TOPIC/TYPE/HASH`. What is published and subscribed is announced by liveliness tokens. Types match by
//! their names, as over DDS: readers take all hashes, writers send to the hash that is known here and to all that are subscribed.
//!
//! The crate `zenoh` is used itself: the wire of rmw_zenoh is little on top of it. `ros2-client` with its feature `zenoh` gives no messages as
//! bytes, has the hashes of few of the types here, asks for nothing that was published before (`/tf_static`), and brings TLS and QUIC.

mod attachment;
mod publication;
mod session;
mod subscription;
mod token;
mod type_hash;

use std::collections::{BTreeSet, VecDeque};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, Weak};

use ::zenoh::liveliness::LivelinessToken;
use ::zenoh::pubsub::Subscriber;
use ::zenoh::sample::SampleKind;
use ::zenoh::{Session, Wait};

use super::locked;
use super::participant::{Event, Events, Joined, Participant, Reader, Reading, Writer};
use crate::graph::Endpoint;
use publication::{Publication, TopicWriter};
use session::{Opened, RouterWatch};
use subscription::{Past, TopicReader};
use token::{Announced, Node, all_tokens, announced, data_key, id_of};

/// Maximum number of announced definitions that are kept.
const MAX_DEFINITIONS: usize = 10_000;

/// A participant in a domain.
pub(super) struct ZenohParticipant {
    session: Session,
    node: Node,
    next_entity: AtomicU32,
    state: Mutex<State>,
    /// Announces the node as long as the participant lives.
    _token: LivelinessToken,
}

/// State that changes as endpoints come.
#[derive(Default)]
struct State {
    /// Endpoints of others, with the hash of their definition, as far as they differ in more than quality of service.
    definitions: BTreeSet<Definition>,
    writers: Vec<Weak<TopicWriter>>,
    /// Readers that want what was published before.
    pasts: Vec<Weak<Past>>,
    notices: VecDeque<String>,
}

#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Definition {
    topic: String,
    message_type: String,
    publishes: bool,
    hash: String,
}

/// News that a participant hears of others.
struct ZenohEvents {
    participant: Arc<ZenohParticipant>,
    tokens: Receiver<(String, SampleKind)>,
    router: RouterWatch,
    _subscriber: Subscriber<()>,
}

/// Joins `domain`, as a client of `router` or as the environment says. Also returns how.
///
/// # Errors
/// The cause in words.
pub(super) fn join(domain: u16, router: Option<&str>) -> Result<(Joined, String), String> {
    let Opened { session, endpoints, mode } = session::open(router)?;
    let failed = |error: ::zenoh::Error| error.to_string();
    let name = format!("yamabico_{}", std::process::id());
    let node = Node { domain, session: session.zid().to_string(), name };
    let node_token = session.liveliness().declare_token(node.token()).wait().map_err(failed)?;
    let participant = Arc::new(ZenohParticipant {
        session: session.clone(),
        node,
        next_entity: AtomicU32::new(1),
        state: Mutex::default(),
        _token: node_token,
    });
    let (sender, tokens) = channel();
    let subscriber =
        session.liveliness().declare_subscriber(all_tokens(domain)).history(true).callback(move |sample| {
            // The receiver lives as long as the subscriber.
            let _ = sender.send((sample.key_expr().to_string(), sample.kind()));
        });
    let subscriber = subscriber.wait().map_err(failed)?;
    let router = RouterWatch::new(session, endpoints.clone());
    let events =
        ZenohEvents { participant: Arc::clone(&participant), tokens, router, _subscriber: subscriber };
    let how = format!("Zenoh as a {mode} ({endpoints})");
    Ok((Joined { participant, events: Box::new(events) }, how))
}

impl ZenohParticipant {
    /// Number for a new endpoint.
    fn entity(&self) -> u32 {
        self.next_entity.fetch_add(1, Ordering::Relaxed)
    }

    /// Takes note of an endpoint of another program.
    fn found(&self, announced: &Announced) {
        let Announced { endpoint, hash, .. } = announced;
        let definition = Definition {
            topic: endpoint.topic.clone(),
            message_type: endpoint.message_type.clone(),
            publishes: endpoint.publishes,
            hash: hash.clone(),
        };
        let mut state = locked(&self.state);
        if state.definitions.len() < MAX_DEFINITIONS {
            state.definitions.insert(definition);
        }
        if endpoint.publishes {
            state.pasts.retain(|past| past.strong_count() > 0);
            let pasts = state.pasts.iter().filter_map(Weak::upgrade);
            let pasts: Vec<_> =
                pasts.filter(|past| endpoint.qos.transient_local && past.is_of(endpoint)).collect();
            drop(state);
            pasts.iter().for_each(|past| past.ask(&self.session));
        } else {
            state.writers.retain(|writer| writer.strong_count() > 0);
            let writers = state.writers.iter().filter_map(Weak::upgrade);
            let writers: Vec<_> = writers.filter(|writer| writer.lacks(endpoint, hash)).collect();
            drop(state);
            for writer in writers {
                self.add_publication(&writer, hash);
            }
        }
    }

    /// Also sends to the subscribers with the definition `hash`.
    fn add_publication(&self, writer: &TopicWriter, hash: &str) {
        let publication = Publication::new(&self.session, &self.node, self.entity(), &writer.endpoint, hash);
        let Endpoint { topic, message_type, .. } = &writer.endpoint;
        let notice = match publication {
            Ok(publication) => {
                writer.add(publication);
                type_hash::foreign(topic, message_type, hash, "subscriber")
            }
            Err(error) => Some(format!("cannot publish `{topic}` with {hash}: {error}")),
        };
        locked(&self.state).notices.extend(notice);
    }

    /// Definitions of the endpoints on a topic with a type.
    fn hashes(&self, topic: &str, message_type: &str, publishes: bool) -> Vec<String> {
        let state = locked(&self.state);
        let is_it = |definition: &&Definition| {
            definition.topic == topic
                && definition.message_type == message_type
                && definition.publishes == publishes
        };
        state.definitions.iter().filter(is_it).map(|definition| definition.hash.clone()).collect()
    }
}

impl Participant for ZenohParticipant {
    fn writer(&self, topic: &str, message_type: &str) -> Result<Box<dyn Writer>, String> {
        let known = type_hash::known(message_type)
            .ok_or_else(|| format!("the definition of {message_type} has no known hash"))?;
        let writer = Arc::new(TopicWriter::new(topic, message_type));
        self.add_publication(&writer, known);
        // From here on, `found` adds what comes.
        locked(&self.state).writers.push(Arc::downgrade(&writer));
        for hash in self.hashes(topic, message_type, false) {
            if writer.lacks(&writer.endpoint, &hash) {
                self.add_publication(&writer, &hash);
            }
        }
        match writer.is_open() {
            true => Ok(Box::new(writer)),
            false => Err("no publisher of Zenoh could be declared".to_owned()),
        }
    }

    fn reader(&self, reading: &Reading<'_>) -> Result<Box<dyn Reader>, String> {
        let (topic, message_type) = (reading.topic, reading.message_type);
        let hashes = self.hashes(topic, message_type, true);
        let foreign =
            hashes.iter().filter_map(|hash| type_hash::foreign(topic, message_type, hash, "publisher"));
        locked(&self.state).notices.extend(foreign);
        // The token shows one definition: that of the publisher, if there is one.
        let shown = type_hash::known(message_type).map(str::to_owned).or_else(|| hashes.first().cloned());
        let shown = shown.unwrap_or_else(|| type_hash::UNSUPPORTED.to_owned());
        let key = data_key(self.node.domain, topic, message_type, "*");
        let reader = TopicReader::new(&self.session, &self.node, self.entity(), reading, key, &shown);
        let reader = reader.map_err(|error| error.to_string())?;
        if let Some(past) = reader.past() {
            past.ask(&self.session);
            locked(&self.state).pasts.push(Arc::downgrade(past));
        }
        Ok(Box::new(reader))
    }
}

impl Events for ZenohEvents {
    fn next(&mut self) -> Option<Event> {
        if let Some(notice) = locked(&self.participant.state).notices.pop_front() {
            return Some(Event::Notice(notice));
        }
        while let Ok((key, kind)) = self.tokens.try_recv() {
            let Some(announced) = announced(&key) else { continue };
            if announced.session == self.participant.node.session {
                continue;
            }
            return Some(match kind {
                SampleKind::Put => {
                    self.participant.found(&announced);
                    Event::Found(id_of(&key), announced.endpoint)
                }
                SampleKind::Delete => Event::Lost(id_of(&key)),
            });
        }
        self.router.look().map(Event::Notice)
    }
}
