//! Inputs of one behavior: a subscriber for each of its slots.

use crate::bus::{Bus, BusError, Inbox};
use yamabico_core::behavior::{InputSource, SlotSource};
use yamabico_core::message::{DecisionHeader, Goal, Message, MessageType};

/// Inboxes of a behavior's slots.
pub(crate) struct InputPorts {
    slots: Vec<Inbox>,
}

impl InputPorts {
    /// Opens a subscriber for each (slot, topic, type).
    ///
    /// # Errors
    /// A topic that does not exist, carries another type or has its maximum number of subscribers.
    pub fn open(bus: &Bus, slots: &[(String, String, MessageType)]) -> Result<InputPorts, BusError> {
        let slots = slots
            .iter()
            .map(|(slot, topic, message)| Ok(Inbox::new(slot, bus.subscriber_raw(topic, message)?)));
        Ok(InputPorts { slots: slots.collect::<Result<_, BusError>>()? })
    }

    /// Receives every waiting message. Returns true if there was any other than a decision of the arbiter, which calls no
    /// behavior.
    ///
    /// # Errors
    /// The bus failed.
    pub fn collect(&mut self) -> Result<bool, BusError> {
        let mut any = false;
        for slot in &mut self.slots {
            any |= slot.refresh()? > 0 && slot.subscriber().message().name != DecisionHeader::NAME;
        }
        Ok(any)
    }

    /// Inboxes, in the order of the connected slots.
    pub fn slots(&self) -> &[Inbox] {
        &self.slots
    }

    /// Oldest evidence stamp of the newest messages of all slots, ns; none before the first message. Goals and
    /// decisions do not count: they contain no sensor data of their own.
    pub fn evidence_ns(&self) -> Option<u64> {
        let newest = self.slots.iter().filter_map(|slot| Some((slot.subscriber().message(), slot.newest()?)));
        let newest =
            newest.filter(|(message, _)| ![Goal::NAME, DecisionHeader::NAME].contains(&message.name));
        newest.map(|(message, newest)| (message.stamps)(newest.header).1.0).min()
    }
}

impl InputSource for InputPorts {
    fn slot(&self, index: usize) -> Option<&dyn SlotSource> {
        self.slots.get(index).map(|slot| slot as &dyn SlotSource)
    }
}
