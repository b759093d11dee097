//! What a program tells of the behaviour that it is, before it runs.

use serde::{Deserialize, Serialize};
use serde_json::Value as Json;

use super::charge::PROTOCOL;
use crate::behavior::{BehaviorPlugin, BuildError, SlotInfo};
use crate::message::{Axes, MessageType};

/// The argument that asks for a description.
pub const DESCRIBE: &str = "--describe";

/// A behaviour in a program of its own, as JSON on standard output.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Description {
    /// The protocol that the program speaks.
    pub protocol: u32,
    /// The behaviour's name.
    pub name: String,
    /// What it does, in one sentence.
    pub summary: String,
    /// Every axis that it may ever claim as a drive, such as `linear+angular`; `none` for one that only halts or limits.
    pub claims: Axes,
    /// What it takes.
    pub inputs: Vec<SlotDescription>,
    /// What it publishes besides proposals.
    pub outputs: Vec<SlotDescription>,
    /// JSON Schema of its parameters.
    pub parameters: Json,
}

/// An input or an output.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SlotDescription {
    /// Its name.
    pub name: String,
    /// What it is for.
    pub summary: String,
    /// Whether it must be plugged in.
    pub required: bool,
    /// What passes, such as `yamabico.Odometry.v1`.
    pub message: String,
}

impl Description {
    /// That of a behaviour of this program.
    pub fn of(plugin: &BehaviorPlugin) -> Description {
        let slots = |slots: &[SlotInfo]| slots.iter().map(SlotDescription::of).collect();
        Description {
            protocol: PROTOCOL,
            name: plugin.name.to_owned(),
            summary: plugin.summary.to_owned(),
            claims: plugin.claims,
            inputs: slots(plugin.inputs),
            outputs: slots(plugin.outputs),
            parameters: plugin.parameters(),
        }
    }

    /// The behaviour as one that this program can compose, though not build. What it says is kept until the program ends.
    ///
    /// # Errors
    /// Another protocol, or messages of other versions than this program's, with both versions named.
    pub fn plugin(self) -> Result<BehaviorPlugin, String> {
        if self.protocol != PROTOCOL {
            let told = self.protocol;
            return Err(format!("it speaks version {told} of the protocol, this program version {PROTOCOL}"));
        }
        let keep = |text: String| -> &'static str { Box::leak(text.into_boxed_str()) };
        let slots = |slots: Vec<SlotDescription>| -> Result<&'static [SlotInfo], String> {
            let known = slots.into_iter().map(|slot| {
                let message = MessageType::find(&slot.message);
                let message = *message
                    .ok_or_else(|| format!("`{}`: {}", slot.name, MessageType::unknown(&slot.message)))?;
                let SlotDescription { name, summary, required, .. } = slot;
                Ok(SlotInfo { name: keep(name), summary: keep(summary), required, message })
            });
            Ok(Box::leak(known.collect::<Result<Box<[_]>, String>>()?))
        };
        Ok(BehaviorPlugin {
            name: keep(self.name),
            summary: keep(self.summary),
            inputs: slots(self.inputs)?,
            outputs: slots(self.outputs)?,
            files: &[],
            claims: self.claims,
            schema: schemars::Schema::default,
            told: Some(Box::leak(Box::new(self.parameters))),
            build: |_, _| Err(BuildError::new("exec", "it is a program of its own: run it with --live")),
        })
    }
}

impl SlotDescription {
    fn of(slot: &SlotInfo) -> SlotDescription {
        SlotDescription {
            name: slot.name.to_owned(),
            summary: slot.summary.to_owned(),
            required: slot.required,
            message: slot.message.name.to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn described() -> Description {
        let slot = SlotDescription {
            name: "wheels".into(),
            summary: "Where it is.".into(),
            required: true,
            message: "yamabico.Odometry.v1".into(),
        };
        Description {
            protocol: PROTOCOL,
            name: "other".into(),
            summary: "Does something.".into(),
            claims: Axes::PLANAR,
            inputs: vec![slot],
            outputs: Vec::new(),
            parameters: serde_json::json!({ "type": "object" }),
        }
    }

    #[test]
    fn a_description_crosses_as_json() {
        let text = serde_json::to_string(&described()).unwrap();
        let told: Description = serde_json::from_str(&text).unwrap();
        let plugin = told.plugin().unwrap();
        assert_eq!((plugin.name, plugin.inputs[0].name, plugin.claims), ("other", "wheels", Axes::PLANAR));
        assert_eq!(Description::of(&plugin), described());
    }

    #[test]
    fn other_versions_are_refused_and_both_are_named() {
        let mut other = described();
        other.inputs[0].message = "yamabico.Odometry.v7".into();
        let told = other.plugin().unwrap_err();
        assert!(told.contains("Odometry.v7") && told.contains("Odometry.v1"), "{told}");
        let told = Description { protocol: 9, ..described() }.plugin().unwrap_err();
        assert!(told.contains("version 9") && told.contains(&format!("version {PROTOCOL}")), "{told}");
    }
}
