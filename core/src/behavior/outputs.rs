//! Outputs of a behavior or a driver, and the reasons why a message is not published.

use std::ops::ControlFlow;

use super::Slot;
use crate::message::{Message, MessageType};
use crate::overlay::Overlay;

/// Destination of a plugin's messages.
pub trait OutputSink {
    /// Publishes a message on output `name`.
    ///
    /// # Errors
    /// The output does not exist or has another type, the message is too long, or the bus failed.
    fn publish(
        &mut self,
        name: &str,
        message: &MessageType,
        header: &[u8],
        items: &[u8],
    ) -> Result<(), PublishError>;

    /// Publishes a message whose `len` bytes of items are written in place by `fill`, unless `fill` breaks.
    ///
    /// # Errors
    /// Same as [`OutputSink::publish`].
    fn publish_in_place(
        &mut self,
        name: &str,
        message: &MessageType,
        header: &[u8],
        len: usize,
        fill: &mut dyn FnMut(&mut [u8]) -> ControlFlow<()>,
    ) -> Result<(), PublishError>;
}

/// Reason why a message could not be published.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PublishError {
    /// The plugin did not declare the output, or no input is connected to it.
    #[error("output `{0}` does not exist: declare it in `OUTPUTS`")]
    NoSuchOutput(String),
    /// The output carries another message type.
    #[error("output `{output}` carries {expected}, but the message is {actual}")]
    WrongType {
        /// Name of the output.
        output: String,
        /// Versioned name of the type that the output carries.
        expected: &'static str,
        /// Type of the refused message.
        actual: &'static str,
    },
    /// The list of items is longer than the output's channel allows.
    #[error("output `{output}` takes at most {max} bytes of items, but the message has {len}")]
    TooLong {
        /// Name of the output.
        output: String,
        /// Capacity of the channel, bytes.
        max: usize,
        /// Size of the items of the refused message, bytes.
        len: usize,
    },
    /// The transport failed.
    #[error("output `{output}` could not publish: {reason}")]
    Refused {
        /// Name of the output.
        output: String,
        /// Error text of the transport.
        reason: String,
    },
}

impl PublishError {
    /// Checks that the output `output`, which carries `declared`, may publish a message of type `actual`.
    ///
    /// # Errors
    /// [`PublishError::WrongType`].
    pub fn check_type(
        output: &str,
        declared: &MessageType,
        actual: &MessageType,
    ) -> Result<(), PublishError> {
        if declared == actual {
            return Ok(());
        }
        let (expected, actual) = (declared.name, actual.name);
        Err(PublishError::WrongType { output: output.to_owned(), expected, actual })
    }
}

/// Outputs of a plugin.
pub struct Outputs<'a> {
    sink: &'a mut dyn OutputSink,
    overlay: Option<&'a mut Overlay>,
}

impl<'a> Outputs<'a> {
    /// Creates outputs that publish to `sink`.
    pub fn new(sink: &'a mut dyn OutputSink) -> Outputs<'a> {
        Outputs { sink, overlay: None }
    }

    /// Sets where [`Outputs::draw`] draws; `None` while overlays have no subscriber.
    #[must_use]
    pub fn with_overlay(self, overlay: Option<&'a mut Overlay>) -> Outputs<'a> {
        Outputs { overlay, ..self }
    }

    /// Draws what the behavior saw in the message `header` of `slot`. `draw` is called only while overlays are viewed: it must not
    /// change what the behavior proposes. The overlay of a call belongs to one message, the last one that it draws over.
    pub fn draw<M: Message>(&mut self, slot: &Slot<M>, header: &M, draw: impl FnOnce(&mut Overlay)) {
        if let Some(overlay) = &mut self.overlay {
            overlay.begin(slot.name, header.stamp());
            draw(overlay);
        }
    }

    /// Publishes a header and its items on output `name`.
    ///
    /// # Errors
    /// See [`PublishError`].
    pub fn publish<M: Message>(
        &mut self,
        name: &str,
        header: &M,
        items: &[M::Item],
    ) -> Result<(), PublishError> {
        self.sink.publish(
            name,
            &MessageType::of::<M>(),
            bytemuck::bytes_of(header),
            bytemuck::cast_slice(items),
        )
    }

    /// Publishes a message with `len` items that `fill` writes directly into shared memory.
    ///
    /// # Errors
    /// See [`PublishError`].
    pub fn publish_in_place<M: Message>(
        &mut self,
        name: &str,
        header: &M,
        len: usize,
        mut fill: impl FnMut(&mut [M::Item]),
    ) -> Result<(), PublishError> {
        let filled = self.try_publish_in_place(name, header, len, |items| {
            fill(items);
            Ok::<(), std::convert::Infallible>(())
        })?;
        let Ok(()) = filled;
        Ok(())
    }

    /// Publishes a message with `len` items that `fill` writes directly into shared memory, or nothing if `fill` fails. Returns the
    /// result of `fill`.
    ///
    /// # Errors
    /// See [`PublishError`].
    pub fn try_publish_in_place<M: Message, E>(
        &mut self,
        name: &str,
        header: &M,
        len: usize,
        mut fill: impl FnMut(&mut [M::Item]) -> Result<(), E>,
    ) -> Result<Result<(), E>, PublishError> {
        let bytes = len.saturating_mul(size_of::<M::Item>());
        let mut filled = Ok(());
        self.sink.publish_in_place(
            name,
            &MessageType::of::<M>(),
            bytemuck::bytes_of(header),
            bytes,
            &mut |bytes| match bytemuck::try_cast_slice_mut(bytes) {
                Ok(items) => {
                    filled = fill(items);
                    if filled.is_ok() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
                }
                // Shared memory may hold data of an earlier message: do not publish it.
                Err(_) => ControlFlow::Break(()),
            },
        )?;
        Ok(filled)
    }
}
