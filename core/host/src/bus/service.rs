//! The two kinds of transport service, and code that is written once for both.
//!
//! The `*_threadsafe` services of iceoryx2 would make the ports `Send` without `unsafe` in this crate, but lock a
//! mutex several times per message: sending and receiving 64 bytes on one thread takes 655 ns instead of 280 ns, and
//! the latency between two processes rises by a fifth (`cargo bench -p yamabico-host --bench bus`). No port of this
//! crate is used by two threads at once.

use iceoryx2::prelude::{ipc, local};

/// Service within one process: lockstep runs, replays and tests.
pub(super) type LocalService = local::Service;
/// Service in shared memory, between the processes of a live robot.
pub(super) type IpcService = ipc::Service;

/// A node, port or sample of either service. Unlike a trait object it needs no allocation, so that samples can be held
/// in it.
pub(super) enum Either<L, I> {
    /// The value for a [`LocalService`].
    Local(L),
    /// The value for an [`IpcService`].
    Ipc(I),
}

/// Evaluates an expression for whichever service it is: `either!(&self.port, port => port.receive())`.
macro_rules! either {
    ($value:expr, $name:ident => $body:expr) => {
        match $value {
            Either::Local($name) => $body,
            Either::Ipc($name) => $body,
        }
    };
}

/// Like [`either`], but wraps the result for the same service.
macro_rules! map_either {
    ($value:expr, $name:ident => $body:expr) => {
        match $value {
            Either::Local($name) => Either::Local($body),
            Either::Ipc($name) => Either::Ipc($body),
        }
    };
}

pub(super) use {either, map_either};
