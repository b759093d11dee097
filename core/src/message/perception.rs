//! Results that behaviors derive from sensor data, and the goal. `stamp_ns` is the time that a result is valid for,
//! `evidence_ns` the stamp of the oldest sensor data behind it.

use super::{code_enum, item, message};

message! {
    /// Goal of the run: a pose in the map frame.
    "yamabico.Goal.v1" Latest [u8]
    pub struct Goal {
        /// Time at which the goal was set.
        pub stamp_ns: u64,
        /// Sequence number.
        pub sequence: u64,
        /// Position along x of the map frame, m.
        pub x: f64,
        /// Position along y of the map frame, m.
        pub y: f64,
        /// Heading, rad; NaN if any heading is accepted.
        pub theta: f64,
        /// Distance at which the goal counts as reached, m.
        pub tolerance_m: f64,
    }
}

message! {
    /// A planned path and the robot's position on it. Its items are the corners.
    "yamabico.PathHeader.v1" Latest [PathPoint] evidence evidence_ns
    pub struct PathHeader {
        /// Time that the errors are valid for.
        pub stamp_ns: u64,
        /// Stamp of the oldest sensor data behind it.
        pub evidence_ns: u64,
        /// Sequence number.
        pub sequence: u64,
        /// Lateral error, m, positive if the robot is left of the path.
        pub lateral_error_m: f64,
        /// Heading error: robot heading minus path heading, rad.
        pub heading_error_rad: f64,
        /// Path length covered so far, m.
        pub progress_m: f64,
    }
}

item! {
    /// A corner of a path in the map frame.
    pub struct PathPoint {
        /// Position along x of the map frame, m.
        pub x: f64,
        /// Position along y of the map frame, m.
        pub y: f64,
    }
}

code_enum! {
    /// Reliability of a pose estimate.
    pub enum PoseStatus {
        /// No measurement has been matched yet.
        Unknown = 0 "unknown",
        /// Recently matched; the covariance is reliable.
        Tracking = 1 "tracking",
        /// Dead reckoning since the last match.
        Coasting = 2 "coasting",
        /// Measurements contradict the covariance.
        Inconsistent = 3 "inconsistent",
        /// Lost: do not use the pose.
        Lost = 4 "lost",
    }
}

message! {
    /// Pose estimate in the map frame.
    "yamabico.Pose.v1" Latest [u8] evidence evidence_ns
    pub struct Pose {
        /// Time that it is valid for.
        pub stamp_ns: u64,
        /// Stamp of the oldest sensor data behind it.
        pub evidence_ns: u64,
        /// Sequence number.
        pub sequence: u64,
        /// Position along x of the map frame, m.
        pub x: f64,
        /// Position along y of the map frame, m.
        pub y: f64,
        /// Heading, rad in (-pi, pi].
        pub theta: f64,
        /// Covariance of (x, y, theta), row-major, in m and rad.
        pub covariance: [f64; 9],
        /// A [`PoseStatus`] code.
        pub status: u32,
        /// Zero.
        pub reserved: u32,
    }
}

impl Pose {
    /// Returns the status, or `None` if the code is undefined.
    pub fn status(&self) -> Option<PoseStatus> {
        PoseStatus::from_code(self.status)
    }
}

message! {
    /// Obstacles that are not on the map. Its items are the obstacles.
    "yamabico.ObstaclesHeader.v1" Latest [Obstacle] evidence evidence_ns
    pub struct ObstaclesHeader {
        /// Time that it is valid for.
        pub stamp_ns: u64,
        /// Stamp of the oldest sensor data behind it.
        pub evidence_ns: u64,
        /// Sequence number.
        pub sequence: u64,
    }
}

item! {
    /// An obstacle in the robot frame.
    pub struct Obstacle {
        /// Position forward of the robot, m.
        pub x: f64,
        /// Position left of the robot, m.
        pub y: f64,
        /// Radius, m.
        pub radius_m: f64,
        /// Covariance of (x, y), row-major, m^2.
        pub covariance: [f64; 4],
        /// Probability that the obstacle exists, 0 to 1.
        pub confidence: f64,
    }
}

message! {
    /// Extent of free floor by direction. Its items are the directions, from right to left.
    "yamabico.FreeSpaceHeader.v1" Latest [FreeDirection] evidence evidence_ns
    pub struct FreeSpaceHeader {
        /// Time that it is valid for.
        pub stamp_ns: u64,
        /// Stamp of the oldest sensor data behind it.
        pub evidence_ns: u64,
        /// Sequence number.
        pub sequence: u64,
    }
}

item! {
    /// Free floor in one direction, robot frame.
    pub struct FreeDirection {
        /// Direction in the robot frame, rad, positive to the left.
        pub azimuth_rad: f64,
        /// Distance from the robot's center to the end of the free floor, m.
        pub distance_m: f64,
    }
}

message! {
    /// Bearings to landmarks. Its items are the landmarks.
    "yamabico.LandmarksHeader.v1" Latest [Landmark] evidence evidence_ns
    pub struct LandmarksHeader {
        /// Time that it is valid for.
        pub stamp_ns: u64,
        /// Stamp of the oldest sensor data behind it.
        pub evidence_ns: u64,
        /// Sequence number.
        pub sequence: u64,
    }
}

item! {
    /// A landmark observed from the robot.
    pub struct Landmark {
        /// Number on the map; `u64::MAX` if unknown.
        pub id: u64,
        /// Direction in the robot frame, rad, positive to the left.
        pub azimuth_rad: f64,
        /// Standard deviation of the direction, rad.
        pub sigma_rad: f64,
        /// Range, m; NaN if only the bearing is known.
        pub range_m: f64,
    }
}

message! {
    /// The corridor intersection ahead.
    "yamabico.Intersection.v1" Latest [u8] evidence evidence_ns
    pub struct Intersection {
        /// Time that it is valid for.
        pub stamp_ns: u64,
        /// Stamp of the oldest sensor data behind it.
        pub evidence_ns: u64,
        /// Sequence number.
        pub sequence: u64,
        /// Direction of its center, rad, positive to the left.
        pub bearing_rad: f64,
        /// Distance to its near end, m.
        pub distance_m: f64,
        /// Standard deviation of the distance, m.
        pub sigma_m: f64,
    }
}

message! {
    /// A corridor seen from the robot: its axis and its two walls. The frame of a corridor without a map.
    "yamabico.Corridor.v1" Latest [u8] evidence evidence_ns
    pub struct Corridor {
        /// Time that it is valid for.
        pub stamp_ns: u64,
        /// Stamp of the oldest sensor data behind it.
        pub evidence_ns: u64,
        /// Sequence number.
        pub sequence: u64,
        /// Heading of the robot from the corridor's axis, rad, positive to the left.
        pub heading_rad: f64,
        /// Standard deviation of the heading, rad.
        pub heading_sigma_rad: f64,
        /// Distance from the robot's center to the wall on its left, m; NaN if it is unknown.
        pub left_m: f64,
        /// Standard deviation of the distance to the wall on the left, m; NaN if it is unknown.
        pub left_sigma_m: f64,
        /// Distance from the robot's center to the wall on its right, m; NaN if it is unknown.
        pub right_m: f64,
        /// Standard deviation of the distance to the wall on the right, m; NaN if it is unknown.
        pub right_sigma_m: f64,
        /// Probability that a corridor is in view and that the heading is right, 0 to 1.
        pub probability: f64,
    }
}
