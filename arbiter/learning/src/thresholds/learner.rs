//! The tap that learns thresholds from frames, odometry and poses.

use std::collections::VecDeque;

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
use yamabico_runtime::execution::topics;
use yamabico_runtime::record::Tap;
use yamabico_stationary_obstacle_avoider::detector::{Detector, DetectorRules};
use yamabico_stationary_obstacle_avoider::threshold_learning::{EdgeCounts, PlaceLearner, Validity};
use yamabico_stationary_obstacle_avoider::threshold_table::{Place, ThresholdTable};
use yamabico_vision::map::WireFrame;

use super::Refused;

/// Number of frames kept until the pose estimate that is based on them arrives.
const MAX_FRAMES: usize = 8;
/// Heading change that starts a new place, rad.
const MAX_TURN_RAD: f64 = 0.26;
/// Range of the distance between places, m.
const SPACING_M: std::ops::RangeInclusive<f64> = 0.05..=10.0;

/// Learns the thresholds of each place that the robot passes.
pub(super) struct ThresholdLearner {
    camera_topic: String,
    odometry_topic: String,
    pose_topic: String,
    detector: Detector,
    table: ThresholdTable,
    spacing_m: f64,
    recent: VecDeque<(Time, f64, GrayImage)>,
    /// Pose estimate whose frame or odometry has not arrived yet: the order of messages on different topics is not fixed.
    waiting: Option<Pose>,
    odometry: OdometryTrack,
    /// Stamp of the newest frame that was learned from.
    learned_at: Option<Time>,
    places: Vec<(Pose2, PlaceLearner)>,
    exposures: Vec<f64>,
    frames: u32,
}

impl ThresholdLearner {
    /// Creates a learner for the camera, odometry and map of the task's localizer.
    ///
    /// # Errors
    /// A spacing out of range, or no suitable localizer in the task, for people.
    pub fn new(task: &Task, spacing_m: f64) -> Result<Self, String> {
        if !SPACING_M.contains(&spacing_m) {
            let (min, max) = (SPACING_M.start(), SPACING_M.end());
            return Err(format!(
                "the distance between places must be {min} to {max} m, but is {spacing_m} m"
            ));
        }
        let publishes_pose = |behavior: &&BehaviorFile| {
            behavior.factory.info().outputs.iter().any(|output| output.message.name == Pose::NAME)
        };
        let localizer = task.behaviors.iter().find(publishes_pose);
        let localizer = localizer.ok_or("no behavior of the task publishes a pose: add a map-localizer")?;
        let missing = |what: &str| format!("the localizer `{}` has no {what}", localizer.name);
        let (slot, camera) = sensor_input(localizer, FrameHeader::NAME).ok_or_else(|| missing("camera"))?;
        let (_, odometry) = sensor_input(localizer, Odometry::NAME).ok_or_else(|| missing("odometry"))?;
        let info =
            localizer.setup.sensors.iter().find(|(name, _)| *name == *slot).map(|(_, info)| &info.kind);
        let Some(SensorKind::Camera { intrinsics, distortion, mount, .. }) = info else {
            return Err(format!("`{camera}` is not a pinhole camera: thresholds are learned with one"));
        };
        let map = localizer.table.get("map").and_then(toml::Value::as_str).ok_or_else(|| missing("map"))?;
        let map = WireFrame::read(&localizer.setup.folder.join(map)).map_err(|error| error.to_string())?;
        let rules = DetectorRules::for_size(intrinsics.width, intrinsics.height);
        Ok(Self {
            camera_topic: topics::sensor(&camera),
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
            spacing_m,
            recent: VecDeque::new(),
            waiting: None,
            odometry: OdometryTrack::default(),
            learned_at: None,
            places: Vec::new(),
            exposures: Vec::new(),
            frames: 0,
        })
    }

    /// Number of frames learned from so far.
    pub fn frames(&self) -> u32 {
        self.frames
    }

    /// Returns the table, the difference curve of each place in it, and the places that are not in it.
    pub fn finish(mut self) -> (ThresholdTable, Vec<Vec<EdgeCounts>>, Vec<Refused>) {
        let (mut curves, mut refused) = (Vec::new(), Vec::new());
        self.exposures.sort_by(f64::total_cmp);
        let exposure = self.exposures.get(self.exposures.len() / 2).copied().unwrap_or(1.0);
        self.table.exposure = if exposure.is_finite() && exposure > 0.0 { exposure } else { 1.0 };
        for (pose, learner) in &self.places {
            let Some(learned) = learner.learned() else { continue };
            let heading_deg = pose.theta.to_degrees();
            let recall = learned.recall.unwrap_or(0.0);
            let reason = match learned.validity {
                Validity::Valid => {
                    curves.push(learner.rows().to_vec());
                    self.table.places.push(Place {
                        x_m: pose.x,
                        y_m: pose.y,
                        heading_deg,
                        t0: learned.t0,
                        n0: learned.n0,
                        n0_extra: learned.n0_extra,
                        contrast: learner.evidence().contrast,
                        level: learner.evidence().level,
                        recall,
                    });
                    continue;
                }
                Validity::LowRecall => format!(
                    "at its threshold of {} gray levels only {:.0} % of the map's edges are found in the images",
                    learned.t0,
                    100.0 * recall
                ),
                Validity::NoModel => "the map has no vertical edge in view".to_owned(),
            };
            refused.push(Refused { x_m: pose.x, y_m: pose.y, heading_deg, reason, is_covered: false });
        }
        for place in &mut refused {
            let pose = Pose2::new(place.x_m, place.y_m, place.heading_deg.to_radians());
            place.is_covered = self.table.at(&pose, self.table.exposure).is_some();
        }
        (self.table, curves, refused)
    }

    fn keep(&mut self, frame: &View<'_, FrameHeader>) {
        let mut gray = match self.recent.len() {
            MAX_FRAMES => self.recent.pop_front().map(|(_, _, gray)| gray).unwrap_or_default(),
            _ => GrayImage::default(),
        };
        let mut luma = GrayImage::default();
        if let Some(image) = frame.gray(self.detector.camera().intrinsics().size(), &mut luma) {
            gray.copy_from(image);
            self.recent.push_back((Time(frame.header.stamp_ns), frame.header.exposure, gray));
        }
    }

    /// Learns, once, from the frame that the waiting pose estimate is based on, if everything has arrived.
    fn learn(&mut self) {
        let Some(pose) = self.waiting else { return };
        let evidence = Time(pose.evidence_ns);
        let Some((_, exposure, gray)) = self.recent.iter().find(|(stamp, ..)| *stamp == evidence) else {
            return;
        };
        let poses = (self.odometry.pose_at(Time(pose.stamp_ns)), self.odometry.pose_at(evidence));
        let (Some(then), Some(at_frame), Ok(image)) = (poses.0, poses.1, gray.view()) else { return };
        self.waiting = None;
        let robot = Pose2::new(pose.x, pose.y, pose.theta) * then.relative(&at_frame);
        self.learned_at = Some(evidence);
        let Ok((rows, evidence)) = self.detector.measure(image, &robot) else { return };
        self.exposures.push(*exposure);
        self.frames += 1;
        self.place(&robot).add(&rows, evidence);
    }

    /// Returns the place of a pose: the last one, or a new one if the robot has left that.
    fn place(&mut self, robot: &Pose2) -> &mut PlaceLearner {
        let half_m = 0.5 * self.spacing_m;
        let is_same = self.places.last().is_some_and(|(at, _)| {
            at.distance(robot) <= 1.02 * half_m
                && angle_difference(at.theta, robot.theta).abs() <= MAX_TURN_RAD
        });
        if !is_same {
            // Centered half a spacing ahead, so that frames are taken from half a spacing before it to half a spacing behind it.
            let (sin, cos) = robot.theta.sin_cos();
            let center = Pose2::new(robot.x + half_m * cos, robot.y + half_m * sin, robot.theta);
            self.places.push((center, PlaceLearner::default()));
        }
        let last = self.places.len() - 1;
        &mut self.places[last].1
    }
}

/// The input slot of `behavior` that takes `message`, and the sensor that it is wired to.
fn sensor_input(behavior: &BehaviorFile, message: &str) -> Option<(String, String)> {
    let slot = behavior.factory.info().inputs.iter().find(|slot| slot.message.name == message)?;
    let input = behavior.inputs.iter().find(|input| input.slot == slot.name)?;
    match &input.source {
        InputSource::Sensor(name) => Some((slot.name.clone().into(), name.clone())),
        _ => None,
    }
}

impl Tap for ThresholdLearner {
    fn message(&mut self, topic: &str, _: &MessageType, time: Time, header: &[u8], items: &[u8]) {
        let raw = RawMessage { header, items };
        if topic == self.odometry_topic {
            if let Some(odometry) = View::<Odometry>::of(raw) {
                self.odometry.push(odometry.header, time);
                self.learn();
            }
        } else if topic == self.camera_topic {
            if let Some(frame) = View::<FrameHeader>::of(raw) {
                self.keep(&frame);
                self.learn();
            }
        } else if topic == self.pose_topic
            && let Some(pose) = View::<Pose>::of(raw)
        {
            let is_new = self.learned_at.is_none_or(|last| Time(pose.header.evidence_ns) > last);
            if is_new && pose.header.status() == Some(PoseStatus::Tracking) {
                self.waiting = Some(*pose.header);
                self.learn();
            }
        }
    }
}
