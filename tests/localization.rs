//! The pose of a robot that drives along the hallway, compared with the simulator's ground truth.

use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_core::message::{MessageType, Pose, PoseStatus, Truth};
use yamabico_core::time::Time;
use yamabico_runtime::execution::{RunEnd, topics};
use yamabico_runtime::record::Tap;

use crate::support::{run_seed, task};

/// Records poses and ground truth.
#[derive(Default)]
struct PoseTap {
    truth: Vec<(u64, Pose2)>,
    poses: Vec<Pose>,
}

impl Tap for PoseTap {
    fn message(&mut self, topic: &str, _: &MessageType, _: Time, header: &[u8], _: &[u8]) {
        if topic == topics::TRUTH {
            let truth: &Truth = bytemuck::from_bytes(header);
            self.truth.push((truth.stamp_ns, Pose2::new(truth.x, truth.y, truth.theta)));
        } else if topic == topics::output("map-localizer", "pose") {
            self.poses.push(*bytemuck::from_bytes(header));
        }
    }
}

impl PoseTap {
    /// Returns the errors along and across the hallway (m) and of the heading (rad) of poses with status tracking.
    fn errors(&self) -> Vec<[f64; 3]> {
        let is_tracking = |pose: &&Pose| pose.status() == Some(PoseStatus::Tracking);
        let error = |pose: &Pose| {
            let at = self.truth.binary_search_by_key(&pose.stamp_ns, |(stamp, _)| *stamp).ok()?;
            let truth = self.truth[at].1;
            Some([pose.x - truth.x, pose.y - truth.y, angle_difference(pose.theta, truth.theta)])
        };
        self.poses.iter().filter(is_tracking).filter_map(error).collect()
    }
}

/// Returns the 95 % quantile of the magnitudes.
fn p95(errors: &[[f64; 3]], axis: usize) -> f64 {
    let mut values: Vec<f64> = errors.iter().map(|error| error[axis].abs()).collect();
    values.sort_by(f64::total_cmp);
    values[(0.95 * (values.len() - 1) as f64).round() as usize]
}

/// Drives along the hallway to x = 4 m.
fn drive(more: &[&str]) -> (RunEnd, PoseTap) {
    let goal = ["run.goal.x_m=4.0", "run.duration_s=30", "behaviors.map-localizer.route=[[4.0, 0.0]]"];
    let task = task("localization", &[&goal, more].concat());
    let mut tap = PoseTap::default();
    let result = run_seed(&task, 1, &mut tap);
    (result.end, tap)
}

#[test]
fn the_pose_is_within_five_centimeters_across_ten_along_and_half_a_degree() {
    let (end, tap) = drive(&[]);
    assert_eq!(end, RunEnd::Arrived);
    let errors = tap.errors();
    assert!(errors.len() > 300, "{}", errors.len());
    assert!(errors.len() as f64 > 0.95 * tap.poses.len() as f64, "the status is not tracking");
    let [along_m, across_m, heading_rad] = [0, 1, 2].map(|axis| p95(&errors, axis));
    assert!(across_m <= 0.05 && along_m <= 0.10, "{across_m} m across, {along_m} m along");
    assert!(heading_rad.to_degrees() <= 0.5, "{} degrees", heading_rad.to_degrees());
}

#[test]
fn late_frames_correct_the_past() {
    let (end, tap) = drive(&["robot.sensors.front.latency_ms=1000", "robot.sensors.front.period_ms=1000"]);
    assert_eq!(end, RunEnd::Arrived);
    let errors = tap.errors();
    let [along_m, across_m] = [0, 1].map(|axis| p95(&errors, axis));
    assert!(across_m <= 0.05 && along_m <= 0.10, "{across_m} m across, {along_m} m along");
    // No frame is younger than its latency.
    let age_s = |pose: &Pose| (pose.stamp_ns - pose.evidence_ns) as f64 * 1e-9;
    assert!(tap.poses.iter().filter(|pose| pose.evidence_ns > 0).all(|pose| age_s(pose) > 0.9));
}
