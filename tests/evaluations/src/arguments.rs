//! Arguments that evaluations share: seeds, data folder, sizes, poses and parameters.

use std::ops::Range;
use std::path::PathBuf;

use clap::Args;
use yamabico_core::geometry::Pose2;
use yamabico_testkit::data;

/// Seeds of the simulated worlds.
#[derive(Args)]
pub struct Seeds {
    /// Seeds: FIRST..LAST, both included, or a number of seeds from 1 on.
    #[arg(long, value_name = "SEEDS", value_parser = parse_seeds)]
    seeds: Option<Range<u64>>,
}

impl Seeds {
    /// Returns the seeds, or `default` if none are given.
    pub fn or(&self, default: Range<u64>) -> Range<u64> {
        self.seeds.clone().unwrap_or(default)
    }
}

fn parse_seeds(text: &str) -> Result<Range<u64>, String> {
    let number = |text: &str| text.parse::<u64>().map_err(|error| format!("{text}: {error}"));
    let (first, last) = match text.split_once("..") {
        Some((first, last)) => (number(first)?, number(last)?),
        None => (1, number(text)?),
    };
    let range = first..last.saturating_add(1);
    if range.is_empty() { Err("needs at least one seed, such as 1..20".to_owned()) } else { Ok(range) }
}

/// Number of samples drawn from one random stream, and the seed of that stream.
#[derive(Args)]
pub struct Samples {
    /// Number of samples.
    #[arg(long, value_name = "COUNT")]
    samples: Option<usize>,
    /// Seed of the random stream that samples are drawn from.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

impl Samples {
    /// Returns the number of samples, or `default` if none is given.
    pub fn count_or(&self, default: usize) -> usize {
        self.samples.unwrap_or(default)
    }
}

/// Folder of the recorded data sets.
#[derive(Args)]
pub struct Data {
    /// Folder of the data sets, or of the data set itself [default: $YAMABICO_DATA, else ../shared/data beside the workspace].
    #[arg(value_name = "DIR")]
    folder: Option<PathBuf>,
}

impl Data {
    /// Returns the folder of a data set; prints that it is skipped and returns `None` if it is missing.
    pub fn set(&self, name: &str) -> Option<PathBuf> {
        match &self.folder {
            Some(folder) => data::data_set_in(folder, name),
            None => data::data_set(name),
        }
    }
}

/// Parameters of a behavior.
#[derive(Args)]
pub struct Parameters {
    /// Parameter of the behavior as a line of TOML, such as `columns = 34`; may be repeated.
    #[arg(long, value_name = "TOML")]
    set: Vec<String>,
}

impl Parameters {
    /// Returns `defaults` with the given parameters in place of equal keys, as TOML.
    pub fn over(&self, defaults: &str) -> Result<toml::Table, String> {
        let parse = |text: &str| text.parse::<toml::Table>().map_err(|error| format!("{text}: {error}"));
        let mut table = parse(defaults)?;
        for line in &self.set {
            table.extend(parse(line)?);
        }
        Ok(table)
    }
}

/// Size of rendered images.
#[derive(Args)]
pub struct Size {
    /// Width and height of the images, px, such as 640x480.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<(u32, u32)>,
}

impl Size {
    /// Returns width and height, or `default` if they are not given.
    pub fn or(&self, default: (u32, u32)) -> (u32, u32) {
        self.size.unwrap_or(default)
    }
}

fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let (width, height) = text.split_once('x').ok_or("needs width and height, such as 640x480")?;
    let number = |text: &str| text.parse::<u32>().map_err(|error| format!("{text}: {error}"));
    Ok((number(width)?, number(height)?))
}

/// A pose of the robot.
#[derive(Args)]
pub struct At {
    /// Pose of the robot, m, m, degrees.
    #[arg(long, value_name = "X,Y,HEADING_DEG", value_parser = parse_pose, allow_hyphen_values = true)]
    at: Option<Pose2>,
}

impl At {
    /// Returns the pose, or x, y (m) and heading (degrees) of `default` if none is given.
    pub fn or(&self, default: [f64; 3]) -> Pose2 {
        let [x, y, heading_deg] = default;
        self.at.unwrap_or_else(|| Pose2::new(x, y, heading_deg.to_radians()))
    }
}

fn parse_pose(text: &str) -> Result<Pose2, String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
    let numbers = numbers.ok().and_then(|list| <[f64; 3]>::try_from(list).ok());
    let [x, y, heading_deg] = numbers.ok_or("needs x, y (m) and heading (degrees), such as 3,0.1,90")?;
    Ok(Pose2::new(x, y, heading_deg.to_radians()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_are_a_range_or_a_count() {
        assert_eq!(parse_seeds("3..5"), Ok(3..6));
        assert_eq!(parse_seeds("20"), Ok(1..21));
        assert!(parse_seeds("5..3").is_err() && parse_seeds("0").is_err());
    }
}
