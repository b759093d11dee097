//! Robot file to begin with, from what a recording contains.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use nalgebra::{Isometry3, Vector3};
use yamabico_core::camera::{Mount, MountConfig};
use yamabico_core::message::{Bumper, FrameHeader, Imu, Message, Odometry, RangeScanHeader};

use crate::measurement::{Measurement, Refusal};
use crate::ros2::camera_info::{CAMERA_INFO, CalibratedCamera, camera_info};
use crate::ros2::transforms::{Frames, TF_MESSAGE};
use crate::ros2::{self, frame_id};
use crate::storage::{Messages, StoredMessage};
use crate::yamabico::{self, CAMERA_CALIBRATION, FRAME_TRANSFORMS};

/// Name of the device in the robot file.
const DEVICE: &str = "recording";
/// Maximum number of topics.
const MAX_TOPICS: usize = 10_000;

/// One topic of the recording.
#[derive(Default)]
struct TopicSummary {
    message_type: String,
    count: u64,
    first_ns: u64,
    last_ns: u64,
    frame: Option<String>,
    /// First message that could be converted.
    example: Option<Measurement>,
}

/// Contents of a recording that a robot file is made of.
#[derive(Default)]
struct Survey {
    topics: BTreeMap<String, TopicSummary>,
    cameras: BTreeMap<String, Result<CalibratedCamera, Refusal>>,
    frames: Frames,
}

/// Returns the text of a robot file whose sensors are the topics of the recording `path`: with mounts from `/tf_static`, and
/// intrinsics from CameraInfo; of a recording of this program, from its own records of both. What the recording does not tell is marked as a guess.
///
/// # Errors
/// The description of what cannot be read.
pub fn robot_file(path: &Path) -> Result<String, String> {
    let mut survey = Survey::default();
    for message in Messages::open(path)? {
        match message {
            Ok(message) => survey.add(&message),
            // The beginning of a file that breaks off counts.
            Err(_) if !survey.topics.is_empty() => break,
            Err(error) => return Err(error),
        }
    }
    Ok(survey.text(path))
}

impl Survey {
    fn add(&mut self, message: &StoredMessage) {
        let (name, message_type) = (&message.topic.name, &message.topic.message_type);
        let is_ros2 = message.topic.encoding == "cdr";
        if is_ros2 && message_type == TF_MESSAGE && name.ends_with("/tf_static") {
            // A malformed transform leaves its sensor without a mount.
            let _ = self.frames.add(&message.data);
        }
        if is_ros2 && message_type == CAMERA_INFO && !self.cameras.contains_key(name) {
            self.cameras.insert(name.clone(), camera_info(&message.data));
        }
        let is_first = !self.topics.contains_key(name);
        if is_first && message_type == CAMERA_CALIBRATION {
            self.cameras.insert(name.clone(), yamabico::calibration(&message.data));
        }
        if is_first && message_type == FRAME_TRANSFORMS {
            let _ = yamabico::add_frames(&mut self.frames, &message.data);
        }
        if !self.topics.contains_key(name) && self.topics.len() < MAX_TOPICS {
            let summary = TopicSummary {
                message_type: message_type.clone(),
                first_ns: message.log_time,
                // In recordings of this program, a topic is the name of its frame.
                frame: if is_ros2 { frame_id(&message.data) } else { Some(name.clone()) },
                ..TopicSummary::default()
            };
            self.topics.insert(name.clone(), summary);
        }
        let Some(topic) = self.topics.get_mut(name) else { return };
        topic.count += 1;
        topic.last_ns = topic.last_ns.max(message.log_time);
        if topic.example.is_none() {
            let converted = match is_ros2 {
                true => ros2::measurement(message_type, &message.data),
                false => yamabico::measurement(message_type, &message.data),
            };
            topic.example = converted.ok().map(|measurement| match measurement {
                Measurement::Frame(header, _) => Measurement::Frame(header, Vec::new()),
                other => other,
            });
        }
    }

    fn text(&self, path: &Path) -> String {
        let name = path.file_stem().map_or("recording".into(), |stem| identifier(&stem.to_string_lossy()));
        let file = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let file = toml::Value::from(file.to_string_lossy().into_owned());
        let mut text = format!(
            "# Sensors of a recording, from `yamabico info --robot-toml`. Check what is marked as a guess.\n\n\
             name = \"{name}\"\n\n[footprint]\nradius_m = 0.2 # a guess\n\n\
             [devices.{DEVICE}]\ndriver = \"recording\"\nfile = {file}\n"
        );
        for (topic, summary) in &self.topics {
            let table = match &summary.example {
                Some(Measurement::Frame(header, _)) => self.camera(topic, summary, header),
                Some(Measurement::Scan(header, _)) => self.range(summary, header),
                Some(Measurement::Odometry(_)) => "kind = \"odometry\"\n".to_owned(),
                Some(Measurement::Imu(_)) => "kind = \"imu\"\n".to_owned(),
                Some(Measurement::Bumper(_)) => "kind = \"bumper\"\n".to_owned(),
                Some(Measurement::Joints { angles, .. }) => wheels(angles),
                None => continue,
            };
            let _ = write!(
                text,
                "\n[sensors.{}]\ndevice = \"{DEVICE}\"\ntopic = {}\nrate_hz = {}\n{table}",
                identifier(topic),
                toml::Value::from(topic.as_str()),
                rate_hz(summary),
            );
        }
        let _ = write!(text, "\n[drive]\ndevice = \"{DEVICE}\"\nkind = \"none\"\n");
        for (topic, summary) in &self.topics {
            if summary.example.is_none() && is_sensor(&summary.message_type) {
                let _ = write!(text, "\n# {topic} is left out: none of its messages could be read.\n");
            }
        }
        text
    }

    fn camera(&self, topic: &str, summary: &TopicSummary, header: &FrameHeader) -> String {
        let same_frame = |camera: &&CalibratedCamera| Some(&camera.frame_id) == summary.frame.as_ref();
        let calibrated = self.cameras.values().filter_map(|camera| camera.as_ref().ok()).find(same_frame);
        let size = [header.width, header.height];
        let fits = |camera: &&CalibratedCamera| [camera.intrinsics.width, camera.intrinsics.height] == size;
        let mut text = "kind = \"camera\"\n".to_owned();
        match calibrated.filter(fits) {
            Some(CalibratedCamera { intrinsics: i, distortion: d, .. }) => {
                let _ = writeln!(
                    text,
                    "intrinsics = {{ width = {}, height = {}, fx = {:?}, fy = {:?}, cx = {:?}, cy = {:?}, distortion = \
                     {{ k1 = {:?}, k2 = {:?}, p1 = {:?}, p2 = {:?}, k3 = {:?} }} }}",
                    i.width, i.height, i.fx, i.fy, i.cx, i.cy, d.k1, d.k2, d.p1, d.p2, d.k3
                );
            }
            None => {
                let parent = |name: &str| name.split('/').nth(1).map(str::to_owned);
                for (name, refusal) in &self.cameras {
                    if let Err(refusal) = refusal
                        && parent(name) == parent(topic)
                    {
                        let _ = writeln!(text, "# {name}: {refusal}");
                    }
                }
                let [width, height] = size;
                let _ = writeln!(
                    text,
                    "intrinsics = {{ width = {width}, height = {height}, fov_deg = 60 }} # a guess"
                );
            }
        }
        match self.mount(summary) {
            Some(body_from_camera) => {
                let config = mount_config(&camera_mount(&body_from_camera));
                let _ = writeln!(text, "calibration = \"measured\"\nmount = {config}");
            }
            None => text += "calibration = \"guessed\"\nmount = { z_m = 0.3 } # a guess\n",
        }
        text
    }

    fn range(&self, summary: &TopicSummary, header: &RangeScanHeader) -> String {
        let mut text =
            format!("kind = \"range\"\nmin_m = {:.3}\nmax_m = {:.3}\n", header.min_m, header.max_m);
        match self.mount(summary) {
            // Beams of this program say where they begin.
            _ if summary.message_type == RangeScanHeader::NAME => {}
            Some(body_from_sensor) => {
                let (x, y) = (body_from_sensor.translation.x, body_from_sensor.translation.y);
                let (ahead, up) = (body_from_sensor * Vector3::x(), body_from_sensor * Vector3::z());
                let yaw_deg = ahead.y.atan2(ahead.x).to_degrees();
                let _ = writeln!(text, "x_m = {x:.4}\ny_m = {y:.4}\nyaw_deg = {yaw_deg:.2}");
                if up.z < 0.9 {
                    text +=
                        "# This scanner is not upright in the recording: its beams have other directions.\n";
                }
            }
            None => {
                text += "# Its mount is not in the recording: x_m = 0, y_m = 0, yaw_deg = 0 is a guess.\n";
            }
        }
        text
    }

    fn mount(&self, summary: &TopicSummary) -> Option<Isometry3<f64>> {
        self.frames.body_from(summary.frame.as_deref()?)
    }
}

/// True for types that can be sensors.
fn is_sensor(message_type: &str) -> bool {
    let messages = [FrameHeader::NAME, RangeScanHeader::NAME, Odometry::NAME, Imu::NAME, Bumper::NAME];
    messages.iter().any(|message| ros2::fits(message_type, message) || yamabico::fits(message_type, message))
}

fn wheels(angles: &[(String, f64)]) -> String {
    let with = |side: &str| angles.iter().map(|(name, _)| name).find(|name| name.contains(side));
    let (left, right) = (with("left"), with("right"));
    let name = |joint: Option<&String>| toml::Value::from(joint.map_or("", |name| name.as_str()));
    format!(
        "kind = \"wheel-joints\"\nleft = {}\nright = {}\nradius_m = 0.033 # a guess\ntrack_m = 0.16 # a guess\n",
        name(left),
        name(right)
    )
}

/// Mean rate, with three digits; 10 Hz for a single message.
fn rate_hz(topic: &TopicSummary) -> f64 {
    let seconds = topic.last_ns.saturating_sub(topic.first_ns) as f64 * 1e-9;
    let rate = if seconds > 0.0 { (topic.count - 1) as f64 / seconds } else { 10.0 };
    let scale = 10_f64.powi(2 - rate.log10().floor().clamp(-2.0, 4.0) as i32);
    ((rate * scale).round() / scale).clamp(0.1, 1000.0)
}

/// Mount of a camera whose optical frame lies so on the robot.
fn camera_mount(body_from_camera: &Isometry3<f64>) -> Mount {
    let level = Mount::default().body_from_camera().rotation;
    let (roll, tilt, pan) = (body_from_camera.rotation * level.inverse()).euler_angles();
    let at = body_from_camera.translation;
    Mount { x: at.x, y: at.y, z: at.z, pan, tilt, roll }
}

fn mount_config(mount: &Mount) -> String {
    let config = MountConfig {
        x_m: mount.x,
        y_m: mount.y,
        z_m: mount.z,
        pan_deg: mount.pan.to_degrees(),
        tilt_deg: mount.tilt.to_degrees(),
        roll_deg: mount.roll.to_degrees(),
    };
    let MountConfig { x_m, y_m, z_m, pan_deg, tilt_deg, roll_deg } = config;
    format!(
        "{{ x_m = {x_m:.4}, y_m = {y_m:.4}, z_m = {z_m:.4}, pan_deg = {pan_deg:.3}, tilt_deg = {tilt_deg:.3}, roll_deg = {roll_deg:.3} }}"
    )
}

/// Name in a robot file for a topic: lower-case letters, digits and hyphens.
fn identifier(topic: &str) -> String {
    let letters = topic.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' });
    let name: String = letters.collect();
    let name = name.trim_matches('-').strip_prefix("sensors-").unwrap_or(name.trim_matches('-')).to_owned();
    if name.starts_with(|c: char| c.is_ascii_alphabetic()) { name } else { format!("topic-{name}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mount_survives_the_way_through_an_optical_frame() {
        let mount = Mount { x: 0.1, y: -0.05, z: 0.4, pan: 0.3, tilt: 0.5, roll: -0.1 };
        let back = camera_mount(&mount.body_from_camera());
        let numbers = |m: &Mount| [m.x, m.y, m.z, m.pan, m.tilt, m.roll];
        assert!(numbers(&mount).iter().zip(numbers(&back)).all(|(a, b)| (a - b).abs() < 1e-12), "{back:?}");
    }

    #[test]
    fn topics_become_names_of_sensors() {
        assert_eq!(identifier("/camera/image_raw/compressed"), "camera-image-raw-compressed");
        assert_eq!(identifier("sensors/wheels"), "wheels");
        assert_eq!(identifier("/2d_scan"), "topic-2d-scan");
    }
}
