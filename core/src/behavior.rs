//! The seam that a behavior implements: sensors in, one proposal out.
//!
//! The contract of [`Behavior::propose`]:
//! - it reads no clock ([`Inputs::now`] is the time), never sleeps, starts no threads, logs nothing;
//! - it allocates nothing after warm-up;
//! - "nothing seen" is a value: [`Proposal::abstain`] with a reason; a panic is a bug, caught at the boundary;
//! - a failure never raises the speed.

mod setup;

use std::borrow::Cow;
use std::marker::PhantomData;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde_json::Value as Json;

pub use setup::Setup;
pub use yamabico_parameters::BuildError;
use yamabico_parameters::{FileKind, read, schema_of};

use crate::message::{Axes, Message, MessageType, Proposal, RawMessage, View};
use crate::time::Time;

/// The longest memory of a behavior, bytes.
pub const MAX_MEMORY_BYTES: usize = 16 * 1024;

/// A module that maps what it sees to a proposed motion.
pub trait Behavior: Send {
    /// Looks at the inputs once and proposes. What else it found out goes to `outputs`.
    fn propose(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) -> Proposal;

    /// Appends to `memory` what a successor must know to go on where this one stops, should it die after this call: JSON, at most
    /// [`MAX_MEMORY_BYTES`]. Nothing, for one that knows only what its inputs tell.
    fn remember(&self, _memory: &mut Vec<u8>) {}

    /// Goes on where a predecessor stopped that remembered this. Called at most once, before the first
    /// [`propose`](Behavior::propose); what makes no sense is not to be believed.
    fn recall(&mut self, _memory: &[u8]) {}
}

/// A behavior that can be composed in a task file.
pub trait Plugin: Behavior + Sized + 'static {
    /// Its parameters: the keys of its table in the task file beyond those that every behavior has.
    type Config: DeserializeOwned + JsonSchema;
    /// Name in task files, kebab-case.
    const NAME: &'static str;
    /// What it does, in one sentence.
    const SUMMARY: &'static str;
    /// What it takes.
    const INPUTS: &'static [SlotInfo];
    /// What it publishes besides proposals.
    const OUTPUTS: &'static [SlotInfo] = &[];
    /// The TOML files that its keys name, such as maps; they are checked with the task.
    const FILES: &'static [FileKind] = &[];
    /// Every axis that it may ever claim as a drive; none for one that only halts or limits.
    const CLAIMS: Axes;

    /// Builds it from its parameters for the given robot.
    ///
    /// # Errors
    /// Parameters that contradict each other or the robot, with the key to change.
    fn new(config: Self::Config, setup: &Setup) -> Result<Self, BuildError>;
}

/// Everything known of a behavior without running it.
#[derive(Clone, Debug)]
pub struct BehaviorInfo {
    /// Name in task files, kebab-case.
    pub name: String,
    /// Its purpose, in one sentence.
    pub summary: String,
    /// Its inputs.
    pub inputs: Vec<SlotInfo>,
    /// Its outputs besides proposals.
    pub outputs: Vec<SlotInfo>,
    /// The TOML files that its parameters name.
    pub files: Vec<FileKind>,
    /// Every axis that it may ever claim as a drive; none for one that only halts or limits.
    pub claims: Axes,
    /// JSON Schema of its parameters.
    pub parameters: Json,
}

/// A kind of behavior that task files can name: its description, and a way to build one.
pub trait BehaviorFactory: Send + Sync {
    /// The description.
    fn info(&self) -> &BehaviorInfo;

    /// Builds a behavior from its parameters, which must have passed the schema.
    ///
    /// # Errors
    /// Parameters that contradict each other or the robot, with the key to change.
    fn build(&self, parameters: &toml::Table, setup: &Setup) -> Result<Box<dyn Behavior>, BuildError>;
}

impl std::fmt::Debug for dyn BehaviorFactory {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.info().name)
    }
}

/// The factory of the behavior `B`.
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

    fn build(&self, parameters: &toml::Table, setup: &Setup) -> Result<Box<dyn Behavior>, BuildError> {
        Ok(Box::new(B::new(read(parameters)?, setup)?))
    }
}

/// A typed place that a message can be plugged into.
#[derive(Debug)]
pub struct Slot<M> {
    /// Key under `inputs` in the task file.
    pub name: &'static str,
    /// What it is for.
    pub summary: &'static str,
    required: bool,
    message: PhantomData<fn() -> M>,
}

impl<M: Message> Slot<M> {
    /// A slot that the task file must fill.
    pub const fn required(name: &'static str, summary: &'static str) -> Slot<M> {
        Slot { name, summary, required: true, message: PhantomData }
    }

    /// A slot that may stay empty.
    pub const fn optional(name: &'static str, summary: &'static str) -> Slot<M> {
        Slot { name, summary, required: false, message: PhantomData }
    }

    /// Its description without the Rust type.
    pub const fn info(&self) -> SlotInfo {
        SlotInfo {
            name: Cow::Borrowed(self.name),
            summary: Cow::Borrowed(self.summary),
            required: self.required,
            message: MessageType::of::<M>(),
        }
    }
}

/// The description of a [`Slot`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SlotInfo {
    /// Key under `inputs` in the task file.
    pub name: Cow<'static, str>,
    /// What it is for.
    pub summary: Cow<'static, str>,
    /// Whether the task file must fill it.
    pub required: bool,
    /// What it takes.
    pub message: MessageType,
}

/// Where the messages of one slot come from: the bus, a recording, or a test.
pub trait SlotSource {
    /// The slot's name.
    fn name(&self) -> &str;
    /// Messages at hand, oldest first; the newest one stays at hand until a newer one arrives.
    fn len(&self) -> usize;
    /// Whether nothing has ever arrived.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// How many of them, counted from the newest, arrived since the last call of `propose`.
    fn fresh(&self) -> usize;
    /// Messages lost by overflow since the last call of `propose`.
    fn lost(&self) -> u64;
    /// The message at `index`, oldest first; `None` beyond [`SlotSource::len`].
    fn get(&self, index: usize) -> Option<RawMessage<'_>>;
}

/// All slots of one behavior.
pub trait InputSource {
    /// The slot at `index`; `None` beyond the last.
    fn slot(&self, index: usize) -> Option<&dyn SlotSource>;
}

/// What a behavior sees in one call.
pub struct Inputs<'a> {
    now: Time,
    source: &'a dyn InputSource,
}

impl<'a> Inputs<'a> {
    /// The slots of `source` at the instant `now`.
    pub fn new(now: Time, source: &'a dyn InputSource) -> Inputs<'a> {
        Inputs { now, source }
    }

    /// The time of this call.
    pub fn now(&self) -> Time {
        self.now
    }

    /// The newest message of a slot, however old; `None` where none ever arrived or its bytes do not fit.
    pub fn latest<M: Message>(&self, slot: &Slot<M>) -> Option<View<'a, M>> {
        let source = self.find(slot.name)?;
        View::of(source.get(source.len().checked_sub(1)?)?)
    }

    /// Whether something arrived in a slot since the last call.
    pub fn is_fresh<M: Message>(&self, slot: &Slot<M>) -> bool {
        self.find(slot.name).is_some_and(|source| source.fresh() > 0)
    }

    /// The messages of a slot that arrived since the last call, oldest first.
    pub fn fresh<M: Message>(&self, slot: &Slot<M>) -> impl Iterator<Item = View<'a, M>> + use<'a, M> {
        let source = self.find(slot.name);
        let range =
            source.map_or(0..0, |source| source.len() - source.fresh().min(source.len())..source.len());
        range.filter_map(move |index| View::of(source?.get(index)?))
    }

    /// Messages of a slot lost by overflow since the last call.
    pub fn lost<M: Message>(&self, slot: &Slot<M>) -> u64 {
        self.find(slot.name).map_or(0, SlotSource::lost)
    }

    fn find(&self, name: &str) -> Option<&'a dyn SlotSource> {
        (0..).map_while(|index| self.source.slot(index)).find(|source| source.name() == name)
    }
}

/// Where the messages that a plugin publishes go.
pub trait OutputSink {
    /// Publishes a whole message on the output `name`.
    ///
    /// # Errors
    /// No such output, another type, too many items, or a bus that refused.
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
    /// As [`OutputSink::publish`].
    fn publish_in_place(
        &mut self,
        name: &str,
        message: &MessageType,
        header: &[u8],
        len: usize,
        fill: &mut dyn FnMut(&mut [u8]),
    ) -> Result<(), PublishError>;
}

/// A message that could not be published.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PublishError {
    /// The plugin did not declare it, or nobody asked for it.
    #[error("there is no output `{0}`")]
    NoSuchOutput(String),
    /// The output carries another type.
    #[error("output `{output}` carries {expected}, not {actual}")]
    WrongType {
        /// The output.
        output: String,
        /// What it carries.
        expected: &'static str,
        /// What was to be published.
        actual: &'static str,
    },
    /// The list is longer than the channel was opened for.
    #[error("output `{output}` holds at most {most} bytes of items, not {len}")]
    TooLong {
        /// The output.
        output: String,
        /// What fits.
        most: usize,
        /// What was to be published.
        len: usize,
    },
    /// The bus refused.
    #[error("output `{output}`: {reason}")]
    Refused {
        /// The output.
        output: String,
        /// Why.
        reason: String,
    },
}

/// What a plugin may publish into.
pub struct Outputs<'a> {
    sink: &'a mut dyn OutputSink,
}

impl<'a> Outputs<'a> {
    /// Outputs that end in `sink`.
    pub fn new(sink: &'a mut dyn OutputSink) -> Outputs<'a> {
        Outputs { sink }
    }

    /// Publishes a header and its items on the output `name`.
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

    /// Publishes a message with `len` items that `fill` writes straight into shared memory.
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
                // Memory that no item fits into must not carry what an earlier message left there.
                Err(_) => bytes.fill(0),
            },
        )
    }
}
