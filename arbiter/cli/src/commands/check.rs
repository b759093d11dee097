//! `yamabico check`: every error in a task, without opening a device; with `--measure`, whether its deadlines suit this machine.

use std::time::Duration;

use clap::Args;
use serde::Serialize;
use yamabico_host::config::Task;
use yamabico_runtime::deadlines::{MeasuredPlugin, measure, proposed_keys};
use yamabico_runtime::supervisor::Program;

use crate::interrupt::interrupt_flag;
use crate::output::{CommandResult, DONE, Failure, Print, table};
use crate::task_arguments::TaskArguments;

/// Arguments of `check`.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    task: TaskArguments,
    /// Run the task live for this time, with every behavior disabled, so that the robot stands; measure how long calls
    /// take with its present load, and propose deadlines that suit it.
    #[arg(long, value_name = "SECONDS", num_args = 0..=1, require_equals = true, default_missing_value = "10", value_parser = seconds)]
    measure: Option<Duration>,
}

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
    #[serde(skip_serializing_if = "Option::is_none")]
    measured: Option<Vec<MeasuredPlugin>>,
}

/// Loads the task and prints a summary of it.
pub fn check(arguments: &Arguments, print: Print) -> CommandResult {
    let task = arguments.task.load().map_err(Failure::Checked)?;
    let measured = arguments.measure.map(|duration| measured(&task, duration)).transpose()?;
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
        measured,
    };
    print.show(&checked, |checked| {
        let list = |items: &[String]| if items.is_empty() { "none".to_owned() } else { items.join(", ") };
        let notes: String = checked.notes.iter().map(|note| format!("\nnote: {note}")).collect();
        let measured = checked.measured.as_deref().map_or_else(String::new, deadlines);
        format!(
            "{} has no errors\n  robot                   {}\n  sensors                 {}\n  \
             behaviors by priority   {}\n  devices to open         {}\n  programs to start       {}{notes}{measured}",
            arguments.task.file.display(),
            checked.robot,
            checked.sensors.join(", "),
            checked.behaviors.join(", "),
            list(&checked.opens),
            list(&checked.starts),
        )
    });
    Ok(DONE)
}

/// Runs the task and measures its plugins.
fn measured(task: &Task, duration: Duration) -> Result<Vec<MeasuredPlugin>, Failure> {
    let interrupt = interrupt_flag()?;
    measure(task, duration, Some(Program::this()), &interrupt).map_err(|error| match error.is_of_a_device() {
        true => Failure::device(error),
        false => Failure::usage(error),
    })
}

/// The measured times as a table, and the keys to paste.
fn deadlines(measured: &[MeasuredPlugin]) -> String {
    let head = ["plugin", "calls", "p50", "p99", "max", "deadline", "proposed"];
    let mut table = table(&head, 1..7);
    for plugin in measured {
        let ms = |ms: f64| format!("{ms:.1} ms");
        let proposed = plugin.proposed_ms.map_or_else(|| "fits".to_owned(), |ms| format!("{ms:.0} ms"));
        table.add_row([
            plugin.name.clone(),
            plugin.calls.to_string(),
            ms(plugin.p50_ms),
            ms(plugin.p99_ms),
            ms(plugin.max_ms),
            format!("{:.0} ms", plugin.deadline_ms),
            proposed,
        ]);
    }
    let keys = proposed_keys(measured);
    let keys = if keys.is_empty() { "every deadline suits this machine".to_owned() } else { keys };
    format!("\n{table}\n{keys}")
}

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    match (1.0..=3600.0).contains(&seconds) {
        true => Ok(Duration::from_secs_f64(seconds)),
        false => Err("must be from 1 to 3600 s".to_owned()),
    }
}
