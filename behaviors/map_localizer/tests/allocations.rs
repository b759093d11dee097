//! The behavior allocates nothing after warm-up.

use crate::rig::{camera, frame_header, setup, toml};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Kind, Odometry, PathHeader, Pose, PoseStatus};
use yamabico_core::testing::{Bench, allocations};
use yamabico_core::time::Time;
use yamabico_map_localizer::{CAMERA, MapLocalizer, ODOMETRY};
use yamabico_rigs::camera::empty_hallway;
use yamabico_sim::random::stream;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene};

#[test]
fn a_frame_allocates_nothing_after_warm_up() {
    let (intrinsics, mount) = camera(256, 240);
    let scene = Scene::new(&empty_hallway(), 0).unwrap();
    let mut renderer = Renderer::new(Photometry::default(), stream(3, "picture"));
    let images: Vec<_> = [0.0, 0.02, -0.02]
        .into_iter()
        .map(|heading| {
            let mut pixels = vec![0; 256 * 240];
            let robot = Pose2::new(0.0, 0.0, heading);
            renderer.render(&scene, &CameraView { intrinsics, mount, robot }, &mut pixels).unwrap();
            (heading, pixels)
        })
        .collect();
    let mut bench = Bench::<MapLocalizer>::new(&toml("route = [[12.5, 0.0]]"), setup(256, 240)).unwrap();
    bench.draw();
    let mut counted = 0;
    for i in 0..150_usize {
        let seconds = i as f64 * 0.1;
        let (heading, pixels) = &images[i % images.len()];
        let stamp_ns = Time::from_secs_f64(seconds).0;
        let odometry = Odometry { stamp_ns, theta: *heading, ..Odometry::default() };
        bench.at(seconds).feed(&ODOMETRY, &odometry, &[]);
        bench.feed(&CAMERA, &frame_header(256, 240, seconds), pixels);
        let (proposal, made) = allocations(|| bench.propose());
        assert_eq!(proposal.kind(), Some(Kind::Drive), "{:?}", proposal.reason());
        if i >= 50 {
            assert_eq!(made.calls, 0, "call {i}");
            let matched = ["expected, matched", "matched segments"].map(|layer| bench.marks(layer));
            assert!(matched[0] > 4 && matched[1] >= matched[0], "{:?}", bench.layers());
            counted += 1;
        }
        assert_eq!(bench.published::<Pose>("pose").len(), 1);
        assert_eq!(bench.published::<PathHeader>("path").len(), 1);
    }
    assert_eq!(bench.behavior.status().0, PoseStatus::Tracking);
    assert_eq!(counted, 100);
}
