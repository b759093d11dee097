//! `yamabico ps`: the plugins of a running robot and their state.

use clap::Args;
use yamabico_runtime::client::{PluginStatus, RobotClient};

use crate::output::{CommandResult, DONE, Print, table};
use crate::robot_argument::RobotArgument;

/// Arguments of `ps`.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    robot: RobotArgument,
}

/// Lists the plugins.
pub fn ps(arguments: &Arguments, print: Print) -> CommandResult {
    let robot = arguments.robot.choose()?;
    let plugins = RobotClient::join(&robot)?.plugin_statuses()?;
    print.show(&plugins, |plugins| format!("robot {robot}\n{}", text(plugins)));
    Ok(DONE)
}

fn text(plugins: &[PluginStatus]) -> String {
    let header = [
        "plugin",
        "kind",
        "pid",
        "state",
        "heartbeat age",
        "restarts",
        "calls",
        "p50",
        "max",
        "priority",
        "last decision",
    ];
    let mut table = table(&header, 4..10);
    if let Some(pid) = table.column_mut(2) {
        pid.set_cell_alignment(comfy_table::CellAlignment::Right);
    }
    for plugin in plugins {
        let pid = plugin.pid.map_or("-".to_owned(), |pid| pid.to_string());
        let calls = plugin.calls;
        table.add_row([
            plugin.name.clone(),
            plugin.kind.to_owned(),
            if plugin.own_process { pid } else { format!("thread of {pid}") },
            plugin.state.clone(),
            plugin.beat_age_s.map_or("none".to_owned(), |age_s| format!("{age_s:.2} s")),
            plugin.restarts.to_string(),
            calls.map_or(String::new(), |calls| calls.count.to_string()),
            calls.map_or(String::new(), |calls| duration(calls.p50_us)),
            calls.map_or(String::new(), |calls| duration(calls.max_us)),
            plugin.priority.map_or(String::new(), |priority| priority.to_string()),
            verdict(plugin),
        ]);
    }
    let mut text = table.to_string();
    for plugin in plugins {
        if let Some(end) = &plugin.last_end {
            text += &format!("\n{}: its last process {} {:.1} s ago", plugin.name, end.text, end.ago_s);
        }
        if let Some(failure) = &plugin.failure {
            text += &format!("\n{}: reported {:.1} s ago: {}", plugin.name, failure.ago_s, failure.text);
        }
        if let Some(calls) = plugin.calls.filter(|calls| calls.panics + u32::from(calls.overruns > 0) > 0) {
            text += &format!(
                "\n{}: {} calls panic_text, {} exceeded the budget",
                plugin.name, calls.panics, calls.overruns
            );
        }
    }
    text
}

/// The outcome of the newest proposal, for example `outranked, by map-localizer`.
fn verdict(plugin: &PluginStatus) -> String {
    match (plugin.outcome, &plugin.by) {
        (Some(outcome), Some(by)) => format!("{outcome}, by {by}"),
        (outcome, _) => outcome.unwrap_or_default().to_owned(),
    }
}

/// A duration of `micros` microseconds, with a unit.
fn duration(micros: f64) -> String {
    if micros < 1000.0 { format!("{micros:.0} us") } else { format!("{:.2} ms", micros * 1e-3) }
}
