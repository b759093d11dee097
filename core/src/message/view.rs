//! Zero-copy views of received messages.

use super::Message;

/// The bytes of a received message.
#[derive(Clone, Copy, Debug)]
pub struct RawMessage<'a> {
    /// Bytes of the header, aligned for its type.
    pub header: &'a [u8],
    /// Bytes of the items, aligned to 8 bytes.
    pub items: &'a [u8],
}

/// Typed view of a received message, without a copy.
#[derive(Debug)]
pub struct View<'a, M: Message> {
    /// Header.
    pub header: &'a M,
    /// Items of the list; the pixels of a frame.
    pub items: &'a [M::Item],
}

impl<M: Message> Clone for View<'_, M> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<M: Message> Copy for View<'_, M> {}

impl<'a, M: Message> View<'a, M> {
    /// Views raw bytes as a message of type `M`. Returns `None` if their size or alignment is wrong.
    pub fn of(raw: RawMessage<'a>) -> Option<View<'a, M>> {
        let header = bytemuck::try_from_bytes(raw.header).ok()?;
        let items = bytemuck::try_cast_slice(raw.items).ok()?;
        Some(View { header, items })
    }
}
