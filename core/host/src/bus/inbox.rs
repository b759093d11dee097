//! Messages at hand in one input slot of a plugin.

use std::collections::VecDeque;

use super::node::default_depth;
use super::sample::Held;
use super::{BusError, RawSubscriber};
use yamabico_core::behavior::SlotSource;
use yamabico_core::message::RawMessage;

/// Messages at hand in one slot: those that the last [`Inbox::refresh`] received, or the newest one ever received if
/// it found none. Nothing is copied: the messages stay where their publisher wrote them.
pub struct Inbox {
    // Dropped before the subscriber: samples must not outlive their port.
    held: VecDeque<Held>,
    subscriber: RawSubscriber,
    slot: String,
    fresh: usize,
    lost: u64,
    lost_before: u64,
}

#[allow(
    unsafe_code,
    reason = "the samples count references only to the subscriber that lies beside them and moves with \
    them; not Sync"
)]
unsafe impl Send for Inbox {}

impl Inbox {
    /// Makes the inbox of the slot of this name.
    pub fn new(slot: impl Into<String>, subscriber: RawSubscriber) -> Inbox {
        let max = max_kept(&subscriber);
        Inbox {
            held: VecDeque::with_capacity(max + 1),
            subscriber,
            slot: slot.into(),
            fresh: 0,
            lost: 0,
            lost_before: 0,
        }
    }

    /// Receives every waiting message and drops those of the last call. Returns the number of messages received.
    ///
    /// # Errors
    /// The transport failed; the messages at hand stay.
    pub fn refresh(&mut self) -> Result<usize, BusError> {
        let max = max_kept(&self.subscriber);
        self.fresh = 0;
        let mut dropped = 0;
        let outcome = loop {
            match self.subscriber.receive_held() {
                Ok(Some(held)) => {
                    if self.fresh == 0 {
                        self.held.clear();
                    } else if self.held.len() == max {
                        self.held.pop_front();
                        dropped += 1;
                        self.fresh -= 1;
                    }
                    self.held.push_back(held);
                    self.fresh += 1;
                }
                Ok(None) => break Ok(self.fresh),
                Err(e) => break Err(e),
            }
        };
        if max == 1 {
            dropped = 0;
        }
        self.lost = self.subscriber.lost().saturating_sub(self.lost_before).saturating_add(dropped);
        self.lost_before = self.subscriber.lost();
        outcome
    }

    /// Newest message at hand; none before the first one.
    pub fn newest(&self) -> Option<RawMessage<'_>> {
        self.held.back().map(Held::message)
    }

    /// Subscriber that the messages come from.
    pub fn subscriber(&self) -> &RawSubscriber {
        &self.subscriber
    }
}

impl SlotSource for Inbox {
    fn name(&self) -> &str {
        &self.slot
    }

    fn len(&self) -> usize {
        self.held.len()
    }

    fn fresh(&self) -> usize {
        self.fresh
    }

    fn lost(&self) -> u64 {
        self.lost
    }

    fn get(&self, index: usize) -> Option<RawMessage<'_>> {
        self.held.get(index).map(Held::message)
    }
}

fn max_kept(subscriber: &RawSubscriber) -> usize {
    default_depth(subscriber.message().channel)
}
