//! Protocol between the supervisor and a plugin that runs in a process of its own.
//!
//! A plugin in any language needs to follow this page only. (Plugins in Rust call [`main`] or [`main_of_driver`];
//! those in Python, `yamabico.main`.)
//!
//! 1. **Describe.** With `--describe` as its last argument the program prints its [`BehaviorDescription`] or
//!    [`DriverDescription`] as JSON and exits. A driver's program also answers `--sensor`: it reads a
//!    [`SensorQuestion`] as JSON from standard input and prints a [`SensorAnswer`].
//! 2. **Launch.** The supervisor starts the program with the arguments of the task or robot file and writes one TOML
//!    document to its standard input, a [`LaunchConfig`]: the bus, the plugin's name, its parameters, its topics with
//!    their message types. Standard output and standard error appear on the supervisor's standard error.
//! 3. **Join the bus.** Every topic exists before the plugin starts and outlives it. The plugin opens topics, never
//!    creates them, and retries for half a second. It uses the iceoryx2 settings `global.root-path` = `bus_root` and
//!    `global.prefix` = `bus_prefix`, and disables iceoryx2's signal handling and clean-up
//!    (`cleanup-dead-nodes-on-creation`, `cleanup-dead-nodes-on-destruction`, `cleanup-dead-nodes-on-open`). A topic
//!    is a publish-subscribe service of bytes (`[u8]`, aligned to 8) with the message's header as user header, and an
//!    event service of the same name, which the publisher notifies after each message.
//! 4. **Report.** The plugin publishes a `Heartbeat` on `plugins/heartbeats` at least every `heartbeat_ms`, from the
//!    loop that does the work. The first one has the state `starting` and means that everything is open. A plugin
//!    without a heartbeat for 3.5 times `heartbeat_ms`, 5 times if it computes, is killed and restarted; time for which it
//!    waits for a processor does not count (see [`Deadline`](crate::Deadline)). A plugin that cannot start publishes the
//!    reason on `plugins/failures` and exits with code 2.
//! 5. **Start.** With `start = "on-first-command"` the plugin waits for a message on `command` before it proposes,
//!    measures or moves. With `start = "immediately"` it does not wait.
//! 6. **Run.** All stamps are `CLOCK_MONOTONIC` in nanoseconds.
//!    - A behavior publishes proposals with its name, a sequence number, its priority and two stamps, `stamp_ns` and
//!      `evidence_ns`; `received_ns` and `proposed_ns` may be zero. With `sleeps_while_inhibited` it may stop
//!      proposing while its verdict on `decision` is `inhibited`.
//!    - A behavior with state to keep across a restart publishes it on `plugins/memories` whenever it changes: a
//!      `SavedStateHeader` and at most 16 kB of JSON. The next launch configuration contains the last one as
//!      `saved_state`.
//!    - A behavior that logs its calls can be replayed: it publishes a `CallHeader` on `replay/behaviors/NAME` after each
//!      call, with the numbers and stamps of the messages that it was handed for the first time.
//!    - A device publishes its measurements and obeys `command`.
//!    - With `clock = "driver"` the device owns the time. In each step it publishes its measurements and then a
//!      `Clock` on `clock`. The arbiter then publishes the phases `collect`, `propose` and `done` on `clock/turns`. In
//!      `collect` a behavior receives its inputs; in `propose` it proposes, stamped with the `stamp_ns` of the phase;
//!      it acknowledges either on `clock/taken` with the same `StepSignal` and its own name, after everything that it
//!      publishes in that phase, its saved state included. After `done` the driver applies the newest command and
//!      begins the next step. A run in lockstep hosts a behavior's program in the same way, without a heartbeat limit.
//! 7. **End.** On SIGTERM the plugin exits within a second. If the supervisor dies, the kernel sends SIGKILL to a
//!    behavior and SIGHUP to a device, which stops its drive and then exits.

mod behavior_description;
mod driver_description;
mod launch;
mod parent;
mod query;
mod serve;

pub use behavior_description::{BehaviorDescription, DESCRIBE, SlotDescription};
pub use driver_description::{
    DriveKindDescription, DriverDescription, SENSOR, SensorAnswer, SensorKindDescription, SensorQuestion,
};
pub use launch::{
    BehaviorLaunch, DeviceLaunch, InputLaunch, LaunchConfig, LaunchError, PROTOCOL, PortLaunch, Role, Start,
};
pub use parent::{OnParentDeath, ParentProcess};
pub(crate) use query::query;
pub use serve::serve;

use std::io::{Read, Write};
use std::process::ExitCode;
use std::sync::Arc;

use serde::Serialize;

use yamabico_core::behavior::{Plugin, factory};
use yamabico_core::driver::Driver;
use yamabico_core::plugins::Plugins;

/// Main function of a behavior's program: `fn main() -> ExitCode { process::main::<MyBehavior>() }`.
pub fn main<B: Plugin>() -> ExitCode {
    let behavior = factory::<B>();
    match std::env::args().next_back() {
        Some(argument) if argument == DESCRIBE => print(&BehaviorDescription::of(behavior.info())),
        _ => serve(&Plugins { behaviors: vec![behavior], drivers: Vec::new() }),
    }
}

/// Main function of a driver's program: `fn main() -> ExitCode { process::main_of_driver(driver()) }`.
pub fn main_of_driver(driver: Arc<dyn Driver>) -> ExitCode {
    match std::env::args().next_back().as_deref() {
        Some(DESCRIBE) => print(&DriverDescription::of(driver.info())),
        Some(SENSOR) => {
            let mut text = String::new();
            let read = std::io::stdin().read_to_string(&mut text).is_ok();
            match serde_json::from_str(&text) {
                Ok(question) if read => print(&SensorAnswer::of(driver.as_ref(), question)),
                _ => ExitCode::FAILURE,
            }
        }
        _ => serve(&Plugins { behaviors: Vec::new(), drivers: vec![driver] }),
    }
}

fn print(answer: &impl Serialize) -> ExitCode {
    match serde_json::to_string_pretty(answer) {
        Ok(text) if writeln!(std::io::stdout(), "{text}").is_ok() => ExitCode::SUCCESS,
        _ => ExitCode::FAILURE,
    }
}
