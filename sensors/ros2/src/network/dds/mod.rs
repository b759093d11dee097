//! DDS: the only module that names its library.

mod raw;

use std::net::{IpAddr, Ipv4Addr};
use std::sync::Arc;
use std::task::Waker;
use std::time::Duration;

use rustdds::no_key::{DataWriter, SimpleDataReader};
use rustdds::policy::{Durability, History, Reliability as DdsReliability};
use rustdds::{
    DomainParticipant, DomainParticipantBuilder, DomainParticipantStatusEvent as Status,
    DomainParticipantStatusListener, Duration as DdsDuration, EndpointDescription, GUID,
    Publisher as DdsPublisher, QosPolicies, QosPolicyBuilder, RTPSEntity, StatusEvented,
    Subscriber as DdsSubscriber, Topic, TopicKind,
};

use super::participant::{Event, Events, Joined, Participant, Reader, Reading, Writer};
use crate::config::Reliability;
use crate::graph::{Endpoint, EndpointId, Qos};
use crate::names::{dds_topic, dds_type, ros_topic, ros_type};
use raw::{Raw, RawAdapter};

/// Number of sent messages that wait for a subscriber's receipt. One that was killed keeps its place until its lease is over,
/// 20 s or more; until then the others must get their messages.
const SENT_DEPTH: i32 = 5000;
/// Number of received messages that wait for the thread.
const RECEIVED_DEPTH: i32 = 16;
/// Longest time for which sending waits for a slow subscriber.
const MAX_BLOCKING_MS: i64 = 2;

/// A participant of DDS.
struct DdsParticipant {
    participant: DomainParticipant,
    publisher: DdsPublisher,
    subscriber: DdsSubscriber,
}

struct DdsEvents {
    participant: DomainParticipant,
    listener: DomainParticipantStatusListener,
}

struct DdsWriter(DataWriter<Raw, RawAdapter>);

struct DdsReader(SimpleDataReader<Raw, RawAdapter>);

/// Returns where the environment confines a participant to this machine.
pub(super) fn is_only_local() -> bool {
    let variable = |name: &str| std::env::var(name).ok();
    variable("ROS_AUTOMATIC_DISCOVERY_RANGE").is_some_and(|range| range == "LOCALHOST")
        || variable("ROS_LOCALHOST_ONLY").is_some_and(|only| only == "1")
}

/// Joins `domain`.
///
/// # Errors
/// The cause in words.
pub(super) fn join(domain: u16) -> Result<Joined, String> {
    let mut builder = DomainParticipantBuilder::new(domain);
    if is_only_local() {
        builder = builder.with_only_networks([IpAddr::V4(Ipv4Addr::LOCALHOST)]);
    }
    let participant = builder.build().map_err(|error| error.to_string())?;
    let publisher = participant.create_publisher(&sending()).map_err(|error| error.to_string())?;
    let subscriber = participant.create_subscriber(&receiving(Reliability::BestEffort, false));
    let subscriber = subscriber.map_err(|error| error.to_string())?;
    let events = DdsEvents { participant: participant.clone(), listener: participant.status_listener() };
    Ok(Joined {
        participant: Arc::new(DdsParticipant { participant, publisher, subscriber }),
        events: Box::new(events),
    })
}

impl DdsParticipant {
    fn topic(&self, topic: &str, message_type: &str, qos: &QosPolicies) -> Result<Topic, String> {
        let created =
            self.participant.create_topic(dds_topic(topic), dds_type(message_type), qos, TopicKind::NoKey);
        created.map_err(|error| error.to_string())
    }
}

impl Participant for DdsParticipant {
    fn writer(&self, topic: &str, message_type: &str) -> Result<Box<dyn Writer>, String> {
        let topic = self.topic(topic, message_type, &sending())?;
        let writer = self.publisher.create_datawriter_no_key(&topic, Some(sending()));
        Ok(Box::new(DdsWriter(writer.map_err(|error| error.to_string())?)))
    }

    fn reader(&self, reading: &Reading<'_>) -> Result<Box<dyn Reader>, String> {
        let policies = receiving(reading.reliability, reading.transient_local);
        let topic = self.topic(reading.topic, reading.message_type, &policies)?;
        let reader = self.subscriber.create_simple_datareader_no_key(&topic, Some(policies));
        Ok(Box::new(DdsReader(reader.map_err(|error| error.to_string())?)))
    }
}

impl DdsEvents {
    fn found(&self, description: EndpointDescription, publishes: bool) -> Option<Event> {
        let EndpointDescription { guid, topic_name, type_name, qos: policies, .. } = description;
        if guid.prefix == self.participant.guid().prefix {
            return None;
        }
        let topic = ros_topic(&topic_name)?;
        let endpoint = Endpoint { topic, message_type: ros_type(&type_name), publishes, qos: qos(&policies) };
        Some(Event::Found(guid.to_bytes(), endpoint))
    }

    fn event(&self, status: Status) -> Option<Event> {
        Some(match status {
            Status::WriterDetected { writer } => self.found(writer, true)?,
            Status::ReaderDetected { reader } => self.found(reader, false)?,
            Status::WriterLost { guid, .. } | Status::ReaderLost { guid, .. } => Event::Lost(guid.to_bytes()),
            Status::ParticipantLost { id, .. } => {
                let mut any = GUID::from_bytes([0; 16]);
                any.prefix = id;
                let bytes = any.to_bytes();
                Event::ParticipantLost(std::array::from_fn(|place| bytes[place]))
            }
            Status::RemoteWriterMatched { local_reader, remote_writer } => {
                Event::Matched { reader: local_reader.to_bytes(), publisher: remote_writer.to_bytes() }
            }
            Status::RemoteWriterQosIncompatible {
                local_reader,
                remote_writer,
                requested_qos,
                offered_qos,
            } => Event::ReaderMismatched {
                reader: local_reader.to_bytes(),
                publisher: remote_writer.to_bytes(),
                requested: qos(&requested_qos),
                offered: qos(&offered_qos),
            },
            Status::RemoteReaderQosIncompatible { local_writer, requested_qos, offered_qos, .. } => {
                Event::WriterMismatched {
                    writer: local_writer.to_bytes(),
                    requested: qos(&requested_qos),
                    offered: qos(&offered_qos),
                }
            }
            _ => return None,
        })
    }
}

impl Events for DdsEvents {
    fn next(&mut self) -> Option<Event> {
        loop {
            let status = self.listener.try_recv_status()?;
            if let Some(event) = self.event(status) {
                return Some(event);
            }
        }
    }
}

impl Writer for DdsWriter {
    fn id(&self) -> EndpointId {
        RTPSEntity::guid(&self.0).to_bytes()
    }

    fn write(&self, message: Vec<u8>) -> bool {
        self.0.write(Raw(message), None).is_ok()
    }

    fn flush(&self, timeout: Duration) {
        // Best-effort subscribers acknowledge nothing: a moment for the thread that sends.
        let _ = self.0.wait_for_acknowledgments(timeout);
        std::thread::sleep(Duration::from_millis(20).min(timeout));
    }
}

impl Reader for DdsReader {
    fn id(&self) -> EndpointId {
        RTPSEntity::guid(&self.0).to_bytes()
    }

    fn read(&mut self, waker: &Waker, take: &mut dyn FnMut(&[u8])) {
        // Set before the look, so that none that arrives in between is missed.
        self.0.set_waker(Some(waker.clone()));
        self.0.drain_read_notifications();
        while let Ok(Some(sample)) = self.0.try_take_one() {
            take(&sample.into_value().0);
        }
    }
}

/// Quality of service of all publishers.
fn sending() -> QosPolicies {
    QosPolicyBuilder::new()
        .reliability(DdsReliability::Reliable {
            max_blocking_time: DdsDuration::from_millis(MAX_BLOCKING_MS),
        })
        .durability(Durability::Volatile)
        .history(History::KeepLast { depth: SENT_DEPTH })
        .build()
}

/// Quality of service of a subscription.
fn receiving(reliability: Reliability, transient_local: bool) -> QosPolicies {
    let reliability = match (reliability, transient_local) {
        (Reliability::BestEffort, false) => DdsReliability::BestEffort,
        // What was published before comes reliably, or not at all.
        _ => DdsReliability::Reliable { max_blocking_time: DdsDuration::from_millis(MAX_BLOCKING_MS) },
    };
    QosPolicyBuilder::new()
        .reliability(reliability)
        .durability(if transient_local { Durability::TransientLocal } else { Durability::Volatile })
        .history(History::KeepLast { depth: RECEIVED_DEPTH })
        .build()
}

fn qos(policies: &QosPolicies) -> Qos {
    Qos {
        reliable: matches!(policies.reliability(), Some(DdsReliability::Reliable { .. })),
        transient_local: !matches!(policies.durability(), None | Some(Durability::Volatile)),
    }
}
