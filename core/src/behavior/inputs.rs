//! Inputs of a behavior: its typed slots, and the messages in them.

use std::borrow::Cow;
use std::marker::PhantomData;

use crate::message::{Message, MessageType, RawMessage, View};
use crate::time::Time;

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

/// Input messages of one call of [`Behavior::propose`](super::Behavior::propose).
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
