//! Reception of everything that a running robot publishes.

use yamabico_core::message::{Clock, MessageType};
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, BusError, RawSubscriber, Subscriber};

use super::{ClientError, RobotClient};
use crate::execution::topics;
use crate::record::Tap;

/// Receives the messages of every topic of a running robot whose type this program knows.
///
/// It polls: a publisher wakes nothing for it, so that the robot does the same work with and without it.
pub struct RobotFeed {
    bus: Bus,
    topics: Vec<(String, MessageType, Option<RawSubscriber>)>,
    clock: Option<(Subscriber<Clock>, Time)>,
    unknown: Vec<String>,
}

impl RobotClient {
    /// Subscribes to every topic whose type `is_wanted`, with the deepest buffers that they have.
    ///
    /// # Errors
    /// The robot publishes no manifest, or the bus fails.
    pub fn feed(&mut self, is_wanted: &dyn Fn(&MessageType) -> bool) -> Result<RobotFeed, ClientError> {
        let manifest = self.manifest()?;
        let (mut known, mut unknown) = (Vec::new(), Vec::new());
        for entry in &manifest.topics {
            match MessageType::find(&entry.message) {
                Some(message) => known.push((entry.name.clone(), *message, None)),
                None => unknown.push(format!("{}: {}", entry.name, MessageType::unknown(&entry.message))),
            }
        }
        let has_clock = manifest.topics.iter().any(|entry| entry.name == topics::CLOCK);
        let clock = has_clock.then(|| self.bus.subscriber(topics::CLOCK)).transpose()?;
        let clock = clock.map(|clock| (clock, Time::ZERO));
        let mut feed = RobotFeed { bus: self.bus.clone(), topics: known, clock, unknown };
        feed.subscribe_to(is_wanted, true)?;
        Ok(feed)
    }
}

impl RobotFeed {
    /// Begins or ends the subscriptions to all topics of the message types that `is_meant`.
    ///
    /// # Errors
    /// The bus fails.
    pub fn subscribe_to(
        &mut self,
        is_meant: &dyn Fn(&MessageType) -> bool,
        is_wanted: bool,
    ) -> Result<(), BusError> {
        for (topic, message, subscriber) in self.topics.iter_mut().filter(|(_, message, _)| is_meant(message))
        {
            match (is_wanted, &subscriber) {
                (true, None) => *subscriber = Some(self.bus.tap(topic, message)?),
                (false, Some(_)) => *subscriber = None,
                _ => {}
            }
        }
        Ok(())
    }

    /// Time on the robot's clock.
    ///
    /// # Errors
    /// The bus fails.
    pub fn now(&mut self) -> Result<Time, BusError> {
        let Some((clock, now)) = &mut self.clock else { return Ok(Time::monotonic_now()) };
        while let Some(instant) = clock.receive()? {
            *now = Time(instant.header().stamp_ns);
        }
        Ok(*now)
    }

    /// Passes `tap` every message received since the last call, sorted by topic; returns the time on the robot's clock.
    ///
    /// # Errors
    /// The bus fails.
    pub fn receive(&mut self, tap: &mut dyn Tap) -> Result<Time, BusError> {
        let now = self.now()?;
        for (topic, message, subscriber) in &self.topics {
            let Some(subscriber) = subscriber else { continue };
            while let Some(sample) = subscriber.receive()? {
                let time = (message.stamps)(sample.header()).0.min(now);
                tap.message(topic, message, time, sample.header(), sample.items());
            }
        }
        Ok(now)
    }

    /// Topics that are left out, each with its cause.
    pub fn unknown(&self) -> &[String] {
        &self.unknown
    }

    /// Number of messages lost to buffer overflow.
    pub fn lost(&self) -> u64 {
        self.topics.iter().filter_map(|(.., subscriber)| subscriber.as_ref()).map(RawSubscriber::lost).sum()
    }
}
