//! After warm-up, a call of the behavior allocates nothing.

use crate::rig::{camera, render, setup};
use yamabico_core::camera::Calibration;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Kind, Odometry};
use yamabico_core::testing::{Bench, allocations};
use yamabico_core::time::Time;
use yamabico_rigs::camera::frame_header;
use yamabico_wall_follower::{CAMERA, ODOMETRY, WallFollower};

#[test]
fn a_frame_allocates_nothing_after_warm_up() {
    let (intrinsics, mount) = camera(640, 480);
    let mut bench =
        Bench::<WallFollower>::new("", setup(intrinsics, mount, Calibration::Measured)).expect("defaults");
    bench.draw();
    let images: Vec<_> = [0.0, 0.1, -0.1]
        .into_iter()
        .map(|heading| (heading, render(intrinsics, mount, Pose2::new(0.0, 0.0, heading))))
        .collect();
    let mut counted = 0;
    for i in 0..150_usize {
        let seconds = i as f64 * 0.1;
        let (heading, pixels) = &images[i % images.len()];
        let odometry =
            Odometry { stamp_ns: Time::from_secs_f64(seconds).0, theta: *heading, ..Odometry::default() };
        bench.at(seconds).feed(&ODOMETRY, &odometry, &[]);
        bench.feed(&CAMERA, &frame_header(&intrinsics, seconds), pixels);
        let (proposal, asked) = allocations(|| bench.propose());
        assert_eq!(proposal.kind(), Some(Kind::Drive), "{:?}", proposal.reason());
        if i >= 50 {
            assert_eq!(asked.calls, 0, "call {i}");
            // A ring, a cross and a text; twelve lines for the floor line of each wall, a line and a text from above.
            assert_eq!(
                [bench.marks("vanishing point"), bench.marks("walls")],
                [4, 4],
                "{:?}",
                bench.layers()
            );
            assert!(bench.marks("segments along the corridor") > 3 && bench.marks("floor lines") > 12);
            counted += 1;
        }
    }
    assert_eq!(counted, 100);
}
