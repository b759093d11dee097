//! The thread that receives.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::task::{Wake, Waker};
use std::thread::Thread;
use std::time::Duration;

use rustdds::no_key::SimpleDataReader;
use rustdds::policy::{Durability, Reliability as DdsReliability};
use rustdds::{
    DomainParticipant, DomainParticipantStatusEvent as Event, DomainParticipantStatusListener,
    EndpointDescription, GUID, QosPolicies, RTPSEntity, StatusEvented, Subscriber as DdsSubscriber,
};
use yamabico_core::time::Time;

use super::raw::{Raw, RawAdapter};
use super::{Shared, Subscription, create_topic, locked, receiving};
use crate::config::Reliability;
use crate::graph::{Endpoint, Qos, mismatch};
use crate::names::{ros_topic, ros_type};
use crate::reception::Link;

/// Longest time between two looks at who is on the network.
const LOOK_PERIOD: Duration = Duration::from_millis(10);
/// Time after which the log says that a needed topic is silent.
const PATIENCE: Duration = Duration::from_secs(5);
/// Maximum number of different texts on the log.
const MAX_LOGGED: usize = 200;

/// State of the thread.
pub(super) struct Listener {
    participant: DomainParticipant,
    subscriber: DdsSubscriber,
    events: DomainParticipantStatusListener,
    domain: u16,
    shared: Arc<Shared>,
    subscribed: Vec<Subscribed>,
    logged: BTreeSet<String>,
}

/// A subscription with its reader, if the topic is published.
struct Subscribed {
    wanted: Subscription,
    reader: Option<Reader>,
    link: Link,
    since: Time,
    has_told: bool,
}

struct Reader {
    message_type: &'static str,
    reader: SimpleDataReader<Raw, RawAdapter>,
    /// Publishers whose quality of service does not match.
    mismatched: BTreeSet<[u8; 16]>,
    matched: BTreeSet<[u8; 16]>,
}

/// Wakes the thread when a message has arrived.
struct Unpark(Thread);

impl Wake for Unpark {
    fn wake(self: Arc<Self>) {
        self.0.unpark();
    }
}

impl Listener {
    pub fn new(
        participant: &DomainParticipant,
        domain: u16,
        shared: Arc<Shared>,
    ) -> rustdds::dds::CreateResult<Listener> {
        Ok(Listener {
            subscriber: participant.create_subscriber(&receiving(Reliability::BestEffort, false))?,
            events: participant.status_listener(),
            participant: participant.clone(),
            domain,
            shared,
            subscribed: Vec::new(),
            logged: BTreeSet::new(),
        })
    }

    /// Receives until the process ends.
    pub fn run(mut self) {
        let waker = Waker::from(Arc::new(Unpark(std::thread::current())));
        loop {
            while let Some(event) = self.events.try_recv_status() {
                self.follow(event);
            }
            let now = Time::monotonic_now();
            let new = std::mem::take(&mut *locked(&self.shared.wanted));
            self.subscribed.extend(new.into_iter().map(|wanted| Subscribed::new(wanted, now)));
            let mut subscribed = std::mem::take(&mut self.subscribed);
            for topic in &mut subscribed {
                self.choose_type(topic);
                topic.receive(&waker);
                self.look_after(topic, Time::monotonic_now());
            }
            self.subscribed = subscribed;
            std::thread::park_timeout(LOOK_PERIOD);
        }
    }

    fn follow(&mut self, event: Event) {
        match event {
            Event::WriterDetected { writer } => self.add(writer, true),
            Event::ReaderDetected { reader } => self.add(reader, false),
            Event::WriterLost { guid, .. } | Event::ReaderLost { guid, .. } => {
                locked(&self.shared.graph).remove(&guid.to_bytes());
                let readers = self.subscribed.iter_mut().filter_map(|topic| topic.reader.as_mut());
                readers.for_each(|reader| reader.forget(&guid.to_bytes()));
            }
            Event::ParticipantLost { id, .. } => {
                let mut any = GUID::from_bytes([0; 16]);
                any.prefix = id;
                let prefix = any.to_bytes();
                locked(&self.shared.graph).remove_participant(&prefix[..12]);
            }
            Event::RemoteWriterMatched { local_reader, remote_writer } => {
                if let Some(topic) = self.subscribed_as(local_reader)
                    && let Some(reader) = &mut topic.reader
                {
                    reader.forget(&remote_writer.to_bytes());
                    reader.matched.insert(remote_writer.to_bytes());
                }
            }
            Event::RemoteWriterQosIncompatible {
                local_reader,
                remote_writer,
                requested_qos,
                offered_qos,
            } => {
                let text = self.subscribed_as(local_reader).map(|topic| {
                    if let Some(reader) = &mut topic.reader {
                        reader.mismatched.insert(remote_writer.to_bytes());
                    }
                    mismatch(&topic.wanted.topic, qos(&requested_qos), qos(&offered_qos), true)
                });
                self.log_once(text);
            }
            Event::RemoteReaderQosIncompatible { local_writer, requested_qos, offered_qos, .. } => {
                let own = locked(&self.shared.own);
                let topic = own.iter().find(|(id, _)| *id == local_writer.to_bytes());
                let text =
                    topic.map(|(_, topic)| mismatch(topic, qos(&requested_qos), qos(&offered_qos), false));
                drop(own);
                self.log_once(text);
            }
            _ => {}
        }
    }

    fn add(&self, description: EndpointDescription, publishes: bool) {
        let EndpointDescription { guid, topic_name, type_name, qos: policies, .. } = description;
        if guid.prefix == self.participant.guid().prefix {
            return;
        }
        if let Some(topic) = ros_topic(&topic_name) {
            let endpoint =
                Endpoint { topic, message_type: ros_type(&type_name), publishes, qos: qos(&policies) };
            locked(&self.shared.graph).add(guid.to_bytes(), endpoint);
        }
    }

    fn subscribed_as(&mut self, local_reader: GUID) -> Option<&mut Subscribed> {
        let is_it = |topic: &&mut Subscribed| {
            topic.reader.as_ref().is_some_and(|reader| RTPSEntity::guid(&reader.reader) == local_reader)
        };
        self.subscribed.iter_mut().find(is_it)
    }

    /// Subscribes with the first type that is published, unless the topic is subscribed with one that is.
    fn choose_type(&mut self, topic: &mut Subscribed) {
        let wanted = &topic.wanted;
        let graph = locked(&self.shared.graph);
        let published = graph.types_on(&wanted.topic, true);
        let current = topic.reader.as_ref().map(|reader| reader.message_type);
        let is_right = current.is_some_and(|current| published.contains(current));
        let right = wanted.types.iter().copied().find(|name| published.contains(name));
        let other = published.iter().next().map(|name| (*name).to_owned());
        drop(graph);
        let link = match (&topic.reader, right, other) {
            (_, None, None) => Link::NoPublisher,
            (_, None, Some(other)) => {
                let who = wanted.needed_by.as_deref().unwrap_or("this program");
                let text = format!(
                    "`{}` carries {other}, but {who} needs {}: name another topic",
                    wanted.topic,
                    wanted.types.join(" or ")
                );
                self.log_once(Some(text));
                Link::OtherType
            }
            (Some(reader), Some(_), _) if reader.matched.is_empty() && !reader.mismatched.is_empty() => {
                Link::QosMismatch
            }
            (_, Some(_), _) => Link::Matched,
        };
        topic.set_link(link);
        if let Some(right) = right.filter(|_| !is_right) {
            let wanted = &topic.wanted;
            let policies = receiving(wanted.reliability, wanted.transient_local);
            let reader =
                create_topic(&self.participant, &wanted.topic, right, &policies).and_then(|dds_topic| {
                    self.subscriber.create_simple_datareader_no_key(&dds_topic, Some(policies))
                });
            match reader {
                Ok(reader) => {
                    tracing::info!("`{}` is subscribed as {right}", wanted.topic);
                    let (mismatched, matched) = (BTreeSet::new(), BTreeSet::new());
                    topic.reader = Some(Reader { message_type: right, reader, mismatched, matched });
                }
                Err(error) => self.log_once(Some(format!("cannot subscribe `{}`: {error}", wanted.topic))),
            }
        }
    }

    /// Tells once what keeps a needed topic silent.
    fn look_after(&mut self, topic: &mut Subscribed, now: Time) {
        if topic.link != Link::NoPublisher || topic.has_told || now.since(topic.since) < PATIENCE {
            return;
        }
        topic.has_told = true;
        if let Some(who) = &topic.wanted.needed_by {
            let why = locked(&self.shared.graph).why_silent(&topic.wanted.topic, self.domain);
            self.log_once(Some(format!("{who}: {why}")));
        }
    }

    /// Tells a text on the log, once.
    fn log_once(&mut self, text: Option<String>) {
        let Some(text) = text.filter(|text| !self.logged.contains(text)) else { return };
        tracing::warn!("{text}");
        if self.logged.len() < MAX_LOGGED {
            self.logged.insert(text);
        }
    }
}

impl Subscribed {
    fn new(wanted: Subscription, now: Time) -> Subscribed {
        Subscribed { wanted, reader: None, link: Link::default(), since: now, has_told: false }
    }

    fn set_link(&mut self, link: Link) {
        if self.link != link {
            (self.link, self.since, self.has_told) = (link, Time::monotonic_now(), false);
            (self.wanted.on_link)(link);
        }
    }

    /// Hands over everything that has arrived.
    fn receive(&mut self, waker: &Waker) {
        let Some(Reader { message_type, reader, .. }) = &self.reader else { return };
        // Set before the look, so that none that arrives in between is missed.
        reader.set_waker(Some(waker.clone()));
        reader.drain_read_notifications();
        while let Ok(Some(sample)) = reader.try_take_one() {
            (self.wanted.receive)(message_type, &sample.into_value().0, Time::monotonic_now());
        }
    }
}

impl Reader {
    fn forget(&mut self, publisher: &[u8; 16]) {
        self.mismatched.remove(publisher);
        self.matched.remove(publisher);
    }
}

fn qos(policies: &QosPolicies) -> Qos {
    Qos {
        reliable: matches!(policies.reliability(), Some(DdsReliability::Reliable { .. })),
        transient_local: !matches!(policies.durability(), None | Some(Durability::Volatile)),
    }
}
