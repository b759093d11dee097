//! A message costs no memory of ours: nothing is allocated to receive one, and to send one only what iceoryx2 takes for the
//! duration of the loan.

#![allow(unsafe_code, reason = "counts what the system's allocator is asked for")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use yamabico_core::bus::{Bus, Inbox, Spec};
use yamabico_core::message::{FrameHeader, MessageType, Odometry};

struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
    static BYTES: Cell<i64> = const { Cell::new(0) };
}

unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let _ = ALLOCATIONS.try_with(|n| n.set(n.get() + 1));
        let _ = BYTES.try_with(|n| n.set(n.get() + layout.size() as i64));
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        let _ = BYTES.try_with(|n| n.set(n.get() - layout.size() as i64));
        unsafe { System.dealloc(memory, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// Allocations during `work`, and the bytes that they left behind.
fn count(work: impl FnOnce()) -> (u64, i64) {
    let before = (ALLOCATIONS.get(), BYTES.get());
    work();
    (ALLOCATIONS.get() - before.0, BYTES.get() - before.1)
}

const MESSAGES: u64 = 1000;

#[test]
fn messages_are_not_paid_for_on_the_heap() {
    for bus in [Bus::local("heap").unwrap(), Bus::ipc(&format!("heap-{}", std::process::id())).unwrap()] {
        let odometry = MessageType::of::<Odometry>();
        bus.create_raw("odometry", &odometry, &Spec::default()).unwrap();
        bus.create::<FrameHeader>("camera", &Spec { list_bytes: 4096, ..Spec::default() }).unwrap();
        let (wheels, camera) = (bus.publisher("odometry").unwrap(), bus.publisher("camera").unwrap());
        let frames = bus.subscriber::<FrameHeader>("camera").unwrap();
        let mut inbox = Inbox::new("wheels", bus.subscriber_raw("odometry", &odometry).unwrap());
        let (mut sent, mut received) = ((0, 0), (0, 0));
        for sequence in 0..MESSAGES + 100 {
            let send = count(|| {
                wheels.publish(&Odometry { sequence, ..Default::default() }, &[]).unwrap();
                let header = FrameHeader { sequence, ..Default::default() };
                camera.publish_in_place(&header, 4096, |pixels| pixels.fill(1)).unwrap();
            });
            let receive = count(|| {
                assert_eq!(inbox.refresh().unwrap(), 1);
                assert_eq!(frames.receive().unwrap().unwrap().header().sequence, sequence);
            });
            if sequence >= 100 {
                sent = (sent.0 + send.0, sent.1 + send.1);
                received = (received.0 + receive.0, received.1 + receive.1);
            }
        }
        assert_eq!(received, (0, 0));
        assert_eq!(sent, (2 * MESSAGES, 0), "one loan of iceoryx2 a message, given back at once");
    }
}
