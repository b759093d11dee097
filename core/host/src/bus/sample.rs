//! A received message, read where it lies.

use std::marker::PhantomData;

use iceoryx2::prelude::{ipc, local};
use iceoryx2::sample::Sample as IoxSample;
use iceoryx2::service::marker::CustomHeaderMarker;

use yamabico_core::message::{Message, RawMessage};

/// A received message of which only the [`MessageType`](yamabico_core::message::MessageType) is known; given back when dropped.
pub struct RawSample<'a> {
    pub(super) held: Held,
    pub(super) subscriber: PhantomData<&'a ()>,
}

impl RawSample<'_> {
    /// The header's bytes, as many as the type's header has and aligned for it.
    pub fn header(&self) -> &[u8] {
        self.held.message().header
    }

    /// The items' bytes, aligned for eight-byte numbers, a whole number of items.
    pub fn items(&self) -> &[u8] {
        self.held.message().items
    }

    /// Both.
    pub fn message(&self) -> RawMessage<'_> {
        self.held.message()
    }
}

/// A received message; given back when dropped.
pub struct Sample<'a, M: Message> {
    pub(super) raw: RawSample<'a>,
    pub(super) message: PhantomData<M>,
}

impl<M: Message> Sample<'_, M> {
    /// The header.
    pub fn header(&self) -> &M {
        bytemuck::from_bytes(self.raw.header())
    }

    /// The items; empty for a message without a list.
    pub fn items(&self) -> &[M::Item] {
        bytemuck::cast_slice(self.raw.items())
    }
}

impl<M: Message> std::fmt::Debug for Sample<'_, M> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Sample").field("header", self.header()).field("items", &self.items().len()).finish()
    }
}

/// The transport's sample with the size of its header; must not outlive the port that it came from, nor leave its thread
/// without it.
pub(super) struct Held {
    pub(super) sample: AnySample,
    pub(super) header_size: usize,
}

pub(super) enum AnySample {
    Local(IoxSample<local::Service, [u8], CustomHeaderMarker>),
    Ipc(IoxSample<ipc::Service, [u8], CustomHeaderMarker>),
}

impl Held {
    pub(super) fn message(&self) -> RawMessage<'_> {
        let (header, items) = match &self.sample {
            AnySample::Local(sample) => (sample.user_header(), sample.payload()),
            AnySample::Ipc(sample) => (sample.user_header(), sample.payload()),
        };
        let header = std::ptr::from_ref(header).cast::<u8>();
        #[allow(
            unsafe_code,
            reason = "the service's description gives the header this size, and the sample keeps it"
        )]
        let header = unsafe { std::slice::from_raw_parts(header, self.header_size) };
        RawMessage { header, items }
    }
}
