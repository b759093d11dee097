//! The receiving end of a topic.

use std::cell::{Cell, RefCell};
use std::marker::PhantomData;

use iceoryx2::identifiers::UniquePublisherId;
use iceoryx2::port::ReceiveError;
use iceoryx2::port::subscriber::{Subscriber as IoxSubscriber, SubscriberCreateError};
use iceoryx2::prelude::{PortFactory as _, Service, ipc, local};
use iceoryx2::service::marker::CustomHeaderMarker;

use super::sample::{AnySample, Held};
use super::world::{Topic, history, max_held, ordinary_depth};
use super::{Bus, BusError, Kind, RawSample, Sample};
use yamabico_core::message::{Channel, Message, MessageType};

/// Receives messages of type `M` from one topic. Belongs to one thread at a time.
pub struct Subscriber<M: Message> {
    raw: RawSubscriber,
    message: PhantomData<fn() -> M>,
}

impl<M: Message> Subscriber<M> {
    pub(super) fn new(raw: RawSubscriber) -> Subscriber<M> {
        Subscriber { raw, message: PhantomData }
    }

    /// The oldest message that was not received yet; `None` where there is none. Never waits.
    ///
    /// # Errors
    /// See [`RawSubscriber::receive`].
    pub fn receive(&self) -> Result<Option<Sample<'_, M>>, BusError> {
        Ok(self.raw.receive()?.map(|raw| Sample { raw, message: PhantomData }))
    }

    /// The newest message that was not received yet; older ones are let go.
    ///
    /// # Errors
    /// See [`RawSubscriber::receive`].
    pub fn newest(&self) -> Result<Option<Sample<'_, M>>, BusError> {
        Ok(self.raw.newest()?.map(|raw| Sample { raw, message: PhantomData }))
    }

    /// See [`RawSubscriber::lost`].
    pub fn lost(&self) -> u64 {
        self.raw.lost()
    }

    /// See [`RawSubscriber::refused`].
    pub fn refused(&self) -> u64 {
        self.raw.refused()
    }
}

/// Receives messages of a type that is known as a [`MessageType`] only. Belongs to one thread at a time.
pub struct RawSubscriber {
    port: AnySubscriber,
    message: MessageType,
    topic: String,
    counting: Counting,
    senders: RefCell<Vec<Sender>>,
    lost: Cell<u64>,
    refused: Cell<u64>,
    // Behind the port, so that the world goes last.
    _bus: Bus,
}

/// How deep a subscriber's buffer is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Depth {
    /// One message of a latest channel, [`STREAM_DEPTH`](super::STREAM_DEPTH) of a stream.
    Ordinary,
    /// All that the topic was created for.
    Deepest,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Counting {
    /// What a newer value replaced was not lost.
    Nothing,
    /// Every gap is a loss.
    Gaps,
}

struct Sender {
    id: UniquePublisherId,
    last: u64,
}

enum AnySubscriber {
    Local(IoxSubscriber<local::Service, [u8], CustomHeaderMarker>),
    Ipc(IoxSubscriber<ipc::Service, [u8], CustomHeaderMarker>),
}

#[allow(
    unsafe_code,
    reason = "the port counts references to itself only in the samples that it hands out, without a lock; \
    they borrow from the subscriber or lie beside it in an inbox, so that whoever moves the port moves all of them; not Sync"
)]
unsafe impl Send for RawSubscriber {}

/// Senders whose sequence is remembered; beyond it the one heard longest ago is forgotten.
const MAX_SENDERS: usize = 32;

impl RawSubscriber {
    pub(super) fn open(
        bus: &Bus,
        topic: &str,
        message: &MessageType,
        depth: Depth,
    ) -> Result<RawSubscriber, BusError> {
        let port = match &bus.0.kind {
            Kind::Local(world) => world.with_topic(topic, message, |factory| {
                port(topic, message, factory, depth).map(AnySubscriber::Local)
            }),
            Kind::Ipc(world) => world.with_topic(topic, message, |factory| {
                port(topic, message, factory, depth).map(AnySubscriber::Ipc)
            }),
        }?;
        let counts = message.channel == Channel::Stream || depth == Depth::Deepest;
        Ok(RawSubscriber {
            port,
            message: *message,
            topic: topic.into(),
            counting: if counts { Counting::Gaps } else { Counting::Nothing },
            senders: RefCell::new(Vec::with_capacity(MAX_SENDERS)),
            lost: Cell::new(0),
            refused: Cell::new(0),
            _bus: bus.clone(),
        })
    }

    /// The topic.
    pub fn topic(&self) -> &str {
        &self.topic
    }

    /// What it carries.
    pub fn message(&self) -> &MessageType {
        &self.message
    }

    /// The oldest message that was not received yet; `None` where there is none. Never waits. A message whose list is not
    /// a whole number of items, or not aligned, is skipped and counted by [`RawSubscriber::refused`].
    ///
    /// # Errors
    /// [`BusError::HoldsTooMany`] while too many samples are held, or the transport failed.
    pub fn receive(&self) -> Result<Option<RawSample<'_>>, BusError> {
        Ok(self.receive_held()?.map(|held| RawSample { held, subscriber: PhantomData }))
    }

    /// The newest message that was not received yet; older ones are let go.
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

    /// Messages that this subscriber lost because it read too slowly, counted by gaps in the sequence numbers of each
    /// publisher from the first message received of it on. On a latest channel only a tap counts: for others a newer value
    /// replaces an older one by design.
    pub fn lost(&self) -> u64 {
        self.lost.get()
    }

    /// Messages that were skipped because their list was not a whole number of items, or not aligned.
    pub fn refused(&self) -> u64 {
        self.refused.get()
    }

    pub(super) fn receive_held(&self) -> Result<Option<Held>, BusError> {
        loop {
            let received = match &self.port {
                AnySubscriber::Local(port) => port.receive().map(|sample| sample.map(AnySample::Local)),
                AnySubscriber::Ipc(port) => port.receive().map(|sample| sample.map(AnySample::Ipc)),
            };
            let sample = match received {
                Ok(Some(sample)) => sample,
                Ok(None) => return Ok(None),
                Err(ReceiveError::ExceedsMaxBorrows) => {
                    let most = max_held(self.message.channel);
                    return Err(BusError::HoldsTooMany { topic: self.topic.clone(), most });
                }
                Err(e) => return Err(BusError::transport("receive from", &self.topic, e)),
            };
            let origin = match &sample {
                AnySample::Local(sample) => sample.origin(),
                AnySample::Ipc(sample) => sample.origin(),
            };
            let held = Held { sample, header_size: self.message.header_size };
            let message = held.message();
            if self.counting == Counting::Gaps {
                self.count(origin, (self.message.sequence)(message.header));
            }
            let aligned = |bytes: &[u8]| bytes.as_ptr().addr().is_multiple_of(align_of::<u64>());
            let whole = message.items.len().is_multiple_of(self.message.item_size);
            if whole && aligned(message.header) && aligned(message.items) {
                return Ok(Some(held));
            }
            self.refused.set(self.refused.get() + 1);
        }
    }

    fn count(&self, origin: UniquePublisherId, sequence: u64) {
        let mut senders = self.senders.borrow_mut();
        if let Some(sender) = senders.iter_mut().find(|sender| sender.id == origin) {
            // A sequence that does not grow started anew.
            let gap = sequence.saturating_sub(sender.last).saturating_sub(1);
            self.lost.set(self.lost.get().saturating_add(gap));
            sender.last = sequence;
            return;
        }
        if senders.len() == MAX_SENDERS {
            senders.remove(0);
        }
        senders.push(Sender { id: origin, last: sequence });
    }
}

fn port<S: Service>(
    topic: &str,
    message: &MessageType,
    factory: &Topic<S>,
    depth: Depth,
) -> Result<IoxSubscriber<S, [u8], CustomHeaderMarker>, BusError> {
    let limits = factory.static_config();
    let buffer = match depth {
        Depth::Ordinary => ordinary_depth(message.channel).min(limits.subscriber_max_buffer_size()),
        Depth::Deepest => limits.subscriber_max_buffer_size(),
    };
    let port = factory
        .subscriber_builder()
        .buffer_size(buffer)
        .history_request(history(message.channel).min(limits.history_size()))
        .create();
    port.map_err(|e| match e {
        SubscriberCreateError::ExceedsMaxSupportedSubscribers => {
            BusError::TooManySubscribers { topic: topic.into(), most: limits.max_subscribers() }
        }
        e => BusError::transport("subscribe to", topic, e),
    })
}
