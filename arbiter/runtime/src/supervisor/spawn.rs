//! Start of a plugin's process.

use std::io::Write;
use std::os::fd::AsFd;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Stdio};

use yamabico_host::bus::close_files_in_children;
use yamabico_host::process::{LaunchConfig, OnParentDeath};

use super::program::Program;
use super::supervised_process::ProcessPlan;

/// Maximum size of a launch configuration, bytes: less than a pipe holds.
const MAX_LAUNCH_BYTES: usize = 60_000;

/// Starts `program` as the plugin of `plan`, and sends it its launch configuration.
pub(crate) fn launch(program: &Program, plan: &ProcessPlan) -> std::io::Result<Child> {
    let mut child = spawn(program, plan)?;
    match send_launch_config(&mut child, &plan.launch) {
        Ok(()) => Ok(child),
        Err(error) => {
            let _ = child.kill().and_then(|()| child.wait());
            Err(error)
        }
    }
}

/// Starts `program` as the plugin of `plan`, in a process group of its own, so that Ctrl-C reaches the supervisor alone.
///
/// The process waits for [`send_launch_config`]. The kernel ties its life to the calling thread, not to the calling process.
pub(super) fn spawn(program: &Program, plan: &ProcessPlan) -> std::io::Result<Child> {
    close_files_in_children();
    let on_death = match plan.on_parent_death {
        OnParentDeath::Die => "die",
        OnParentDeath::Brake => "brake",
    };
    Command::new(&program.path)
        .arg0("yamabico")
        .args(&program.arguments)
        .arg(&plan.launch.name)
        .args(["--guardian", &std::process::id().to_string(), "--on-death", on_death])
        .arg(format!("--scheduling={}", plan.scheduling))
        .arg("--")
        .args(&plan.exec)
        // The order of sets of texts in Python must not change from process to process.
        .env("PYTHONHASHSEED", std::env::var_os("PYTHONHASHSEED").unwrap_or_else(|| "0".into()))
        .stdin(Stdio::piped())
        .stdout(Stdio::from(std::io::stderr().as_fd().try_clone_to_owned()?))
        .process_group(0)
        .spawn()
}

/// Writes the launch configuration to a process. It never blocks: the pipe is empty and holds the largest configuration.
pub(super) fn send_launch_config(child: &mut Child, launch: &LaunchConfig) -> std::io::Result<()> {
    let text = toml::to_string(launch).map_err(std::io::Error::other)?;
    if text.len() > MAX_LAUNCH_BYTES {
        let problem = format!(
            "its parameters take {} bytes, the maximum is {MAX_LAUNCH_BYTES}: put them into a file",
            text.len()
        );
        return Err(std::io::Error::other(problem));
    }
    let mut pipe = child.stdin.take().ok_or(std::io::ErrorKind::BrokenPipe)?;
    pipe.write_all(text.as_bytes())
}
