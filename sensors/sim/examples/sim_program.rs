//! The simulator as a program of its own: a robot file names it by `exec`.

use std::process::ExitCode;

fn main() -> ExitCode {
    yamabico_host::process::main_of_driver(yamabico_sim::driver())
}
