//! Messages published during a test.

use std::ops::ControlFlow;

use crate::behavior::{OutputSink, PublishError, SlotInfo};
use crate::message::{Message, MessageType};
use crate::message::{RawMessage, View};

use super::allocations::uncounted;
use super::inbox::Stored;

/// An output sink that stores all messages: of a behavior on the [`Bench`](super::Bench), or of a sensor polled by a
/// test.
#[derive(Debug, Default)]
pub struct Published {
    declared: Option<&'static [SlotInfo]>,
    kept: Vec<(String, MessageType, Stored)>,
}

impl Published {
    /// Creates a sink that accepts the outputs in `declared` only, as the bus does.
    #[must_use]
    pub fn declared(declared: &'static [SlotInfo]) -> Published {
        Published { declared: Some(declared), kept: Vec::new() }
    }

    /// Returns header and items of every message of type `M` on `output`, in order of publication.
    #[must_use]
    pub fn of<M: Message>(&self, output: &str) -> Vec<(M, Vec<M::Item>)> {
        let views = self.iter().filter(|&(name, message, _)| name == output && message.name == M::NAME);
        views
            .filter_map(|(_, _, raw)| View::<M>::of(raw).map(|view| (*view.header, view.items.to_vec())))
            .collect()
    }

    /// Iterates over output, type and bytes of every message, in order of publication.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &MessageType, RawMessage<'_>)> {
        self.kept.iter().map(|(name, message, stored)| (name.as_str(), message, stored.raw()))
    }

    /// Removes all messages.
    pub fn clear(&mut self) {
        uncounted(|| self.kept.clear());
    }
}

impl OutputSink for Published {
    fn publish(
        &mut self,
        name: &str,
        message: &MessageType,
        header: &[u8],
        items: &[u8],
    ) -> Result<(), PublishError> {
        if let Some(declared) = self.declared {
            let output = declared.iter().find(|output| output.name == name);
            let output = output.ok_or_else(|| PublishError::NoSuchOutput(name.to_owned()))?;
            PublishError::check_type(name, &output.message, message)?;
        }
        uncounted(|| {
            let mut stored = Stored::default();
            stored.set(header, items);
            self.kept.push((name.to_owned(), *message, stored));
        });
        Ok(())
    }

    fn publish_in_place(
        &mut self,
        name: &str,
        message: &MessageType,
        header: &[u8],
        len: usize,
        fill: &mut dyn FnMut(&mut [u8]) -> ControlFlow<()>,
    ) -> Result<(), PublishError> {
        let mut items = uncounted(|| vec![0_u64; len.div_ceil(8)]);
        match fill(&mut bytemuck::cast_slice_mut(&mut items)[..len]) {
            ControlFlow::Continue(()) => {
                self.publish(name, message, header, &bytemuck::cast_slice(&items)[..len])
            }
            ControlFlow::Break(()) => Ok(()),
        }
    }
}
