//! Outputs of one plugin: a publisher for each of them.

use std::ops::ControlFlow;

use crate::bus::{Bus, BusError, RawPublisher};
use yamabico_core::behavior::{OutputSink, PublishError};
use yamabico_core::message::MessageType;

/// Publishers of a plugin's outputs, by name.
pub(crate) struct OutputPorts {
    ports: Vec<(String, MessageType, RawPublisher)>,
}

impl OutputPorts {
    /// Opens a publisher for each (output, topic, type).
    ///
    /// # Errors
    /// A topic that does not exist, carries another type or has its maximum number of publishers.
    pub fn open(bus: &Bus, outputs: &[(String, String, MessageType)]) -> Result<OutputPorts, BusError> {
        let ports = outputs.iter().map(|(output, topic, message)| {
            Ok((output.clone(), *message, bus.publisher_raw(topic, message)?))
        });
        Ok(OutputPorts { ports: ports.collect::<Result<_, BusError>>()? })
    }

    fn find(&mut self, name: &str, message: &MessageType) -> Result<&mut RawPublisher, PublishError> {
        let port = self.ports.iter_mut().find(|(output, ..)| output == name);
        let (_, declared, publisher) = port.ok_or_else(|| PublishError::NoSuchOutput(name.to_owned()))?;
        PublishError::check_type(name, declared, message)?;
        Ok(publisher)
    }
}

impl OutputSink for OutputPorts {
    fn publish(
        &mut self,
        name: &str,
        message: &MessageType,
        header: &[u8],
        items: &[u8],
    ) -> Result<(), PublishError> {
        self.find(name, message)?.publish(header, items).map_err(|error| refused(name, error))
    }

    fn publish_in_place(
        &mut self,
        name: &str,
        message: &MessageType,
        header: &[u8],
        len: usize,
        fill: &mut dyn FnMut(&mut [u8]) -> ControlFlow<()>,
    ) -> Result<(), PublishError> {
        self.find(name, message)?
            .try_publish_in_place(header, len, fill)
            .map_err(|error| refused(name, error))
    }
}

fn refused(output: &str, error: BusError) -> PublishError {
    PublishError::Refused { output: output.to_owned(), reason: error.to_string() }
}
