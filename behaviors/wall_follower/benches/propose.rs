//! One call of `propose` with a new image of a rendered corridor.

use criterion::{Criterion, criterion_group, criterion_main};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::Odometry;
use yamabico_core::testing::{Bench, camera_setup};
use yamabico_rigs::camera::{forward_camera, frame_header, render};
use yamabico_sim::random::stream;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World};
use yamabico_wall_follower::{CAMERA, ODOMETRY, WallFollower};

fn propose(criterion: &mut Criterion) {
    let scene = Scene::new(&World::random_corridor(3, 2.0), 0).expect("a valid world");
    for (width, height) in [(640, 480), (256, 240)] {
        let (intrinsics, mount) = forward_camera(width, height, 60.0, 5.0);
        let view = CameraView { intrinsics, mount, robot: Pose2::new(0.0, 0.1, 0.03) };
        let pixels = render(&mut Renderer::new(Photometry::default(), stream(3, "picture")), &scene, &view);
        let mut bench =
            Bench::<WallFollower>::new("", camera_setup(intrinsics, mount)).expect("defaults are valid");
        let mut step = 0_u32;
        criterion.bench_function(&format!("wall_follower/propose/{width}x{height}"), |b| {
            b.iter_batched(
                || {
                    step += 1;
                    f64::from(step) * 0.1
                },
                |seconds| {
                    let header = frame_header(&intrinsics, seconds);
                    let odometry = Odometry { stamp_ns: header.stamp_ns, ..Odometry::default() };
                    bench.at(seconds).feed(&ODOMETRY, &odometry, &[]).feed(&CAMERA, &header, &pixels);
                    bench.propose()
                },
                criterion::BatchSize::SmallInput,
            );
        });
    }
}

criterion_group!(benches, propose);
criterion_main!(benches);
