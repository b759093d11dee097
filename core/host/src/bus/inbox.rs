//! A subscriber that keeps what it received, for a slot of a plugin.

use std::collections::VecDeque;

use super::sample::Held;
use super::world::ordinary_depth;
use super::{BusError, RawSubscriber};
use yamabico_core::behavior::SlotSource;
use yamabico_core::message::RawMessage;

/// The messages at hand in one slot: those of the last [`Inbox::refresh`], or the newest one ever where nothing came since.
///
/// Nothing is copied: the messages stay where their sender wrote them.
pub struct Inbox {
    // In front of the subscriber: samples go before their port.
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
    /// An inbox of `subscriber` for the slot of this name.
    pub fn new(slot: impl Into<String>, subscriber: RawSubscriber) -> Inbox {
        let most = max_kept(&subscriber);
        Inbox {
            held: VecDeque::with_capacity(most + 1),
            subscriber,
            slot: slot.into(),
            fresh: 0,
            lost: 0,
            lost_before: 0,
        }
    }

    /// Takes in what has arrived and lets go of what is older; returns how many arrived.
    ///
    /// # Errors
    /// The transport failed; what is at hand stays.
    pub fn refresh(&mut self) -> Result<usize, BusError> {
        let most = max_kept(&self.subscriber);
        self.fresh = 0;
        let mut crowded_out = 0;
        let outcome = loop {
            match self.subscriber.receive_held() {
                Ok(Some(held)) => {
                    if self.fresh == 0 {
                        self.held.clear();
                    } else if self.held.len() == most {
                        self.held.pop_front();
                        crowded_out += 1;
                        self.fresh -= 1;
                    }
                    self.held.push_back(held);
                    self.fresh += 1;
                }
                Ok(None) => break Ok(self.fresh),
                Err(e) => break Err(e),
            }
        };
        if most == 1 {
            crowded_out = 0;
        }
        self.lost = self.subscriber.lost().saturating_sub(self.lost_before).saturating_add(crowded_out);
        self.lost_before = self.subscriber.lost();
        outcome
    }

    /// The newest message at hand; `None` where nothing has ever arrived.
    pub fn newest(&self) -> Option<RawMessage<'_>> {
        self.held.back().map(Held::message)
    }

    /// The subscriber behind it.
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
    ordinary_depth(subscriber.message().channel)
}
