//! After warm-up, a call of the behaviour allocates nothing but what the bench itself keeps of what it publishes.

#[allow(dead_code, reason = "the examples use the rest")]
#[path = "../examples/office/mod.rs"]
mod office;

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicU64, Ordering};
use yamabico_core::behavior::{
    Behavior, InputSource, Inputs, OutputSink, Outputs, Plugin, PublishError, RawMessage, SlotSource,
};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{FrameHeader, Kind, MessageType};
use yamabico_core::time::Time;
use yamabico_free_space_avoider::{CAMERA, Config, FreeSpaceAvoider};
use yamabico_sim::random::stream;
use yamabico_sim::{Renderer, Scene, World};

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

/// One picture in the camera's slot.
struct Picture<'a> {
    header: FrameHeader,
    pixels: &'a [u8],
}

impl SlotSource for Picture<'_> {
    fn name(&self) -> &str {
        CAMERA.name
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
    fn get(&self, _: usize) -> Option<RawMessage<'_>> {
        Some(RawMessage { header: bytemuck::bytes_of(&self.header), items: self.pixels })
    }
}

impl InputSource for Picture<'_> {
    fn slot(&self, index: usize) -> Option<&dyn SlotSource> {
        (index == 0).then_some(self as &dyn SlotSource)
    }
}

/// Counts what is published.
#[derive(Default)]
struct Sink(usize);

impl OutputSink for Sink {
    fn publish(&mut self, _: &str, _: &MessageType, _: &[u8], items: &[u8]) -> Result<(), PublishError> {
        assert_eq!(items.len(), 17 * 16);
        self.0 += 1;
        Ok(())
    }

    fn publish_in_place(
        &mut self,
        _: &str,
        _: &MessageType,
        _: &[u8],
        _: usize,
        _: &mut dyn FnMut(&mut [u8]),
    ) -> Result<(), PublishError> {
        Ok(())
    }
}

#[test]
fn a_frame_allocates_nothing_after_warm_up() {
    let scene = Scene::new(&World::from_toml(office::OFFICE).expect("a world"), 1).expect("a scene");
    let mut renderer = Renderer::new(office::photometry(), stream(1, "noise"));
    for (width, height) in [(340, 180), (640, 480)] {
        let camera = office::camera(width, height);
        let mut behavior =
            FreeSpaceAvoider::new(Config::default(), &office::setup(camera.0, camera.1)).expect("defaults");
        let pictures: Vec<_> = [0.0, 0.4, -0.4]
            .map(|heading| {
                office::render(&mut renderer, &scene, camera, Pose2::new(1.7, 2.6, heading))
                    .expect("a picture")
            })
            .into();
        let mut sink = Sink::default();
        for i in 0..60_usize {
            let seconds = 1.0 + 0.1 * i as f64;
            let picture = Picture {
                header: office::frame_header(&camera.0, seconds),
                pixels: pictures[i % pictures.len()].pixels(),
            };
            let before = ALLOCATIONS.load(Ordering::Relaxed);
            let proposal = behavior
                .propose(&Inputs::new(Time::from_secs_f64(seconds), &picture), &mut Outputs::new(&mut sink));
            let during = ALLOCATIONS.load(Ordering::Relaxed) - before;
            assert_eq!(proposal.kind(), Some(Kind::Drive), "{:?}", proposal.reason());
            assert!(i < 3 || during == 0, "call {i} of {width}x{height}: {during} allocations");
        }
        assert_eq!(sink.0, 60, "every picture gives free space");
    }
}
