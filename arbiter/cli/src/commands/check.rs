//! `yamabico check`: everything that is wrong with a task, without opening a device.

use std::process::ExitCode;

use serde::Serialize;

use super::TaskArguments;
use crate::output::{BAD_CONFIGURATION, DONE, Print, exit};

#[derive(Serialize)]
struct Checked<'a> {
    task: &'a str,
    robot: &'a str,
    behaviors: Vec<&'a str>,
    sensors: Vec<&'a str>,
    opens: Vec<String>,
    starts: Vec<String>,
}

/// Loads the task and tells what it would open.
pub fn check(arguments: &TaskArguments, print: Print) -> ExitCode {
    let Some(task) = arguments.load_or_tell(print) else { return exit(BAD_CONFIGURATION) };
    let devices = task.robot.devices.iter();
    let programs = task.robot.devices.iter().map(|device| (&device.name, &device.exec));
    let programs = programs.chain(task.behaviors.iter().map(|behavior| (&behavior.name, &behavior.exec)));
    let programs = programs.filter(|(_, exec)| !exec.is_empty());
    let checked = Checked {
        task: &task.name,
        robot: &task.robot.robot.name,
        behaviors: task.behaviors.iter().map(|behavior| behavior.name.as_str()).collect(),
        sensors: task.robot.sensors.iter().map(|sensor| sensor.part.name.as_str()).collect(),
        opens: devices.map(|device| format!("{} ({})", device.name, device.driver.info().name)).collect(),
        starts: programs.map(|(name, exec)| format!("{name} ({})", exec.join(" "))).collect(),
    };
    print.show(&checked, |checked| {
        format!(
            "{} is right: robot {} with {}; {} in the order of priority; opens {}; starts {}",
            arguments.file.display(),
            checked.robot,
            checked.sensors.join(", "),
            checked.behaviors.join(", "),
            checked.opens.join(", "),
            if checked.starts.is_empty() { "no other program".to_owned() } else { checked.starts.join(", ") },
        )
    });
    exit(DONE)
}
