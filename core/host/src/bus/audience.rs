//! The subscribers of a topic.

use std::sync::Arc;

use iceoryx2::prelude::{PortFactory as _, Service};

use super::node::{Node, Topic};
use super::service::{Either, IpcService, LocalService, either, map_either};
use super::{Bus, BusError};
use yamabico_core::message::MessageType;

/// Tells whether anybody subscribes to a topic.
pub struct Audience {
    topic: Either<Arc<Topic<LocalService>>, Arc<Topic<IpcService>>>,
    // Dropped after the topic, so that the node goes last.
    _bus: Bus,
}

impl Audience {
    pub(super) fn open(bus: &Bus, topic: &str, message: &MessageType) -> Result<Audience, BusError> {
        let factory = map_either!(&bus.0.node, node => shared(node, topic, message)?);
        Ok(Audience { topic: factory, _bus: bus.clone() })
    }

    /// Returns true if the topic has a subscriber in any process. One that died counts until it is cleaned up. Costs a few
    /// nanoseconds.
    pub fn is_present(&self) -> bool {
        either!(&self.topic, topic => topic.dynamic_config().number_of_subscribers() > 0)
    }
}

fn shared<S: Service>(node: &Node<S>, topic: &str, message: &MessageType) -> Result<Arc<Topic<S>>, BusError> {
    node.with_topic(topic, message, |factory| Ok(Arc::clone(factory)))
}
