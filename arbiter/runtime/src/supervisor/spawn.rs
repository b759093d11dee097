//! Starting a process.

use std::io::Write;
use std::os::fd::AsFd;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Stdio};

use yamabico_host::bus::keep_files_from_children;
use yamabico_host::process::{Charge, OnDeath};

use super::program::Program;
use super::ward::WardPlan;

/// Longest charge, bytes: what a pipe holds.
const MAX_CHARGE: usize = 60_000;

/// Starts `program` as the plugin that `plan` names, in a process group of its own, so that Ctrl-C reaches the supervisor alone.
///
/// It waits for what [`tell`] tells it. The kernel ties the child's life to the calling thread, not to its process.
pub(super) fn spawn(program: &Program, plan: &WardPlan) -> std::io::Result<Child> {
    keep_files_from_children();
    let on_death = match plan.on_death {
        OnDeath::Die => "die",
        OnDeath::Brake => "brake",
    };
    Command::new(&program.path)
        .arg0("yamabico")
        .args(&program.arguments)
        .arg(&plan.charge.name)
        .args(["--guardian", &std::process::id().to_string(), "--on-death", on_death])
        .arg(format!("--scheduling={}", plan.scheduling))
        .arg("--")
        .args(&plan.exec)
        .stdin(Stdio::piped())
        .stdout(Stdio::from(std::io::stderr().as_fd().try_clone_to_owned()?))
        .process_group(0)
        .spawn()
}

/// Tells a process what it is. Nobody waits for its reader: the pipe is empty and holds more than that.
pub(super) fn tell(child: &mut Child, charge: &Charge) -> std::io::Result<()> {
    let text = toml::to_string(charge).map_err(std::io::Error::other)?;
    if text.len() > MAX_CHARGE {
        let problem =
            format!("its parameters take {} bytes, more than {MAX_CHARGE}: put them into a file", text.len());
        return Err(std::io::Error::other(problem));
    }
    let mut pipe = child.stdin.take().ok_or(std::io::ErrorKind::BrokenPipe)?;
    pipe.write_all(text.as_bytes())
}
