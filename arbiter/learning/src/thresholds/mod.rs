//! Edge thresholds of an empty building, by location, for the stationary-obstacle-avoider.
//!
//! Ohya, Kosaka & Kak (1998): the task is driven once through the empty building while a localizer estimates the pose; at each
//! place the threshold is kept that minimizes the difference between the edges of the images and of the map.

mod learner;
mod plot;
mod unlearned;

use std::path::PathBuf;

use serde::Serialize;
use yamabico_core::behavior::Plugin;
use yamabico_host::config::Task;
use yamabico_runtime::execution::{Progress, RunEnd};
use yamabico_stationary_obstacle_avoider::StationaryObstacleAvoider;
use yamabico_stationary_obstacle_avoider::threshold_table::{Place, THRESHOLD_FILE};

use crate::error::write_text;
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
}

/// The thresholds learned on a drive.
#[derive(Debug, Serialize)]
pub struct Learned {
    /// The table that was written.
    pub table: PathBuf,
    /// The plot that was written.
    pub plot: PathBuf,
    /// Why the drive ended.
    pub end: RunEnd,
    /// Number of frames learned from.
    pub frames: u32,
    /// Places with a threshold.
    pub places: Vec<Place>,
    /// Places without one.
    pub refused: Vec<Refused>,
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
}

/// Drives the task once, with the stationary-obstacle-avoider disabled, and writes the table and its plot. Thresholds that the
/// task names are neither read nor needed: they may be missing, or learned with another camera.
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
        behavior.settings.enabled &= behavior.factory.info().name != StationaryObstacleAvoider::NAME;
    }
    let mut learner = ThresholdLearner::new(&task, options.spacing_m).map_err(LearningError::Unsuitable)?;
    let end = source.drive(&task, &mut learner, progress)?;
    let frames = learner.frames();
    let (table, curves, refused) = learner.finish();
    write_text(&options.table, &THRESHOLD_FILE, &table.to_toml())?;
    plot::plot(&options.plot, &curves, &table.places)?;
    Ok(Learned {
        table: options.table.clone(),
        plot: options.plot.clone(),
        end,
        frames,
        places: table.places,
        refused,
    })
}
