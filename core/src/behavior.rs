//! The interface of a behavior: sensor messages in, one motion proposal out.
//!
//! Contract of [`Behavior::propose`]:
//! - It reads no clock ([`Inputs::now`] is the current time), never sleeps, starts no threads and logs nothing.
//! - It allocates nothing after the first calls.
//! - A perception without a result is a value: [`Proposal::abstain`] with a reason. A panic is a bug: the host catches
//!   it and restarts the behavior.
//! - A failure never raises the speed.

mod inputs;
mod outputs;
mod setup;

use std::marker::PhantomData;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde_json::Value as Json;

pub use inputs::{InputSource, Inputs, Slot, SlotInfo, SlotSource};
pub use outputs::{OutputSink, Outputs, PublishError};
pub use setup::Setup;
pub use yamabico_parameters::ParameterError;
use yamabico_parameters::{FileKind, read, schema_of};

use crate::message::{Axes, Proposal};

/// Maximum size of a behavior's saved state, bytes.
pub const MAX_SAVED_STATE_BYTES: usize = 16 * 1024;

/// A module that maps sensor data to a proposed motion.
pub trait Behavior: Send {
    /// Proposes a motion from the current inputs, and publishes other results, such as a pose, to `outputs`.
    fn propose(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) -> Proposal;

    /// Appends the state that a restarted instance needs to continue from here to `state`: JSON, at most
    /// [`MAX_SAVED_STATE_BYTES`]. Called after each [`propose`](Behavior::propose). A behavior that depends on its
    /// current inputs only saves nothing.
    fn save_state(&self, _state: &mut Vec<u8>) {}

    /// Continues from the state that an earlier instance saved. Called at most once, before the first
    /// [`propose`](Behavior::propose). Ignores invalid state.
    fn restore_state(&mut self, _state: &[u8]) {}
}

/// A behavior that task files can name.
pub trait Plugin: Behavior + Sized + 'static {
    /// Parameters: the keys of the behavior's table in the task file, without those common to all behaviors.
    type Config: DeserializeOwned + JsonSchema;
    /// Name in task files, kebab-case.
    const NAME: &'static str;
    /// Purpose, one sentence.
    const SUMMARY: &'static str;
    /// Input slots.
    const INPUTS: &'static [SlotInfo];
    /// Outputs besides proposals.
    const OUTPUTS: &'static [SlotInfo] = &[];
    /// Kinds of TOML file that its parameters name, such as maps; they are checked together with the task.
    const FILES: &'static [FileKind] = &[];
    /// Axes that it may ever claim with a drive proposal; none for a behavior that only halts or limits.
    const CLAIMS: Axes;

    /// Builds the behavior from its parameters for the robot described by `setup`.
    ///
    /// # Errors
    /// Parameters that contradict each other or do not fit the robot, with the key to change.
    fn new(config: Self::Config, setup: &Setup) -> Result<Self, ParameterError>;

    /// Returns what people should know about valid parameters before the robot starts, such as a limit that they
    /// imply: a text for each.
    fn notes(_config: &Self::Config, _setup: &Setup) -> Vec<String> {
        Vec::new()
    }
}

/// Static description of a behavior.
#[derive(Clone, Debug)]
pub struct BehaviorInfo {
    /// Name in task files, kebab-case.
    pub name: String,
    /// Purpose, one sentence.
    pub summary: String,
    /// Input slots.
    pub inputs: Vec<SlotInfo>,
    /// Outputs besides proposals.
    pub outputs: Vec<SlotInfo>,
    /// Kinds of TOML file that its parameters name.
    pub files: Vec<FileKind>,
    /// Axes that it may ever claim with a drive proposal; none for a behavior that only halts or limits.
    pub claims: Axes,
    /// JSON Schema of the parameters.
    pub parameters: Json,
}

/// A kind of behavior that task files can name: its description and its constructor.
pub trait BehaviorFactory: Send + Sync {
    /// Static description of the behaviors that this factory builds.
    fn info(&self) -> &BehaviorInfo;

    /// Builds a behavior from parameters that passed the schema check.
    ///
    /// # Errors
    /// Parameters that contradict each other or do not fit the robot, with the key to change.
    fn build(&self, parameters: &toml::Table, setup: &Setup) -> Result<Box<dyn Behavior>, ParameterError>;

    /// Returns what people should know about valid parameters; see [`Plugin::notes`].
    fn notes(&self, _parameters: &toml::Table, _setup: &Setup) -> Vec<String> {
        Vec::new()
    }
}

impl std::fmt::Debug for dyn BehaviorFactory {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.info().name)
    }
}

/// Returns the factory of behavior `B`.
#[must_use]
pub fn factory<B: Plugin>() -> Arc<dyn BehaviorFactory> {
    let info = BehaviorInfo {
        name: B::NAME.to_owned(),
        summary: B::SUMMARY.to_owned(),
        inputs: B::INPUTS.to_vec(),
        outputs: B::OUTPUTS.to_vec(),
        files: B::FILES.to_vec(),
        claims: B::CLAIMS,
        parameters: schema_of::<B::Config>(),
    };
    Arc::new(Factory::<B> { info, behavior: PhantomData })
}

struct Factory<B> {
    info: BehaviorInfo,
    behavior: PhantomData<fn() -> B>,
}

impl<B: Plugin> BehaviorFactory for Factory<B> {
    fn info(&self) -> &BehaviorInfo {
        &self.info
    }

    fn build(&self, parameters: &toml::Table, setup: &Setup) -> Result<Box<dyn Behavior>, ParameterError> {
        Ok(Box::new(B::new(read(parameters)?, setup)?))
    }

    fn notes(&self, parameters: &toml::Table, setup: &Setup) -> Vec<String> {
        read(parameters).map_or_else(|_| Vec::new(), |config| B::notes(&config, setup))
    }
}
