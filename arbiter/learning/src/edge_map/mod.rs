//! A map of the vertical edges of a building, for the map-localizer with method azimuth.
//!
//! Yagi, Nishizawa & Yachida (1995): the azimuths of vertical edges in the images of a mirror camera, taken along a drive, are
//! intersected. A second drive may then face each surface between two edges with a sonar, to verify that it is solid.

mod mapper;
mod plot;
mod surface_route;
mod surface_verifier;

use std::path::{Path, PathBuf};

use nalgebra::Point2;
use serde::Serialize;
use yamabico_core::geometry::Pose2;
use yamabico_host::config::Task;
use yamabico_runtime::execution::{Progress, RunEnd};
use yamabico_vision::azimuth_map::EdgeMap;

use crate::error::write_text;
use crate::task_source::play_recording;
use crate::{LearningError, TaskSource};
use mapper::EdgeMapper;
use surface_verifier::SurfaceVerifier;

/// Settings of a mapping drive.
#[derive(Clone, Debug)]
pub struct Options {
    /// The map to write.
    pub map: PathBuf,
    /// The plot to write, a PNG.
    pub plot: PathBuf,
    /// Standard deviation of the camera's sway about the vertical between frames, degrees, 0.01 to 10.
    pub sway_deg: f64,
    /// A recording to read instead of driving.
    pub recording: Option<PathBuf>,
    /// If set, a second drive verifies the surfaces.
    pub verify: bool,
}

/// The map learned on a drive.
#[derive(Debug, Serialize)]
pub struct Learned {
    /// The map that was written.
    pub map: PathBuf,
    /// The plot that was written.
    pub plot: PathBuf,
    /// Why the drive ended.
    pub end: RunEnd,
    /// Number of frames that went into the map.
    pub frames: usize,
    /// The edges of the map.
    pub edges: Vec<LearnedEdge>,
    /// Number of surfaces between edges.
    pub surfaces: usize,
    /// Number of surfaces that the second drive verified.
    pub verified: usize,
    /// Parts of the recording that were not used, for people.
    pub warnings: Vec<String>,
}

/// An edge of a learned map.
#[derive(Debug, Serialize)]
pub struct LearnedEdge {
    /// Number of the edge in the map.
    pub number: u32,
    /// Position on the map, m.
    pub x_m: f64,
    /// Position on the map, m.
    pub y_m: f64,
    /// Standard deviation of the position along the major axis of its covariance, m.
    pub sigma_m: f64,
    /// Number of frames in which the edge was observed.
    pub frames: u32,
}

/// Drives the task, or plays the recording, and writes the map and its plot.
///
/// # Errors
/// [`LearningError`]; a task without a mirror camera or odometry is unsuitable, as is one without a sonar or a localizer if the
/// surfaces are to be verified.
pub fn learn(
    source: &TaskSource,
    options: &Options,
    progress: &mut dyn FnMut(&Task, Progress),
) -> Result<Learned, LearningError> {
    let task = source.load()?;
    let mut mapper = EdgeMapper::new(&task, options.sway_deg).map_err(LearningError::Unsuitable)?;
    if options.verify {
        SurfaceVerifier::new(&task, &EdgeMap::default()).map_err(LearningError::Unsuitable)?;
    }
    let (end, warnings) = match &options.recording {
        Some(recording) => (RunEnd::SensorsEnded, play_recording(recording, &mut mapper)?),
        None => (source.drive(&task, &mut mapper, progress)?, Vec::new()),
    };
    let mut map = mapper.finish().map_err(LearningError::Unsuitable)?;
    write(&options.map, &map)?;
    let mut verified = 0;
    if options.verify {
        let start = mapper.camera_poses().first().map_or(Point2::origin(), Pose2::position);
        verified = verify(source, &task, start, &mut map, &options.map, progress)?;
        write(&options.map, &map)?;
    }
    plot::plot(&options.plot, &map)?;
    let edges = map.edges.iter().map(|edge| LearnedEdge {
        number: edge.number,
        x_m: edge.at_m[0],
        y_m: edge.at_m[1],
        sigma_m: edge.located().covariance.symmetric_eigenvalues().max().max(0.0).sqrt(),
        frames: edge.seen,
    });
    Ok(Learned {
        map: options.map.clone(),
        plot: options.plot.clone(),
        end,
        frames: mapper.camera_poses().len(),
        surfaces: map.surfaces.len(),
        verified,
        edges: edges.collect(),
        warnings,
    })
}

/// Drives a second time, on the new map in `file`, and writes the states of the surfaces into `map`; returns how many
/// surfaces were verified.
fn verify(
    source: &TaskSource,
    task: &Task,
    start: Point2<f64>,
    map: &mut EdgeMap,
    file: &Path,
    progress: &mut dyn FnMut(&Task, Progress),
) -> Result<usize, LearningError> {
    let Some(settings) = surface_route::settings(task, map, start, file) else { return Ok(0) };
    let mut second = source.clone();
    second.overrides.set.extend(settings);
    let task = second.load()?;
    let mut verifier = SurfaceVerifier::new(&task, map).map_err(LearningError::Unsuitable)?;
    second.drive(&task, &mut verifier, progress)?;
    Ok(verifier.apply(map))
}

fn write(path: &Path, map: &EdgeMap) -> Result<(), LearningError> {
    let head = "# Vertical edges, the surfaces between them and the free space, learned by `yamabico learn map`.\n\n";
    write_text(path, &(head.to_owned() + &map.to_toml()))
}
