//! The thread that receives.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::task::{Wake, Waker};
use std::thread::Thread;
use std::time::Duration;

use yamabico_core::time::Time;

use super::participant::{Event, Events, Participant, Reader, Reading};
use super::{Shared, Subscription, locked};
use crate::graph::{EndpointId, mismatch};
use crate::reception::Link;

/// Longest time between two looks at who is on the network.
const LOOK_PERIOD: Duration = Duration::from_millis(10);
/// Time after which the log says that a needed topic is silent.
const PATIENCE: Duration = Duration::from_secs(5);
/// Maximum number of different texts on the log.
const MAX_LOGGED: usize = 200;

/// State of the thread.
pub(super) struct Listener {
    participant: Arc<dyn Participant>,
    events: Box<dyn Events>,
    domain: u16,
    shared: Arc<Shared>,
    subscribed: Vec<Subscribed>,
    logged: BTreeSet<String>,
}

/// A subscription with its reader, if the topic is published.
struct Subscribed {
    wanted: Subscription,
    reader: Option<TypedReader>,
    link: Link,
    since: Time,
    has_told: bool,
}

/// A reader of one type of messages, with its publishers.
struct TypedReader {
    message_type: &'static str,
    reader: Box<dyn Reader>,
    /// Publishers whose quality of service does not match.
    mismatched: BTreeSet<EndpointId>,
    matched: BTreeSet<EndpointId>,
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
        participant: Arc<dyn Participant>,
        events: Box<dyn Events>,
        domain: u16,
        shared: Arc<Shared>,
    ) -> Listener {
        Listener { participant, events, domain, shared, subscribed: Vec::new(), logged: BTreeSet::new() }
    }

    /// Receives until the process ends.
    pub fn run(mut self) {
        let waker = Waker::from(Arc::new(Unpark(std::thread::current())));
        loop {
            while let Some(event) = self.events.next() {
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
            Event::Found(id, endpoint) => locked(&self.shared.graph).add(id, endpoint),
            Event::Lost(id) => {
                locked(&self.shared.graph).remove(&id);
                let readers = self.subscribed.iter_mut().filter_map(|topic| topic.reader.as_mut());
                readers.for_each(|reader| reader.forget(&id));
            }
            Event::ParticipantLost(prefix) => locked(&self.shared.graph).remove_participant(&prefix),
            Event::Matched { reader, publisher } => {
                if let Some(TypedReader { mismatched, matched, .. }) = self.typed_reader(&reader) {
                    mismatched.remove(&publisher);
                    matched.insert(publisher);
                }
            }
            Event::ReaderMismatched { reader, publisher, requested, offered } => {
                let text = self.subscribed_as(&reader).map(|topic| {
                    if let Some(reader) = &mut topic.reader {
                        reader.mismatched.insert(publisher);
                    }
                    mismatch(&topic.wanted.topic, requested, offered, true)
                });
                self.log_once(text);
            }
            Event::WriterMismatched { writer, requested, offered } => {
                let own = locked(&self.shared.own);
                let topic = own.iter().find(|(id, _)| *id == writer);
                let text = topic.map(|(_, topic)| mismatch(topic, requested, offered, false));
                drop(own);
                self.log_once(text);
            }
            Event::Notice(text) => tracing::warn!("{text}"),
        }
    }

    fn subscribed_as(&mut self, reader: &EndpointId) -> Option<&mut Subscribed> {
        let is_it =
            |topic: &&mut Subscribed| topic.reader.as_ref().is_some_and(|typed| typed.reader.id() == *reader);
        self.subscribed.iter_mut().find(is_it)
    }

    fn typed_reader(&mut self, reader: &EndpointId) -> Option<&mut TypedReader> {
        self.subscribed_as(reader)?.reader.as_mut()
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
            let reading = Reading {
                topic: &wanted.topic,
                message_type: right,
                reliability: wanted.reliability,
                transient_local: wanted.transient_local,
            };
            let reader = self.participant.reader(&reading);
            match reader {
                Ok(reader) => {
                    tracing::info!("`{}` is subscribed as {right}", wanted.topic);
                    let (mismatched, matched) = (BTreeSet::new(), BTreeSet::new());
                    topic.reader = Some(TypedReader { message_type: right, reader, mismatched, matched });
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
        let Some(TypedReader { message_type, reader, .. }) = &mut self.reader else { return };
        let wanted = &mut self.wanted;
        reader.read(waker, &mut |message| {
            (wanted.receive)(message_type, message, Time::monotonic_now());
        });
    }
}

impl TypedReader {
    fn forget(&mut self, publisher: &EndpointId) {
        self.mismatched.remove(publisher);
        self.matched.remove(publisher);
    }
}
