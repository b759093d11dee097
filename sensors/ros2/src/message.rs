//! Messages of ROS 2 that are sent, in CDR.

use byteorder::LittleEndian;
use cdr_encoding::to_vec;
use serde::Serialize;
use yamabico_core::geometry::{Pose2, Twist as BodyTwist};
use yamabico_core::message::{Odometry as OdometryReading, PathPoint, Pose as PoseEstimate};

/// A type of message that can be sent.
pub trait RosMessage: Serialize {
    /// Name in ROS, such as `geometry_msgs/msg/Twist`.
    const TYPE: &'static str;
}

/// Returns the CDR of a message, little-endian and without its encapsulation header. Empty if it cannot be encoded, which these
/// types rule out.
#[must_use]
pub fn encode<M: RosMessage>(message: &M) -> Vec<u8> {
    to_vec::<M, LittleEndian>(message).unwrap_or_default()
}

/// Time in `builtin_interfaces/msg/Time`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Stamp {
    /// Seconds since 1970.
    pub sec: i32,
    /// Nanoseconds of the second.
    pub nanosec: u32,
}

impl Stamp {
    /// Returns the time `ns` after 1970.
    #[must_use]
    pub fn of(ns: u64) -> Stamp {
        let sec = i32::try_from(ns / 1_000_000_000).unwrap_or(i32::MAX);
        Stamp { sec, nanosec: (ns % 1_000_000_000) as u32 }
    }
}

/// `std_msgs/msg/Header`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Header {
    /// Time of the data.
    pub stamp: Stamp,
    /// Frame of the data.
    pub frame_id: String,
}

impl Header {
    /// Returns the header of data of the time `ns` after 1970 in the frame `frame_id`.
    #[must_use]
    pub fn new(ns: u64, frame_id: &str) -> Header {
        Header { stamp: Stamp::of(ns), frame_id: frame_id.to_owned() }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
struct Vector {
    x: f64,
    y: f64,
    z: f64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
struct Quaternion {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
struct PlainPose {
    position: Vector,
    orientation: Quaternion,
}

impl PlainPose {
    fn of(pose: &Pose2) -> PlainPose {
        let (sin, cos) = (0.5 * pose.theta).sin_cos();
        PlainPose {
            position: Vector { x: pose.x, y: pose.y, z: 0.0 },
            orientation: Quaternion { z: sin, w: cos, ..Quaternion::default() },
        }
    }
}

/// A 6x6 matrix; serde has no arrays of 36.
type Covariance = [[f64; 18]; 2];

/// Covariance of x, y, z, roll, pitch and yaw from that of x, y and yaw.
fn covariance(of_plane: &[f64; 9]) -> Covariance {
    let mut all = Covariance::default();
    for (i, row) in [0, 1, 5].into_iter().enumerate() {
        for (j, column) in [0, 1, 5].into_iter().enumerate() {
            let at = 6 * row + column;
            all[at / 18][at % 18] = of_plane[3 * i + j];
        }
    }
    all
}

/// `geometry_msgs/msg/Twist`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Twist {
    linear: Vector,
    angular: Vector,
}

impl RosMessage for Twist {
    const TYPE: &'static str = "geometry_msgs/msg/Twist";
}

impl From<&BodyTwist> for Twist {
    fn from(twist: &BodyTwist) -> Twist {
        Twist {
            linear: Vector { x: twist.linear, y: twist.lateral, z: 0.0 },
            angular: Vector { z: twist.angular, ..Vector::default() },
        }
    }
}

/// `geometry_msgs/msg/TwistStamped`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TwistStamped {
    /// Time and frame.
    pub header: Header,
    /// Velocity.
    pub twist: Twist,
}

impl RosMessage for TwistStamped {
    const TYPE: &'static str = "geometry_msgs/msg/TwistStamped";
}

/// `nav_msgs/msg/Odometry`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Odometry {
    header: Header,
    child_frame_id: String,
    pose: PlainPose,
    pose_covariance: Covariance,
    twist: Twist,
    twist_covariance: Covariance,
}

impl RosMessage for Odometry {
    const TYPE: &'static str = "nav_msgs/msg/Odometry";
}

impl Odometry {
    /// Converts a reading; `header` has the frame of its pose, and `child` is the frame of the robot.
    #[must_use]
    pub fn of(reading: &OdometryReading, header: Header, child: &str) -> Odometry {
        Odometry {
            header,
            child_frame_id: child.to_owned(),
            pose: PlainPose::of(&Pose2::new(reading.x, reading.y, reading.theta)),
            pose_covariance: covariance(&reading.covariance),
            twist: (&BodyTwist::new(reading.vx, reading.vy, reading.omega)).into(),
            twist_covariance: Covariance::default(),
        }
    }
}

/// `geometry_msgs/msg/PoseWithCovarianceStamped`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PoseWithCovarianceStamped {
    header: Header,
    pose: PlainPose,
    covariance: Covariance,
}

impl RosMessage for PoseWithCovarianceStamped {
    const TYPE: &'static str = "geometry_msgs/msg/PoseWithCovarianceStamped";
}

impl PoseWithCovarianceStamped {
    /// Converts an estimate; `header` has the frame of the map.
    #[must_use]
    pub fn of(estimate: &PoseEstimate, header: Header) -> PoseWithCovarianceStamped {
        let pose = PlainPose::of(&Pose2::new(estimate.x, estimate.y, estimate.theta));
        PoseWithCovarianceStamped { header, pose, covariance: covariance(&estimate.covariance) }
    }
}

#[derive(Clone, Debug, Default, PartialEq, Serialize)]
struct PoseStamped {
    header: Header,
    pose: PlainPose,
}

/// `nav_msgs/msg/Path`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Path {
    header: Header,
    poses: Vec<PoseStamped>,
}

impl RosMessage for Path {
    const TYPE: &'static str = "nav_msgs/msg/Path";
}

impl Path {
    /// Converts the corners of a path; each pose looks to the next one.
    #[must_use]
    pub fn of(corners: &[PathPoint], header: Header) -> Path {
        let mut theta = 0.0;
        let poses = corners.iter().enumerate().map(|(i, corner)| {
            if let Some(next) = corners.get(i + 1) {
                theta = (next.y - corner.y).atan2(next.x - corner.x);
            }
            PoseStamped {
                header: header.clone(),
                pose: PlainPose::of(&Pose2::new(corner.x, corner.y, theta)),
            }
        });
        Path { poses: poses.collect(), header }
    }
}

/// Level of a [`DiagnosticStatus`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// As it should be.
    Ok = 0,
    /// Something to look at.
    Warn = 1,
    /// The robot stands because of it.
    Error = 2,
}

/// `diagnostic_msgs/msg/DiagnosticStatus`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct DiagnosticStatus {
    level: u8,
    name: String,
    message: String,
    hardware_id: String,
    values: Vec<(String, String)>,
}

impl DiagnosticStatus {
    /// Returns the status of the part `name` of the robot `robot`, with named values.
    #[must_use]
    pub fn new(
        level: Level,
        name: String,
        message: String,
        robot: &str,
        values: Vec<(String, String)>,
    ) -> Self {
        DiagnosticStatus { level: level as u8, name, message, hardware_id: robot.to_owned(), values }
    }
}

/// `diagnostic_msgs/msg/DiagnosticArray`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct DiagnosticArray {
    /// Time.
    pub header: Header,
    /// States of the parts.
    pub status: Vec<DiagnosticStatus>,
}

impl RosMessage for DiagnosticArray {
    const TYPE: &'static str = "diagnostic_msgs/msg/DiagnosticArray";
}

/// `std_msgs/msg/String`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Text {
    /// The text.
    pub data: String,
}

impl RosMessage for Text {
    const TYPE: &'static str = "std_msgs/msg/String";
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_recording::{Measurement, ros2};

    /// The message as it arrives: behind the encapsulation header.
    fn received<M: RosMessage>(message: &M) -> Vec<u8> {
        [[0, 1, 0, 0].to_vec(), encode(message)].concat()
    }

    #[test]
    fn twists_are_read_as_they_were_written() {
        let twist = BodyTwist::new(0.3, -0.1, 0.7);
        assert_eq!(ros2::twist(&received(&Twist::from(&twist))), Ok(twist));
        let header = Header::new(5_000_000_007, "base_link");
        let stamped = TwistStamped { header, twist: (&twist).into() };
        assert_eq!(ros2::twist_stamped(&received(&stamped)), Ok((5_000_000_007, twist)));
    }

    #[test]
    fn odometry_is_read_as_it_was_written() {
        let mut reading =
            OdometryReading::new(77, &Pose2::new(1.0, -2.0, 2.5), &BodyTwist::new(0.2, 0.0, 0.1));
        reading.covariance = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0];
        let sent = Odometry::of(&reading, Header::new(77, "odom"), "base_link");
        let read = ros2::measurement(Odometry::TYPE, &received(&sent));
        let Ok(Measurement::Odometry(read)) = read else { panic!("{read:?}") };
        assert!((read.theta - 2.5).abs() < 1e-12);
        assert_eq!(OdometryReading { theta: 2.5, ..read }, reading);
    }

    #[test]
    fn a_path_looks_ahead() {
        let corners = [[0.0, 0.0], [0.0, 2.0], [3.0, 2.0]].map(|[x, y]| PathPoint { x, y });
        let path = Path::of(&corners, Header::new(0, "map"));
        let yaws = path.poses.iter().map(|pose| 2.0 * pose.pose.orientation.z.atan2(pose.pose.orientation.w));
        assert_eq!(yaws.map(|yaw| yaw.to_degrees().round() as i64).collect::<Vec<_>>(), [90, 0, 0]);
    }
}
