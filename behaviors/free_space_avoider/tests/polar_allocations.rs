//! Memory allocations of method polar-cells: none after warm-up, with and without a free direction.

use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Axes, Kind, Odometry};
use yamabico_core::testing::{Bench, allocations};
use yamabico_free_space_avoider::{CAMERA, FreeSpaceAvoider, ODOMETRY};
use yamabico_rigs::field;

#[test]
fn a_frame_allocates_nothing_after_warm_up() {
    let scene = field::scene();
    let mut renderer = field::renderer(field::camera());
    let mut images = [(-0.75, 0.0), (0.0, 0.3), (0.9, -0.6)]
        .map(|(x, y)| field::render(&mut renderer, &scene, Pose2::new(x, y, 0.0)))
        .to_vec();
    images.push(vec![90; 3 * 256 * 220]);
    for axes in [Axes::ALL, Axes::PLANAR] {
        let mut bench = Bench::<FreeSpaceAvoider>::new(field::CONFIG, field::setup(field::camera(), axes))
            .expect("valid");
        bench.draw();
        for i in 0..60_usize {
            let seconds = 1.0 + 0.04 * i as f64;
            let header = field::frame_header(seconds);
            let odometry = Odometry { stamp_ns: header.stamp_ns, vx: 0.2, ..Odometry::default() };
            let pixels = &images[i / 3 % images.len()];
            bench.at(seconds).feed(&ODOMETRY, &odometry, &[]).feed(&CAMERA, &header, pixels);
            let (proposal, asked) = allocations(|| bench.propose());
            assert_ne!(proposal.kind(), Some(Kind::Abstain), "{:?}", proposal.reason());
            assert!(i < 12 || asked.calls == 0, "call {i}: {asked:?}");
            let marks = ["rings", "first obstacle cells", "free space"].map(|layer| bench.marks(layer));
            assert!(marks.iter().all(|&marks| marks >= 7), "{:?}", bench.layers());
        }
    }
}
