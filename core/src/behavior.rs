//! The interface of a behavior: sensor messages in, one motion proposal out.
//!
//! Contract of [`Behavior::propose`]:
//! - It reads no clock ([`Inputs::now`] is the current time), never sleeps, starts no threads and logs nothing.
//! - It allocates nothing after the first calls.
//! - A perception without a result is a value: [`Proposal::abstain`] with a reason. A panic is a bug: the host catches
//!   it and restarts the behavior.
//! - A failure never raises the speed.

mod setup;

use std::borrow::Cow;
use std::marker::PhantomData;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde_json::Value as Json;

pub use setup::Setup;
pub use yamabico_parameters::ParameterError;
use yamabico_parameters::{FileKind, read, schema_of};

use crate::message::{Axes, Message, MessageType, Proposal, RawMessage, View};
use crate::time::Time;

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

/// A typed input of a behavior.
#[derive(Debug)]
pub struct Slot<M> {
    /// Key under `inputs` in the task file.
    pub name: &'static str,
    /// Purpose, shown by `yamabico describe`.
    pub summary: &'static str,
    required: bool,
    preferred: bool,
    message: PhantomData<fn() -> M>,
}

impl<M: Message> Slot<M> {
    /// Creates a slot that every task must connect.
    pub const fn required(name: &'static str, summary: &'static str) -> Slot<M> {
        Slot { name, summary, required: true, preferred: false, message: PhantomData }
    }

    /// Creates a slot that a task may leave unconnected.
    pub const fn optional(name: &'static str, summary: &'static str) -> Slot<M> {
        Slot { name, summary, required: false, preferred: false, message: PhantomData }
    }

    /// Creates an optional slot that is connected by itself where only one source fits: the behavior is better with it.
    pub const fn preferred(name: &'static str, summary: &'static str) -> Slot<M> {
        Slot { name, summary, required: false, preferred: true, message: PhantomData }
    }

    /// Description without the Rust type.
    pub const fn info(&self) -> SlotInfo {
        SlotInfo {
            name: Cow::Borrowed(self.name),
            summary: Cow::Borrowed(self.summary),
            required: self.required,
            preferred: self.preferred,
            message: MessageType::of::<M>(),
        }
    }
}

/// Description of a [`Slot`] or of an output.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SlotInfo {
    /// Key under `inputs` in the task file.
    pub name: Cow<'static, str>,
    /// Purpose, shown by `yamabico describe`.
    pub summary: Cow<'static, str>,
    /// True if the task file must connect it.
    pub required: bool,
    /// True if an optional input is connected to the only source that fits, unless the task file names one.
    pub preferred: bool,
    /// Input slots.
    pub message: MessageType,
}

/// Source of one slot's messages: the bus, a recording or a test.
pub trait SlotSource {
    /// Name of the slot.
    fn name(&self) -> &str;
    /// Number of messages held, oldest first. The newest message is held until a newer one arrives.
    fn len(&self) -> usize;
    /// Returns true if no message has ever arrived.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Number of held messages, counted from the newest, that arrived since the last call of `propose`.
    fn fresh(&self) -> usize;
    /// Number of messages lost to buffer overflow since the last call of `propose`.
    fn lost(&self) -> u64;
    /// Returns the held message at `index` (0 is the oldest), or `None` if `index` is out of range.
    fn get(&self, index: usize) -> Option<RawMessage<'_>>;
}

/// Sources of all slots of one behavior.
pub trait InputSource {
    /// Returns the source at `index`, or `None` if `index` is out of range.
    fn slot(&self, index: usize) -> Option<&dyn SlotSource>;
}

/// Input messages of one call of [`Behavior::propose`].
pub struct Inputs<'a> {
    now: Time,
    source: &'a dyn InputSource,
}

impl<'a> Inputs<'a> {
    /// Creates the inputs of a call at time `now`.
    pub fn new(now: Time, source: &'a dyn InputSource) -> Inputs<'a> {
        Inputs { now, source }
    }

    /// Current time: the time of this call.
    pub fn now(&self) -> Time {
        self.now
    }

    /// Returns the newest message of a slot regardless of its age, or `None` if none has arrived or its size is wrong.
    pub fn latest<M: Message>(&self, slot: &Slot<M>) -> Option<View<'a, M>> {
        let source = self.find(slot.name)?;
        View::of(source.get(source.len().checked_sub(1)?)?)
    }

    /// Returns true if a message arrived in the slot since the last call.
    pub fn is_fresh<M: Message>(&self, slot: &Slot<M>) -> bool {
        self.find(slot.name).is_some_and(|source| source.fresh() > 0)
    }

    /// Returns the messages of a slot that arrived since the last call, oldest first.
    pub fn fresh<M: Message>(&self, slot: &Slot<M>) -> impl Iterator<Item = View<'a, M>> + use<'a, M> {
        let source = self.find(slot.name);
        let range =
            source.map_or(0..0, |source| source.len() - source.fresh().min(source.len())..source.len());
        range.filter_map(move |index| View::of(source?.get(index)?))
    }

    /// Returns the number of messages of a slot lost to buffer overflow since the last call.
    pub fn lost<M: Message>(&self, slot: &Slot<M>) -> u64 {
        self.find(slot.name).map_or(0, SlotSource::lost)
    }

    fn find(&self, name: &str) -> Option<&'a dyn SlotSource> {
        (0..).map_while(|index| self.source.slot(index)).find(|source| source.name() == name)
    }
}

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

    /// Publishes a message whose `len` bytes of items are written in place by `fill`.
    ///
    /// # Errors
    /// Same as [`OutputSink::publish`].
    fn publish_in_place(
        &mut self,
        name: &str,
        message: &MessageType,
        header: &[u8],
        len: usize,
        fill: &mut dyn FnMut(&mut [u8]),
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
}

impl<'a> Outputs<'a> {
    /// Creates outputs that publish to `sink`.
    pub fn new(sink: &'a mut dyn OutputSink) -> Outputs<'a> {
        Outputs { sink }
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
        let bytes = len.saturating_mul(size_of::<M::Item>());
        self.sink.publish_in_place(
            name,
            &MessageType::of::<M>(),
            bytemuck::bytes_of(header),
            bytes,
            &mut |bytes| match bytemuck::try_cast_slice_mut(bytes) {
                Ok(items) => fill(items),
                // Shared memory may hold data of an earlier message: do not publish it.
                Err(_) => bytes.fill(0),
            },
        )
    }
}
