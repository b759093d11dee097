//! Memory allocations of method navel-grid, with an overlay of the grid: none after warm-up.

use yamabico_core::geometry::Pose2;
use yamabico_core::message::{FrameHeader, FreeSpaceHeader, Kind};
use yamabico_core::testing::{Bench, allocations};
use yamabico_core::time::Time;
use yamabico_free_space_avoider::{CAMERA, FreeSpaceAvoider};
use yamabico_rigs::office;
use yamabico_sim::Renderer;
use yamabico_sim::random::stream;

#[test]
fn a_frame_allocates_nothing_after_warm_up() {
    let scene = office::scene();
    let mut renderer = Renderer::new(office::photometry(), stream(1, "noise"));
    for (width, height) in [(340, 180), (640, 480)] {
        let camera = office::camera(width, height);
        let mut bench =
            Bench::<FreeSpaceAvoider>::new("", office::setup(camera.0, camera.1)).expect("defaults");
        bench.draw();
        let images: Vec<_> = [0.0, 0.4, -0.4]
            .map(|heading| {
                office::render(&mut renderer, &scene, camera, Pose2::new(1.7, 2.6, heading))
                    .expect("an image")
            })
            .into();
        for i in 0..60_usize {
            let seconds = 1.0 + 0.1 * i as f64;
            let image = &images[i % images.len()];
            let header = FrameHeader::gray(width, height, Time::from_secs_f64(seconds).0);
            bench.at(seconds).feed(&CAMERA, &header, image.pixels());
            let (proposal, asked) = allocations(|| bench.propose());
            assert_eq!(proposal.kind(), Some(Kind::Drive), "{:?}", proposal.reason());
            assert!(i < 3 || asked.calls == 0, "call {i} of {width}x{height}: {asked:?}");
            let published = bench.published::<FreeSpaceHeader>("free-space");
            assert_eq!((published.len(), published[0].1.len()), (1, 17));
            // A line and a digit for each column, a side for each direction and the robot's center.
            assert_eq!([bench.marks("free cells by column"), bench.marks("free space")], [34, 18]);
            assert!(bench.marks("obstacle cells") > 40 && bench.marks("free cells of the path") > 40);
        }
    }
}
