//! Topics behave the same within a process and in shared memory.

use std::time::Duration;

use yamabico_core::behavior::SlotSource;
use yamabico_core::message::{Beam, Command, FrameHeader, MessageType, Odometry, Proposal, RangeScanHeader};
use yamabico_host::bus::{Bus, BusError, Inbox, Notification, STREAM_DEPTH, TopicSpec};

/// Runs `claim` on a bus of each kind.
fn on_both(name: &str, claim: fn(&Bus)) {
    claim(&Bus::local(name).unwrap());
    claim(&Bus::ipc(&format!("{name}-{}", std::process::id())).unwrap());
}

fn odometry(sequence: u64) -> Odometry {
    Odometry { sequence, x: sequence as f64, ..Default::default() }
}

#[test]
fn a_header_without_a_list_arrives() {
    on_both("header", |bus| {
        bus.create::<Odometry>("odometry", &TopicSpec::default()).unwrap();
        let subscriber = bus.subscriber::<Odometry>("odometry").unwrap();
        let publisher = bus.publisher::<Odometry>("odometry").unwrap();
        assert!(subscriber.receive().unwrap().is_none());
        publisher.publish(&odometry(7), &[]).unwrap();
        let sample = subscriber.receive().unwrap().unwrap();
        assert_eq!((*sample.header(), sample.items()), (odometry(7), &[][..]));
        assert!(subscriber.receive().unwrap().is_none());
    });
}

#[test]
fn lists_arrive_with_their_lengths() {
    on_both("lists", |bus| {
        let spec = TopicSpec { list_bytes: 3 * size_of::<Beam>(), ..TopicSpec::default() };
        bus.create::<RangeScanHeader>("sonar", &spec).unwrap();
        let subscriber = bus.subscriber::<RangeScanHeader>("sonar").unwrap();
        let publisher = bus.publisher::<RangeScanHeader>("sonar").unwrap();
        let beams = [1.0, 2.0, 3.0].map(|range_m| Beam { range_m, ..Default::default() });
        for len in [3, 0, 2] {
            publisher.publish(&RangeScanHeader { max_m: 4.0, ..Default::default() }, &beams[..len]).unwrap();
            let sample = subscriber.receive().unwrap().unwrap();
            assert_eq!((sample.header().max_m, sample.items()), (4.0, &beams[..len]));
        }
        let too_long = publisher.publish(&Default::default(), &[Beam::default(); 4]);
        let max_bytes = 3 * size_of::<Beam>();
        assert!(matches!(too_long, Err(BusError::TooLong { max, .. }) if max == max_bytes), "{too_long:?}");
    });
}

#[test]
fn a_frame_is_written_in_place() {
    on_both("frame", |bus| {
        bus.create::<FrameHeader>("camera", &TopicSpec { list_bytes: 640 * 480, ..TopicSpec::default() })
            .unwrap();
        let publisher = bus.publisher::<FrameHeader>("camera").unwrap();
        let subscriber = bus.subscriber::<FrameHeader>("camera").unwrap();
        for value in 1..200 {
            let header = FrameHeader { sequence: value, ..Default::default() };
            publisher.publish_in_place(&header, 640 * 480, |pixels| pixels.fill(value as u8)).unwrap();
            let sample = subscriber.receive().unwrap().unwrap();
            assert_eq!(sample.header().sequence, value);
            assert!(sample.items().len() == 640 * 480 && sample.items().iter().all(|&p| p == value as u8));
        }
    });
}

#[test]
fn a_late_subscriber_of_a_latest_channel_receives_the_last_value() {
    on_both("late", |bus| {
        bus.create::<Proposal>("proposal", &TopicSpec::default()).unwrap();
        let publisher = bus.publisher::<Proposal>("proposal").unwrap();
        for sequence in 1..=5 {
            publisher.publish(&Proposal { sequence, ..Default::default() }, &[]).unwrap();
        }
        let late = bus.subscriber::<Proposal>("proposal").unwrap();
        publisher.resend_to_new_subscribers().unwrap();
        assert_eq!(late.receive().unwrap().unwrap().header().sequence, 5);
        assert!(late.receive().unwrap().is_none());
        for sequence in 6..=8 {
            publisher.publish(&Proposal { sequence, ..Default::default() }, &[]).unwrap();
        }
        assert_eq!(late.receive().unwrap().unwrap().header().sequence, 8);
        assert!(late.receive().unwrap().is_none());
        assert_eq!(late.lost(), 0);
    });
}

#[test]
fn a_late_subscriber_of_a_stream_receives_no_old_message() {
    on_both("late-stream", |bus| {
        bus.create::<Command>("command", &TopicSpec::default()).unwrap();
        let publisher = bus.publisher::<Command>("command").unwrap();
        publisher.publish(&Command::default(), &[]).unwrap();
        assert!(bus.subscriber::<Command>("command").unwrap().receive().unwrap().is_none());
    });
}

#[test]
fn messages_lost_in_an_overflow_are_counted() {
    on_both("overflow", |bus| {
        bus.create::<Odometry>("odometry", &TopicSpec { depth: 200, ..TopicSpec::default() }).unwrap();
        let publisher = bus.publisher::<Odometry>("odometry").unwrap();
        let subscriber = bus.subscriber::<Odometry>("odometry").unwrap();
        let tap = bus.tap("odometry", &MessageType::of::<Odometry>()).unwrap();
        publisher.publish(&odometry(1), &[]).unwrap();
        assert_eq!(subscriber.receive().unwrap().unwrap().header().sequence, 1);
        for sequence in 2..=200 {
            publisher.publish(&odometry(sequence), &[]).unwrap();
        }
        let mut received = Vec::new();
        while let Some(sample) = subscriber.receive().unwrap() {
            received.push(sample.header().sequence);
        }
        assert_eq!(received, (200 - STREAM_DEPTH as u64 + 1..=200).collect::<Vec<_>>());
        assert_eq!(subscriber.lost(), 199 - STREAM_DEPTH as u64);
        let mut tapped = 0;
        while tap.receive().unwrap().is_some() {
            tapped += 1;
        }
        assert_eq!((tapped, tap.lost()), (200, 0));
    });
}

#[test]
fn a_sequence_that_restarts_is_not_a_loss() {
    on_both("anew", |bus| {
        bus.create::<Odometry>("odometry", &TopicSpec { publishers: 2, ..TopicSpec::default() }).unwrap();
        let subscriber = bus.subscriber::<Odometry>("odometry").unwrap();
        for _ in 0..3 {
            let publisher = bus.publisher::<Odometry>("odometry").unwrap();
            for sequence in [10, 11, 1, 2] {
                publisher.publish(&odometry(sequence), &[]).unwrap();
                assert_eq!(subscriber.receive().unwrap().unwrap().header().sequence, sequence);
            }
        }
        assert_eq!(subscriber.lost(), 0);
    });
}

#[test]
fn a_second_publisher_is_refused() {
    on_both("second", |bus| {
        bus.create::<Command>("command", &TopicSpec::default()).unwrap();
        let first = bus.publisher::<Command>("command").unwrap();
        let second = bus.publisher::<Command>("command").err().unwrap();
        assert!(matches!(second, BusError::TooManyPublishers { max: 1, .. }), "{second}");
        assert!(second.to_string().contains("`command`"), "{second}");
        drop(first);
        bus.publisher::<Command>("command").unwrap();
    });
}

#[test]
fn the_error_for_a_wrong_type_names_both_types() {
    on_both("type", |bus| {
        bus.create::<Odometry>("odometry", &TopicSpec::default()).unwrap();
        let error = bus.subscriber::<Command>("odometry").err().unwrap().to_string();
        assert!(error.contains("yamabico.Odometry.v1") && error.contains("yamabico.Command.v2"), "{error}");
        assert!(matches!(bus.subscriber::<Odometry>("none").err(), Some(BusError::NoSuchTopic { .. })));
        assert!(matches!(
            bus.create::<Odometry>("odometry", &TopicSpec::default()),
            Err(BusError::Exists { .. })
        ));
    });
}

#[test]
fn wrong_sizes_are_errors() {
    on_both("sizes", |bus| {
        let scan = MessageType::of::<RangeScanHeader>();
        bus.create_raw("sonar", &scan, &TopicSpec { list_bytes: 1000, ..TopicSpec::default() }).unwrap();
        let publisher = bus.publisher_raw("sonar", &scan).unwrap();
        let header = vec![0xff; scan.header_size];
        let size = scan.item_size;
        for (header, items) in [(&header[1..], 0), (&[], 0), (&header[..], size - 1), (&header[..], size + 1)]
        {
            let refused = publisher.publish(header, &vec![0xff; items]);
            assert!(matches!(refused, Err(BusError::Malformed { .. })), "{items} {refused:?}");
        }
        let subscriber = bus.subscriber::<RangeScanHeader>("sonar").unwrap();
        publisher.publish(&header, &vec![0xff; size]).unwrap();
        let hostile = subscriber.receive().unwrap().unwrap();
        assert!(hostile.header().max_m.is_nan() && hostile.items()[0].range_m.is_nan());
    });
}

#[test]
fn the_number_of_held_samples_is_limited() {
    on_both("held", |bus| {
        bus.create::<Proposal>("proposal", &TopicSpec::default()).unwrap();
        let publisher = bus.publisher::<Proposal>("proposal").unwrap();
        let subscriber = bus.subscriber::<Proposal>("proposal").unwrap();
        let mut held = Vec::new();
        let refused = loop {
            publisher.publish(&Proposal { sequence: held.len() as u64, ..Default::default() }, &[]).unwrap();
            match subscriber.receive() {
                Ok(sample) => held.push(sample.unwrap()),
                Err(error) => break error,
            }
        };
        assert!(matches!(refused, BusError::TooManySamples { max: 3, .. }), "{refused}");
        assert_eq!(held.iter().map(|s| s.header().sequence).collect::<Vec<_>>(), [0, 1, 2]);
        drop(held);
        assert!(subscriber.receive().unwrap().is_some());
    });
}

#[test]
fn an_inbox_keeps_the_newest_messages_and_moves_with_its_samples() {
    on_both("inbox", |bus| {
        let message = MessageType::of::<Odometry>();
        bus.create_raw("odometry", &message, &TopicSpec::default()).unwrap();
        let publisher = bus.publisher::<Odometry>("odometry").unwrap();
        let mut inbox = Inbox::new("wheels", bus.subscriber_raw("odometry", &message).unwrap());
        assert_eq!((inbox.refresh().unwrap(), inbox.len(), inbox.lost()), (0, 0, 0));
        for sequence in 1..=3 {
            publisher.publish(&odometry(sequence), &[]).unwrap();
        }
        let sequences = |inbox: &Inbox| -> Vec<u64> {
            (0..inbox.len()).map(|i| (message.sequence)(inbox.get(i).unwrap().header)).collect()
        };
        assert_eq!((inbox.refresh().unwrap(), sequences(&inbox)), (3, vec![1, 2, 3]));
        let mut inbox = std::thread::spawn(move || {
            assert_eq!(inbox.refresh().unwrap(), 0);
            assert_eq!((inbox.fresh(), inbox.newest().unwrap().header.len()), (0, message.header_size));
            inbox
        })
        .join()
        .unwrap();
        for sequence in 4..=203 {
            publisher.publish(&odometry(sequence), &[]).unwrap();
        }
        assert_eq!(inbox.refresh().unwrap(), STREAM_DEPTH);
        assert_eq!(inbox.lost(), 200 - STREAM_DEPTH as u64);
        assert_eq!(sequences(&inbox), (204 - STREAM_DEPTH as u64..=203).collect::<Vec<_>>());
        assert_eq!((inbox.refresh().unwrap(), inbox.lost(), inbox.fresh()), (0, 0, 0));
    });
}

#[test]
fn ports_work_on_other_threads() {
    on_both("threads", |bus| {
        bus.create::<Odometry>("odometry", &TopicSpec::default()).unwrap();
        let subscriber = bus.subscriber::<Odometry>("odometry").unwrap();
        let publisher = bus.publisher::<Odometry>("odometry").unwrap();
        publisher.publish(&odometry(1), &[]).unwrap();
        let sender = std::thread::spawn(move || {
            for sequence in 2..=10_000 {
                publisher.publish(&odometry(sequence), &[]).unwrap();
            }
            publisher
        });
        let receiver = std::thread::spawn(move || {
            let mut last = 0;
            let mut received = 0;
            while last < 10_000 {
                if let Some(sample) = subscriber.receive().unwrap() {
                    assert!(
                        sample.header().sequence > last
                            && sample.header().x == sample.header().sequence as f64
                    );
                    last = sample.header().sequence;
                    received += 1;
                }
            }
            (received, subscriber.lost())
        });
        let publisher = sender.join().unwrap();
        let (received, lost) = receiver.join().unwrap();
        drop(publisher);
        assert!(received > 0 && received + lost <= 10_000, "{received} {lost}");
    });
}

#[test]
fn a_wait_set_returns_the_notified_topics() {
    on_both("notification", |bus| {
        let spec = TopicSpec { notification: Notification::On, ..TopicSpec::default() };
        bus.create::<Odometry>("odometry", &spec).unwrap();
        bus.create::<Command>("command", &spec).unwrap();
        bus.create::<Proposal>("unnotified", &TopicSpec::default()).unwrap();
        let mut wait_set = bus.wait_set(&["odometry", "command"]).unwrap();
        let publisher = bus.publisher::<Command>("command").unwrap();
        let brief = Duration::from_millis(1);
        let long = Duration::from_secs(60);
        while !wait_set.wait(brief).unwrap().is_empty() {}
        publisher.publish(&Command::default(), &[]).unwrap();
        publisher.publish(&Command::default(), &[]).unwrap();
        let notified = wait_set.wait(long).unwrap();
        assert!(notified.contains(1) && !notified.contains(0));
        assert!(wait_set.wait(brief).unwrap().is_empty());
        let woken = std::thread::spawn(move || wait_set.wait(long).unwrap());
        std::thread::sleep(brief);
        publisher.publish(&Command::default(), &[]).unwrap();
        assert!(woken.join().unwrap().contains(1));
        assert!(matches!(bus.wait_set(&["unnotified"]).err(), Some(BusError::NoNotification { .. })));
    });
}

#[test]
fn buses_within_a_process_are_separate() {
    let (a, b) = (Bus::local("same").unwrap(), Bus::local("same").unwrap());
    a.create::<Odometry>("odometry", &TopicSpec::default()).unwrap();
    b.create::<Odometry>("odometry", &TopicSpec::default()).unwrap();
    let subscriber = b.subscriber::<Odometry>("odometry").unwrap();
    a.publisher::<Odometry>("odometry").unwrap().publish(&odometry(1), &[]).unwrap();
    assert!(subscriber.receive().unwrap().is_none());
}
