//! After warm-up, a call of the behavior allocates nothing.

use crate::rig::{camera, drive, setup};
use yamabico_core::geometry::{Pose2, Twist};
use yamabico_core::message::Kind;
use yamabico_core::testing::{Bench, allocations};
use yamabico_intersection_tracker::{CAMERA, IntersectionTracker, ODOMETRY};
use yamabico_rigs::approach::{END_M, Ending, world};
use yamabico_rigs::camera::{frame_header, odometry};

#[test]
fn a_frame_allocates_nothing_after_warm_up() {
    let seen_by = camera(640, 480, 60.0);
    let start = Pose2::new(END_M - 5.0, 0.0, 0.0);
    let mut drive = drive(&world(Ending::Crossing, 2.4), start, seen_by, 4.0, 1);
    // Every fifth image is dark, so that edges are missed and detected again.
    let images: Vec<_> = (0..10).map(|_| drive.render()).collect();
    let dark = vec![0; 640 * 480];
    let mut bench = Bench::<IntersectionTracker>::new("", setup(seen_by)).expect("defaults");
    bench.draw();
    let mut drawn = std::collections::BTreeSet::new();
    let mut driven = 0;
    for i in 0..120_usize {
        let seconds = 1.0 + i as f64 * 0.1;
        let is_dark = i > 20 && i % 20 < 5;
        let pixels = if is_dark { &dark } else { &images[i % images.len()] };
        bench.at(seconds).feed(&ODOMETRY, &odometry(seconds, Pose2::IDENTITY, Twist::ZERO), &[]);
        bench.feed(&CAMERA, &frame_header(&seen_by.0, seconds), pixels);
        let (proposal, asked) = allocations(|| bench.propose());
        driven += u32::from(proposal.kind() == Some(Kind::Drive));
        if i >= 60 {
            assert_eq!(asked.calls, 0, "call {i}");
        }
        drawn.extend(bench.layers().into_iter().filter(|(_, marks)| *marks > 0).map(|(name, _)| name));
    }
    assert!(driven > 80, "{driven}");
    for layer in
        ["segments along the corridor", "ends of walls", "tracked edges", "predicted edges", "intersection"]
    {
        assert!(drawn.contains(layer), "{layer}: {drawn:?}");
    }
}
