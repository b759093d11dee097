//! The sending end of a topic.

use std::marker::PhantomData;

use iceoryx2::port::LoanError;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::{Publisher as IoxPublisher, PublisherCreateError};
use iceoryx2::port::update_connections::UpdateConnections as _;
use iceoryx2::prelude::{AllocationStrategy, BackpressureStrategy, PortFactory as _, Service, ipc, local};
use iceoryx2::service::marker::CustomHeaderMarker;

use super::bell::{Ringer, ringer};
use super::world::{Topic, World, list_bytes, rings};
use super::{Bus, BusError, Kind};
use yamabico_core::message::{Message, MessageType};

/// Sends messages of type `M` on one topic. Belongs to one thread at a time.
pub struct Publisher<M: Message> {
    raw: RawPublisher,
    message: PhantomData<fn(M)>,
}

impl<M: Message> Publisher<M> {
    pub(super) fn new(raw: RawPublisher) -> Publisher<M> {
        Publisher { raw, message: PhantomData }
    }

    /// Sends a header and its items to every subscriber.
    ///
    /// # Errors
    /// [`BusError::TooLong`], or the transport failed.
    pub fn publish(&self, header: &M, items: &[M::Item]) -> Result<(), BusError> {
        self.raw.publish(bytemuck::bytes_of(header), bytemuck::cast_slice(items))
    }

    /// Sends a message whose `len` items are written by `fill` where the subscribers will read them. `fill` must write
    /// every item: what it leaves out holds what lay there before.
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

    /// See [`RawPublisher::welcome`].
    ///
    /// # Errors
    /// The transport failed.
    pub fn welcome(&self) -> Result<(), BusError> {
        self.raw.welcome()
    }
}

/// Sends messages of a type that is known as a [`MessageType`] only. Belongs to one thread at a time.
pub struct RawPublisher {
    port: AnyPublisher,
    bell: Option<Ringer>,
    message: MessageType,
    topic: String,
    most: usize,
    // Behind the port, so that the world goes last.
    _bus: Bus,
}

enum AnyPublisher {
    Local(IoxPublisher<local::Service, [u8], CustomHeaderMarker>),
    Ipc(IoxPublisher<ipc::Service, [u8], CustomHeaderMarker>),
}

#[allow(
    unsafe_code,
    reason = "the port counts references to itself only in the samples that it loans, without a lock; a \
    loan ends within the call that made it, so that whoever moves the port moves the only reference; not Sync"
)]
unsafe impl Send for RawPublisher {}

/// What one of the two services opens: the port, the longest list, and the bell.
type Opened<S, N> = (IoxPublisher<S, [u8], CustomHeaderMarker>, usize, Option<N>);

fn open<S: Service>(
    world: &World<S>,
    topic: &str,
    message: &MessageType,
) -> Result<Opened<S, Notifier<S>>, BusError> {
    let (port, most, rings) = world.with_topic(topic, message, |factory| {
        Ok((port(topic, factory)?, list_bytes(factory), rings(factory)))
    })?;
    let bell = if rings { Some(ringer(world, topic)?) } else { None };
    Ok((port, most, bell))
}

fn port<S: Service>(
    topic: &str,
    factory: &Topic<S>,
) -> Result<IoxPublisher<S, [u8], CustomHeaderMarker>, BusError> {
    let port = factory
        .publisher_builder()
        .initial_max_slice_len(list_bytes(factory).max(1))
        .allocation_strategy(AllocationStrategy::Static)
        .max_loaned_samples(1)
        .backpressure_strategy(BackpressureStrategy::DiscardData)
        .create();
    port.map_err(|e| match e {
        PublisherCreateError::ExceedsMaxSupportedPublishers => BusError::TooManyPublishers {
            topic: topic.into(),
            most: factory.static_config().max_publishers(),
        },
        e => BusError::transport("publish on", topic, e),
    })
}

impl RawPublisher {
    pub(super) fn open(bus: &Bus, topic: &str, message: &MessageType) -> Result<RawPublisher, BusError> {
        let (port, most, bell) = match &bus.0.kind {
            Kind::Local(world) => {
                let (port, most, bell) = open(world, topic, message)?;
                (AnyPublisher::Local(port), most, bell.map(|bell| Ringer::Local(Box::new(bell))))
            }
            Kind::Ipc(world) => {
                let (port, most, bell) = open(world, topic, message)?;
                (AnyPublisher::Ipc(port), most, bell.map(|bell| Ringer::Ipc(Box::new(bell))))
            }
        };
        Ok(RawPublisher { port, bell, message: *message, topic: topic.into(), most, _bus: bus.clone() })
    }

    /// The topic.
    pub fn topic(&self) -> &str {
        &self.topic
    }

    /// The longest list that the topic holds, bytes.
    pub fn most_bytes(&self) -> usize {
        self.most
    }

    /// Sends a header and its items, both as bytes, to every subscriber.
    ///
    /// # Errors
    /// [`BusError::Malformed`] where the sizes are not the type's, [`BusError::TooLong`], or the transport failed.
    pub fn publish(&self, header: &[u8], items: &[u8]) -> Result<(), BusError> {
        self.publish_in_place(header, items.len(), |bytes| bytes.copy_from_slice(items))
    }

    /// Sends a message whose `len` bytes of items are written by `fill` where the subscribers will read them. `fill` must
    /// write every byte: what it leaves out holds what lay there before.
    ///
    /// # Errors
    /// As [`RawPublisher::publish`].
    pub fn publish_in_place(
        &self,
        header: &[u8],
        len: usize,
        fill: impl FnOnce(&mut [u8]),
    ) -> Result<(), BusError> {
        self.check(header, len)?;
        match &self.port {
            AnyPublisher::Local(port) => self.send(port, header, len, fill),
            AnyPublisher::Ipc(port) => self.send(port, header, len, fill),
        }?;
        if let Some(bell) = &self.bell {
            bell.ring();
        }
        Ok(())
    }

    /// Hands the last value of a latest channel to subscribers that came since the last message. Cheap where none came: for
    /// those who publish rarely, at every turn.
    ///
    /// # Errors
    /// The transport failed.
    pub fn welcome(&self) -> Result<(), BusError> {
        match &self.port {
            AnyPublisher::Local(port) => port.update_connections(),
            AnyPublisher::Ipc(port) => port.update_connections(),
        }
        .map_err(|e| BusError::transport("publish on", &self.topic, e))
    }

    fn send<S: Service>(
        &self,
        port: &IoxPublisher<S, [u8], CustomHeaderMarker>,
        header: &[u8],
        len: usize,
        fill: impl FnOnce(&mut [u8]),
    ) -> Result<(), BusError> {
        let mut sample = port.loan_slice_uninit(len).map_err(|e| match e {
            LoanError::ExceedsMaxLoanSize => self.too_long(len),
            e => BusError::transport("publish on", &self.topic, e),
        })?;
        let user_header = std::ptr::from_mut(sample.user_header_mut()).cast::<u8>();
        #[allow(
            unsafe_code,
            reason = "the service's description gives the header this size; checked against `header`"
        )]
        unsafe {
            std::ptr::copy_nonoverlapping(header.as_ptr(), user_header, header.len());
        }
        let items = sample.payload_mut();
        if matches!(self.port, AnyPublisher::Local(_)) {
            items.fill(std::mem::MaybeUninit::new(0));
        }
        #[allow(
            unsafe_code,
            reason = "initialized bytes: of a mapped segment, zeroed by the kernel or left by an earlier message, or \
            of the local service's heap, zeroed above"
        )]
        let items = unsafe { std::slice::from_raw_parts_mut(items.as_mut_ptr().cast::<u8>(), items.len()) };
        fill(items);
        #[allow(unsafe_code, reason = "header and items are bytes, for which every value is valid")]
        let sample = unsafe { sample.assume_init() };
        sample.send().map_err(|e| BusError::transport("publish on", &self.topic, e))?;
        Ok(())
    }

    fn check(&self, header: &[u8], len: usize) -> Result<(), BusError> {
        let malformed =
            |problem| BusError::Malformed { topic: self.topic.clone(), message: self.message.name, problem };
        if header.len() != self.message.header_size {
            let (is, should) = (header.len(), self.message.header_size);
            return Err(malformed(format!("its header has {should} bytes, not {is}")));
        }
        if !len.is_multiple_of(self.message.item_size) {
            let size = self.message.item_size;
            return Err(malformed(format!("its items have {size} bytes each, so no list has {len}")));
        }
        if len > self.most { Err(self.too_long(len)) } else { Ok(()) }
    }

    fn too_long(&self, len: usize) -> BusError {
        BusError::TooLong { topic: self.topic.clone(), most: self.most, len }
    }
}
