//! Edge thresholds of an empty building, by location, for the stationary-obstacle-avoider.
//!
//! Ohya, Kosaka & Kak (1998): the task is driven once through the empty building while a localizer estimates the pose, or the
//! recording of such a drive is read; at each place the threshold is kept that minimizes the difference between the edges of the
//! images and of the map.

mod learner;
mod plot;
mod unlearned;

use std::fmt;
use std::path::PathBuf;

use serde::Serialize;
use yamabico_core::behavior::Plugin;
use yamabico_host::config::Task;
use yamabico_runtime::execution::{Progress, RunEnd};
use yamabico_stationary_obstacle_avoider::StationaryObstacleAvoider;
use yamabico_stationary_obstacle_avoider::threshold_table::{Place, THRESHOLD_FILE};

use crate::error::write_text;
use crate::task_source::play_recording;
use crate::{LearningError, TaskSource};
use learner::ThresholdLearner;
use unlearned::without_learned_thresholds;

/// Settings of a threshold learning drive.
#[derive(Clone, Debug)]
pub struct Options {
    /// The table to write.
    pub table: PathBuf,
    /// The plot to write, a PNG.
    pub plot: PathBuf,
    /// Distance between places, m, 0.05 to 10.
    pub spacing_m: f64,
    /// A recording to read instead of driving.
    pub recording: Option<PathBuf>,
}

/// The thresholds learned on a drive.
#[derive(Debug, Serialize)]
pub struct Learned {
    /// The table that was written; `None` if no place was learned.
    pub table: Option<PathBuf>,
    /// The plot that was written; `None` if no place was learned.
    pub plot: Option<PathBuf>,
    /// Why the drive ended.
    pub end: RunEnd,
    /// Number of frames learned from.
    pub frames: u32,
    /// Places with a threshold.
    pub places: Vec<Place>,
    /// Places without one.
    pub refused: Vec<Refused>,
    /// Parts of the recording that were not used, for people.
    pub warnings: Vec<String>,
}

/// A place where no threshold could be learned.
#[derive(Debug, Serialize)]
pub struct Refused {
    /// Position of the robot on the map, m.
    pub x_m: f64,
    /// Position of the robot on the map, m.
    pub y_m: f64,
    /// Heading of the robot on the map, degrees.
    pub heading_deg: f64,
    /// The reason, for people.
    pub reason: String,
    /// True if the thresholds of a learned place nearby apply here. Without them only edges on the floor show obstacles, and
    /// within 1 m of a learned place none: the robot then drives at most at `blind_speed_mps`.
    pub is_covered: bool,
}

/// Drives the task once, with the stationary-obstacle-avoider disabled, or plays the recording, and writes the table and its
/// plot, unless no place was learned. Thresholds that the task names are neither read nor needed: they may be missing, or learned
/// with another camera.
///
/// # Errors
/// [`LearningError`]; a task without a localizer that has a camera, odometry and a map is unsuitable.
pub fn learn(
    source: &TaskSource,
    options: &Options,
    progress: &mut dyn FnMut(&Task, Progress),
) -> Result<Learned, LearningError> {
    let source = TaskSource { plugins: without_learned_thresholds(source.plugins.clone()), ..source.clone() };
    let mut task = source.load()?;
    for behavior in &mut task.behaviors {
        if behavior.factory.info().name == StationaryObstacleAvoider::NAME {
            behavior.settings.enabled = false;
            // In a process of its own it reads the table as it is in the task.
            behavior.table.remove(THRESHOLD_FILE.key);
        }
    }
    let mut learner = ThresholdLearner::new(&task, options.spacing_m).map_err(LearningError::Unsuitable)?;
    let (end, warnings) = match &options.recording {
        Some(recording) => (RunEnd::SensorsEnded, play_recording(recording, &mut learner)?),
        None => (source.drive(&task, &mut learner, progress)?, Vec::new()),
    };
    let frames = learner.frames();
    let (table, curves, refused) = learner.finish();
    let is_usable = !table.places.is_empty();
    if is_usable {
        write_text(&options.table, &THRESHOLD_FILE, &(table.to_toml() + &comment(&refused)))?;
        plot::plot(&options.plot, &curves, &table.places)?;
    }
    Ok(Learned {
        table: is_usable.then(|| options.table.clone()),
        plot: is_usable.then(|| options.plot.clone()),
        end,
        frames,
        places: table.places,
        refused,
        warnings,
    })
}

/// Returns the refused places as comments of the table.
fn comment(refused: &[Refused]) -> String {
    let lines = refused.iter().map(|refused| format!("# {refused}\n"));
    if refused.is_empty() { String::new() } else { format!("\n{}", lines.collect::<String>()) }
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Refused { x_m, y_m, heading_deg, reason, is_covered } = self;
        let effect = match is_covered {
            true => "the thresholds of the nearest learned place apply here",
            false => {
                "without thresholds only edges on the floor show obstacles here; within 1 m of a learned place the robot \
                 drives at most at `blind_speed_mps`"
            }
        };
        write!(
            f,
            "nothing learned at x {x_m:.2} m, y {y_m:.2} m, heading {heading_deg:.0} deg: {reason}; {effect}"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_stationary_obstacle_avoider::threshold_table::ThresholdTable;

    #[test]
    fn a_table_names_the_refused_places_and_can_be_read() {
        let place = |is_covered| Refused {
            x_m: 2.5,
            y_m: 0.1,
            heading_deg: 3.0,
            reason: "the map has no vertical edge in view".to_owned(),
            is_covered,
        };
        let table = ThresholdTable { width: 256, height: 240, regions: 5, exposure: 1.0, places: Vec::new() };
        let text = table.to_toml() + &comment(&[place(false), place(true)]);
        assert!(text.contains("# nothing learned at x 2.50 m, y 0.10 m, heading 3 deg: the map has"));
        assert!(text.contains("`blind_speed_mps`") && text.contains("nearest learned place"));
        assert!(ThresholdTable::from_toml(&text).is_ok_and(|read| read == table));
    }
}
