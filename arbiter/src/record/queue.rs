//! The bounded queue between a run and the thread that writes its recording.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use yamabico_core::message::MessageType;
use yamabico_core::time::Time;

/// Bytes of messages that may wait for the writer.
const MOST_BYTES: usize = 64 << 20;
/// Messages that may wait for the writer.
const MOST_MESSAGES: usize = 16_384;
/// What a waiting message takes besides its bytes.
const OVERHEAD: usize = 128;
/// Written messages whose memory is kept for later ones.
const MOST_SPARE: usize = 64;

/// A message that waits to be written.
#[derive(Debug)]
pub(super) struct Entry {
    pub topic: Arc<str>,
    pub message: MessageType,
    pub time: Time,
    pub header: Vec<u8>,
    pub items: Vec<u8>,
}

/// What became of a message that was offered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Offer {
    Taken,
    Full,
    Closed,
}

/// Both ends of the queue.
#[derive(Clone, Default)]
pub(super) struct Queue(Arc<Shared>);

#[derive(Default)]
struct Shared {
    state: Mutex<State>,
    filled: Condvar,
    drained: Condvar,
}

#[derive(Default)]
struct State {
    waiting: VecDeque<Entry>,
    bytes: usize,
    spare: Vec<Entry>,
    ended: bool,
    closed: bool,
}

impl Queue {
    /// Whether `more` bytes would be taken now, with a share of the room left over for what is small.
    pub fn has_room_for(&self, more: usize) -> bool {
        self.lock().bytes + more <= MOST_BYTES / 2
    }

    /// Adds a message where there is room. Copies into memory of messages written earlier.
    pub fn offer(
        &self,
        topic: Arc<str>,
        message: MessageType,
        time: Time,
        header: &[u8],
        items: &[u8],
    ) -> Offer {
        let mut state = self.lock();
        if state.closed {
            return Offer::Closed;
        }
        if !state.has_room() {
            return Offer::Full;
        }
        state.push(topic, message, time, header, items);
        drop(state);
        self.0.filled.notify_one();
        Offer::Taken
    }

    /// Adds a message and waits for room, for as long as there is a writer.
    pub fn wait(
        &self,
        topic: Arc<str>,
        message: MessageType,
        time: Time,
        header: &[u8],
        items: &[u8],
    ) -> Offer {
        let mut state = self.lock();
        while !state.closed && !state.has_room() {
            state = self.0.drained.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        if state.closed {
            return Offer::Closed;
        }
        state.push(topic, message, time, header, items);
        drop(state);
        self.0.filled.notify_one();
        Offer::Taken
    }

    /// Nothing will be added any more.
    pub fn end(&self) {
        self.lock().ended = true;
        self.0.filled.notify_one();
    }

    /// Nobody will take anything any more; waiting ends.
    pub fn close(&self) {
        let mut state = self.lock();
        state.closed = true;
        state.waiting.clear();
        state.spare.clear();
        drop(state);
        self.0.drained.notify_all();
    }

    /// Swaps everything that waits for `written`, whose memory is used again; `false` at the end.
    pub fn take(&self, written: &mut VecDeque<Entry>) -> bool {
        let mut state = self.lock();
        let keep = MOST_SPARE.saturating_sub(state.spare.len());
        state.spare.extend(written.drain(..).take(keep));
        while state.waiting.is_empty() && !state.ended {
            state = self.0.filled.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        std::mem::swap(&mut state.waiting, written);
        state.bytes = 0;
        drop(state);
        self.0.drained.notify_all();
        !written.is_empty()
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// A queue that is empty takes a message of any size.
    fn has_room(&self) -> bool {
        self.waiting.len() < MOST_MESSAGES && self.bytes < MOST_BYTES
    }

    fn push(&mut self, topic: Arc<str>, message: MessageType, time: Time, header: &[u8], items: &[u8]) {
        let (mut header_bytes, mut item_bytes) =
            self.spare.pop().map_or_else(Default::default, |spare| (spare.header, spare.items));
        header_bytes.clear();
        header_bytes.extend_from_slice(header);
        item_bytes.clear();
        item_bytes.extend_from_slice(items);
        self.bytes += OVERHEAD + header.len() + items.len();
        self.waiting.push_back(Entry { topic, message, time, header: header_bytes, items: item_bytes });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::{FrameHeader, Message};

    fn offer(queue: &Queue, topic: &str, items: usize) -> Offer {
        let message = MessageType::of::<FrameHeader>();
        assert_eq!(message.name, FrameHeader::NAME);
        queue.offer(topic.into(), message, Time::ZERO, &[1, 2], &vec![0; items])
    }

    #[test]
    fn keeps_order_and_ends() {
        let queue = Queue::default();
        for topic in ["a", "b", "c"] {
            assert_eq!(offer(&queue, topic, 3), Offer::Taken);
        }
        queue.end();
        let mut taken = VecDeque::new();
        assert!(queue.take(&mut taken));
        assert_eq!(taken.iter().map(|entry| &*entry.topic).collect::<Vec<_>>(), ["a", "b", "c"]);
        assert!(!queue.take(&mut taken));
    }

    #[test]
    fn is_bounded_and_a_gone_writer_blocks_nobody() {
        let queue = Queue::default();
        assert!(queue.has_room_for(MOST_BYTES / 2));
        assert_eq!(offer(&queue, "a", MOST_BYTES), Offer::Taken);
        assert!(!queue.has_room_for(1));
        assert_eq!(offer(&queue, "a", 1), Offer::Full);
        let writer = queue.clone();
        let closing = std::thread::spawn(move || {
            std::thread::sleep(std::time::Duration::from_millis(20));
            writer.close();
        });
        let message = MessageType::of::<FrameHeader>();
        assert_eq!(queue.wait("a".into(), message, Time::ZERO, &[], &[]), Offer::Closed);
        closing.join().unwrap();
    }
}
