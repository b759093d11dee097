//! Handover of an intersection that the robot has reached to the next behavior.

use nalgebra::Point2;
use yamabico_core::time::Time;

use crate::frame::Frame;

/// Distance from which on an intersection that was handed over counts as passed, m.
const PASSED_M: f64 = 3.0;
/// Time after which it counts as passed without odometry, s.
const PASSED_S: f64 = 5.0;

/// Intersection that the robot has reached.
#[derive(Clone, Copy, Debug)]
pub struct Handover {
    /// Position in the odometry frame, m.
    pub point: Point2<f64>,
    /// Time of the handover.
    pub stamp: Time,
}

impl Handover {
    /// Returns true if the robot has passed the intersection at the capture of `frame`.
    pub fn is_passed(&self, frame: &Frame) -> bool {
        match frame.pose {
            Some(pose) => {
                let point = pose.inverse().transform_point(self.point);
                point.x < 0.0 || point.coords.norm() > PASSED_M
            }
            None => frame.stamp.seconds_after(self.stamp) > PASSED_S,
        }
    }
}
