//! Scores on recordings of robots.

pub mod beacons;
pub mod halts;
pub mod landmarks;

use std::fs::File;
use std::io::Read;
use std::path::Path;

use flate2::read::GzDecoder;

/// Reads the numbers of a CSV table with one header row, gzip-compressed if its name ends with `.gz`.
fn rows(path: &Path) -> Result<Vec<Vec<f64>>, String> {
    let problem = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
    let mut file = File::open(path).map_err(|error| problem(&error))?;
    let mut text = String::new();
    let is_compressed = path.extension().is_some_and(|extension| extension == "gz");
    let read = if is_compressed {
        GzDecoder::new(file).read_to_string(&mut text)
    } else {
        file.read_to_string(&mut text)
    };
    read.map_err(|error| problem(&error))?;
    let parse = |line: &str| line.split(',').map(|value| value.trim().parse()).collect::<Result<_, _>>();
    let lines = text.lines().skip(1).filter(|line| !line.trim().is_empty());
    lines.map(parse).collect::<Result<_, std::num::ParseFloatError>>().map_err(|error| problem(&error))
}
