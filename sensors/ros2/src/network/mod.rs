//! The network of ROS 2: the only module that names the DDS library.
//!
//! One thread receives. It follows who publishes what, subscribes a topic with the type that it is published with, hands each message to
//! its receiver, and logs what keeps a topic silent.

mod listener;
mod raw;

use std::net::{IpAddr, Ipv4Addr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::Thread;
use std::time::Duration;

use rustdds::no_key::DataWriter;
use rustdds::policy::{Durability, History, Reliability as DdsReliability};
use rustdds::{
    DomainParticipant, DomainParticipantBuilder, Duration as DdsDuration, Publisher as DdsPublisher,
    QosPolicies, QosPolicyBuilder, Topic, TopicKind,
};
use yamabico_core::behavior::ParameterError;
use yamabico_core::time::Time;

use crate::config::{self, DOMAIN_VARIABLE, Reliability};
use crate::graph::Graph;
use crate::message::{RosMessage, encode};
use crate::names::{dds_topic, dds_type};
use crate::reception::Link;
use listener::Listener;
use raw::{Raw, RawAdapter};

/// Number of sent messages that wait for a subscriber's receipt. One that was killed keeps its place until its lease is over,
/// 20 s or more; until then the others must get their messages.
const SENT_DEPTH: i32 = 5000;
/// Number of received messages that wait for the thread.
const RECEIVED_DEPTH: i32 = 16;
/// Longest time for which sending waits for a slow subscriber.
const MAX_BLOCKING_MS: i64 = 2;

/// Failure of the network.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NetworkError {
    /// The domain cannot be joined.
    #[error("cannot join the domain {domain} of ROS 2: {reason}")]
    Join {
        /// Number of the domain.
        domain: u16,
        /// Cause.
        reason: String,
    },
    /// A publisher or subscriber cannot be created.
    #[error("cannot use the topic `{topic}`: {reason}")]
    Topic {
        /// Name of the topic.
        topic: String,
        /// Cause.
        reason: String,
    },
}

impl From<NetworkError> for ParameterError {
    fn from(error: NetworkError) -> ParameterError {
        ParameterError::new("", error.to_string())
    }
}

/// Receiver of the messages of a topic: its type, the message behind its encapsulation header, and its arrival.
pub type Receiver = Box<dyn FnMut(&str, &[u8], Time) + Send>;

/// A topic to subscribe.
pub struct Subscription {
    /// Name, such as `/scan`.
    pub topic: String,
    /// Types of messages that can be read, the preferred first.
    pub types: Vec<&'static str>,
    /// Reliability that is asked for.
    pub reliability: Reliability,
    /// True to get what was published before.
    pub transient_local: bool,
    /// Part of the robot that needs it, for the log; without one, its silence is not logged.
    pub needed_by: Option<String>,
    /// Receiver of the messages.
    pub receive: Receiver,
    /// Called when the state of the subscription changes.
    pub on_link: Box<dyn FnMut(Link) + Send>,
}

/// A participant in a domain.
pub struct Network {
    /// Number of the domain.
    pub domain: u16,
    participant: DomainParticipant,
    publisher: DdsPublisher,
    shared: Arc<Shared>,
    thread: Thread,
}

/// Shared by the thread and its users.
#[derive(Default)]
struct Shared {
    graph: Mutex<Graph>,
    /// Subscriptions that the thread has not taken yet.
    wanted: Mutex<Vec<Subscription>>,
    /// Topics of the publishers of this program, by the identities of their endpoints.
    own: Mutex<Vec<([u8; 16], String)>>,
}

impl Network {
    /// Joins the domain `configured`, or that of the environment.
    ///
    /// # Errors
    /// No such domain, or no network.
    pub fn join(configured: Option<u16>) -> Result<Arc<Network>, ParameterError> {
        let variable = |name: &str| std::env::var(name).ok();
        let domain = config::domain(configured, variable(DOMAIN_VARIABLE).as_deref())?;
        let only_local = variable("ROS_AUTOMATIC_DISCOVERY_RANGE").is_some_and(|range| range == "LOCALHOST")
            || variable("ROS_LOCALHOST_ONLY").is_some_and(|only| only == "1");
        let network = Self::join_domain(domain, only_local)?;
        let from = match (configured, variable(DOMAIN_VARIABLE)) {
            (Some(_), _) => "the configuration",
            (None, Some(_)) => DOMAIN_VARIABLE,
            (None, None) => "its default",
        };
        let reach = if only_local { ", on this machine only" } else { "" };
        tracing::info!("in the domain {domain} of ROS 2 (from {from}), over DDS{reach}");
        Ok(network)
    }

    fn join_domain(domain: u16, only_local: bool) -> Result<Arc<Network>, NetworkError> {
        let failed = |error: &dyn std::fmt::Display| NetworkError::Join { domain, reason: error.to_string() };
        let mut builder = DomainParticipantBuilder::new(domain);
        if only_local {
            builder = builder.with_only_networks([IpAddr::V4(Ipv4Addr::LOCALHOST)]);
        }
        let participant = builder.build().map_err(|error| failed(&error))?;
        let publisher = participant.create_publisher(&sending()).map_err(|error| failed(&error))?;
        let shared = Arc::new(Shared::default());
        let listener =
            Listener::new(&participant, domain, Arc::clone(&shared)).map_err(|error| failed(&error))?;
        let handle = std::thread::Builder::new().name("ros2".into()).spawn(move || listener.run());
        let thread = handle.map_err(|error| failed(&error))?.thread().clone();
        Ok(Arc::new(Network { domain, participant, publisher, shared, thread }))
    }

    /// Subscribes a topic as soon as it is published with one of the types.
    pub fn subscribe(&self, subscription: Subscription) {
        locked(&self.shared.wanted).push(subscription);
        self.thread.unpark();
    }

    /// Creates a publisher of `topic`: reliable and volatile.
    ///
    /// # Errors
    /// [`NetworkError::Topic`].
    pub fn publisher<M: RosMessage>(&self, topic: &str) -> Result<Publisher, NetworkError> {
        let failed = |error: &dyn std::fmt::Display| NetworkError::Topic {
            topic: topic.to_owned(),
            reason: error.to_string(),
        };
        let dds_topic =
            create_topic(&self.participant, topic, M::TYPE, &sending()).map_err(|error| failed(&error))?;
        let writer = self.publisher.create_datawriter_no_key(&dds_topic, Some(sending()));
        let writer: DataWriter<Raw, RawAdapter> = writer.map_err(|error| failed(&error))?;
        let id = rustdds::RTPSEntity::guid(&writer).to_bytes();
        locked(&self.shared.own).push((id, topic.to_owned()));
        Ok(Publisher { writer })
    }

    /// Calls `look` with all endpoints that are seen.
    pub fn with_graph<R>(&self, look: impl FnOnce(&Graph) -> R) -> R {
        look(&locked(&self.shared.graph))
    }
}

/// Publisher of a topic.
pub struct Publisher {
    writer: DataWriter<Raw, RawAdapter>,
}

impl Publisher {
    /// Sends a message. One that no subscriber takes in time is dropped.
    pub fn publish<M: RosMessage>(&self, message: &M) {
        if self.writer.write(Raw(encode(message)), None).is_err() {
            tracing::debug!("a message on {} was dropped", M::TYPE);
        }
    }

    /// Waits until all reliable subscribers have what was sent, at most for `timeout`.
    pub fn flush(&self, timeout: Duration) {
        // Best-effort subscribers acknowledge nothing: a moment for the thread that sends.
        let _ = self.writer.wait_for_acknowledgments(timeout);
        std::thread::sleep(Duration::from_millis(20).min(timeout));
    }
}

/// Quality of service of all publishers.
fn sending() -> QosPolicies {
    QosPolicyBuilder::new()
        .reliability(DdsReliability::Reliable {
            max_blocking_time: DdsDuration::from_millis(MAX_BLOCKING_MS),
        })
        .durability(Durability::Volatile)
        .history(History::KeepLast { depth: SENT_DEPTH })
        .build()
}

/// Quality of service of a subscription.
fn receiving(reliability: Reliability, transient_local: bool) -> QosPolicies {
    let reliability = match (reliability, transient_local) {
        (Reliability::BestEffort, false) => DdsReliability::BestEffort,
        // What was published before comes reliably, or not at all.
        _ => DdsReliability::Reliable { max_blocking_time: DdsDuration::from_millis(MAX_BLOCKING_MS) },
    };
    QosPolicyBuilder::new()
        .reliability(reliability)
        .durability(if transient_local { Durability::TransientLocal } else { Durability::Volatile })
        .history(History::KeepLast { depth: RECEIVED_DEPTH })
        .build()
}

fn create_topic(
    participant: &DomainParticipant,
    topic: &str,
    message_type: &str,
    qos: &QosPolicies,
) -> rustdds::dds::CreateResult<Topic> {
    participant.create_topic(dds_topic(topic), dds_type(message_type), qos, TopicKind::NoKey)
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
