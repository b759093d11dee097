//! After warm-up, a call of the behaviour allocates nothing.

mod rig;

use rig::{camera, frame_header, picture, setup};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicU64, Ordering};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Kind, Odometry};
use yamabico_core::sensor::Calibration;
use yamabico_core::testing::Bench;
use yamabico_core::time::Time;
use yamabico_wall_follower::{CAMERA, ODOMETRY, WallFollower};

struct Counting;

static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);

#[allow(unsafe_code, reason = "hands every call on to the system's allocator, and counts")]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn a_frame_allocates_nothing_after_warm_up() {
    let (intrinsics, mount) = camera(640, 480);
    let mut bench =
        Bench::<WallFollower>::new("", setup(intrinsics, mount, Calibration::Measured)).expect("defaults");
    let pictures: Vec<_> = [0.0, 0.1, -0.1]
        .into_iter()
        .map(|heading| (heading, picture(intrinsics, mount, Pose2::new(0.0, 0.0, heading))))
        .collect();
    let mut counted = 0;
    for i in 0..150_usize {
        let seconds = i as f64 * 0.1;
        let (heading, pixels) = &pictures[i % pictures.len()];
        let odometry =
            Odometry { stamp_ns: Time::from_secs_f64(seconds).0, theta: *heading, ..Odometry::default() };
        bench.at(seconds).feed(&ODOMETRY, &odometry, &[]);
        bench.feed(&CAMERA, &frame_header(&intrinsics, seconds), pixels);
        let before = ALLOCATIONS.load(Ordering::Relaxed);
        let proposal = bench.propose();
        let during = ALLOCATIONS.load(Ordering::Relaxed) - before;
        assert_eq!(proposal.kind(), Some(Kind::Drive), "{:?}", proposal.reason());
        if i >= 50 {
            assert_eq!(during, 0, "call {i}");
            counted += 1;
        }
    }
    assert_eq!(counted, 100);
}
