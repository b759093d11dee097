//! `yamabico learn`: what the robot needs to know of a building, from a drive through it while it is empty.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

use clap::{Args, Subcommand};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;
use yamabico_core::behavior::Plugin;
use yamabico_core::camera::Pinhole;
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_core::image::GrayImage;
use yamabico_core::message::{
    FrameHeader, Message, MessageType, Odometry, Pose, PoseStatus, RawMessage, View,
};
use yamabico_core::odometry_track::OdometryTrack;
use yamabico_core::sensor::SensorKind;
use yamabico_core::time::Time;
use yamabico_host::config::{BehaviorFile, InputSource, Task};
use yamabico_runtime::execution::{End, topics};
use yamabico_runtime::record::Tap;
use yamabico_runtime::run::{Options, run as run_task};
use yamabico_stationary_obstacle_avoider::StationaryObstacleAvoider;
use yamabico_stationary_obstacle_avoider::detector::{Detector, DetectorRules};
use yamabico_stationary_obstacle_avoider::threshold_learning::{PlaceLearner, Row, Validity};
use yamabico_stationary_obstacle_avoider::threshold_table::{Place, ThresholdTable};
use yamabico_vision::map::WireFrame;

use super::learn_plot::plot;
use super::{TaskArguments, learn_floor, learn_map};
use crate::output::{BAD_CONFIGURATION, DEVICE_FAILED, DONE, NOT_ARRIVED, Print, exit, fail, table};

/// Pictures that wait for their pose.
const MAX_PICTURES: usize = 8;
/// Turned by more than this (rad), the robot is at another place.
const TURNED_RAD: f64 = 0.26;

/// What is learned.
#[derive(Subcommand)]
pub enum Learn {
    /// The thresholds of the stationary-obstacle-avoider: drives the task through the empty building and writes a table.
    Thresholds(Arguments),
    /// A map of vertical edges, for the map-localizer: drives the task and looks all around.
    Map(learn_map::Arguments),
    /// The colors of a floor, for the free-space-avoider: from pictures and masks in a folder.
    Floor(learn_floor::Arguments),
}

/// What `learn thresholds` is told.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    task: TaskArguments,
    /// The table that is written.
    #[arg(long, value_name = "FILE.toml", default_value = "thresholds.toml")]
    out: PathBuf,
    /// A picture of how much differs from the map at each threshold; without it, beside the table.
    #[arg(long, value_name = "FILE.png")]
    plot: Option<PathBuf>,
    /// Distance from one place to the next, meters.
    #[arg(long, value_name = "M", default_value_t = 0.5)]
    every: f64,
    /// Seed of everything that is drawn by chance.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// What was learned.
#[derive(Debug, Serialize)]
struct Learned {
    table: PathBuf,
    plot: PathBuf,
    end: End,
    pictures: u32,
    places: Vec<Place>,
    refused: Vec<Refused>,
}

/// A place that nothing was learned at.
#[derive(Debug, Serialize)]
struct Refused {
    x_m: f64,
    y_m: f64,
    heading_deg: f64,
    why: String,
}

/// Learns and prints what.
pub fn learn(learn: &Learn, print: Print) -> ExitCode {
    match learn {
        Learn::Thresholds(arguments) => learn_thresholds(arguments, print),
        Learn::Map(arguments) => learn_map::learn(arguments, print),
        Learn::Floor(arguments) => learn_floor::learn(arguments, print),
    }
}

fn learn_thresholds(arguments: &Arguments, print: Print) -> ExitCode {
    let Some(mut task) = arguments.task.load_or_tell(print) else { return exit(BAD_CONFIGURATION) };
    // What it knew so far must not turn the robot aside from what it learns.
    for behavior in &mut task.behaviors {
        behavior.enabled &= behavior.factory.info().name != StationaryObstacleAvoider::NAME;
    }
    let mut student = match Student::new(&task, arguments.every) {
        Ok(student) => student,
        Err(problem) => return fail(&problem, BAD_CONFIGURATION),
    };
    let end = match drive(&task, &arguments.task, arguments.seed, &mut student, print) {
        Ok(end) => end,
        Err(code) => return code,
    };
    let plot_file = arguments.plot.clone().unwrap_or_else(|| arguments.out.with_extension("png"));
    let learned = match student.finish(&arguments.out, &plot_file, end) {
        Ok(learned) => learned,
        Err(problem) => return fail(&problem, DEVICE_FAILED),
    };
    print.show(&learned, text);
    let is_done = !learned.places.is_empty() && end != End::Interrupted;
    exit(if is_done { DONE } else { NOT_ARRIVED })
}

/// Runs the task once while `student` listens, and tells how it ended.
///
/// # Errors
/// The code to end with, when the problem has been told.
pub(super) fn drive(
    task: &Task,
    arguments: &TaskArguments,
    seed: u64,
    student: &mut dyn Tap,
    print: Print,
) -> Result<End, ExitCode> {
    let bar = progress_bar(task, print);
    let options = Options { seed, overrides: arguments.overrides(), ..Options::default() };
    let ran = run_task(task, &options, &AtomicBool::new(false), student, &mut |progress| {
        let elapsed = progress.elapsed.as_millis() as u64;
        if elapsed >= bar.position() + 100 {
            bar.set_position(elapsed);
            bar.set_message(format!("{:.1} s", progress.elapsed.as_secs_f64()));
        }
    });
    bar.finish_and_clear();
    ran.map(|ran| ran.end).map_err(|error| {
        let code = if error.is_of_a_device() { DEVICE_FAILED } else { BAD_CONFIGURATION };
        fail(&error.to_string(), code)
    })
}

fn text(learned: &Learned) -> String {
    let head = ["x m", "y m", "heading", "T0", "N0", "unexplained", "contrast", "level", "recall"];
    let mut places = table(&head, 0..head.len());
    for p in &learned.places {
        places.add_row([
            format!("{:.2}", p.x_m),
            format!("{:.2}", p.y_m),
            format!("{:.1}", p.heading_deg),
            p.t0.to_string(),
            p.n0.to_string(),
            p.n0_extra.to_string(),
            format!("{:.1}", p.contrast),
            p.level.to_string(),
            format!("{:.2}", p.recall),
        ]);
    }
    let mut text = format!("{places}\n");
    for r in &learned.refused {
        text +=
            &format!("refused: x {:.2} m, y {:.2} m, {:.0} deg: {}\n", r.x_m, r.y_m, r.heading_deg, r.why);
    }
    text + &format!(
        "{} places from {} pictures in {}; the picture of all thresholds is {}\n",
        learned.places.len(),
        learned.pictures,
        learned.table.display(),
        learned.plot.display()
    )
}

fn progress_bar(task: &Task, print: Print) -> ProgressBar {
    let length = task.run.duration.map_or(0, |duration| duration.as_millis() as u64);
    let bar = ProgressBar::with_draw_target(Some(length), ProgressDrawTarget::stderr_with_hz(10));
    if print == Print::Json {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    if let Ok(style) = ProgressStyle::with_template("{prefix} {wide_bar} {msg}") {
        bar.set_style(style);
    }
    bar.set_prefix(format!("learning in {}", task.name));
    bar
}

/// Listens to a run: pictures, odometry and poses.
struct Student {
    camera: String,
    odometry_topic: String,
    pose_topic: String,
    detector: Detector,
    table: ThresholdTable,
    every_m: f64,
    pictures: VecDeque<(Time, f64, GrayImage)>,
    odometry: OdometryTrack,
    learned_at: Option<Time>,
    places: Vec<(Pose2, PlaceLearner)>,
    exposures: Vec<f64>,
    count: u32,
}

impl Student {
    /// For the behavior of the task that publishes poses: its camera, its odometry and its map.
    fn new(task: &Task, every_m: f64) -> Result<Self, String> {
        if !(0.05..=10.0).contains(&every_m) {
            return Err(format!("--every {every_m}: 0.05 to 10 meters"));
        }
        let is_localizer = |behavior: &&BehaviorFile| {
            behavior.factory.info().outputs.iter().any(|output| output.message.name == Pose::NAME)
        };
        let localizer = task.behaviors.iter().find(is_localizer);
        let localizer = localizer.ok_or("no behavior of the task publishes a pose: add a map-localizer")?;
        let sensor_with = |message: &str| {
            localizer.factory.info().inputs.iter().find(|slot| slot.message.name == message).and_then(
                |slot| {
                    localizer.inputs.iter().find(|input| input.slot == slot.name).and_then(|input| {
                        match &input.source {
                            InputSource::Sensor(name) => Some((slot.name.clone(), name.clone())),
                            _ => None,
                        }
                    })
                },
            )
        };
        let (slot, camera) = sensor_with(FrameHeader::NAME).ok_or("the localizer has no camera")?;
        let (_, odometry) = sensor_with(Odometry::NAME).ok_or("the localizer has no odometry")?;
        let info =
            localizer.setup.sensors.iter().find(|(name, _)| *name == *slot).map(|(_, info)| &info.kind);
        let Some(SensorKind::Camera { intrinsics, distortion, mount, .. }) = info else {
            return Err(format!("`{camera}` is no pinhole camera"));
        };
        let map =
            localizer.table.get("map").and_then(toml::Value::as_str).ok_or("the localizer has no map")?;
        let map = WireFrame::read(&localizer.setup.folder.join(map)).map_err(|error| error.to_string())?;
        let rules = DetectorRules::for_size(intrinsics.width, intrinsics.height);
        Ok(Self {
            camera: topics::sensor(&camera),
            odometry_topic: topics::sensor(&odometry),
            pose_topic: topics::output(&localizer.name, "pose"),
            detector: Detector::new(Pinhole::new(*intrinsics, *distortion), *mount, map, rules),
            table: ThresholdTable {
                width: intrinsics.width,
                height: intrinsics.height,
                regions: rules.regions as u32,
                exposure: 1.0,
                places: Vec::new(),
            },
            every_m,
            pictures: VecDeque::new(),
            odometry: OdometryTrack::default(),
            learned_at: None,
            places: Vec::new(),
            exposures: Vec::new(),
            count: 0,
        })
    }

    fn keep(&mut self, frame: &View<'_, FrameHeader>) {
        let mut gray = match self.pictures.len() {
            MAX_PICTURES => self.pictures.pop_front().map(|(_, _, gray)| gray).unwrap_or_default(),
            _ => GrayImage::default(),
        };
        let mut luma = GrayImage::default();
        if let Some(image) = frame.gray(self.detector.camera().intrinsics().size(), &mut luma) {
            gray.copy_from(image);
            self.pictures.push_back((Time(frame.header.stamp_ns), frame.header.exposure, gray));
        }
    }

    /// Learns from the picture that a pose rests on, once.
    fn locate(&mut self, pose: &Pose) {
        let evidence = Time(pose.evidence_ns);
        let is_known = self.learned_at.is_some_and(|last| evidence <= last);
        if is_known || pose.status() != Some(PoseStatus::Tracking) {
            return;
        }
        let Some((_, exposure, gray)) = self.pictures.iter().find(|(stamp, ..)| *stamp == evidence) else {
            return;
        };
        let poses = (self.odometry.pose_at(Time(pose.stamp_ns)), self.odometry.pose_at(evidence));
        let (Some(then), Some(at_picture), Ok(image)) = (poses.0, poses.1, gray.view()) else { return };
        let robot = Pose2::new(pose.x, pose.y, pose.theta) * then.relative(&at_picture);
        self.learned_at = Some(evidence);
        let Ok((rows, look)) = self.detector.learn(image, &robot) else { return };
        self.exposures.push(*exposure);
        self.count += 1;
        self.place(&robot).take(&rows, look);
    }

    /// The place that a pose belongs to: the last one, or a new one where the robot has left it.
    fn place(&mut self, robot: &Pose2) -> &mut PlaceLearner {
        let half_m = 0.5 * self.every_m;
        let is_there = self.places.last().is_some_and(|(at, _)| {
            at.distance(robot) <= 1.02 * half_m && angle_difference(at.theta, robot.theta).abs() <= TURNED_RAD
        });
        if !is_there {
            // The place's middle lies ahead: pictures are taken from half a step before it to half a step behind it.
            let (sin, cos) = robot.theta.sin_cos();
            let middle = Pose2::new(robot.x + half_m * cos, robot.y + half_m * sin, robot.theta);
            self.places.push((middle, PlaceLearner::default()));
        }
        let last = self.places.len() - 1;
        &mut self.places[last].1
    }

    fn finish(mut self, out: &Path, plot_file: &Path, end: End) -> Result<Learned, String> {
        let mut refused = Vec::new();
        let mut curves: Vec<Vec<Row>> = Vec::new();
        self.exposures.sort_by(f64::total_cmp);
        let exposure = self.exposures.get(self.exposures.len() / 2).copied().unwrap_or(1.0);
        self.table.exposure = if exposure.is_finite() && exposure > 0.0 { exposure } else { 1.0 };
        for (pose, learner) in &self.places {
            let Some(learned) = learner.learned() else { continue };
            let heading_deg = pose.theta.to_degrees();
            let recall = learned.recall.unwrap_or(0.0);
            let why = match learned.validity {
                Validity::Valid => {
                    curves.push(learner.rows().to_vec());
                    self.table.places.push(Place {
                        x_m: pose.x,
                        y_m: pose.y,
                        heading_deg,
                        t0: learned.t0,
                        n0: learned.n0,
                        n0_extra: learned.n0_extra,
                        contrast: learner.look().contrast,
                        level: learner.look().level,
                        recall,
                    });
                    continue;
                }
                Validity::LowRecall => {
                    format!(
                        "at its threshold {} only {:.0} % of the map's edges are seen",
                        learned.t0,
                        100.0 * recall
                    )
                }
                Validity::NoModel => "the map has no vertical edge in view".to_owned(),
            };
            refused.push(Refused { x_m: pose.x, y_m: pose.y, heading_deg, why });
        }
        let cannot = |error: std::io::Error| format!("{}: {error}", out.display());
        if let Some(folder) = out.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            std::fs::create_dir_all(folder).map_err(cannot)?;
        }
        std::fs::write(out, self.table.to_toml()).map_err(cannot)?;
        plot(plot_file, &curves, &self.table.places)?;
        Ok(Learned {
            table: out.to_owned(),
            plot: plot_file.to_owned(),
            end,
            pictures: self.count,
            places: self.table.places,
            refused,
        })
    }
}

impl Tap for Student {
    fn message(&mut self, topic: &str, _: &MessageType, time: Time, header: &[u8], items: &[u8]) {
        let raw = RawMessage { header, items };
        if topic == self.odometry_topic {
            if let Some(odometry) = View::<Odometry>::of(raw) {
                self.odometry.push(odometry.header, time);
            }
        } else if topic == self.camera {
            if let Some(frame) = View::<FrameHeader>::of(raw) {
                self.keep(&frame);
            }
        } else if topic == self.pose_topic
            && let Some(pose) = View::<Pose>::of(raw)
        {
            self.locate(pose.header);
        }
    }
}
