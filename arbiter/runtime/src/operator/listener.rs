//! One topic of a running robot, listened to.

use std::ops::ControlFlow;
use std::time::Duration;

use serde::Serialize;
use yamabico_core::message::{Clock, MessageType};
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, BusError, RawSample, RawSubscriber, Subscriber, Waiter};
use yamabico_parameters::instead;

use super::lookout::LookError;
use crate::execution::{Roster, topics};

/// Why a topic cannot be listened to.
#[derive(Debug, thiserror::Error)]
pub enum ListenError {
    /// The robot does not say what there is.
    #[error(transparent)]
    Look(#[from] LookError),
    /// The bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// It has no such topic.
    #[error("the robot has no topic `{topic}`: {instead}")]
    NoSuchTopic {
        /// What was asked for.
        topic: String,
        /// What it has.
        instead: String,
    },
    /// This program does not know what it carries.
    #[error("`{topic}` cannot be read: {problem}")]
    UnknownMessage {
        /// The topic.
        topic: String,
        /// Why.
        problem: String,
    },
}

/// From one look to the next at a topic that does not ring.
const PAUSE: Duration = Duration::from_millis(2);

/// Hears every message on one topic.
pub struct Listener {
    /// None where the topic does not ring.
    waiter: Option<Waiter>,
    subscriber: RawSubscriber,
    message: MessageType,
    /// The instants of a robot whose clock is a driver's, and the newest of them.
    clock: Option<(Subscriber<Clock>, Time)>,
}

/// A message that was received.
pub struct Heard<'a> {
    /// When, by the clock of the machine.
    pub at: Time,
    /// When, by the clock of the robot: what stamps are held against.
    pub now: Time,
    /// The message.
    pub sample: RawSample<'a>,
}

impl Listener {
    /// Listens to `topic` of the running robot of this name, with the deepest buffer that it has.
    ///
    /// # Errors
    /// No such robot or topic, or a message of another version.
    pub fn join(robot: &str, topic: &str) -> Result<Listener, ListenError> {
        let bus = Bus::join(robot).map_err(LookError::from)?;
        let roster = Roster::of_robot(&bus)?;
        let Some(posted) = roster.topics.iter().find(|posted| posted.name == topic) else {
            let names = roster.topics.iter().map(|posted| posted.name.as_str());
            return Err(ListenError::NoSuchTopic {
                topic: topic.into(),
                instead: instead(topic, names, "topic"),
            });
        };
        let message = MessageType::find(&posted.message).copied();
        let message = message.ok_or_else(|| ListenError::UnknownMessage {
            topic: topic.into(),
            problem: MessageType::unknown(&posted.message),
        })?;
        let waiter = match bus.waiter(&[topic]) {
            Err(BusError::Silent { .. }) => None,
            waiter => Some(waiter?),
        };
        let subscriber = bus.tap(topic, &message)?;
        let has_clock = roster.topics.iter().any(|posted| posted.name == topics::CLOCK);
        let clock = has_clock.then(|| bus.subscriber(topics::CLOCK)).transpose()?;
        Ok(Listener { waiter, subscriber, message, clock: clock.map(|clock| (clock, Time::ZERO)) })
    }

    /// What the topic carries.
    pub fn message(&self) -> &MessageType {
        &self.message
    }

    /// Waits until something arrives, or for so long, and hands everything that has arrived to `each`, the oldest first, until
    /// `each` has had enough. Whether it has.
    ///
    /// # Errors
    /// The transport failed.
    pub fn hear(
        &mut self,
        longest: Duration,
        each: &mut dyn FnMut(Heard<'_>) -> ControlFlow<()>,
    ) -> Result<ControlFlow<()>, BusError> {
        match &mut self.waiter {
            Some(waiter) => drop(waiter.wait(longest)?),
            None => std::thread::sleep(longest.min(PAUSE)),
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
            if each(Heard { at, now, sample }).is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// Messages that came too fast.
    pub fn lost(&self) -> u64 {
        self.subscriber.lost()
    }
}

/// What somebody measures on a topic: so many numbers, of which the oldest give way.
#[derive(Clone, Debug)]
pub struct Window {
    numbers: Vec<f64>,
    next: usize,
    most: usize,
}

/// What a window says.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// Numbers in it.
    pub count: usize,
    /// Their mean.
    pub mean: f64,
    /// How far they lie from it: the standard deviation.
    pub std_dev: f64,
    /// The least.
    pub min: f64,
    /// Half of them are smaller.
    pub p50: f64,
    /// Ninety-nine of a hundred are smaller.
    pub p99: f64,
    /// The largest.
    pub max: f64,
}

impl Window {
    /// One of `most` numbers, at least one.
    pub fn new(most: usize) -> Window {
        Window { numbers: Vec::new(), next: 0, most: most.max(1) }
    }

    /// Takes one in.
    pub fn add(&mut self, number: f64) {
        if self.numbers.len() < self.most {
            self.numbers.push(number);
        } else {
            self.numbers[self.next] = number;
            self.next = (self.next + 1) % self.most;
        }
    }

    /// What it says; `None` while it is empty.
    pub fn figures(&self) -> Option<Figures> {
        let mut sorted = self.numbers.clone();
        sorted.sort_by(f64::total_cmp);
        let count = sorted.len();
        let mean = sorted.iter().sum::<f64>() / count as f64;
        let variance = sorted.iter().map(|number| (number - mean).powi(2)).sum::<f64>() / count as f64;
        let quantile = |q: f64| {
            let rank = (q * count as f64).ceil().max(1.0) as usize;
            sorted.get(rank - 1).copied()
        };
        Some(Figures {
            count,
            mean,
            std_dev: variance.sqrt(),
            min: *sorted.first()?,
            p50: quantile(0.5)?,
            p99: quantile(0.99)?,
            max: *sorted.last()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_tells_of_its_newest_numbers() {
        let mut window = Window::new(100);
        assert_eq!(window.figures(), None);
        (0..300).for_each(|number| window.add(f64::from(number)));
        let figures = window.figures().unwrap();
        assert_eq!((figures.count, figures.min, figures.max), (100, 200.0, 299.0));
        assert_eq!((figures.p50, figures.p99, figures.mean), (249.0, 298.0, 249.5));
        assert!((figures.std_dev - 28.866).abs() < 1e-3, "{}", figures.std_dev);
    }
}
