//! Description of a behavior in an external program, printed before it is launched.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::Value as Json;

use super::launch::PROTOCOL;
use yamabico_core::behavior::{Behavior, BehaviorFactory, BehaviorInfo, ParameterError, Setup, SlotInfo};
use yamabico_core::message::{Axes, MessageDeclaration, MessageType};

/// Argument that makes a program print its description.
pub const DESCRIBE: &str = "--describe";

/// Description of a behavior, printed as JSON on standard output.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BehaviorDescription {
    /// Version of the protocol, [`PROTOCOL`].
    pub protocol: u32,
    /// Name of the behavior, kebab-case.
    pub name: String,
    /// One sentence on the behavior.
    pub summary: String,
    /// Axes that its drive proposals may claim, such as `linear+angular`; `none` for a behavior that only halts or
    /// limits.
    pub claims: Axes,
    /// Input slots.
    pub inputs: Vec<SlotDescription>,
    /// Outputs besides proposals.
    pub outputs: Vec<SlotDescription>,
    /// JSON Schema of its parameters.
    pub parameters: Json,
}

/// Description of an input slot or an output.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SlotDescription {
    /// Name of the slot, kebab-case.
    pub name: String,
    /// One sentence on its purpose.
    pub summary: String,
    /// True if the slot must be connected.
    pub required: bool,
    /// True if an optional input is connected to the only source that fits.
    #[serde(default)]
    pub preferred: bool,
    /// Versioned name of its message type, such as `yamabico.Odometry.v1`.
    pub message: String,
    /// Layout of a message type of the program's own; none for one of Yamabico.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub declares: Option<MessageDeclaration>,
}

/// Returns the message type `name`, which the program may declare.
pub(super) fn message_type(name: &str, declares: Option<&MessageDeclaration>) -> Result<MessageType, String> {
    // Another version of a message of Yamabico is no message of its own.
    if let Some(declaration) = declares.filter(|_| !name.starts_with("yamabico.")) {
        if declaration.name != name {
            return Err(format!("declares `{}`, but its message is `{name}`", declaration.name));
        }
        return MessageType::declare(declaration).copied();
    }
    MessageType::find(name).copied().ok_or_else(|| MessageType::unknown(name))
}

/// Returns the declaration of a message type, unless it is one of Yamabico.
pub(super) fn declares(message: &MessageType) -> Option<MessageDeclaration> {
    (!message.is_built_in()).then(|| message.declaration())
}

impl BehaviorDescription {
    /// Describes a behavior of this program.
    pub fn of(behavior: &BehaviorInfo) -> BehaviorDescription {
        let slots = |slots: &[SlotInfo]| slots.iter().map(SlotDescription::of).collect();
        BehaviorDescription {
            protocol: PROTOCOL,
            name: behavior.name.clone(),
            summary: behavior.summary.clone(),
            claims: behavior.claims,
            inputs: slots(&behavior.inputs),
            outputs: slots(&behavior.outputs),
            parameters: behavior.parameters.clone(),
        }
    }

    /// Makes a factory with which a task can be checked; it cannot build the behavior.
    ///
    /// # Errors
    /// The protocol or a message type has another version; the error names both versions.
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

/// Checks that the protocol has this program's version.
pub(super) fn check_protocol(version: u32) -> Result<(), String> {
    if version == PROTOCOL {
        return Ok(());
    }
    Err(format!(
        "the program has version {version} of the protocol, but this one has version {PROTOCOL}: \
         build both from one version"
    ))
}

/// Factory of a behavior in an external program.
struct ExternalBehavior {
    info: BehaviorInfo,
}

impl BehaviorFactory for ExternalBehavior {
    fn info(&self) -> &BehaviorInfo {
        &self.info
    }

    fn build(&self, _: &toml::Table, _: &Setup) -> Result<Box<dyn Behavior>, ParameterError> {
        Err(ParameterError::new("exec", "an external program is not built here, but started"))
    }
}

impl SlotDescription {
    fn of(slot: &SlotInfo) -> SlotDescription {
        SlotDescription {
            name: slot.name.clone().into_owned(),
            summary: slot.summary.clone().into_owned(),
            required: slot.required,
            preferred: slot.preferred,
            message: slot.message.name.to_owned(),
            declares: declares(&slot.message),
        }
    }

    fn info(self) -> Result<SlotInfo, String> {
        let SlotDescription { name, summary, required, preferred, message, declares } = self;
        let message =
            message_type(&message, declares.as_ref()).map_err(|problem| format!("`{name}`: {problem}"))?;
        Ok(SlotInfo { name: name.into(), summary: summary.into(), required, preferred, message })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn described() -> BehaviorDescription {
        let slot = SlotDescription {
            name: "wheels".into(),
            summary: "Position.".into(),
            required: true,
            preferred: false,
            message: "yamabico.Odometry.v1".into(),
            declares: None,
        };
        BehaviorDescription {
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
    fn a_description_survives_as_json() {
        let text = serde_json::to_string(&described()).unwrap();
        let result: BehaviorDescription = serde_json::from_str(&text).unwrap();
        let factory = result.factory().unwrap();
        let info = factory.info();
        assert_eq!((&*info.name, &*info.inputs[0].name, info.claims), ("other", "wheels", Axes::PLANAR));
        assert_eq!(BehaviorDescription::of(info), described());
    }

    #[test]
    fn an_error_names_both_versions() {
        let mut other = described();
        other.inputs[0].message = "yamabico.Odometry.v7".into();
        let result = other.factory().unwrap_err();
        assert!(result.contains("Odometry.v7") && result.contains("Odometry.v1"), "{result}");
        let result = BehaviorDescription { protocol: 9, ..described() }.factory().unwrap_err();
        assert!(result.contains("version 9") && result.contains(&format!("version {PROTOCOL}")), "{result}");
    }
}
