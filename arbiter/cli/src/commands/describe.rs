//! `yamabico describe`: inputs, outputs and every parameter of a plugin.

use std::path::PathBuf;

use clap::Args;
use yamabico::plugins::plugins;
use yamabico_host::config::{self, Description, Parameter, Port};

use crate::output::{CommandResult, DONE, Failure, Print, table};

/// Arguments of `describe`.
#[derive(Args)]
pub struct Arguments {
    /// Name in `yamabico list`, for example `wall-follower` or `sim/camera`.
    name: String,
    /// Task file with a behavior NAME that is an external program.
    #[arg(long, value_name = "FILE")]
    task: Option<PathBuf>,
}

/// Describes one plugin.
pub fn describe(arguments: &Arguments, print: Print) -> CommandResult {
    let description = match &arguments.task {
        Some(task) => config::describe_in_task(&arguments.name, task, &plugins()),
        None => config::describe(&arguments.name, &plugins()),
    };
    let description = description.map_err(Failure::usage)?;
    print.show(&description, text);
    Ok(DONE)
}

fn text(description: &Description) -> String {
    let mut text = format!("{} ({}): {}\n", description.name, description.what, description.summary);
    if let Some(axes) = &description.axes {
        text += &format!("axes: {axes}\n");
    }
    text += &ports("input", &description.inputs);
    text += &ports("output", &description.outputs);
    text += &parameters("parameter", &description.parameters);
    text += &parameters("common key", &description.common);
    text
}

fn ports(kind: &str, ports: &[Port]) -> String {
    if ports.is_empty() {
        return String::new();
    }
    let mut table = table(&[kind, "message", "required", "meaning"], 0..0);
    for port in ports {
        let required = match (port.required, port.preferred) {
            (true, _) => "yes",
            (false, true) => "if there is one",
            (false, false) => "no",
        };
        table.add_row([port.name.as_str(), port.message, required, port.summary.as_str()]);
    }
    format!("{table}\n")
}

fn parameters(kind: &str, parameters: &[Parameter]) -> String {
    if parameters.is_empty() {
        return String::new();
    }
    let mut table = table(&[kind, "type", "unit", "range", "default", "meaning"], 0..0);
    table.set_content_arrangement(comfy_table::ContentArrangement::Dynamic);
    for parameter in parameters {
        let default = match (&parameter.default, parameter.required) {
            (_, true) => "required".to_owned(),
            (Some(default), _) if !default.is_null() => default.to_string(),
            _ => "-".to_owned(),
        };
        table.add_row([
            parameter.key.as_str(),
            parameter.takes.as_str(),
            parameter.unit.unwrap_or(""),
            parameter.range.as_deref().unwrap_or(""),
            &default,
            parameter.summary.as_str(),
        ]);
    }
    format!("{table}\n")
}
