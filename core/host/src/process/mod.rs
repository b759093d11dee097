//! A plugin in a process of its own: how it is started, what it is told, what is expected of it.
//!
//! This is all that a plugin in any language has to follow.
//!
//! 1. **Start.** The supervisor starts the program with the arguments of the task or robot file. Standard input is one TOML
//!    document, a [`Charge`]: the bus, the plugin's name, its parameters, its topics with their types. Standard output and
//!    error go to the supervisor's standard error. With the single argument `--describe` the program prints its
//!    [`Description`] as JSON instead, and ends.
//! 2. **Bus.** Every topic exists before the plugin starts and goes on after it. The plugin opens and never creates, tries
//!    again for half a second, and switches iceoryx2's own clean-up off (`cleanup-dead-nodes-on-creation`,
//!    `...-on-destruction`, `...-on-open`) and its signal handling. A topic is a publish-subscribe service of bytes
//!    (`[u8]`, aligned to 8) with the message's header as user header, and an event service of the same name that is
//!    notified after each message.
//! 3. **Signs of life.** It publishes a `Heartbeat` on `plugins/heartbeats` at least every `beat_ms`, from the loop that does
//!    the work: one that is silent for four times as long is killed and started again. The first one, `starting`, says that
//!    everything is open. What keeps it from opening it tells on `plugins/failures`, and ends with exit code 2.
//! 4. **Begin.** With `begin = "with-the-first-command"` it waits for a message on `command` before it proposes, measures or
//!    moves; with `at-once` it does not.
//! 5. **Work.** A behavior publishes proposals with its name, a sequence, its priority and two stamps (`CLOCK_MONOTONIC`,
//!    nanoseconds); `received_ns` and `proposed_ns` are zero where it does not tell its stages. With `sleeps_while_inhibited` it
//!    need not propose while its verdict on `decision` is `inhibited`. A device publishes what it measures and obeys `command`.
//!    Where `clock` is `driver`, the driver owns the time: for each step it publishes what it measured and then a `Clock` on
//!    `clock`. The arbiter calls turns on `clock/turns`: `collect`, `propose`, `done`. A behavior takes in what has arrived, or
//!    proposes, stamped with the turn's `stamp_ns`, and says so on `clock/taken` with the same `Turn` and its name. When the
//!    step is `done` the driver obeys the newest command and goes on with the next one.
//!    A behavior that must go on where it stopped publishes its memory on `plugins/memories` when that changes: a `MemoryHeader`
//!    and JSON of at most 16 kB. Its successor is told the last one in `memory`.
//! 6. **End.** On SIGTERM it ends within a second. The supervisor's death is SIGKILL for a behavior and SIGHUP for a device,
//!    which then brakes, and ends.

mod charge;
mod converse;
mod description;
mod driver_description;
mod process;

pub use charge::{
    Begin, BehaviorCharge, Charge, ChargeError, DeviceCharge, InputCharge, PROTOCOL, Part, PortCharge,
};
pub(crate) use converse::converse;
pub use description::{DESCRIBE, Description, SlotDescription};
pub use driver_description::{
    DriveKindDescription, DriverDescription, SENSOR, SensorAnswer, SensorKindDescription, SensorQuestion,
};
pub use process::{Guardian, OnDeath, serve};

use std::io::Read;
use std::process::ExitCode;
use std::sync::Arc;

use serde::Serialize;

use yamabico_core::behavior::{Plugin, factory};
use yamabico_core::driver::Driver;
use yamabico_core::plugins::Plugins;

/// All that the `main` of a behavior's program has to do: `fn main() -> ExitCode { main::<MyBehavior>() }`.
pub fn main<B: Plugin>() -> ExitCode {
    let behavior = factory::<B>();
    match std::env::args().nth(1) {
        Some(argument) if argument == DESCRIBE => say(&Description::of(behavior.info())),
        _ => serve(&Plugins { behaviors: vec![behavior], drivers: Vec::new() }),
    }
}

/// All that the `main` of a driver's program has to do: `fn main() -> ExitCode { main_of_driver(driver()) }`.
pub fn main_of_driver(driver: Arc<dyn Driver>) -> ExitCode {
    match std::env::args().nth(1).as_deref() {
        Some(DESCRIBE) => say(&DriverDescription::of(driver.info())),
        Some(SENSOR) => {
            let mut text = String::new();
            let read = std::io::stdin().read_to_string(&mut text).is_ok();
            match serde_json::from_str(&text) {
                Ok(question) if read => say(&SensorAnswer::of(driver.as_ref(), question)),
                _ => ExitCode::FAILURE,
            }
        }
        _ => serve(&Plugins { behaviors: Vec::new(), drivers: vec![driver] }),
    }
}

fn say(what: &impl Serialize) -> ExitCode {
    match serde_json::to_string_pretty(what) {
        Ok(text) => {
            println!("{text}");
            ExitCode::SUCCESS
        }
        Err(_) => ExitCode::FAILURE,
    }
}
