//! One `propose` with a new picture of a rendered corridor.

#[path = "../tests/rig/mod.rs"]
mod rig;

use criterion::{Criterion, criterion_group, criterion_main};
use rig::{camera, frame_header, picture, setup};
use yamabico_core::camera::Calibration;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::Odometry;
use yamabico_core::testing::Bench;
use yamabico_wall_follower::{CAMERA, ODOMETRY, WallFollower};

fn propose(criterion: &mut Criterion) {
    for (width, height) in [(640, 480), (256, 240)] {
        let (intrinsics, mount) = camera(width, height);
        let pixels = picture(intrinsics, mount, Pose2::new(0.0, 0.1, 0.03));
        let setup = setup(intrinsics, mount, Calibration::Measured);
        let mut bench = Bench::<WallFollower>::new("", setup).expect("defaults are valid");
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
