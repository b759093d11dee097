//! What an example that proposes on one picture is told.

use std::path::PathBuf;

use yamabico_core::geometry::Pose2;

/// `[PICTURE] [--at X,Y,HEADING_DEG] [--set TOML] [--out FILE]`
pub struct Arguments {
    /// The picture; without one, the simulator takes it.
    pub picture: Option<PathBuf>,
    /// Where the simulator takes it.
    pub robot: Pose2,
    /// Keys of the behavior.
    pub toml: String,
    /// Where what was seen is to be written.
    pub out: Option<PathBuf>,
}

impl Arguments {
    /// Those of the command line, with what holds where it says nothing: a place and keys of the behavior.
    ///
    /// # Errors
    /// What is wrong with them.
    pub fn read(robot: Pose2, toml: &str) -> Result<Self, String> {
        let mut read = Self { picture: None, robot, toml: toml.to_owned(), out: None };
        let mut rest = std::env::args().skip(1);
        while let Some(argument) = rest.next() {
            let mut value = || rest.next().ok_or(format!("{argument} needs a value"));
            match argument.as_str() {
                "--at" => {
                    let text = value()?;
                    let numbers: Result<Vec<f64>, _> = text.split(',').map(str::parse).collect();
                    let [x, y, heading_deg] =
                        numbers.ok().and_then(|list| list.try_into().ok()).ok_or("--at X,Y,HEADING_DEG")?;
                    read.robot = Pose2::new(x, y, heading_deg.to_radians());
                }
                "--set" => read.toml = read.toml + &value()? + "\n",
                "--out" => read.out = Some(PathBuf::from(value()?)),
                _ if read.picture.is_none() && !argument.starts_with('-') => {
                    read.picture = Some(PathBuf::from(&argument));
                }
                _ => return Err(format!("unknown argument {argument}")),
            }
        }
        Ok(read)
    }
}
