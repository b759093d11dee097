//! The network of ROS 2, over DDS or over Zenoh.
//!
//! One thread receives. It follows who publishes what, subscribes a topic with the type that it is published with, hands each message to
//! its receiver, and logs what keeps a topic silent. What the two middlewares differ in is behind the traits of `participant`.

#[cfg(feature = "dds")]
mod dds;
mod listener;
mod participant;
#[cfg(feature = "zenoh")]
mod zenoh;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::Thread;
use std::time::Duration;

use yamabico_core::behavior::ParameterError;
use yamabico_core::time::Time;

use crate::config::Reliability;
use crate::graph::{EndpointId, Graph};
use crate::message::{RosMessage, encode};
use crate::network_config::{
    DOMAIN_VARIABLE, MIDDLEWARE_VARIABLE, Middleware, NetworkConfig, domain, middleware,
};
use crate::reception::Link;
use listener::Listener;
use participant::{Joined, Participant, Writer};

#[cfg(not(any(feature = "dds", feature = "zenoh")))]
compile_error!("the feature `program` needs `dds`, `zenoh`, or both");

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
    /// Middleware.
    pub middleware: Middleware,
    participant: Arc<dyn Participant>,
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
    own: Mutex<Vec<(EndpointId, String)>>,
}

impl Network {
    /// Joins the network of `config`; the environment says what is not set there.
    ///
    /// # Errors
    /// No such domain or middleware, or no network.
    pub fn join(config: &NetworkConfig) -> Result<Arc<Network>, ParameterError> {
        let variable = |name: &str| std::env::var(name).ok();
        let domain = domain(config.domain, variable(DOMAIN_VARIABLE).as_deref())?;
        let middleware = middleware(config, variable(MIDDLEWARE_VARIABLE).as_deref(), Middleware::built())?;
        let from = match (config.domain, variable(DOMAIN_VARIABLE)) {
            (Some(_), _) => "the configuration",
            (None, Some(_)) => DOMAIN_VARIABLE,
            (None, None) => "its default",
        };
        let failed = |reason| NetworkError::Join { domain, reason };
        let (joined, over) = join_over(middleware, domain, config).map_err(failed)?;
        let Joined { participant, events } = joined;
        let shared = Arc::new(Shared::default());
        let listener = Listener::new(Arc::clone(&participant), events, domain, Arc::clone(&shared));
        let handle = std::thread::Builder::new().name("ros2".into()).spawn(move || listener.run());
        let thread = handle.map_err(|error| failed(error.to_string()))?.thread().clone();
        tracing::info!("in the domain {domain} of ROS 2 (from {from}), over {over}");
        Ok(Arc::new(Network { domain, middleware, participant, shared, thread }))
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
        let writer = self.participant.writer(topic, M::TYPE);
        let writer = writer.map_err(|reason| NetworkError::Topic { topic: topic.to_owned(), reason })?;
        locked(&self.shared.own).push((writer.id(), topic.to_owned()));
        Ok(Publisher { writer })
    }

    /// Calls `look` with all endpoints that are seen.
    pub fn with_graph<R>(&self, look: impl FnOnce(&Graph) -> R) -> R {
        look(&locked(&self.shared.graph))
    }
}

/// Joins `domain` over one middleware; also returns its name, with what is particular about this participant.
fn join_over(
    middleware: Middleware,
    domain: u16,
    config: &NetworkConfig,
) -> Result<(Joined, String), String> {
    match middleware {
        #[cfg(feature = "dds")]
        Middleware::Dds => {
            let _ = config;
            let reach = if dds::is_only_local() { ", on this machine only" } else { "" };
            Ok((dds::join(domain)?, format!("DDS{reach}")))
        }
        #[cfg(feature = "zenoh")]
        Middleware::Zenoh => zenoh::join(domain, config.router.as_deref()),
        #[cfg(not(all(feature = "dds", feature = "zenoh")))]
        other => Err(format!("this program was built without {}", other.feature())),
    }
}

/// Publisher of a topic.
pub struct Publisher {
    writer: Box<dyn Writer>,
}

impl Publisher {
    /// Sends a message. One that no subscriber takes in time is dropped.
    pub fn publish<M: RosMessage>(&self, message: &M) {
        if !self.writer.write(encode(message)) {
            tracing::debug!("a message on {} was dropped", M::TYPE);
        }
    }

    /// Waits until all reliable subscribers have what was sent, as far as that is known, at most for `timeout`.
    pub fn flush(&self, timeout: Duration) {
        self.writer.flush(timeout);
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
