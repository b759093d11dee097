//! Odometry, inertial measurements and joints of ROS 2.

use serde::Deserialize;
use yamabico_core::message::{Imu as ImuReading, Odometry as OdometryReading, Twist};

use super::{Header, Quaternion, Vector, finite, read};
use crate::measurement::{Measurement, Refusal};

#[derive(Deserialize)]
pub(super) struct Odometry {
    header: Header,
    _child_frame_id: String,
    position: Vector,
    orientation: Quaternion,
    /// 6x6; serde has no arrays of 36.
    pose_covariance: [[f64; 18]; 2],
    linear: Vector,
    angular: Vector,
}

pub(super) fn odometry(message: &Odometry) -> Result<Measurement, Refusal> {
    let Quaternion { x, y, z, w } = message.orientation;
    let theta = (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z));
    // Rows and columns x, y and yaw of a 6x6 matrix.
    let all: Vec<f64> = message.pose_covariance.iter().flatten().copied().collect();
    let mut covariance = [0.0; 9];
    for (i, row) in [0, 1, 5].into_iter().enumerate() {
        for (j, column) in [0, 1, 5].into_iter().enumerate() {
            covariance[3 * i + j] = all[6 * row + column];
        }
    }
    let odometry = OdometryReading {
        stamp_ns: message.header.stamp_ns(),
        sequence: 0,
        x: message.position.x,
        y: message.position.y,
        theta,
        vx: message.linear.x,
        vy: message.linear.y,
        omega: message.angular.z,
        covariance,
    };
    let OdometryReading { x, y, theta, vx, vy, omega, .. } = odometry;
    finite(&[x, y, theta, vx, vy, omega], "odometry")?;
    Ok(Measurement::Odometry(odometry))
}

#[derive(Deserialize)]
pub(super) struct Imu {
    header: Header,
    _orientation: Quaternion,
    _orientation_covariance: [f64; 9],
    angular_velocity: Vector,
    _angular_velocity_covariance: [f64; 9],
    linear_acceleration: Vector,
    _linear_acceleration_covariance: [f64; 9],
}

pub(super) fn imu(message: &Imu) -> Result<Measurement, Refusal> {
    let array = |vector: &Vector| [vector.x, vector.y, vector.z];
    let (angular_velocity, linear_acceleration) =
        (array(&message.angular_velocity), array(&message.linear_acceleration));
    finite(&angular_velocity, "a turn rate")?;
    Ok(Measurement::Imu(ImuReading {
        stamp_ns: message.header.stamp_ns(),
        angular_velocity,
        linear_acceleration,
        roll: f64::NAN,
        pitch: f64::NAN,
        sequence: 0,
    }))
}

#[derive(Deserialize)]
pub(super) struct JointState {
    header: Header,
    name: Vec<String>,
    position: Vec<f64>,
    _velocity: Vec<f64>,
    _effort: Vec<f64>,
}

pub(super) fn joints(message: JointState) -> Result<Measurement, Refusal> {
    if message.position.len() != message.name.len() {
        return Err(Refusal::Malformed("joints without their positions".to_owned()));
    }
    finite(&message.position, "a position of a joint")?;
    let angles = message.name.into_iter().zip(message.position).collect();
    Ok(Measurement::Joints { stamp_ns: message.header.stamp_ns(), angles })
}

#[derive(Deserialize)]
struct TwistMessage {
    linear: Vector,
    angular: Vector,
}

/// Reads a command, `geometry_msgs/msg/Twist`.
///
/// # Errors
/// [`Refusal`].
pub fn twist(data: &[u8]) -> Result<Twist, Refusal> {
    let TwistMessage { linear, angular } = read(data)?;
    finite(&[linear.x, linear.y, angular.z], "a command")?;
    Ok(Twist::new(linear.x, linear.y, angular.z))
}

#[derive(Deserialize)]
struct TwistStamped {
    header: Header,
    linear: Vector,
    angular: Vector,
}

/// Reads a command, `geometry_msgs/msg/TwistStamped`, with its stamp, ns.
///
/// # Errors
/// [`Refusal`].
pub fn twist_stamped(data: &[u8]) -> Result<(u64, Twist), Refusal> {
    let TwistStamped { header, linear, angular } = read(data)?;
    finite(&[linear.x, linear.y, angular.z], "a command")?;
    Ok((header.stamp_ns(), Twist::new(linear.x, linear.y, angular.z)))
}
