//! Starting a process.

use std::fs::File;
use std::io::{Seek, Write};
use std::os::fd::AsFd;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Stdio};

use rustix::fs::{MemfdFlags, memfd_create};
use yamabico_core::bus::keep_files_from_children;
use yamabico_core::plugin::{Charge, OnDeath};

use super::program::Program;

/// Starts `program` as the plugin of `charge`, in a process group of its own, so that Ctrl-C reaches the supervisor alone.
///
/// The kernel ties the child's life to the calling thread, not to its process.
pub(super) fn spawn(program: &Program, charge: &Charge, on_death: OnDeath) -> std::io::Result<Child> {
    keep_files_from_children();
    let on_death = match on_death {
        OnDeath::Die => "die",
        OnDeath::End => "end",
    };
    Command::new(&program.path)
        .arg0("yamabico")
        .args(&program.arguments)
        .arg(&charge.name)
        .args(["--guardian", &std::process::id().to_string(), "--on-death", on_death])
        .stdin(written(charge)?)
        .stdout(Stdio::from(std::io::stderr().as_fd().try_clone_to_owned()?))
        .process_group(0)
        .spawn()
}

/// The charge in memory, to be read like a file: nobody waits for its reader.
fn written(charge: &Charge) -> std::io::Result<Stdio> {
    let text = toml::to_string(charge).map_err(std::io::Error::other)?;
    let mut file = File::from(memfd_create("charge", MemfdFlags::CLOEXEC)?);
    file.write_all(text.as_bytes())?;
    file.rewind()?;
    Ok(file.into())
}
