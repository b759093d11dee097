//! Received messages, read in place.

use std::marker::PhantomData;

use iceoryx2::sample::Sample as IoxSample;
use iceoryx2::service::marker::CustomHeaderMarker;

use super::service::{Either, IpcService, LocalService, either};
use yamabico_core::message::{Message, RawMessage};

/// Received message whose type is known only as a [`MessageType`](yamabico_core::message::MessageType). Dropping it
/// frees its slot in the subscriber.
pub struct RawSample<'a> {
    pub(super) held: Held,
    pub(super) subscriber: PhantomData<&'a ()>,
}

impl RawSample<'_> {
    /// Bytes of the header, with the size and alignment of the message type.
    pub fn header(&self) -> &[u8] {
        self.held.message().header
    }

    /// Bytes of the items: a whole number of items, aligned to eight bytes.
    pub fn items(&self) -> &[u8] {
        self.held.message().items
    }

    /// Header and items.
    pub fn message(&self) -> RawMessage<'_> {
        self.held.message()
    }
}

/// Received message of type `M`. Dropping it frees its slot in the subscriber.
pub struct Sample<'a, M: Message> {
    pub(super) raw: RawSample<'a>,
    pub(super) message: PhantomData<M>,
}

impl<M: Message> Sample<'_, M> {
    /// The message's header.
    pub fn header(&self) -> &M {
        bytemuck::from_bytes(self.raw.header())
    }

    /// The message's items; empty for a message type without a list.
    pub fn items(&self) -> &[M::Item] {
        bytemuck::cast_slice(self.raw.items())
    }
}

impl<M: Message> std::fmt::Debug for Sample<'_, M> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Sample").field("header", self.header()).field("items", &self.items().len()).finish()
    }
}

/// Sample of the transport with the size of its header. Must not outlive its port, nor move to another thread without
/// it.
pub(super) struct Held {
    pub(super) sample: AnySample,
    pub(super) header_size: usize,
}

pub(super) type AnySample = Either<
    IoxSample<LocalService, [u8], CustomHeaderMarker>,
    IoxSample<IpcService, [u8], CustomHeaderMarker>,
>;

impl Held {
    pub(super) fn message(&self) -> RawMessage<'_> {
        let (header, items) = either!(&self.sample, sample => (sample.user_header(), sample.payload()));
        let header = std::ptr::from_ref(header).cast::<u8>();
        #[allow(
            unsafe_code,
            reason = "the service's static configuration gives the header this size, and the sample keeps it alive"
        )]
        let header = unsafe { std::slice::from_raw_parts(header, self.header_size) };
        RawMessage { header, items }
    }
}
