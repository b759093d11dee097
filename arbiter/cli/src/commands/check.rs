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
}

/// Loads the task and tells what it would open.
pub fn check(arguments: &TaskArguments, print: Print) -> ExitCode {
    let Some(task) = arguments.load_or_tell(print) else { return exit(BAD_CONFIGURATION) };
    let devices = task.robot.devices.iter();
    let checked = Checked {
        task: &task.name,
        robot: &task.robot.robot.name,
        behaviors: task.behaviors.iter().map(|behavior| behavior.name.as_str()).collect(),
        sensors: task.robot.sensors.iter().map(|sensor| sensor.part.name.as_str()).collect(),
        opens: devices.map(|device| format!("{} ({})", device.name, device.driver.name)).collect(),
    };
    print.show(&checked, |checked| {
        format!(
            "{} is right: robot {} with {}; {} in the order of priority; opens {}",
            arguments.file.display(),
            checked.robot,
            checked.sensors.join(", "),
            checked.behaviors.join(", "),
            checked.opens.join(", "),
        )
    });
    exit(DONE)
}
