//! What behaviors make of what sensors measured. Each carries two stamps: `stamp_ns`, the instant that its state was
//! propagated to, and `evidence_ns`, the oldest sensor data in it.

use super::{item, message, vocabulary};

message! {
    /// Where to go: a pose in the map frame.
    "yamabico.Goal.v1" Latest [u8]
    pub struct Goal {
        /// When it was given.
        pub stamp_ns: u64,
        /// Counts up by one a goal.
        pub sequence: u64,
        /// Meters.
        pub x: f64,
        /// Meters.
        pub y: f64,
        /// Radians; NaN where any heading will do.
        pub theta: f64,
        /// Reached within this distance, meters.
        pub tolerance_m: f64,
    }
}

message! {
    /// A planned path and where the robot stands on it; the points follow.
    "yamabico.PathHeader.v1" Latest [PathPoint] evidence evidence_ns
    pub struct PathHeader {
        /// The instant that the errors hold for.
        pub stamp_ns: u64,
        /// Oldest sensor data in it.
        pub evidence_ns: u64,
        /// Counts up by one a message.
        pub sequence: u64,
        /// Robot left of the path, meters.
        pub lateral_error_m: f64,
        /// Robot heading less path heading, radians.
        pub heading_error_rad: f64,
        /// Path length behind the robot, meters.
        pub progress_m: f64,
    }
}

item! {
    /// A corner of a path, map frame.
    pub struct PathPoint {
        /// Meters.
        pub x: f64,
        /// Meters.
        pub y: f64,
    }
}

vocabulary! {
    /// How far a pose can be trusted.
    pub enum PoseStatus {
        /// Nothing has been matched yet.
        Unknown = 0 "unknown",
        /// Matched lately, covariance honest.
        Tracking = 1 "tracking",
        /// Dead reckoning since the last match.
        Coasting = 2 "coasting",
        /// Measurements disagree with the covariance.
        Inconsistent = 3 "inconsistent",
        /// Not to be used.
        Lost = 4 "lost",
    }
}

message! {
    /// Where the robot is on the map.
    "yamabico.Pose.v1" Latest [u8] evidence evidence_ns
    pub struct Pose {
        /// The instant that it holds for.
        pub stamp_ns: u64,
        /// Oldest sensor data in it.
        pub evidence_ns: u64,
        /// Counts up by one a pose.
        pub sequence: u64,
        /// Meters.
        pub x: f64,
        /// Meters.
        pub y: f64,
        /// Radians in (-pi, pi].
        pub theta: f64,
        /// Of (x, y, theta), row by row.
        pub covariance: [f64; 9],
        /// A [`PoseStatus`] code.
        pub status: u32,
        /// Zero.
        pub reserved: u32,
    }
}

impl Pose {
    /// The status, where the code is known.
    pub fn status(&self) -> Option<PoseStatus> {
        PoseStatus::from_code(self.status)
    }
}

message! {
    /// Things that the map does not explain; the obstacles follow.
    "yamabico.ObstaclesHeader.v1" Latest [Obstacle] evidence evidence_ns
    pub struct ObstaclesHeader {
        /// The instant that it holds for.
        pub stamp_ns: u64,
        /// Oldest sensor data in it.
        pub evidence_ns: u64,
        /// Counts up by one a message.
        pub sequence: u64,
    }
}

item! {
    /// An obstacle in the robot frame.
    pub struct Obstacle {
        /// Forward, meters.
        pub x: f64,
        /// Left, meters.
        pub y: f64,
        /// Meters.
        pub radius_m: f64,
        /// Of (x, y), row by row.
        pub covariance: [f64; 4],
        /// 0 to 1.
        pub confidence: f64,
    }
}

message! {
    /// How far the floor is free in each direction; the directions follow, from right to left.
    "yamabico.FreeSpaceHeader.v1" Latest [FreeDirection] evidence evidence_ns
    pub struct FreeSpaceHeader {
        /// The instant that it holds for.
        pub stamp_ns: u64,
        /// Oldest sensor data in it.
        pub evidence_ns: u64,
        /// Counts up by one a message.
        pub sequence: u64,
    }
}

item! {
    /// Free floor in one direction, robot frame.
    pub struct FreeDirection {
        /// Left positive, radians.
        pub azimuth_rad: f64,
        /// Meters from the robot's center.
        pub distance_m: f64,
    }
}

message! {
    /// Bearings to landmarks; they follow.
    "yamabico.LandmarksHeader.v1" Latest [Landmark] evidence evidence_ns
    pub struct LandmarksHeader {
        /// The instant that it holds for.
        pub stamp_ns: u64,
        /// Oldest sensor data in it.
        pub evidence_ns: u64,
        /// Counts up by one a message.
        pub sequence: u64,
    }
}

item! {
    /// A landmark seen from the robot.
    pub struct Landmark {
        /// Number on the map; `u64::MAX` where it is not known.
        pub id: u64,
        /// Left positive, radians.
        pub azimuth_rad: f64,
        /// Standard deviation, radians.
        pub sigma_rad: f64,
        /// Meters; NaN where only the bearing is known.
        pub range_m: f64,
    }
}

message! {
    /// The intersection ahead.
    "yamabico.Intersection.v1" Latest [u8] evidence evidence_ns
    pub struct Intersection {
        /// The instant that it holds for.
        pub stamp_ns: u64,
        /// Oldest sensor data in it.
        pub evidence_ns: u64,
        /// Counts up by one a message.
        pub sequence: u64,
        /// Of its middle, left positive, radians.
        pub bearing_rad: f64,
        /// To its nearer end, meters.
        pub distance_m: f64,
        /// Standard deviation of the distance, meters.
        pub sigma_m: f64,
    }
}
