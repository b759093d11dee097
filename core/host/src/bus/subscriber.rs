//! Subscribers of a topic.

use std::cell::{Cell, RefCell};
use std::marker::PhantomData;

use iceoryx2::identifiers::UniquePublisherId;
use iceoryx2::port::ReceiveError;
use iceoryx2::port::subscriber::{Subscriber as IoxSubscriber, SubscriberCreateError};
use iceoryx2::prelude::{PortFactory as _, Service};
use iceoryx2::service::marker::CustomHeaderMarker;

use super::node::{Topic, default_depth, history, max_held};
use super::sample::{AnySample, Held};
use super::service::{Either, IpcService, LocalService, either, map_either};
use super::{Bus, BusError, RawSample, Sample};
use yamabico_core::message::{Channel, Message, MessageType};

/// Receives messages of type `M` from one topic. May move to another thread, but is used by one at a time.
pub struct Subscriber<M: Message> {
    raw: RawSubscriber,
    message: PhantomData<fn() -> M>,
}

impl<M: Message> Subscriber<M> {
    pub(super) fn new(raw: RawSubscriber) -> Subscriber<M> {
        Subscriber { raw, message: PhantomData }
    }

    /// Receives the oldest waiting message; none if the buffer is empty. Never blocks.
    ///
    /// # Errors
    /// See [`RawSubscriber::receive`].
    pub fn receive(&self) -> Result<Option<Sample<'_, M>>, BusError> {
        Ok(self.raw.receive()?.map(|raw| Sample { raw, message: PhantomData }))
    }

    /// Receives the newest waiting message and drops older ones.
    ///
    /// # Errors
    /// See [`RawSubscriber::receive`].
    pub fn newest(&self) -> Result<Option<Sample<'_, M>>, BusError> {
        Ok(self.raw.newest()?.map(|raw| Sample { raw, message: PhantomData }))
    }

    /// Number of lost messages; see [`RawSubscriber::lost`].
    pub fn lost(&self) -> u64 {
        self.raw.lost()
    }
}

/// Receives messages of a type that is known only as a [`MessageType`]. May move to another thread, but is used by one
/// at a time.
pub struct RawSubscriber {
    port: AnySubscriber,
    message: MessageType,
    topic: String,
    counts_gaps: bool,
    publishers: RefCell<Vec<LastSequence>>,
    lost: Cell<u64>,
    // Dropped after the port, so that the node goes last.
    _bus: Bus,
}

/// Depth of a subscriber's buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Depth {
    /// One message of a latest channel, [`STREAM_DEPTH`](super::STREAM_DEPTH) messages of a stream.
    Default,
    /// The maximum that the topic was created for.
    Maximum,
}

/// Sequence number of the last message received from one publisher.
struct LastSequence {
    publisher: UniquePublisherId,
    sequence: u64,
}

type Port<S> = IoxSubscriber<S, [u8], CustomHeaderMarker>;
type AnySubscriber = Either<Port<LocalService>, Port<IpcService>>;

#[allow(
    unsafe_code,
    reason = "the port counts references to itself only in the samples that it hands out, without a lock; \
    they borrow from the subscriber or lie beside it in an inbox, so that all of them move together; not Sync"
)]
unsafe impl Send for RawSubscriber {}

/// Publishers whose sequence numbers are tracked; the one that was added first makes room for a new one.
const MAX_TRACKED_PUBLISHERS: usize = 32;

impl RawSubscriber {
    pub(super) fn open(
        bus: &Bus,
        topic: &str,
        message: &MessageType,
        depth: Depth,
    ) -> Result<RawSubscriber, BusError> {
        let port: AnySubscriber = map_either!(&bus.0.node, node => {
            node.with_topic(topic, message, |factory| port(topic, message, factory, depth))?
        });
        Ok(RawSubscriber {
            port,
            message: *message,
            topic: topic.into(),
            counts_gaps: message.channel == Channel::Stream || depth == Depth::Maximum,
            publishers: RefCell::new(Vec::with_capacity(MAX_TRACKED_PUBLISHERS)),
            lost: Cell::new(0),
            _bus: bus.clone(),
        })
    }

    /// Type of the topic's messages.
    pub fn message(&self) -> &MessageType {
        &self.message
    }

    /// Receives the oldest waiting message; none if the buffer is empty. Never blocks. Skips a message whose list is
    /// misaligned or not a whole number of items.
    ///
    /// # Errors
    /// [`BusError::TooManySamples`] while the maximum number of samples is held; the transport failed.
    pub fn receive(&self) -> Result<Option<RawSample<'_>>, BusError> {
        Ok(self.receive_held()?.map(|held| RawSample { held, subscriber: PhantomData }))
    }

    /// Receives the newest waiting message and drops older ones.
    ///
    /// # Errors
    /// See [`RawSubscriber::receive`].
    pub fn newest(&self) -> Result<Option<RawSample<'_>>, BusError> {
        let mut newest = self.receive()?;
        while newest.is_some() {
            match self.receive()? {
                None => break,
                newer => newest = newer,
            }
        }
        Ok(newest)
    }

    /// Number of messages lost to a buffer overflow, from the gaps in each publisher's sequence numbers since its first
    /// received message. On a latest channel only a tap counts them: elsewhere a newer value replaces an older one by
    /// design.
    pub fn lost(&self) -> u64 {
        self.lost.get()
    }

    pub(super) fn receive_held(&self) -> Result<Option<Held>, BusError> {
        loop {
            let received: Option<AnySample> = match &self.port {
                Either::Local(port) => self.checked(port.receive())?.map(Either::Local),
                Either::Ipc(port) => self.checked(port.receive())?.map(Either::Ipc),
            };
            let Some(sample) = received else { return Ok(None) };
            let publisher = either!(&sample, sample => sample.origin());
            let held = Held { sample, header_size: self.message.header_size };
            let message = held.message();
            if self.counts_gaps {
                self.count_gap(publisher, (self.message.sequence)(message.header));
            }
            let aligned = |bytes: &[u8]| bytes.as_ptr().addr().is_multiple_of(align_of::<u64>());
            let whole = message.items.len().is_multiple_of(self.message.item_size);
            if whole && aligned(message.header) && aligned(message.items) {
                return Ok(Some(held));
            }
        }
    }

    fn checked<T>(&self, received: Result<T, ReceiveError>) -> Result<T, BusError> {
        received.map_err(|e| match e {
            ReceiveError::ExceedsMaxBorrows => {
                let max = max_held(self.message.channel);
                BusError::TooManySamples { topic: self.topic.clone(), max }
            }
            e => BusError::transport("receive from", &self.topic, e),
        })
    }

    fn count_gap(&self, publisher: UniquePublisherId, sequence: u64) {
        let mut publishers = self.publishers.borrow_mut();
        if let Some(last) = publishers.iter_mut().find(|last| last.publisher == publisher) {
            // A sequence number that does not grow belongs to a publisher that started over.
            let gap = sequence.saturating_sub(last.sequence).saturating_sub(1);
            self.lost.set(self.lost.get().saturating_add(gap));
            last.sequence = sequence;
            return;
        }
        if publishers.len() == MAX_TRACKED_PUBLISHERS {
            publishers.remove(0);
        }
        publishers.push(LastSequence { publisher, sequence });
    }
}

fn port<S: Service>(
    topic: &str,
    message: &MessageType,
    factory: &Topic<S>,
    depth: Depth,
) -> Result<Port<S>, BusError> {
    let limits = factory.static_config();
    let buffer = match depth {
        Depth::Default => default_depth(message.channel).min(limits.subscriber_max_buffer_size()),
        Depth::Maximum => limits.subscriber_max_buffer_size(),
    };
    let port = factory
        .subscriber_builder()
        .buffer_size(buffer)
        .history_request(history(message.channel).min(limits.history_size()))
        .create();
    port.map_err(|e| match e {
        SubscriberCreateError::ExceedsMaxSupportedSubscribers => {
            BusError::TooManySubscribers { topic: topic.into(), max: limits.max_subscribers() }
        }
        e => BusError::transport("subscribe to", topic, e),
    })
}
