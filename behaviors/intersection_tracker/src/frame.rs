//! Frames, and the motion of the robot between them.

use yamabico_core::geometry::Pose2;
use yamabico_core::message::Reason;
use yamabico_core::odometry_track::travel;
use yamabico_core::time::Time;

use crate::landmarks::Motion;

/// Time without a frame after which the intersection is lost, s.
const COAST_S: f64 = 1.0;
/// Speeds (m/s, rad/s) above which the odometry jumped.
const JUMP_SPEEDS: [f64; 2] = [3.0, 6.0];

/// Capture of a frame.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// Capture time.
    pub stamp: Time,
    /// Pose of the robot in the odometry frame; `None` without odometry.
    pub pose: Option<Pose2>,
}

impl Frame {
    /// Returns the motion of the robot since the frame `last`.
    ///
    /// # Errors
    /// The last frame is too old, or the odometry jumped.
    pub fn motion_since(&self, last: Option<&Frame>) -> Result<Motion, Reason> {
        let Some(last) = last else { return Ok(Motion::Unknown { elapsed_s: 0.0 }) };
        let elapsed_s = self.stamp.seconds_after(last.stamp);
        if elapsed_s > COAST_S {
            return Err(Reason::StaleInput);
        }
        let (Some(from), Some(to)) = (last.pose, self.pose) else {
            return Ok(Motion::Unknown { elapsed_s });
        };
        let (meters, turned) = travel(&from, &to);
        let [fastest, quickest] = JUMP_SPEEDS;
        if meters > fastest * elapsed_s + 0.1 || turned > quickest * elapsed_s + 0.1 {
            return Err(Reason::Inconsistent);
        }
        Ok(Motion::Between(from, to))
    }
}
