//! Typed access to the bytes of a message.

use bytemuck::Pod;
use yamabico_core::message::Message;

/// Header of a message of type `M`; `None` if the size differs.
pub(crate) fn header<M: Message>(bytes: &[u8]) -> Option<M> {
    bytemuck::try_pod_read_unaligned(bytes).ok()
}

/// Items of a message; a partial one at the end is left out.
pub(crate) fn items<T: Pod>(bytes: &[u8]) -> impl Iterator<Item = T> + '_ {
    bytes.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned)
}
