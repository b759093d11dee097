//! The messages: every type that is sent over the bus.
//!
//! A message is a fixed header and, for lists, a slice of items behind it. Headers and items are plain old data without
//! padding: every bit pattern is a valid value, so a faulty sender cannot put anything into shared memory that is
//! undefined to read. Codes are checked by accessors that return `None` for an undefined value.
//!
//! Type names are versioned: a change of layout needs a new version. Fields named `reserved` fill gaps and are zero.
//! Stamps are [`Time`] values; results derived from sensor data have two, `stamp_ns` (the time that the result is valid
//! for) and `evidence_ns` (the stamp of the oldest sensor data behind it).

mod call;
mod command;
mod declared;
mod frame;
mod from_json;
mod layout;
mod operator;
mod overlay;
mod perception;
mod plugin;
mod proposal;
mod registry;
mod sensors;
mod text;
mod to_json;
mod view;

pub use crate::geometry::{Axis, Twist};
pub use call::{CallEvent, CallHeader, CallInput, Heard, HeardHeader, HeardKind, state_hash};
pub use command::{Command, Control, ControlKind, DecisionHeader, Mode, Outcome, Verdict};
pub use declared::{FieldDeclaration, FieldType, MessageDeclaration};
pub use layout::{Field, HasLayout, Layout, StructLayout};
pub use operator::{RetuneHeader, RetuneOutcome, RetuneStep, RetunedHeader, Stick};
pub use overlay::{MarkKind, OverlayHeader, OverlayMark};
pub use perception::{
    Corridor, FreeDirection, FreeSpaceHeader, Goal, Intersection, Landmark, LandmarksHeader, Obstacle,
    ObstaclesHeader, PathHeader, PathPoint, Pose, PoseStatus,
};
pub use plugin::{
    CallBucket, CallsHeader, FailureHeader, Heartbeat, PluginState, Process, ProcessState, ProcessesHeader,
    RobotManifestHeader, SavedStateHeader, WallPoint, WallsHeader,
};
pub use proposal::{Axes, Kind, Proposal, Reason, Sector};
pub use registry::{ALL, MessageType};
pub use sensors::{
    Beam, Bumper, Clock, Encoding, FrameHeader, Imu, NO_ECHO, Odometry, RangeScanHeader, StepPhase,
    StepSignal, Truth,
};
pub use text::{Name, Note, Text};
pub use view::{RawMessage, View};

use bytemuck::Pod;
use serde::{Deserialize, Serialize};

use crate::time::Time;

/// Delivery policy of a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Channel {
    /// Keeps the newest message only; a new subscriber receives it at once.
    Latest,
    /// Queues messages; a subscriber whose queue overflows counts the lost ones.
    Stream,
}

/// A type that is sent over the bus: the header of a message, and the items behind it.
pub trait Message: Pod + Serialize + HasLayout + std::fmt::Debug + 'static {
    /// Element of the list behind the header; [`u8`] for a message without a list.
    type Item: Pod + Serialize + HasLayout + std::fmt::Debug;
    /// Versioned name, such as `yamabico.Odometry.v1`.
    const NAME: &'static str;
    /// Delivery policy of its channels.
    const CHANNEL: Channel;
    /// Returns the time that the message is valid for; for a measurement, the capture time.
    fn stamp(&self) -> Time;
    /// Returns the sequence number, which increases by one with each message; a gap in a stream reveals lost messages.
    fn sequence(&self) -> u64;
    /// True if the items are the bytes of a UTF-8 text.
    const IS_TEXT: bool = false;
    /// Returns the stamp of the oldest sensor data in the message; for a measurement, the capture time.
    fn evidence(&self) -> Time {
        self.stamp()
    }
}

/// Declares the header of a message: `repr(C)`, plain old data, with its versioned name, channel and items.
///
/// A plugin of another program declares a message type of its own in the same way; its crate needs `bytemuck` with the feature
/// `derive`, and `serde` with `derive`. Every field and the type have a doc comment, the fields lie without gaps, and the first two
/// are `stamp_ns` and `sequence`:
///
/// ```
/// use yamabico_core::message::{Message, MessageType};
///
/// yamabico_core::message_type! {
///     /// Concentration of a gas.
///     "acme.Smell.v1" Stream [u8]
///     pub struct Smell {
///         /// Time of the measurement.
///         pub stamp_ns: u64,
///         /// Sequence number.
///         pub sequence: u64,
///         /// Concentration, ppm.
///         pub ppm: f64,
///     }
/// }
///
/// let smell = Smell { stamp_ns: 5, ppm: 0.5, ..Smell::default() };
/// let json = MessageType::of::<Smell>().to_json(bytemuck::bytes_of(&smell), &[]);
/// assert_eq!((Smell::NAME, json["ppm"].as_f64()), ("acme.Smell.v1", Some(0.5)));
/// ```
#[macro_export]
macro_rules! message_type {
    (@text) => { true };
    (@sequence $header:ident) => { $header.sequence };
    (@sequence $header:ident $field:ident) => { $header.$field };
    (
        $(#[doc = $doc:literal])*
        $name:literal $channel:ident [$item:ty] $(evidence $evidence:ident)? $(counted by $sequence:ident)? $(as $text:ident)?
        pub struct $ty:ident { $($body:tt)* }
    ) => {
        $(#[doc = $doc])*
        #[repr(C)]
        #[derive(
            Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable, serde::Serialize,
        )]
        pub struct $ty { $($body)* }

        impl Default for $ty {
            fn default() -> Self {
                bytemuck::Zeroable::zeroed()
            }
        }

        $crate::struct_layout! { $(#[doc = $doc])* struct $ty { $($body)* } }

        impl $crate::message::Message for $ty {
            type Item = $item;
            const NAME: &'static str = $name;
            const CHANNEL: $crate::message::Channel = $crate::message::Channel::$channel;
            $(const IS_TEXT: bool = $crate::message_type!(@$text);)?
            fn stamp(&self) -> $crate::time::Time {
                $crate::time::Time(self.stamp_ns)
            }
            fn sequence(&self) -> u64 {
                $crate::message_type!(@sequence self $($sequence)?)
            }
            $(fn evidence(&self) -> $crate::time::Time {
                $crate::time::Time(self.$evidence)
            })?
        }
    };
}
pub(crate) use message_type as message;

/// Declares an item of a list: `repr(C)`, plain old data. See [`message_type`](crate::message_type).
#[macro_export]
macro_rules! message_item {
    ($(#[doc = $doc:literal])* pub struct $ty:ident { $($body:tt)* }) => {
        $(#[doc = $doc])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable, serde::Serialize)]
        pub struct $ty { $($body)* }

        $crate::struct_layout! { $(#[doc = $doc])* struct $ty { $($body)* } }

        impl Default for $ty {
            fn default() -> Self {
                bytemuck::Zeroable::zeroed()
            }
        }
    };
}
pub(crate) use message_item as item;

/// Declares an enum that is sent as a `u32` code.
macro_rules! code_enum {
    ($(#[$meta:meta])* pub enum $ty:ident { $($(#[$vmeta:meta])* $variant:ident = $code:literal $text:literal,)* }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize)]
        #[repr(u32)]
        pub enum $ty { $($(#[$vmeta])* $variant = $code,)* }

        impl $ty {
            /// All values.
            pub const ALL: &'static [$ty] = &[$($ty::$variant),*];

            /// Code in messages.
            pub const fn code(self) -> u32 {
                self as u32
            }

            /// Returns the value with this code, or `None` if the code is undefined.
            pub const fn from_code(code: u32) -> Option<$ty> {
                match code { $($code => Some($ty::$variant),)* _ => None }
            }

            /// Name for tables and logs, lower case.
            pub const fn as_str(self) -> &'static str {
                match self { $($ty::$variant => $text,)* }
            }
        }

        impl std::fmt::Display for $ty {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(self.as_str())
            }
        }
    };
}
pub(crate) use code_enum;
