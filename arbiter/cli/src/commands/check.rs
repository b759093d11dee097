//! `yamabico check`: every error in a task, without opening a device.

use serde::Serialize;

use crate::output::{CommandResult, DONE, Print};
use crate::task_arguments::TaskArguments;

/// A task without errors, and what running it opens and starts.
#[derive(Serialize)]
struct Checked<'a> {
    task: &'a str,
    robot: &'a str,
    behaviors: Vec<&'a str>,
    sensors: Vec<&'a str>,
    opens: Vec<String>,
    starts: Vec<String>,
    notes: Vec<String>,
}

/// Loads the task and prints a summary of it.
pub fn check(arguments: &TaskArguments, print: Print) -> CommandResult {
    let task = arguments.load()?;
    let devices = task.robot.devices.iter();
    let programs = task.robot.devices.iter().map(|device| (&device.name, &device.settings.exec));
    let programs =
        programs.chain(task.behaviors.iter().map(|behavior| (&behavior.name, &behavior.settings.host.exec)));
    let programs = programs.filter(|(_, exec)| !exec.is_empty());
    let checked = Checked {
        task: &task.name,
        robot: &task.robot.robot.name,
        behaviors: task.behaviors.iter().map(|behavior| behavior.name.as_str()).collect(),
        sensors: task.robot.sensors.iter().map(|sensor| sensor.part.name.as_str()).collect(),
        opens: devices.map(|device| format!("{} ({})", device.name, device.driver.info().name)).collect(),
        starts: programs.map(|(name, exec)| format!("{name} ({})", exec.join(" "))).collect(),
        notes: task.notes(),
    };
    print.show(&checked, |checked| {
        let list = |items: &[String]| if items.is_empty() { "none".to_owned() } else { items.join(", ") };
        let notes: String = checked.notes.iter().map(|note| format!("\nnote: {note}")).collect();
        format!(
            "{} has no errors\n  robot                   {}\n  sensors                 {}\n  \
             behaviors by priority   {}\n  devices to open         {}\n  programs to start       {}{notes}",
            arguments.file.display(),
            checked.robot,
            checked.sensors.join(", "),
            checked.behaviors.join(", "),
            list(&checked.opens),
            list(&checked.starts),
        )
    });
    Ok(DONE)
}
