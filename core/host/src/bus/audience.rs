//! The subscribers of a topic.

use std::sync::Arc;
use std::time::Duration;

use iceoryx2::prelude::{PortFactory as _, Service};

use super::node::{Node, Topic};
use super::service::{Either, IpcService, LocalService, either, map_either};
use super::{Bus, BusError};
use yamabico_core::message::MessageType;
use yamabico_core::time::Time;

/// Time between two looks at the subscribers, which take about 0.1 us each.
const LOOK_PERIOD: Duration = Duration::from_millis(200);

/// Tells whether anybody subscribes to a topic.
pub struct Audience {
    /// Time of the last look, and its result.
    looked: Option<Time>,
    is_present: bool,
    topic: Either<Arc<Topic<LocalService>>, Arc<Topic<IpcService>>>,
    // Dropped after the topic, so that the node goes last.
    _bus: Bus,
}

impl Audience {
    pub(super) fn open(bus: &Bus, topic: &str, message: &MessageType) -> Result<Audience, BusError> {
        let factory = map_either!(&bus.0.node, node => shared(node, topic, message)?);
        Ok(Audience { looked: None, is_present: false, topic: factory, _bus: bus.clone() })
    }

    /// Returns true if the topic has a subscriber in any process; one that came or went less than 0.2 s ago, on the clock of
    /// `now`, may not count yet. One that died counts until it is cleaned up.
    pub fn is_present(&mut self, now: Time) -> bool {
        if self.looked.is_none_or(|looked| now.since(looked) >= LOOK_PERIOD) {
            self.looked = Some(now);
            self.is_present =
                either!(&self.topic, topic => topic.dynamic_config().number_of_subscribers() > 0);
        }
        self.is_present
    }
}

fn shared<S: Service>(node: &Node<S>, topic: &str, message: &MessageType) -> Result<Arc<Topic<S>>, BusError> {
    node.with_topic(topic, message, |factory| Ok(Arc::clone(factory)))
}
