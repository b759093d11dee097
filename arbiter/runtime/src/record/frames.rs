//! Coordinate frames of a recording, and poses in them.

use foxglove::messages::{
    FrameTransform, FrameTransforms, Pose, PoseInFrame, PosesInFrame, Quaternion, Timestamp, Vector3,
};
use nalgebra::Isometry3;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::PathPoint;

/// Frame of the building.
pub(super) const MAP: &str = "map";
/// Frame of the odometry: the start of the robot.
pub(super) const ODOM: &str = "odom";
/// Frame of the robot.
pub(super) const BASE: &str = "base";

/// Converts a stamp.
pub(super) fn timestamp(stamp_ns: u64) -> Timestamp {
    let seconds = u32::try_from(stamp_ns / 1_000_000_000).unwrap_or(u32::MAX);
    Timestamp::new(seconds, (stamp_ns % 1_000_000_000) as u32)
}

pub(super) fn vector(x: f64, y: f64, z: f64) -> Vector3 {
    Vector3 { x, y, z }
}

/// Rotation about the vertical axis.
pub(super) fn yaw(theta: f64) -> Quaternion {
    let (sin, cos) = (theta / 2.0).sin_cos();
    Quaternion { x: 0.0, y: 0.0, z: sin, w: cos }
}

/// Pose on the floor.
pub(super) fn pose(pose: &Pose2) -> Pose {
    Pose { position: Some(vector(pose.x, pose.y, 0.0)), orientation: Some(yaw(pose.theta)) }
}

/// Pose on the floor in the frame `frame_id`; `None` if it is not finite.
pub(super) fn pose_in_frame(stamp_ns: u64, frame_id: &str, at: &Pose2) -> Option<PoseInFrame> {
    at.is_finite().then(|| PoseInFrame {
        timestamp: Some(timestamp(stamp_ns)),
        frame_id: frame_id.to_owned(),
        pose: Some(pose(at)),
    })
}

/// Path on the floor in the map frame: each corner heads for the next one.
pub(super) fn path(stamp_ns: u64, corners: &[PathPoint]) -> PosesInFrame {
    let known = |corner: &&PathPoint| corner.x.is_finite() && corner.y.is_finite();
    let corners: Vec<&PathPoint> = corners.iter().filter(known).collect();
    let headings = corners.windows(2).map(|ends| (ends[1].y - ends[0].y).atan2(ends[1].x - ends[0].x));
    let mut headings: Vec<f64> = headings.collect();
    headings.push(headings.last().copied().unwrap_or(0.0));
    let poses =
        corners.iter().zip(headings).map(|(corner, theta)| pose(&Pose2::new(corner.x, corner.y, theta)));
    PosesInFrame { timestamp: Some(timestamp(stamp_ns)), frame_id: MAP.to_owned(), poses: poses.collect() }
}

fn transform(stamp_ns: u64, parent: &str, child: &str, parent_from_child: &Pose2) -> FrameTransform {
    FrameTransform {
        timestamp: Some(timestamp(stamp_ns)),
        parent_frame_id: parent.to_owned(),
        child_frame_id: child.to_owned(),
        translation: Some(vector(parent_from_child.x, parent_from_child.y, 0.0)),
        rotation: Some(yaw(parent_from_child.theta)),
    }
}

/// Mount of a camera: its frame in the robot's frame.
fn mounted(stamp_ns: u64, frame_id: &str, body_from_camera: &Isometry3<f64>) -> FrameTransform {
    let (position, turn) = (body_from_camera.translation.vector, body_from_camera.rotation);
    FrameTransform {
        timestamp: Some(timestamp(stamp_ns)),
        parent_frame_id: BASE.to_owned(),
        child_frame_id: frame_id.to_owned(),
        translation: Some(vector(position.x, position.y, position.z)),
        rotation: Some(Quaternion { x: turn.i, y: turn.j, z: turn.k, w: turn.w }),
    }
}

/// Tree of the frames map, odom and base, from poses that arrive one by one.
///
/// Until a behavior publishes a pose on the map, the odometry starts at the first ground truth, or at the map's origin without
/// one. Each message holds the whole tree, so that a viewer that begins anywhere has it.
#[derive(Default)]
pub(super) struct FrameTree {
    mounts: Vec<(String, Isometry3<f64>)>,
    odom_from_base: Option<Pose2>,
    map_from_odom: Option<Pose2>,
    localized: bool,
}

impl FrameTree {
    /// Tree with these cameras: frame, and its pose on the robot.
    pub fn new(mounts: Vec<(String, Isometry3<f64>)>) -> FrameTree {
        FrameTree { mounts, ..FrameTree::default() }
    }

    /// Transforms of the cameras on the robot; `None` if there is no camera.
    pub fn cameras(&self, stamp_ns: u64) -> Option<FrameTransforms> {
        let mounted = |(frame_id, at): &(String, Isometry3<f64>)| mounted(stamp_ns, frame_id, at);
        let transforms: Vec<_> = self.mounts.iter().map(mounted).collect();
        (!transforms.is_empty()).then_some(FrameTransforms { transforms })
    }

    /// Takes in odometry; returns all transforms, or `None` if it is not finite.
    pub fn odometry(&mut self, stamp_ns: u64, odom_from_base: Pose2) -> Option<FrameTransforms> {
        if !odom_from_base.is_finite() {
            return None;
        }
        self.odom_from_base = Some(odom_from_base);
        let map_from_odom = *self.map_from_odom.get_or_insert(Pose2::IDENTITY);
        let mut transforms = vec![
            transform(stamp_ns, MAP, ODOM, &map_from_odom),
            transform(stamp_ns, ODOM, BASE, &odom_from_base),
        ];
        transforms.extend(self.cameras(stamp_ns).unwrap_or_default().transforms);
        Some(FrameTransforms { transforms })
    }

    /// Takes in a pose estimate.
    pub fn localized(&mut self, map_from_base: &Pose2) {
        if map_from_base.is_finite() {
            self.localized = true;
            self.map_from_odom = Some(self.origin_of_odometry(map_from_base));
        }
    }

    /// Takes in the ground truth.
    pub fn truth(&mut self, map_from_base: &Pose2) {
        let first = !self.localized && self.map_from_odom.is_none_or(|known| known == Pose2::IDENTITY);
        if first && map_from_base.is_finite() {
            self.map_from_odom = Some(self.origin_of_odometry(map_from_base));
        }
    }

    fn origin_of_odometry(&self, map_from_base: &Pose2) -> Pose2 {
        map_from_base.compose(&self.odom_from_base.unwrap_or(Pose2::IDENTITY).inverse())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::camera::Mount;

    fn translation(transforms: &Option<FrameTransforms>, index: usize) -> (f64, f64) {
        let translation = transforms.as_ref().unwrap().transforms[index].translation.as_ref().unwrap();
        (translation.x, translation.y)
    }

    #[test]
    fn odometry_starts_at_the_first_truth_until_there_is_a_pose_estimate() {
        let mut tree = FrameTree::default();
        tree.truth(&Pose2::new(2.0, 1.0, 0.0));
        let moved = tree.odometry(1, Pose2::new(0.5, 0.0, 0.0));
        assert_eq!((translation(&moved, 0), translation(&moved, 1)), ((2.0, 1.0), (0.5, 0.0)));
        tree.truth(&Pose2::new(9.0, 9.0, 0.0));
        assert_eq!(translation(&tree.odometry(2, Pose2::new(0.5, 0.0, 0.0)), 0), (2.0, 1.0));
        tree.localized(&Pose2::new(2.6, 1.1, 0.0));
        let corrected = translation(&tree.odometry(3, Pose2::new(0.5, 0.0, 0.0)), 0);
        assert!((corrected.0 - 2.1).abs() < 1e-12 && (corrected.1 - 1.1).abs() < 1e-12);
    }

    #[test]
    fn poses_that_are_not_finite_are_left_out() {
        let nowhere = Pose2 { x: f64::NAN, y: 0.0, theta: 0.0 };
        assert!(FrameTree::default().odometry(1, nowhere).is_none());
        assert!(pose_in_frame(1, MAP, &nowhere).is_none());
        let corners = [(0.0, 0.0), (f64::NAN, 1.0), (0.0, 2.0)].map(|(x, y)| PathPoint { x, y });
        let poses = path(1, &corners).poses;
        let upward = yaw(std::f64::consts::FRAC_PI_2);
        assert!(poses.len() == 2 && poses.iter().all(|pose| pose.orientation == Some(upward)), "{poses:?}");
        assert!(path(1, &[]).poses.is_empty());
    }

    #[test]
    fn a_level_camera_looks_along_the_robot() {
        let mut tree = FrameTree::new(vec![("front".to_owned(), Mount::level(0.6).body_from_camera())]);
        let transform = tree.odometry(1, Pose2::IDENTITY).unwrap().transforms[2].clone();
        let q = transform.rotation.unwrap();
        // The optical axis (0, 0, 1) turned by the quaternion.
        let axis = (
            2.0 * (q.x * q.z + q.w * q.y),
            2.0 * (q.y * q.z - q.w * q.x),
            1.0 - 2.0 * (q.x * q.x + q.y * q.y),
        );
        assert!((axis.0 - 1.0).abs() < 1e-12 && axis.1.abs() < 1e-12 && axis.2.abs() < 1e-12);
        assert_eq!(transform.translation.unwrap().z, 0.6);
    }
}
