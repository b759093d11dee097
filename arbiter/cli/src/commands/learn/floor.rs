//! `yamabico learn floor`: the colors of a floor.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use yamabico_learning::floor::{self, Learned};

use crate::output::{CommandResult, DONE, Print, table};

/// Arguments of `learn floor`.
#[derive(Args)]
pub struct Arguments {
    /// Folder of images NAME.png or NAME.jpg, each with a mask NAME.mask.png of the same size: white marks the floor, black
    /// everything else, gray is left out.
    folder: PathBuf,
    /// File to write.
    #[arg(long, value_name = "FILE.toml", default_value = "floor.toml")]
    out: PathBuf,
    /// Form of the colors.
    #[arg(long, value_enum, default_value_t = Form::Table)]
    form: Form,
}

#[derive(Clone, Copy, ValueEnum)]
enum Form {
    /// A class for each of 32 x 32 x 32 colors.
    Table,
    /// A minimum and a maximum of red, green and blue: faster, and enough for a floor in one light.
    Thresholds,
}

/// Learns the colors and prints how well each image is recognized.
pub fn learn(arguments: &Arguments, print: Print) -> CommandResult {
    let form = match arguments.form {
        Form::Table => floor::Form::Table,
        Form::Thresholds => floor::Form::Thresholds,
    };
    let learned = floor::learn(&arguments.folder, &arguments.out, form)?;
    print.show(&learned, text);
    Ok(DONE)
}

fn text(learned: &Learned) -> String {
    let header = [
        "image",
        "floor px",
        "other px",
        "recall",
        "false alarms",
        "recall, left out",
        "false alarms, left out",
    ];
    let mut rows = table(&header, 1..header.len());
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let optional = |share: Option<f64>| share.map_or_else(|| "-".into(), percent);
    for image in &learned.images {
        rows.add_row([
            image.name.clone(),
            image.floor_px.to_string(),
            image.other_px.to_string(),
            percent(image.recall),
            percent(image.false_alarms),
            optional(image.recall_by_others),
            optional(image.false_alarms_by_others),
        ]);
    }
    format!(
        "{rows}\nleft out: by the colors learned from all other images\n\
         colors {}: name the file as `floor_colors` of the free-space-avoider\n",
        learned.file.display()
    )
}
