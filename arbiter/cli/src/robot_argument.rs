//! The argument of every command for a running robot: which one.

use std::path::{Path, PathBuf};

use clap::Args;
use yamabico_parameters::instead;
use yamabico_runtime::client::RobotClient;

use crate::output::Failure;

/// One of the running robots.
#[derive(Args)]
pub struct RobotArgument {
    /// Name of the running robot; by default the only one, or the only one whose task is in this folder.
    #[arg(long, value_name = "NAME")]
    robot: Option<String>,
}

impl RobotArgument {
    /// The robot of this name; without one, as if the argument were absent.
    pub fn named(robot: Option<String>) -> RobotArgument {
        RobotArgument { robot }
    }

    /// Returns the name of the chosen robot.
    ///
    /// # Errors
    /// No such robot is running; without a name, none is running, or several of which not exactly one is of this folder.
    pub fn choose(&self) -> Result<String, Failure> {
        let here = std::env::current_dir().unwrap_or_default();
        choose(self.robot.as_deref(), &RobotClient::running(), &here, &folders_of).map_err(Failure::usage)
    }
}

/// Folders that the robot `name` is of: the one where it was started, and the one of its task file.
fn folders_of(name: &str) -> Vec<PathBuf> {
    let client = RobotClient::join(name);
    let Ok(pid) = client.and_then(|mut client| client.manifest().map(|manifest| manifest.pid)) else {
        return Vec::new();
    };
    let process = PathBuf::from(format!("/proc/{pid}"));
    let Ok(started_in) = std::fs::read_link(process.join("cwd")) else { return Vec::new() };
    let arguments = std::fs::read(process.join("cmdline")).unwrap_or_default();
    let arguments =
        arguments.split(|&byte| byte == 0).filter_map(|argument| std::str::from_utf8(argument).ok());
    let tasks = arguments.filter(|argument| argument.ends_with(".toml") && !argument.contains('='));
    let files = tasks.filter_map(|task| started_in.join(task).canonicalize().ok());
    let of_task: Vec<_> = files.filter_map(|file| file.parent().map(Path::to_path_buf)).collect();
    std::iter::once(started_in).chain(of_task).collect()
}

fn choose(
    name: Option<&str>,
    running: &[String],
    here: &Path,
    folders_of: &dyn Fn(&str) -> Vec<PathBuf>,
) -> Result<String, String> {
    match (name, running) {
        (Some(name), running) if running.iter().any(|robot| robot == name) => Ok(name.to_owned()),
        (None, [only]) => Ok(only.clone()),
        (_, []) => {
            let robot = name.map_or("no robot".to_owned(), |name| format!("no robot `{name}`"));
            Err(format!("{robot} is running: start one with `yamabico run --live FILE`"))
        }
        (Some(name), running) => {
            let instead = instead(name, running.iter().map(String::as_str), "running robot");
            Err(format!("no robot `{name}` is running: {instead}"))
        }
        (None, several) => {
            let folders: Vec<_> = several.iter().map(|robot| folders_of(robot)).collect();
            let is_of_here = |folders: &Vec<PathBuf>| folders.iter().any(|folder| folder == here);
            let mut of_here = several.iter().zip(&folders).filter(|(_, folders)| is_of_here(folders));
            if let (Some((robot, _)), None) = (of_here.next(), of_here.next()) {
                return Ok(robot.clone());
            }
            let listed = several.iter().zip(&folders).map(|(robot, folders)| match folders.first() {
                Some(folder) => format!("\n  {robot}, started in {}", folder.display()),
                None => format!("\n  {robot}"),
            });
            Err(format!(
                "several robots are running: choose one with --robot NAME{}",
                listed.collect::<String>()
            ))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_robot_is_named_unless_it_is_the_only_one_or_of_this_folder() {
        let run = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
        let folders_of = |name: &str| vec![PathBuf::from(if name == "kame" { "/pond" } else { "/hill" })];
        let choose = |name, running: &[&str], here: &str| {
            super::choose(name, &run(running), Path::new(here), &folders_of)
        };
        assert_eq!(choose(None, &["kame"], "/").as_deref(), Ok("kame"));
        assert_eq!(choose(Some("kame"), &["kame", "tora"], "/").as_deref(), Ok("kame"));
        assert!(choose(None, &[], "/").unwrap_err().contains("run --live"));
        assert!(choose(Some("kame"), &[], "/").unwrap_err().contains("`kame`"));
        assert!(choose(Some("kane"), &["kame", "tora"], "/").unwrap_err().contains("did you mean `kame`?"));
        assert_eq!(choose(None, &["kame", "tora"], "/pond").as_deref(), Ok("kame"));
        let several = choose(None, &["kame", "neko", "tora"], "/hill").unwrap_err();
        assert!(several.contains("kame, started in /pond") && several.contains("tora"), "{several}");
    }
}
