//! Message queue of one slot.

use std::collections::VecDeque;

use crate::behavior::SlotSource;
use crate::message::Channel;
use crate::message::RawMessage;

/// Queue length of a slot fed by a stream.
pub const DEPTH: usize = 64;

/// The newest messages of a slot, as many as the bus would keep: one of a latest-value channel, [`DEPTH`] of a stream.
/// A full queue accepts messages of the same size without allocating.
pub struct Inbox {
    name: String,
    depth: usize,
    kept: VecDeque<Stored>,
    fresh: usize,
    lost: u64,
}

impl Inbox {
    /// Creates an empty queue for the slot `name`.
    pub fn new(name: impl Into<String>, channel: Channel) -> Inbox {
        let depth = match channel {
            Channel::Latest => 1,
            Channel::Stream => DEPTH,
        };
        Inbox { name: name.into(), depth, kept: VecDeque::with_capacity(depth), fresh: 0, lost: 0 }
    }

    /// Adds a message and drops the oldest one if the queue is full. A dropped message of a stream that was not read
    /// yet counts as lost.
    pub fn push(&mut self, header: &[u8], items: &[u8]) {
        let mut entry =
            if self.kept.len() < self.depth { None } else { self.kept.pop_front() }.unwrap_or_default();
        entry.set(header, items);
        self.kept.push_back(entry);
        if self.fresh < self.depth {
            self.fresh += 1;
        } else if self.depth > 1 {
            self.lost += 1;
        }
    }

    /// Counts `count` messages as lost on the way to the slot.
    pub fn lose(&mut self, count: u64) {
        self.lost += count;
    }

    /// Marks all messages as read; they stay in the queue.
    pub fn mark_read(&mut self) {
        self.fresh = 0;
        self.lost = 0;
    }
}

impl SlotSource for Inbox {
    fn name(&self) -> &str {
        &self.name
    }

    fn len(&self) -> usize {
        self.kept.len()
    }

    fn fresh(&self) -> usize {
        self.fresh
    }

    fn lost(&self) -> u64 {
        self.lost
    }

    fn get(&self, index: usize) -> Option<RawMessage<'_>> {
        self.kept.get(index).map(Stored::raw)
    }
}

/// A copy of a message in 8-byte words, so that its bytes are aligned for any header and item.
#[derive(Clone, Debug, Default)]
pub struct Stored {
    header: Vec<u64>,
    header_len: usize,
    items: Vec<u64>,
    items_len: usize,
}

impl Stored {
    /// Copies a message.
    pub fn set(&mut self, header: &[u8], items: &[u8]) {
        self.header_len = copy_into(&mut self.header, header);
        self.items_len = copy_into(&mut self.items, items);
    }

    /// Returns the message.
    pub fn raw(&self) -> RawMessage<'_> {
        RawMessage {
            header: &bytemuck::cast_slice(&self.header)[..self.header_len],
            items: &bytemuck::cast_slice(&self.items)[..self.items_len],
        }
    }
}

fn copy_into(words: &mut Vec<u64>, bytes: &[u8]) -> usize {
    words.resize(bytes.len().div_ceil(8), 0);
    bytemuck::cast_slice_mut(words)[..bytes.len()].copy_from_slice(bytes);
    bytes.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_inbox_counts_lost_messages() {
        let mut inbox = Inbox::new("sonar", Channel::Stream);
        for i in 0..DEPTH as u64 + 3 {
            inbox.push(&i.to_ne_bytes(), &[]);
        }
        assert_eq!((inbox.len(), inbox.fresh(), inbox.lost()), (DEPTH, DEPTH, 3));
        assert_eq!(inbox.get(0).unwrap().header, 3_u64.to_ne_bytes());
        inbox.mark_read();
        assert_eq!((inbox.len(), inbox.fresh(), inbox.lost()), (DEPTH, 0, 0));
        inbox.push(&[9], &[1, 2, 3]);
        assert_eq!((inbox.fresh(), inbox.lost()), (1, 0));
        assert_eq!(inbox.get(DEPTH - 1).unwrap().items, [1, 2, 3]);
    }
}
