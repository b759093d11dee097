//! What a program tells of the behavior that it is, before it runs.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::Value as Json;

use super::charge::PROTOCOL;
use yamabico_core::behavior::{Behavior, BehaviorFactory, BehaviorInfo, BuildError, Setup, SlotInfo};
use yamabico_core::message::{Axes, MessageType};

/// The argument that asks for a description.
pub const DESCRIBE: &str = "--describe";

/// A behavior in a program of its own, as JSON on standard output.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Description {
    /// The protocol that the program speaks.
    pub protocol: u32,
    /// The behavior's name.
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
    /// That of a behavior of this program.
    pub fn of(behavior: &BehaviorInfo) -> Description {
        let slots = |slots: &[SlotInfo]| slots.iter().map(SlotDescription::of).collect();
        Description {
            protocol: PROTOCOL,
            name: behavior.name.clone(),
            summary: behavior.summary.clone(),
            claims: behavior.claims,
            inputs: slots(&behavior.inputs),
            outputs: slots(&behavior.outputs),
            parameters: behavior.parameters.clone(),
        }
    }

    /// The behavior as one that this program can compose, though not build.
    ///
    /// # Errors
    /// Another protocol, or messages of other versions than this program's, with both versions named.
    pub fn factory(self) -> Result<Arc<dyn BehaviorFactory>, String> {
        check_protocol(self.protocol)?;
        let slots = |slots: Vec<SlotDescription>| slots.into_iter().map(SlotDescription::info).collect();
        let inputs = slots(self.inputs)?;
        let outputs: Result<_, String> = slots(self.outputs);
        let info = BehaviorInfo {
            name: self.name,
            summary: self.summary,
            inputs,
            outputs: outputs?,
            files: Vec::new(),
            claims: self.claims,
            parameters: self.parameters,
        };
        Ok(Arc::new(ExternalBehavior { info }))
    }
}

/// Refuses another version of the protocol than this program's.
pub(super) fn check_protocol(version: u32) -> Result<(), String> {
    if version == PROTOCOL {
        return Ok(());
    }
    Err(format!("it speaks version {version} of the protocol, this program version {PROTOCOL}"))
}

/// A behavior in a program of its own.
struct ExternalBehavior {
    info: BehaviorInfo,
}

impl BehaviorFactory for ExternalBehavior {
    fn info(&self) -> &BehaviorInfo {
        &self.info
    }

    fn build(&self, _: &toml::Table, _: &Setup) -> Result<Box<dyn Behavior>, BuildError> {
        Err(BuildError::new("exec", "it is a program of its own: run it with --live"))
    }
}

impl SlotDescription {
    fn of(slot: &SlotInfo) -> SlotDescription {
        SlotDescription {
            name: slot.name.clone().into_owned(),
            summary: slot.summary.clone().into_owned(),
            required: slot.required,
            message: slot.message.name.to_owned(),
        }
    }

    fn info(self) -> Result<SlotInfo, String> {
        let SlotDescription { name, summary, required, message } = self;
        let known = MessageType::find(&message);
        let message = *known.ok_or_else(|| format!("`{name}`: {}", MessageType::unknown(&message)))?;
        Ok(SlotInfo { name: name.into(), summary: summary.into(), required, message })
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
        let factory = told.factory().unwrap();
        let info = factory.info();
        assert_eq!((&*info.name, &*info.inputs[0].name, info.claims), ("other", "wheels", Axes::PLANAR));
        assert_eq!(Description::of(info), described());
    }

    #[test]
    fn other_versions_are_refused_and_both_are_named() {
        let mut other = described();
        other.inputs[0].message = "yamabico.Odometry.v7".into();
        let told = other.factory().unwrap_err();
        assert!(told.contains("Odometry.v7") && told.contains("Odometry.v1"), "{told}");
        let told = Description { protocol: 9, ..described() }.factory().unwrap_err();
        assert!(told.contains("version 9") && told.contains(&format!("version {PROTOCOL}")), "{told}");
    }
}
