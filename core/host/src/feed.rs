//! What the bus brings to one behavior, slot by slot.

use crate::bus::{Bus, BusError, Inbox};
use yamabico_core::behavior::{InputSource, SlotSource};
use yamabico_core::message::{Goal, Message, MessageType};

/// The slots of one behavior, fed from the bus.
pub struct Feed {
    slots: Vec<Inbox>,
}

impl Feed {
    /// Opens a subscriber for each (slot, topic, type).
    ///
    /// # Errors
    /// A topic that does not exist, carries another type or admits no more readers.
    pub fn open(bus: &Bus, slots: &[(String, String, MessageType)]) -> Result<Feed, BusError> {
        let slots = slots
            .iter()
            .map(|(slot, topic, message)| Ok(Inbox::new(slot, bus.subscriber_raw(topic, message)?)));
        Ok(Feed { slots: slots.collect::<Result<_, BusError>>()? })
    }

    /// Takes in what has arrived and lets go of what was seen; whether anything had arrived.
    ///
    /// # Errors
    /// The bus failed on a topic.
    pub fn collect(&mut self) -> Result<bool, BusError> {
        let mut any = false;
        for slot in &mut self.slots {
            any |= slot.refresh()? > 0;
        }
        Ok(any)
    }

    /// The oldest evidence among the newest messages of all slots; `None` where nothing ever arrived. A goal is what
    /// somebody wants and no evidence.
    pub fn evidence_ns(&self) -> Option<u64> {
        let newest = self.slots.iter().filter_map(|slot| Some((slot.subscriber().message(), slot.newest()?)));
        let newest = newest.filter(|(message, _)| message.name != Goal::NAME);
        newest.map(|(message, newest)| (message.stamps)(newest.header).1.0).min()
    }
}

impl InputSource for Feed {
    fn slot(&self, index: usize) -> Option<&dyn SlotSource> {
        self.slots.get(index).map(|slot| slot as &dyn SlotSource)
    }
}
