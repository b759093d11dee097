//! Messages of one slot, kept until the behavior has seen them.

use std::collections::VecDeque;

use crate::behavior::SlotSource;
use crate::message::Channel;
use crate::message::RawMessage;

/// How many messages of a stream an inbox keeps at hand.
pub const DEPTH: usize = 64;

/// The newest messages of a slot, as many as the bus keeps: one or [`DEPTH`]. Reuses its memory: a full inbox takes messages of the same size without
/// allocating.
pub struct Inbox {
    name: String,
    depth: usize,
    kept: VecDeque<Stored>,
    fresh: usize,
    lost: u64,
}

impl Inbox {
    /// An empty inbox of the slot `name`.
    pub fn new(name: impl Into<String>, channel: Channel) -> Inbox {
        let depth = match channel {
            Channel::Latest => 1,
            Channel::Stream => DEPTH,
        };
        Inbox { name: name.into(), depth, kept: VecDeque::with_capacity(depth), fresh: 0, lost: 0 }
    }

    /// Takes a message; the oldest one makes room, and counts as lost where it was not yet seen and a newer one does not stand for it.
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

    /// Tells that `count` messages were lost on the way here.
    pub fn lose(&mut self, count: u64) {
        self.lost += count;
    }

    /// Marks everything at hand as seen; it stays at hand.
    pub fn seen(&mut self) {
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

/// A copy of a message, kept in eight-byte words so that its bytes are aligned for any header and item.
#[derive(Clone, Debug, Default)]
pub struct Stored {
    header: Vec<u64>,
    header_len: usize,
    items: Vec<u64>,
    items_len: usize,
}

impl Stored {
    /// Becomes a copy of this message.
    pub fn set(&mut self, header: &[u8], items: &[u8]) {
        self.header_len = copy_into(&mut self.header, header);
        self.items_len = copy_into(&mut self.items, items);
    }

    /// The message, lent.
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
    fn a_full_inbox_tells_what_it_lost() {
        let mut inbox = Inbox::new("sonar", Channel::Stream);
        for i in 0..DEPTH as u64 + 3 {
            inbox.push(&i.to_ne_bytes(), &[]);
        }
        assert_eq!((inbox.len(), inbox.fresh(), inbox.lost()), (DEPTH, DEPTH, 3));
        assert_eq!(inbox.get(0).unwrap().header, 3_u64.to_ne_bytes());
        inbox.seen();
        assert_eq!((inbox.len(), inbox.fresh(), inbox.lost()), (DEPTH, 0, 0));
        inbox.push(&[9], &[1, 2, 3]);
        assert_eq!((inbox.fresh(), inbox.lost()), (1, 0));
        assert_eq!(inbox.get(DEPTH - 1).unwrap().items, [1, 2, 3]);
    }
}
