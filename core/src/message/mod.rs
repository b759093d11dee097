//! The types that travel over the bus.
//!
//! A message is a fixed header and, for lists, a slice of items behind it. Headers and items are plain old data without
//! padding: every bit pattern is a valid value, so a hostile or broken sender can put nothing into shared memory that is
//! undefined to read. What a number *means* is checked by accessors that answer `None` for a value outside the vocabulary.
//!
//! Type names carry a version; a change of layout is a new version.

mod command;
mod frame;
mod from_json;
mod layout;
mod operator;
mod perception;
mod plugin;
mod proposal;
mod registry;
mod sensors;
mod text;
mod view;

pub use crate::geometry::{Axis, Twist};
pub use command::{Command, Control, ControlKind, DecisionHeader, Mode, Outcome, Verdict};
pub use layout::{Field, Laid, Layout, StructLayout};
pub use operator::{RetuneHeader, RetuneStep, RetunedHeader, Retuning, Stick};
pub use perception::{
    FreeDirection, FreeSpaceHeader, Goal, Intersection, Landmark, LandmarksHeader, Obstacle, ObstaclesHeader,
    PathHeader, PathPoint, Pose, PoseStatus,
};
pub use plugin::{
    CallBucket, CallsHeader, FailureHeader, Heartbeat, MemoryHeader, PluginState, Process, ProcessState,
    ProcessesHeader, RosterHeader, WallPoint, WallsHeader,
};
pub use proposal::{Axes, Kind, Proposal, Reason, Sector};
pub use registry::{ALL, MessageType};
pub use sensors::{
    Beam, Bumper, Clock, Encoding, FrameHeader, Imu, NO_ECHO, Odometry, RangeScanHeader, Truth, Turn,
    TurnPhase,
};
pub use text::{Name, Note, Text};
pub use view::{RawMessage, View};

use bytemuck::Pod;
use serde::Serialize;

use crate::time::Time;

/// How a channel treats a slow reader.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Channel {
    /// The newest value wins; a late reader gets the last one.
    Latest,
    /// Every value counts; a reader that overflows is told how many it lost.
    Stream,
}

/// A type that travels: the header, and the items behind it.
pub trait Message: Pod + Serialize + Laid + std::fmt::Debug + 'static {
    /// What the slice behind the header holds; [`u8`] and empty for a message without a list.
    type Item: Pod + Serialize + Laid + std::fmt::Debug;
    /// Versioned name, such as `yamabico.Odometry.v1`.
    const NAME: &'static str;
    /// How a channel of it treats a slow reader.
    const CHANNEL: Channel;
    /// The capture stamp.
    fn stamp(&self) -> Time;
    /// Counts up by one a message; a reader of a stream counts its losses by the gaps.
    fn sequence(&self) -> u64;
    /// Whether the items are the bytes of a text.
    const IS_WORDED: bool = false;
    /// The oldest sensor data in it; the capture stamp for what a sensor measured itself.
    fn evidence(&self) -> Time {
        self.stamp()
    }
}

/// Declares a header: `repr(C)`, plain old data, with its versioned name, its channel and its items.
macro_rules! message {
    (@words) => { true };
    (@sequence $header:ident) => { $header.sequence };
    (@sequence $header:ident $field:ident) => { $header.$field };
    (
        $(#[doc = $doc:literal])*
        $name:literal $channel:ident [$item:ty] $(evidence $evidence:ident)? $(counted by $sequence:ident)? $(in $words:ident)?
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

        crate::message::layout::lay! { $(#[doc = $doc])* struct $ty { $($body)* } }

        impl crate::message::Message for $ty {
            type Item = $item;
            const NAME: &'static str = $name;
            const CHANNEL: crate::message::Channel = crate::message::Channel::$channel;
            $(const IS_WORDED: bool = crate::message::message!(@$words);)?
            fn stamp(&self) -> crate::time::Time {
                crate::time::Time(self.stamp_ns)
            }
            fn sequence(&self) -> u64 {
                crate::message::message!(@sequence self $($sequence)?)
            }
            $(fn evidence(&self) -> crate::time::Time {
                crate::time::Time(self.$evidence)
            })?
        }
    };
}
pub(crate) use message;

/// Declares an element of a list: `repr(C)`, plain old data.
macro_rules! item {
    ($(#[doc = $doc:literal])* pub struct $ty:ident { $($body:tt)* }) => {
        $(#[doc = $doc])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable, serde::Serialize)]
        pub struct $ty { $($body)* }

        crate::message::layout::lay! { $(#[doc = $doc])* struct $ty { $($body)* } }

        impl Default for $ty {
            fn default() -> Self {
                bytemuck::Zeroable::zeroed()
            }
        }
    };
}
pub(crate) use item;

/// Declares the vocabulary of a code that travels as `u32`.
macro_rules! vocabulary {
    ($(#[$meta:meta])* pub enum $ty:ident { $($(#[$vmeta:meta])* $variant:ident = $code:literal $text:literal,)* }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize)]
        #[repr(u32)]
        pub enum $ty { $($(#[$vmeta])* $variant = $code,)* }

        impl $ty {
            /// Every word of this vocabulary.
            pub const ALL: &'static [$ty] = &[$($ty::$variant),*];

            /// The number that travels.
            pub const fn code(self) -> u32 {
                self as u32
            }

            /// The meaning of a number that traveled; `None` where it is not in the vocabulary.
            pub const fn from_code(code: u32) -> Option<$ty> {
                match code { $($code => Some($ty::$variant),)* _ => None }
            }

            /// In words, lower case.
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
pub(crate) use vocabulary;
