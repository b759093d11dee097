//! Subscription to any topic of a running robot.

use std::ops::ControlFlow;
use std::time::Duration;

use yamabico_core::message::{Clock, MessageType};
use yamabico_core::time::Time;
use yamabico_host::bus::{BusError, RawSample, RawSubscriber, Subscriber, WaitSet};
use yamabico_parameters::instead;

use super::{ClientError, RobotClient};
use crate::execution::topics;

/// Pause between two attempts to receive on a topic without notifications.
const PAUSE: Duration = Duration::from_millis(2);

/// Receives every message on one topic.
pub struct TopicSubscriber {
    /// `None` if the topic has no notifications.
    wait_set: Option<WaitSet>,
    subscriber: RawSubscriber,
    message: MessageType,
    /// Clock of a robot whose driver owns the clock, and its newest instant.
    clock: Option<(Subscriber<Clock>, Time)>,
}

/// A message as received.
pub struct ReceivedMessage<'a> {
    /// Time of arrival on the clock of the machine.
    pub at: Time,
    /// Time of arrival on the clock of the robot, which stamps refer to.
    pub now: Time,
    /// Header and items.
    pub sample: RawSample<'a>,
}

impl RobotClient {
    /// Subscribes to `topic` with the deepest buffer that it has.
    ///
    /// # Errors
    /// The robot has no such topic, or its message type is unknown.
    pub fn subscribe(&mut self, topic: &str) -> Result<TopicSubscriber, ClientError> {
        let manifest = self.manifest()?;
        let Some(entry) = manifest.topics.iter().find(|entry| entry.name == topic) else {
            let names = manifest.topics.iter().map(|entry| entry.name.as_str());
            let instead = instead(topic, names, "topic");
            return Err(ClientError::NoSuchTopic { topic: topic.into(), instead });
        };
        let message = MessageType::find(&entry.message).copied().ok_or_else(|| {
            let problem = MessageType::unknown(&entry.message);
            ClientError::UnknownMessage { topic: topic.into(), problem }
        })?;
        let has_clock = manifest.topics.iter().any(|entry| entry.name == topics::CLOCK);
        let wait_set = match self.bus.wait_set(&[topic]) {
            Err(BusError::NoNotification { .. }) => None,
            wait_set => Some(wait_set?),
        };
        let subscriber = self.bus.tap(topic, &message)?;
        let clock = has_clock.then(|| self.bus.subscriber(topics::CLOCK)).transpose()?;
        let clock = clock.map(|clock| (clock, Time::ZERO));
        Ok(TopicSubscriber { wait_set, subscriber, message, clock })
    }
}

impl TopicSubscriber {
    /// Message type of the topic.
    pub fn message(&self) -> &MessageType {
        &self.message
    }

    /// Waits up to `timeout` for messages and hands all of them to `each`, the oldest first, until `each` breaks.
    ///
    /// # Errors
    /// The bus fails.
    pub fn receive(
        &mut self,
        timeout: Duration,
        each: &mut dyn FnMut(ReceivedMessage<'_>) -> ControlFlow<()>,
    ) -> Result<ControlFlow<()>, ClientError> {
        match &mut self.wait_set {
            Some(wait_set) => drop(wait_set.wait(timeout)?),
            None => std::thread::sleep(timeout.min(PAUSE)),
        }
        while let Some(sample) = self.subscriber.receive()? {
            let at = Time::monotonic_now();
            let now = match &mut self.clock {
                None => at,
                Some((clock, now)) => {
                    while let Some(instant) = clock.receive()? {
                        *now = Time(instant.header().stamp_ns);
                    }
                    *now
                }
            };
            if each(ReceivedMessage { at, now, sample }).is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// Number of messages lost to buffer overflow.
    pub fn lost(&self) -> u64 {
        self.subscriber.lost()
    }
}
