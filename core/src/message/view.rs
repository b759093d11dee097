//! A message read where it lies.

use super::Message;

/// A message lent by whoever holds it.
#[derive(Clone, Copy, Debug)]
pub struct RawMessage<'a> {
    /// The header's bytes, aligned for it.
    pub header: &'a [u8],
    /// The items' bytes, aligned for eight-byte numbers.
    pub items: &'a [u8],
}

/// A message read in place.
#[derive(Debug)]
pub struct View<'a, M: Message> {
    /// The fixed part.
    pub header: &'a M,
    /// The list behind it.
    pub items: &'a [M::Item],
}

impl<M: Message> Clone for View<'_, M> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<M: Message> Copy for View<'_, M> {}

impl<'a, M: Message> View<'a, M> {
    /// The typed view of raw bytes; `None` where sizes or alignment do not fit.
    pub fn of(raw: RawMessage<'a>) -> Option<View<'a, M>> {
        let header = bytemuck::try_from_bytes(raw.header).ok()?;
        let items = bytemuck::try_cast_slice(raw.items).ok()?;
        Some(View { header, items })
    }
}
