//! A message on its way into records, with its stamps on their clock.

use bytemuck::Pod;
use yamabico_core::message::{Layout, Message, MessageType};
use yamabico_core::time::Time;

use super::schema;

/// Field of every header with a stamp.
const STAMP: &str = "stamp_ns";

/// Clock of records: `origin` on the clock of the run is `start` on this one.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RunClock {
    pub origin: Time,
    pub start: Time,
}

impl RunClock {
    /// Time on this clock; of a time before the origin, the start.
    pub fn time(self, time: Time) -> Time {
        Time(time.0.saturating_sub(self.origin.0).saturating_add(self.start.0))
    }
}

/// A message with its time on the clock of the records.
pub(super) struct Incoming<'a> {
    pub topic: &'a str,
    pub time: Time,
    pub message: &'a MessageType,
    pub header: &'a [u8],
    pub items: &'a [u8],
    pub clock: RunClock,
}

impl Incoming<'_> {
    /// Message as JSON, with its stamps as they are.
    pub fn json(&self) -> Vec<u8> {
        let value = schema::to_json(self.message, self.header, self.items);
        serde_json::to_vec(&value).unwrap_or_else(|_| b"null".to_vec())
    }

    /// Header, with its stamp on the clock of the records.
    pub fn header<M: Message>(&self) -> Option<M> {
        let mut header: M = bytemuck::try_pod_read_unaligned(self.header).ok()?;
        if let Layout::Struct(layout) = M::LAYOUT
            && let Some(field) = layout.fields.iter().find(|field| field.name == STAMP)
            && let Some(bytes) = bytemuck::bytes_of_mut(&mut header).get_mut(field.offset..field.offset + 8)
        {
            let stamp = Time((&*bytes).try_into().map_or(0, u64::from_ne_bytes));
            bytes.copy_from_slice(&self.clock.time(stamp).0.to_ne_bytes());
        }
        Some(header)
    }

    /// Items.
    pub fn items<T: Pod>(&self) -> Vec<T> {
        self.items.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned).collect()
    }
}
