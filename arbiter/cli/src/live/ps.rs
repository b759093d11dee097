//! `yamabico ps`: how every plugin of a running robot fares.

use std::process::ExitCode;

use clap::Args;
use yamabico_runtime::operator::{LookError, Mustered, muster};

use super::which::Which;
use crate::output::{BAD_CONFIGURATION, DONE, NOT_ARRIVED, Print, exit, fail, table};

/// What `ps` is told.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    robot: Which,
}

/// Lists the plugins.
pub fn ps(arguments: &Arguments, print: Print) -> ExitCode {
    let robot = match arguments.robot.choose() {
        Ok(robot) => robot,
        Err(problem) => return fail(&problem, BAD_CONFIGURATION),
    };
    match muster(&robot) {
        Ok(plugins) => {
            print.show(&plugins, |plugins| in_words(plugins));
            exit(DONE)
        }
        Err(error @ LookError::Bus(_)) => fail(&error.to_string(), BAD_CONFIGURATION),
        Err(error) => fail(&error.to_string(), NOT_ARRIVED),
    }
}

fn in_words(plugins: &[Mustered]) -> String {
    let head = [
        "plugin",
        "kind",
        "pid",
        "state",
        "beat",
        "restarts",
        "calls",
        "p50",
        "max",
        "prio",
        "in the last decision",
    ];
    let mut table = table(&head, 4..10);
    if let Some(pid) = table.column_mut(2) {
        pid.set_cell_alignment(comfy_table::CellAlignment::Right);
    }
    for plugin in plugins {
        let pid = plugin.pid.map_or("-".to_owned(), |pid| pid.to_string());
        let calls = plugin.calls;
        table.add_row([
            plugin.name.clone(),
            plugin.kind.to_owned(),
            if plugin.own_process { pid } else { format!("thread {pid}") },
            plugin.state.clone(),
            plugin.beat_age_s.map_or("none".to_owned(), |age_s| format!("{age_s:.2} s")),
            plugin.restarts.to_string(),
            calls.map_or(String::new(), |calls| calls.count.to_string()),
            calls.map_or(String::new(), |calls| span(calls.p50_us)),
            calls.map_or(String::new(), |calls| span(calls.max_us)),
            plugin.priority.map_or(String::new(), |priority| priority.to_string()),
            verdict(plugin),
        ]);
    }
    let mut text = table.to_string();
    for plugin in plugins {
        if let Some(end) = &plugin.last_end {
            text += &format!("\n{}: its last process {} {:.1} s ago", plugin.name, end.words, end.ago_s);
        }
        if let Some(said) = &plugin.said {
            text += &format!("\n{}: said {:.1} s ago: {}", plugin.name, said.ago_s, said.words);
        }
        if let Some(calls) = plugin.calls.filter(|calls| calls.panics + u32::from(calls.overruns > 0) > 0) {
            text += &format!(
                "\n{}: {} calls panicked, {} took longer than its budget",
                plugin.name, calls.panics, calls.overruns
            );
        }
    }
    text
}

/// Such as `out-ranked, by map-localizer`.
fn verdict(plugin: &Mustered) -> String {
    match (plugin.outcome, &plugin.by) {
        (Some(outcome), Some(by)) => format!("{outcome}, by {by}"),
        (outcome, _) => outcome.unwrap_or_default().to_owned(),
    }
}

/// Microseconds for people.
fn span(micros: f64) -> String {
    if micros < 1000.0 { format!("{micros:.0} us") } else { format!("{:.2} ms", micros * 1e-3) }
}
