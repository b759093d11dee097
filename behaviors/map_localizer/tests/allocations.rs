//! After warm-up, a call of the behaviour allocates nothing.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod rig;

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicU64, Ordering};

use bytemuck::bytes_of;
use rig::{camera, empty_hallway, frame_header, setup, toml};
use yamabico_core::behavior::{
    Behavior, InputSource, Inputs, OutputSink, Outputs, PublishError, RawMessage, SlotSource,
};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Kind, MessageType, Odometry, PoseStatus};
use yamabico_core::testing::Bench;
use yamabico_core::time::Time;
use yamabico_map_localizer::{CAMERA, MapLocalizer, ODOMETRY};
use yamabico_sim::random::stream;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene};

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

/// One message in a slot, fresh.
struct One<'a> {
    name: &'static str,
    header: &'a [u8],
    items: &'a [u8],
}

impl SlotSource for One<'_> {
    fn name(&self) -> &str {
        self.name
    }

    fn len(&self) -> usize {
        1
    }

    fn fresh(&self) -> usize {
        1
    }

    fn lost(&self) -> u64 {
        0
    }

    fn get(&self, index: usize) -> Option<RawMessage<'_>> {
        (index == 0).then_some(RawMessage { header: self.header, items: self.items })
    }
}

struct Two<'a>([One<'a>; 2]);

impl InputSource for Two<'_> {
    fn slot(&self, index: usize) -> Option<&dyn SlotSource> {
        self.0.get(index).map(|slot| slot as &dyn SlotSource)
    }
}

/// Counts what is published, and forgets it.
#[derive(Default)]
struct Count(u32);

impl OutputSink for Count {
    fn publish(&mut self, _: &str, _: &MessageType, _: &[u8], _: &[u8]) -> Result<(), PublishError> {
        self.0 += 1;
        Ok(())
    }

    fn publish_in_place(
        &mut self,
        name: &str,
        _: &MessageType,
        _: &[u8],
        _: usize,
        _: &mut dyn FnMut(&mut [u8]),
    ) -> Result<(), PublishError> {
        Err(PublishError::NoSuchOutput(name.to_owned()))
    }
}

#[test]
fn a_frame_allocates_nothing_after_warm_up() {
    let (intrinsics, mount) = camera(256, 240);
    let scene = Scene::new(&empty_hallway(), 0).unwrap();
    let mut renderer = Renderer::new(Photometry::default(), stream(3, "picture"));
    let pictures: Vec<_> = [0.0, 0.02, -0.02]
        .into_iter()
        .map(|heading| {
            let mut pixels = vec![0; 256 * 240];
            let robot = Pose2::new(0.0, 0.0, heading);
            renderer.render(&scene, &CameraView { intrinsics, mount, robot }, &mut pixels).unwrap();
            (heading, pixels)
        })
        .collect();
    let bench = Bench::<MapLocalizer>::new(&toml("route = [[12.5, 0.0]]"), setup(256, 240)).unwrap();
    let mut localizer = bench.behavior;
    let mut sink = Count::default();
    let mut counted = 0;
    for i in 0..150_usize {
        let seconds = i as f64 * 0.1;
        let (heading, pixels) = &pictures[i % pictures.len()];
        let stamp_ns = Time::from_secs_f64(seconds).0;
        let odometry = Odometry { stamp_ns, theta: *heading, ..Odometry::default() };
        let frame = frame_header(256, 240, seconds);
        let slots = Two([
            One { name: CAMERA.name, header: bytes_of(&frame), items: pixels },
            One { name: ODOMETRY.name, header: bytes_of(&odometry), items: &[] },
        ]);
        let before = ALLOCATIONS.load(Ordering::Relaxed);
        let proposal = localizer.propose(&Inputs::new(Time(stamp_ns), &slots), &mut Outputs::new(&mut sink));
        let during = ALLOCATIONS.load(Ordering::Relaxed) - before;
        assert_eq!(proposal.kind(), Some(Kind::Drive), "{:?}", proposal.reason());
        if i >= 50 {
            assert_eq!(during, 0, "call {i}");
            counted += 1;
        }
    }
    assert_eq!(localizer.status().0, PoseStatus::Tracking);
    assert_eq!((counted, sink.0), (100, 300), "a pose and a path each time");
}
