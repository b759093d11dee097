//! Bounded queue between a run and the writer of its recording.

use std::ops::Range;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use yamabico_core::message::MessageType;
use yamabico_core::time::Time;

/// Maximum size of the waiting messages, bytes.
const MAX_BYTES: usize = 64 << 20;
/// Maximum number of waiting messages.
const MAX_MESSAGES: usize = 16_384;
/// Memory of a waiting message besides its bytes, bytes.
const OVERHEAD: usize = 128;
/// Memory that an empty batch keeps, bytes; what a burst took above it is freed.
const KEPT_BYTES: usize = 2 << 20;

/// A message to be written.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry<'a> {
    pub topic: &'a Arc<str>,
    pub message: &'a MessageType,
    pub time: Time,
    pub header: &'a [u8],
    pub items: &'a [u8],
}

/// Messages in the order of arrival, with their bytes in one buffer.
#[derive(Debug, Default)]
pub(super) struct Batch {
    slots: Vec<Slot>,
    bytes: Vec<u8>,
}

#[derive(Debug)]
struct Slot {
    topic: Arc<str>,
    message: MessageType,
    time: Time,
    header: Range<usize>,
    items: Range<usize>,
}

impl Batch {
    /// Messages of the batch.
    pub fn entries(&self) -> impl Iterator<Item = Entry<'_>> {
        self.slots.iter().map(|slot| Entry {
            topic: &slot.topic,
            message: &slot.message,
            time: slot.time,
            header: &self.bytes[slot.header.clone()],
            items: &self.bytes[slot.items.clone()],
        })
    }

    /// Share of [`MAX_BYTES`] that it occupies.
    fn size(&self) -> usize {
        self.bytes.len() + OVERHEAD * self.slots.len()
    }

    /// Returns true if it can take another message; an empty batch takes a message of any size.
    fn has_room(&self) -> bool {
        self.slots.len() < MAX_MESSAGES && self.size() < MAX_BYTES
    }

    fn push(&mut self, entry: &Entry) {
        let header = self.append(entry.header);
        let items = self.append(entry.items);
        let (topic, message, time) = (entry.topic.clone(), *entry.message, entry.time);
        self.slots.push(Slot { topic, message, time, header, items });
    }

    fn append(&mut self, bytes: &[u8]) -> Range<usize> {
        let begin = self.bytes.len();
        self.bytes.extend_from_slice(bytes);
        begin..self.bytes.len()
    }

    fn clear(&mut self) {
        self.slots.clear();
        self.slots.shrink_to(KEPT_BYTES / size_of::<Slot>());
        self.bytes.clear();
        self.bytes.shrink_to(KEPT_BYTES);
    }
}

/// Both ends of the queue.
#[derive(Clone, Default)]
pub(super) struct Queue(Arc<Shared>);

#[derive(Default)]
struct Shared {
    state: Mutex<QueueState>,
    filled: Condvar,
    drained: Condvar,
}

#[derive(Default)]
struct QueueState {
    waiting: Batch,
    ended: bool,
    closed: bool,
}

impl Queue {
    /// Returns true if `more` bytes have room now, leaving half of the queue to small messages.
    pub fn has_room_for(&self, more: usize) -> bool {
        self.lock().waiting.size() + more <= MAX_BYTES / 2
    }

    /// Adds a message if there is room and a writer; returns true if it was added.
    pub fn offer(&self, entry: &Entry) -> bool {
        self.push(self.lock(), entry)
    }

    /// Adds a message and waits for room as long as there is a writer; returns true if it was added.
    pub fn wait(&self, entry: &Entry) -> bool {
        let is_full = |state: &mut QueueState| !state.closed && !state.waiting.has_room();
        let state = self.0.drained.wait_while(self.lock(), is_full).unwrap_or_else(PoisonError::into_inner);
        self.push(state, entry)
    }

    fn push(&self, mut state: MutexGuard<'_, QueueState>, entry: &Entry) -> bool {
        let is_taken = !state.closed && state.waiting.has_room();
        if is_taken {
            state.waiting.push(entry);
            drop(state);
            self.0.filled.notify_one();
        }
        is_taken
    }

    /// Reports that no message will be added any more.
    pub fn end(&self) {
        self.lock().ended = true;
        self.0.filled.notify_one();
    }

    /// Reports that no message will be taken any more; every wait ends.
    pub fn close(&self) {
        let mut state = self.lock();
        state.closed = true;
        state.waiting = Batch::default();
        drop(state);
        self.0.drained.notify_all();
    }

    /// Swaps the waiting messages for `written`, whose memory is reused; returns false at the end.
    pub fn take(&self, written: &mut Batch) -> bool {
        written.clear();
        let is_idle = |state: &mut QueueState| state.waiting.slots.is_empty() && !state.ended;
        let mut state =
            self.0.filled.wait_while(self.lock(), is_idle).unwrap_or_else(PoisonError::into_inner);
        std::mem::swap(&mut state.waiting, written);
        drop(state);
        self.0.drained.notify_all();
        !written.slots.is_empty()
    }

    fn lock(&self) -> MutexGuard<'_, QueueState> {
        self.0.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::FrameHeader;

    fn with_entry(topic: &str, items: usize, send: impl FnOnce(&Entry) -> bool) -> bool {
        let message = MessageType::of::<FrameHeader>();
        let items = vec![0; items];
        send(&Entry {
            topic: &topic.into(),
            message: &message,
            time: Time::ZERO,
            header: &[1, 2],
            items: &items,
        })
    }

    fn offer(queue: &Queue, topic: &str, items: usize) -> bool {
        with_entry(topic, items, |entry| queue.offer(entry))
    }

    #[test]
    fn keeps_order_and_ends() {
        let queue = Queue::default();
        for topic in ["a", "b", "c"] {
            assert!(offer(&queue, topic, 3));
        }
        queue.end();
        let mut taken = Batch::default();
        assert!(queue.take(&mut taken));
        assert_eq!(taken.entries().map(|entry| &**entry.topic).collect::<Vec<_>>(), ["a", "b", "c"]);
        assert!(taken.entries().all(|entry| entry.header == [1, 2] && entry.items == [0; 3]));
        assert!(!queue.take(&mut taken));
    }

    #[test]
    fn frees_the_memory_of_a_burst() {
        let queue = Queue::default();
        let mut taken = Batch::default();
        for _ in 0..4 {
            assert!((0..10).all(|_| offer(&queue, "frames", KEPT_BYTES)));
            assert!(queue.take(&mut taken));
            assert_eq!(taken.entries().count(), 10);
            assert!(offer(&queue, "frames", 1));
            assert!(queue.take(&mut taken));
            assert!(taken.bytes.capacity() + queue.lock().waiting.bytes.capacity() <= 2 * KEPT_BYTES);
        }
    }

    #[test]
    fn is_bounded_and_a_missing_writer_blocks_nothing() {
        let queue = Queue::default();
        assert!(queue.has_room_for(MAX_BYTES / 2));
        assert!(offer(&queue, "a", MAX_BYTES));
        assert!(!queue.has_room_for(1));
        assert!(!offer(&queue, "a", 1));
        let writer = queue.clone();
        let closing = std::thread::spawn(move || {
            std::thread::sleep(std::time::Duration::from_millis(20));
            writer.close();
        });
        assert!(!with_entry("a", 1, |entry| queue.wait(entry)));
        closing.join().unwrap();
    }
}
