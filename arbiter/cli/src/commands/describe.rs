//! `yamabico describe`: inputs, outputs and every parameter of a plugin.

use std::process::ExitCode;

use clap::Args;
use yamabico::plugins::plugins;
use yamabico_host::config::{self, Description, Parameter, Port};

use crate::output::{BAD_CONFIGURATION, DONE, Print, exit, table};

/// What `describe` is told.
#[derive(Args)]
pub struct Arguments {
    /// A name of `yamabico list`, such as `wall-follower` or `sim/camera`.
    name: String,
}

/// Describes one plugin.
pub fn describe(arguments: &Arguments, print: Print) -> ExitCode {
    match config::describe(&arguments.name, &plugins()) {
        Ok(description) => {
            print.show(&description, text);
            exit(DONE)
        }
        Err(problem) => {
            eprintln!("error: {problem}");
            exit(BAD_CONFIGURATION)
        }
    }
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

fn ports(what: &str, ports: &[Port]) -> String {
    if ports.is_empty() {
        return String::new();
    }
    let mut table = table(&[what, "message", "needed", "for"], 0..0);
    for port in ports {
        let needed = if port.required { "yes" } else { "no" };
        table.add_row([port.name.as_str(), port.message, needed, port.summary.as_str()]);
    }
    format!("{table}\n")
}

fn parameters(what: &str, parameters: &[Parameter]) -> String {
    if parameters.is_empty() {
        return String::new();
    }
    let mut table = table(&[what, "takes", "unit", "range", "default", "meaning"], 0..0);
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
