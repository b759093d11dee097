//! After warm-up, a call with polar cells allocates nothing, whether there is a way or none.

#[path = "../examples/field/mod.rs"]
mod field;
#[path = "../examples/field/robot.rs"]
mod field_robot;

use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Axes, Kind, Odometry};
use yamabico_core::testing::{Bench, CountingAllocator, allocations};
use yamabico_free_space_avoider::{CAMERA, FreeSpaceAvoider, ODOMETRY};
use yamabico_sim::{Scene, World};

#[global_allocator]
static HEAP: CountingAllocator = CountingAllocator;

#[test]
fn a_frame_allocates_nothing_after_warm_up() {
    let scene = Scene::new(&World::from_toml(field::FIELD).expect("a world"), 1).expect("a scene");
    let mut renderer = field::renderer(field::camera());
    let mut pictures = [(-0.75, 0.0), (0.0, 0.3), (0.9, -0.6)]
        .map(|(x, y)| field::render(&mut renderer, &scene, Pose2::new(x, y, 0.0)))
        .to_vec();
    pictures.push(vec![90; 3 * 256 * 220]);
    for axes in [Axes::ALL, Axes::PLANAR] {
        let mut bench =
            Bench::<FreeSpaceAvoider>::new(field_robot::CONFIG, field_robot::setup(field::camera(), axes))
                .expect("valid");
        for i in 0..60_usize {
            let seconds = 1.0 + 0.04 * i as f64;
            let header = field_robot::frame_header(seconds);
            let odometry = Odometry { stamp_ns: header.stamp_ns, vx: 0.2, ..Odometry::default() };
            let pixels = &pictures[i / 3 % pictures.len()];
            bench.at(seconds).feed(&ODOMETRY, &odometry, &[]).feed(&CAMERA, &header, pixels);
            let (proposal, asked) = allocations(|| bench.propose());
            assert_ne!(proposal.kind(), Some(Kind::Abstain), "{:?}", proposal.reason());
            assert!(i < 12 || asked.calls == 0, "call {i}: {asked:?}");
        }
    }
}
