//! `yamabico learn map`: where the vertical edges of a building stand, from a drive with a camera that looks all around.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use nalgebra::Point2;
use serde::Serialize;
use yamabico_core::camera::Mount;
use yamabico_core::geometry::Pose2;
use yamabico_core::image::GrayImage;
use yamabico_core::message::{FrameHeader, MessageType, RawMessage, View};
use yamabico_core::sensor::SensorKind;
use yamabico_core::time::Time;
use yamabico_host::config::Task;
use yamabico_runtime::execution::{End, topics};
use yamabico_runtime::record::{Tap, play};
use yamabico_vision::azimuth_map::{EdgeMap, Mapper, MapperRule, WayRule};
use yamabico_vision::azimuth_profile::ProfileRule;
use yamabico_vision::radial_edges::{RadialEdgeRule, RadialEdges};

use super::TaskArguments;
use super::learn::drive;
use super::map_plot::plot;
use super::verify_surfaces::{self, Verifier};
use super::whereabouts::Whereabouts;
use crate::output::{BAD_CONFIGURATION, DEVICE_FAILED, DONE, NOT_ARRIVED, Print, exit, fail, table};

/// Pictures that wait for the odometry of their instant.
const MAX_PICTURES: usize = 16;

/// What `learn map` is told.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    task: TaskArguments,
    /// The map that is written.
    #[arg(long, value_name = "FILE.toml", default_value = "map.toml")]
    out: PathBuf,
    /// A picture of it; without it, beside the map.
    #[arg(long, value_name = "FILE.png")]
    plot: Option<PathBuf>,
    /// How far the camera sways about the vertical from picture to picture, degrees, 0.01 to 10.
    #[arg(long, value_name = "DEG", default_value_t = 0.1)]
    sway_deg: f64,
    /// Listens to this recording instead of driving.
    #[arg(long, value_name = "FILE.mcap", conflicts_with_all = ["verify", "seed"])]
    from: Option<PathBuf>,
    /// Drives a second time, on the new map, and faces every surface with the sonar to tell whether it is solid.
    #[arg(long)]
    verify: bool,
    /// Seed of everything that is drawn by chance.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// What was learned.
#[derive(Debug, Serialize)]
struct Learned {
    map: PathBuf,
    plot: PathBuf,
    end: End,
    pictures: usize,
    edges: Vec<Edge>,
    surfaces: usize,
    verified: usize,
}

/// An edge of the map.
#[derive(Debug, Serialize)]
struct Edge {
    number: u32,
    x_m: f64,
    y_m: f64,
    sigma_m: f64,
    pictures: u32,
}

/// Learns and prints what.
pub fn learn(arguments: &Arguments, print: Print) -> ExitCode {
    let Some(task) = arguments.task.load_or_tell(print) else { return exit(BAD_CONFIGURATION) };
    let mut cartographer = match Cartographer::new(&task, arguments.sway_deg) {
        Ok(cartographer) => cartographer,
        Err(problem) => return fail(&problem, BAD_CONFIGURATION),
    };
    if arguments.verify
        && let Err(problem) = Verifier::new(&task, &EdgeMap::default())
    {
        return fail(&problem, BAD_CONFIGURATION);
    }
    let ended = match &arguments.from {
        Some(recording) => listen(recording, &mut cartographer),
        None => drive(&task, &arguments.task, arguments.seed, &mut cartographer, print),
    };
    let end = match ended {
        Ok(end) => end,
        Err(code) => return code,
    };
    let plot_file = arguments.plot.clone().unwrap_or_else(|| arguments.out.with_extension("png"));
    let found = cartographer.mapper.finish().map_err(|error| error.to_string());
    let mut map = match found.and_then(|map| write(&arguments.out, &map).map(|()| map)) {
        Ok(map) => map,
        Err(problem) => return fail(&problem, DEVICE_FAILED),
    };
    let mut verified = 0;
    if arguments.verify && end != End::Interrupted {
        let start = cartographer.mapper.places().first().map_or(Point2::origin(), Pose2::position);
        verified = match verify(arguments, &task, start, &mut map, print) {
            Ok(verified) => verified,
            Err(code) => return code,
        };
    }
    let written = write(&arguments.out, &map).and_then(|()| plot(&plot_file, &map));
    if let Err(problem) = written {
        return fail(&problem, DEVICE_FAILED);
    }
    let learned = Learned {
        map: arguments.out.clone(),
        plot: plot_file,
        end,
        pictures: cartographer.mapper.places().len(),
        surfaces: map.surfaces.len(),
        verified,
        edges: map
            .edges
            .iter()
            .map(|edge| Edge {
                number: edge.number,
                x_m: edge.at_m[0],
                y_m: edge.at_m[1],
                sigma_m: edge.located().covariance.symmetric_eigenvalues().max().max(0.0).sqrt(),
                pictures: edge.seen,
            })
            .collect(),
    };
    print.show(&learned, text);
    exit(if end == End::Interrupted { NOT_ARRIVED } else { DONE })
}

/// Hears what was recorded on an earlier drive.
fn listen(recording: &Path, cartographer: &mut Cartographer) -> Result<End, ExitCode> {
    let played =
        play(recording, cartographer).map_err(|error| fail(&error.to_string(), BAD_CONFIGURATION))?;
    let file = recording.display();
    for left_out in &played.left_out {
        eprintln!("{file}: left out: {left_out}");
    }
    if let Some(why) = &played.broken_off {
        eprintln!("{file} breaks off after {} messages: {why}", played.messages);
    }
    Ok(End::SensorsEnded)
}

/// The second drive; how many surfaces it told.
fn verify(
    arguments: &Arguments,
    task: &Task,
    start: Point2<f64>,
    map: &mut EdgeMap,
    print: Print,
) -> Result<usize, ExitCode> {
    let Some(settings) = verify_surfaces::settings(task, map, start, &arguments.out) else { return Ok(0) };
    let set = arguments.task.set.iter().cloned().chain(settings).collect();
    let file = arguments.task.file.clone();
    let second = TaskArguments { file, robot: arguments.task.robot.clone(), set };
    let task = second.load_or_tell(print).ok_or_else(|| exit(BAD_CONFIGURATION))?;
    let mut verifier = Verifier::new(&task, map).map_err(|problem| fail(&problem, BAD_CONFIGURATION))?;
    drive(&task, &second, arguments.seed, &mut verifier, print)?;
    Ok(verifier.tell(map))
}

fn write(path: &Path, map: &EdgeMap) -> Result<(), String> {
    let cannot = |error: std::io::Error| format!("{}: {error}", path.display());
    if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(cannot)?;
    }
    let head = "# Vertical edges, what may stand between them, and what is free, as `yamabico learn map` found them.\n\n";
    std::fs::write(path, head.to_owned() + &map.to_toml()).map_err(cannot)
}

fn text(learned: &Learned) -> String {
    let head = ["edge", "x m", "y m", "sigma m", "pictures"];
    let mut edges = table(&head, 0..head.len());
    for edge in &learned.edges {
        edges.add_row([
            edge.number.to_string(),
            format!("{:.3}", edge.x_m),
            format!("{:.3}", edge.y_m),
            format!("{:.3}", edge.sigma_m),
            edge.pictures.to_string(),
        ]);
    }
    format!(
        "{edges}\n{} edges and {} surfaces between them, {} of these verified, from {} pictures in {}; its picture is {}\n",
        learned.edges.len(),
        learned.surfaces,
        learned.verified,
        learned.pictures,
        learned.map.display(),
        learned.plot.display()
    )
}

/// Listens to a run: pictures of the mirror camera, odometry, and poses where somebody tells them.
struct Cartographer {
    camera: String,
    whereabouts: Whereabouts,
    robot_from_camera: Pose2,
    size: [u32; 2],
    edges: RadialEdges,
    mapper: Mapper,
    pictures: VecDeque<(Time, GrayImage)>,
}

impl Cartographer {
    fn new(task: &Task, sway_deg: f64) -> Result<Self, String> {
        if !(0.01..=10.0).contains(&sway_deg) {
            return Err(format!("--sway-deg {sway_deg}: 0.01 to 10 degrees"));
        }
        let sensors = || task.behaviors.iter().flat_map(|behavior| &behavior.setup.sensors);
        let mirror = sensors().find_map(|(_, sensor)| match &sensor.kind {
            SensorKind::MirrorCamera { camera, mount, .. } => Some((sensor.name.clone(), camera, *mount)),
            _ => None,
        });
        let (camera, mirror, mount) =
            mirror.ok_or("no behavior of the task has a mirror camera: edges are mapped by one")?;
        let whereabouts = Whereabouts::of(task)
            .ok_or("no behavior of the task has odometry: a map has its scale from it")?;
        let Mount { x, y, pan, .. } = mount;
        let image = mirror.image();
        let ways = WayRule { sway_rad: sway_deg.to_radians(), ..WayRule::default() };
        Ok(Self {
            camera: topics::sensor(&camera),
            whereabouts,
            robot_from_camera: Pose2::new(x, y, pan),
            size: image.size(),
            edges: RadialEdges::new(image, &RadialEdgeRule::within(image), ProfileRule::default()),
            mapper: Mapper::new(MapperRule { ways, ..MapperRule::default() }),
            pictures: VecDeque::new(),
        })
    }

    fn keep(&mut self, frame: &View<'_, FrameHeader>) {
        let mut luma = GrayImage::default();
        if let Some(image) = frame.gray(self.size, &mut luma) {
            let mut gray = GrayImage::default();
            gray.copy_from(image);
            self.pictures.truncate(MAX_PICTURES - 1);
            self.pictures.push_back((Time(frame.header.stamp_ns), gray));
        }
    }

    /// Maps the pictures whose place is known by now.
    fn map(&mut self) {
        while let Some((stamp, gray)) = self.pictures.front() {
            let Some(robot) = self.whereabouts.at(*stamp) else { return };
            let camera = robot.compose(&self.robot_from_camera);
            if let Ok(picture) = gray.view()
                && let Ok(edges) = self.edges.find(picture)
            {
                self.mapper.take(edges, &camera);
            }
            self.pictures.pop_front();
        }
    }
}

impl Tap for Cartographer {
    fn message(&mut self, topic: &str, _: &MessageType, time: Time, header: &[u8], items: &[u8]) {
        let raw = RawMessage { header, items };
        if topic == self.camera
            && let Some(frame) = View::<FrameHeader>::of(raw)
        {
            self.keep(&frame);
        }
        if self.whereabouts.hear(topic, raw, time) {
            self.map();
        }
    }
}
