//! Overlays of one behavior: drawn and published only while they have a subscriber.

use crate::bus::{Audience, Bus, BusError, Publisher};
use crate::topics;
use yamabico_core::message::{MessageType, OverlayHeader};
use yamabico_core::overlay::Overlay;
use yamabico_core::time::Time;

/// Publisher of a behavior's overlays.
pub(crate) struct OverlayPort {
    audience: Audience,
    publisher: Publisher<OverlayHeader>,
    /// Slot and topic of each input.
    inputs: Vec<(String, String)>,
    overlay: Option<Overlay>,
    sequence: u64,
}

impl OverlayPort {
    /// Opens the overlays of the behavior `name` with these inputs: slot, topic, type.
    ///
    /// # Errors
    /// The topic does not exist.
    pub fn open(
        bus: &Bus,
        name: &str,
        inputs: &[(String, String, MessageType)],
    ) -> Result<OverlayPort, BusError> {
        let topic = topics::overlay(name);
        Ok(OverlayPort {
            audience: bus.audience(&topic, &MessageType::of::<OverlayHeader>())?,
            publisher: bus.publisher(&topic)?,
            inputs: inputs.iter().map(|(slot, topic, _)| (slot.clone(), topic.clone())).collect(),
            overlay: None,
            sequence: 0,
        })
    }

    /// Returns an empty overlay for the call at `now`; `None` without a subscriber. The first one is allocated.
    pub fn canvas(&mut self, now: Time) -> Option<&mut Overlay> {
        if !self.audience.is_present(now) {
            return None;
        }
        let overlay = self.overlay.get_or_insert_default();
        overlay.clear();
        Some(overlay)
    }

    /// Publishes what the last call drew.
    ///
    /// # Errors
    /// The bus failed.
    pub fn publish(&mut self) -> Result<(), BusError> {
        let Some(overlay) = self.overlay.as_mut().filter(|overlay| overlay.is_drawn()) else { return Ok(()) };
        let topic = self.inputs.iter().find(|(slot, _)| slot == overlay.slot());
        self.sequence += 1;
        let header = overlay.header(topic.map_or("", |(_, topic)| topic), self.sequence);
        self.publisher.publish(&header, overlay.marks())?;
        overlay.clear();
        Ok(())
    }
}
