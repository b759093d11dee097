//! Receiving a message allocates no memory; sending one allocates only what iceoryx2 needs for the duration of the
//! loan.

use yamabico_core::message::{FrameHeader, MessageType, Odometry};
use yamabico_core::testing::{Allocations, allocations};
use yamabico_host::bus::{Bus, Inbox, TopicSpec};

const MESSAGES: u64 = 1000;

#[test]
fn messages_allocate_no_memory() {
    for bus in [Bus::local("heap").unwrap(), Bus::ipc(&format!("heap-{}", std::process::id())).unwrap()] {
        let odometry = MessageType::of::<Odometry>();
        bus.create_raw("odometry", &odometry, &TopicSpec::default()).unwrap();
        bus.create::<FrameHeader>("camera", &TopicSpec { list_bytes: 4096, ..TopicSpec::default() }).unwrap();
        let (wheels, camera) = (bus.publisher("odometry").unwrap(), bus.publisher("camera").unwrap());
        let frames = bus.subscriber::<FrameHeader>("camera").unwrap();
        let mut inbox = Inbox::new("wheels", bus.subscriber_raw("odometry", &odometry).unwrap());
        let (mut sent, mut received) = (Allocations::default(), Allocations::default());
        for sequence in 0..MESSAGES + 100 {
            let ((), send) = allocations(|| {
                wheels.publish(&Odometry { sequence, ..Default::default() }, &[]).unwrap();
                let header = FrameHeader { sequence, ..Default::default() };
                camera.publish_in_place(&header, 4096, |pixels| pixels.fill(1)).unwrap();
            });
            let ((), receive) = allocations(|| {
                assert_eq!(inbox.refresh().unwrap(), 1);
                assert_eq!(frames.receive().unwrap().unwrap().header().sequence, sequence);
            });
            if sequence >= 100 {
                for (sum, asked) in [(&mut sent, send), (&mut received, receive)] {
                    sum.calls += asked.calls;
                    sum.bytes_kept += asked.bytes_kept;
                }
            }
        }
        assert_eq!(received, Allocations::default());
        let one_each = Allocations { calls: 2 * MESSAGES, bytes_kept: 0 };
        assert_eq!(sent, one_each, "one loan of iceoryx2 per message, freed at once");
    }
}
