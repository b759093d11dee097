//! `yamabico schema`: the JSON Schemas of configuration files.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::{Map, Value};
use yamabico::plugins::plugins;
use yamabico_host::config;
use yamabico_parameters::instead;

use crate::output::{CommandResult, DONE, Failure, Print, say};

/// Arguments of `schema`.
#[derive(Args)]
pub struct Arguments {
    /// Kind of file: task, robot, world, map, ...; without it, all kinds in one object.
    kind: Option<String>,
    /// Folder to which all schemas are written, one file KIND.json per kind.
    #[arg(long, value_name = "DIR", conflicts_with = "kind")]
    out: Option<PathBuf>,
    /// Task file whose external programs are asked for the keys of their behaviors, which the schema of tasks then has.
    #[arg(long, value_name = "FILE")]
    task: Option<PathBuf>,
    /// Robot file whose external programs are asked for the keys of their devices, sensors and drives, which the schema of
    /// robots then has.
    #[arg(long, value_name = "FILE")]
    robot: Option<PathBuf>,
}

/// Prints or writes the schemas.
pub fn schema(arguments: &Arguments) -> CommandResult {
    let Arguments { task, robot, .. } = arguments;
    let all = config::schema_with_programs(task.as_deref(), robot.as_deref(), &plugins());
    let all = all.map_err(Failure::usage)?;
    let none = Map::new();
    let kinds = all.as_object().unwrap_or(&none);
    if let Some(folder) = &arguments.out {
        return write(kinds, folder);
    }
    match &arguments.kind {
        None => Print::Json.show(&all, |_| String::new()),
        Some(kind) => match kinds.get(kind) {
            Some(schema) => Print::Json.show(schema, |_| String::new()),
            None => {
                let instead = instead(kind, kinds.keys().map(String::as_str), "kind of file");
                return Err(Failure::usage(format!("unknown kind of file `{kind}`; {instead}")));
            }
        },
    }
    Ok(DONE)
}

fn write(kinds: &Map<String, Value>, folder: &Path) -> CommandResult {
    let failed = |path: &Path, error: &dyn std::fmt::Display| {
        Failure::usage(format!("{} could not be written: {error}", path.display()))
    };
    std::fs::create_dir_all(folder).map_err(|error| failed(folder, &error))?;
    for (kind, schema) in kinds {
        let path = folder.join(format!("{kind}.json"));
        std::fs::write(&path, format!("{schema:#}\n")).map_err(|error| failed(&path, &error))?;
    }
    say(&format!("{} schemas written to {}", kinds.len(), folder.display()));
    Ok(DONE)
}
