//! A robot that drives down the hallway knows where it is: on the whole spine, against the simulator's truth.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::Path;
use std::sync::atomic::AtomicBool;

use yamabico::plugins::plugins;
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_core::message::{MessageType, Pose, PoseStatus, Truth};
use yamabico_core::time::Time;
use yamabico_host::config::{Overrides, load};
use yamabico_runtime::execution::{End, topics};
use yamabico_runtime::record::{Tap, Tee};
use yamabico_runtime::run::{Options, run};

/// Keeps poses and truths.
#[derive(Default)]
struct Judge {
    truth: Vec<(u64, Pose2)>,
    poses: Vec<Pose>,
}

impl Tap for Judge {
    fn message(&mut self, topic: &str, _: &MessageType, _: Time, header: &[u8], _: &[u8]) {
        if topic == topics::TRUTH {
            let truth: &Truth = bytemuck::from_bytes(header);
            self.truth.push((truth.stamp_ns, Pose2::new(truth.x, truth.y, truth.theta)));
        } else if topic == topics::output("map-localizer", "pose") {
            self.poses.push(*bytemuck::from_bytes(header));
        }
    }
}

impl Judge {
    /// Errors along and across the hallway (m) and of the heading (rad) of poses that are said to be good.
    fn errors(&self) -> Vec<[f64; 3]> {
        let is_good = |pose: &&Pose| pose.status() == Some(PoseStatus::Tracking);
        let error = |pose: &Pose| {
            let at = self.truth.binary_search_by_key(&pose.stamp_ns, |(stamp, _)| *stamp).ok()?;
            let truth = self.truth[at].1;
            Some([pose.x - truth.x, pose.y - truth.y, angle_difference(pose.theta, truth.theta)])
        };
        self.poses.iter().filter(is_good).filter_map(error).collect()
    }
}

/// 95 % of the magnitudes are at most this.
fn percentile(errors: &[[f64; 3]], axis: usize) -> f64 {
    let mut values: Vec<f64> = errors.iter().map(|error| error[axis].abs()).collect();
    values.sort_by(f64::total_cmp);
    values[(0.95 * (values.len() - 1) as f64).round() as usize]
}

/// Drives down the hallway to 4 m and tells how it ended.
fn drive(more: &[&str]) -> (End, Judge) {
    let task = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/localization.toml");
    let near = ["run.goal.x_m=4.0", "run.duration_s=30", "behaviors.map-localizer.route=[[4.0, 0.0]]"];
    let set = near.iter().chain(more).map(ToString::to_string).collect();
    let loaded = load(&task, &Overrides { robot: None, set }, &plugins())
        .unwrap_or_else(|problems| panic!("{problems}"));
    let mut judge = Judge::default();
    let mut tee = Tee(vec![&mut judge]);
    let ran = run(&loaded, &Options::default(), &AtomicBool::new(false), &mut tee, &mut |_| {}).unwrap();
    (ran.end, judge)
}

#[test]
fn the_pose_is_within_five_centimeters_across_ten_along_and_half_a_degree() {
    let (end, judge) = drive(&[]);
    assert_eq!(end, End::Arrived);
    let errors = judge.errors();
    assert!(errors.len() > 300, "{}", errors.len());
    assert!(
        errors.len() as f64 > 0.95 * judge.poses.len() as f64,
        "the robot says that it knows where it is"
    );
    let [along_m, across_m, heading_rad] = [0, 1, 2].map(|axis| percentile(&errors, axis));
    assert!(across_m <= 0.05 && along_m <= 0.10, "{across_m} m across, {along_m} m along");
    assert!(heading_rad.to_degrees() <= 0.5, "{} degrees", heading_rad.to_degrees());
}

#[test]
fn late_pictures_correct_the_past() {
    let (end, judge) = drive(&["robot.sensors.front.latency_ms=1000", "robot.sensors.front.period_ms=1000"]);
    assert_eq!(end, End::Arrived);
    let errors = judge.errors();
    let [along_m, across_m] = [0, 1].map(|axis| percentile(&errors, axis));
    assert!(across_m <= 0.05 && along_m <= 0.10, "{across_m} m across, {along_m} m along");
    // A picture is never younger than its latency.
    let age_s = |pose: &Pose| (pose.stamp_ns - pose.evidence_ns) as f64 * 1e-9;
    assert!(judge.poses.iter().filter(|pose| pose.evidence_ns > 0).all(|pose| age_s(pose) > 0.9));
}
