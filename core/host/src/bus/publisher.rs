//! Publishers of a topic.

use std::marker::PhantomData;
use std::ops::ControlFlow;

use iceoryx2::port::LoanError;
use iceoryx2::port::publisher::{Publisher as IoxPublisher, PublisherCreateError};
use iceoryx2::port::update_connections::UpdateConnections as _;
use iceoryx2::prelude::{AllocationStrategy, BackpressureStrategy, PortFactory as _, Service};
use iceoryx2::service::marker::CustomHeaderMarker;

use super::node::{Node, Topic, has_notification, max_list_bytes};
use super::notification::Notifier;
use super::service::{Either, IpcService, LocalService, either};
use super::{Bus, BusError};
use yamabico_core::message::{Message, MessageType};

/// Publishes messages of type `M` on one topic. May move to another thread, but is used by one at a time.
pub struct Publisher<M: Message> {
    raw: RawPublisher,
    message: PhantomData<fn(M)>,
}

impl<M: Message> Publisher<M> {
    pub(super) fn new(raw: RawPublisher) -> Publisher<M> {
        Publisher { raw, message: PhantomData }
    }

    /// Publishes a message.
    ///
    /// # Errors
    /// [`BusError::TooLong`], or the transport failed.
    pub fn publish(&self, header: &M, items: &[M::Item]) -> Result<(), BusError> {
        self.raw.publish(bytemuck::bytes_of(header), bytemuck::cast_slice(items))
    }

    /// Publishes a message with `len` items that `fill` writes straight into shared memory. `fill` must write every
    /// item: one that it leaves out holds data of an earlier message.
    ///
    /// # Errors
    /// [`BusError::TooLong`], or the transport failed.
    pub fn publish_in_place(
        &self,
        header: &M,
        len: usize,
        fill: impl FnOnce(&mut [M::Item]),
    ) -> Result<(), BusError> {
        let bytes = len.saturating_mul(size_of::<M::Item>());
        self.raw.publish_in_place(bytemuck::bytes_of(header), bytes, |bytes| {
            fill(bytemuck::cast_slice_mut(bytes));
        })
    }

    /// Sends the last value of a latest channel to new subscribers; see [`RawPublisher::resend_to_new_subscribers`].
    ///
    /// # Errors
    /// The transport failed.
    pub fn resend_to_new_subscribers(&self) -> Result<(), BusError> {
        self.raw.resend_to_new_subscribers()
    }
}

/// Publishes messages of a type that is known only as a [`MessageType`]. May move to another thread, but is used by
/// one at a time.
pub struct RawPublisher {
    port: AnyPublisher,
    notifier: Option<Notifier>,
    message: MessageType,
    topic: String,
    max_bytes: usize,
    // Dropped after the port, so that the node goes last.
    _bus: Bus,
}

type Port<S> = IoxPublisher<S, [u8], CustomHeaderMarker>;
type AnyPublisher = Either<Port<LocalService>, Port<IpcService>>;

#[allow(
    unsafe_code,
    reason = "the port counts references to itself only in the samples that it loans, without a lock; a \
    loan ends within the call that made it, so that the only reference moves with the port; not Sync"
)]
unsafe impl Send for RawPublisher {}

/// A port with what its topic's creator fixed: the longest list in bytes, and notification.
struct Opened<P> {
    port: P,
    max_bytes: usize,
    notifies: bool,
}

fn open<S: Service>(node: &Node<S>, topic: &str, message: &MessageType) -> Result<Opened<Port<S>>, BusError> {
    node.with_topic(topic, message, |factory| {
        Ok(Opened {
            port: port(topic, factory)?,
            max_bytes: max_list_bytes(factory),
            notifies: has_notification(factory),
        })
    })
}

fn port<S: Service>(topic: &str, factory: &Topic<S>) -> Result<Port<S>, BusError> {
    let port = factory
        .publisher_builder()
        .initial_max_slice_len(max_list_bytes(factory).max(1))
        .allocation_strategy(AllocationStrategy::Static)
        .max_loaned_samples(1)
        .backpressure_strategy(BackpressureStrategy::DiscardData)
        .create();
    port.map_err(|e| match e {
        PublisherCreateError::ExceedsMaxSupportedPublishers => {
            BusError::TooManyPublishers { topic: topic.into(), max: factory.static_config().max_publishers() }
        }
        e => BusError::transport("publish on", topic, e),
    })
}

impl<P> Opened<P> {
    fn wrap<Q>(self, wrap: impl FnOnce(P) -> Q) -> Opened<Q> {
        Opened { port: wrap(self.port), max_bytes: self.max_bytes, notifies: self.notifies }
    }
}

impl RawPublisher {
    pub(super) fn open(bus: &Bus, topic: &str, message: &MessageType) -> Result<RawPublisher, BusError> {
        let opened: Opened<AnyPublisher> = match &bus.0.node {
            Either::Local(node) => open(node, topic, message)?.wrap(Either::Local),
            Either::Ipc(node) => open(node, topic, message)?.wrap(Either::Ipc),
        };
        Ok(RawPublisher {
            port: opened.port,
            notifier: opened.notifies.then(|| Notifier::open(bus, topic)).transpose()?,
            message: *message,
            topic: topic.into(),
            max_bytes: opened.max_bytes,
            _bus: bus.clone(),
        })
    }

    /// Publishes a message given as bytes.
    ///
    /// # Errors
    /// [`BusError::Malformed`] if the sizes are not those of the message type; [`BusError::TooLong`]; the transport
    /// failed.
    pub fn publish(&self, header: &[u8], items: &[u8]) -> Result<(), BusError> {
        self.publish_in_place(header, items.len(), |bytes| bytes.copy_from_slice(items))
    }

    /// Publishes a message with `len` bytes of items that `fill` writes straight into shared memory. `fill` must write
    /// every byte: one that it leaves out holds data of an earlier message.
    ///
    /// # Errors
    /// Like [`RawPublisher::publish`].
    pub fn publish_in_place(
        &self,
        header: &[u8],
        len: usize,
        fill: impl FnOnce(&mut [u8]),
    ) -> Result<(), BusError> {
        self.try_publish_in_place(header, len, |bytes| {
            fill(bytes);
            ControlFlow::Continue(())
        })
    }

    /// Like [`RawPublisher::publish_in_place`], but publishes nothing if `fill` breaks.
    ///
    /// # Errors
    /// Like [`RawPublisher::publish`].
    pub fn try_publish_in_place(
        &self,
        header: &[u8],
        len: usize,
        fill: impl FnOnce(&mut [u8]) -> ControlFlow<()>,
    ) -> Result<(), BusError> {
        self.check(header, len)?;
        let sent = either!(&self.port, port => self.send(port, header, len, fill))?;
        if let (ControlFlow::Continue(()), Some(notifier)) = (sent, &self.notifier) {
            notifier.notify();
        }
        Ok(())
    }

    /// Sends the last value of a latest channel to the subscribers that were opened since the last message. Cheap if
    /// there are none; a node that publishes rarely calls it in every cycle.
    ///
    /// # Errors
    /// The transport failed.
    pub fn resend_to_new_subscribers(&self) -> Result<(), BusError> {
        let updated = either!(&self.port, port => port.update_connections());
        updated.map_err(|e| BusError::transport("publish on", &self.topic, e))
    }

    fn send<S: Service>(
        &self,
        port: &Port<S>,
        header: &[u8],
        len: usize,
        fill: impl FnOnce(&mut [u8]) -> ControlFlow<()>,
    ) -> Result<ControlFlow<()>, BusError> {
        let mut sample = port.loan_slice_uninit(len).map_err(|e| match e {
            LoanError::ExceedsMaxLoanSize => self.too_long(len),
            e => BusError::transport("publish on", &self.topic, e),
        })?;
        let user_header = std::ptr::from_mut(sample.user_header_mut()).cast::<u8>();
        #[allow(
            unsafe_code,
            reason = "the service's static configuration gives the header this size; checked against `header`"
        )]
        unsafe {
            std::ptr::copy_nonoverlapping(header.as_ptr(), user_header, header.len());
        }
        let items = sample.payload_mut();
        if matches!(self.port, Either::Local(_)) {
            items.fill(std::mem::MaybeUninit::new(0));
        }
        #[allow(
            unsafe_code,
            reason = "initialized bytes: of a mapped segment, zeroed by the kernel or left by an earlier message, or \
            of the local service's heap, zeroed above"
        )]
        let items = unsafe { std::slice::from_raw_parts_mut(items.as_mut_ptr().cast::<u8>(), items.len()) };
        if fill(items).is_break() {
            return Ok(ControlFlow::Break(()));
        }
        #[allow(unsafe_code, reason = "header and items are bytes, for which every value is valid")]
        let sample = unsafe { sample.assume_init() };
        sample.send().map_err(|e| BusError::transport("publish on", &self.topic, e))?;
        Ok(ControlFlow::Continue(()))
    }

    fn check(&self, header: &[u8], len: usize) -> Result<(), BusError> {
        let malformed =
            |problem| BusError::Malformed { topic: self.topic.clone(), message: self.message.name, problem };
        if header.len() != self.message.header_size {
            let (actual, expected) = (header.len(), self.message.header_size);
            return Err(malformed(format!("the header must have {expected} bytes, but has {actual}")));
        }
        if !len.is_multiple_of(self.message.item_size) {
            let size = self.message.item_size;
            return Err(malformed(format!("{len} bytes are not a whole number of items of {size} bytes")));
        }
        if len > self.max_bytes { Err(self.too_long(len)) } else { Ok(()) }
    }

    fn too_long(&self, len: usize) -> BusError {
        BusError::TooLong { topic: self.topic.clone(), max: self.max_bytes, len }
    }
}
