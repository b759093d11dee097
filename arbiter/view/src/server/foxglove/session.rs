//! A session: the channels of one start of the robot, their newest records, and the way to the clients.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use axum::body::Bytes;
use tokio::sync::broadcast;
use yamabico_core::message::MessageType;
use yamabico_core::time::Time;
use yamabico_runtime::execution::RobotManifest;
use yamabico_runtime::record::{Channel, Format, Records, channels};

use super::{graph, protocol, teleop};
use crate::live::is_shown;
use crate::model::OVERLAY;

/// Size above which a record is large, such as a picture, bytes.
const LARGE_BYTES: usize = 16 * 1024;
/// Maximum number of small records that a client may be behind; then it skips the oldest.
const MAX_SMALL: usize = 1024;
/// Maximum number of large records that a client may be behind.
const MAX_LARGE: usize = 8;
/// Minimum time between two records of a channel whose newest one counts: viewers show about 60 a second.
const MIN_INTERVAL_S: f64 = 0.015;

/// A record on its way to the clients.
#[derive(Clone, Debug)]
pub(super) enum News {
    /// A record of the channel with this index.
    Record { channel: usize, time: Time, data: Bytes },
    /// Time.
    Time(Time),
}

/// One start of the robot.
pub(super) struct Session {
    /// Number of the start.
    pub number: u64,
    /// Name of the robot.
    pub robot: String,
    /// Channels; the identifier of a channel is its index.
    pub channels: Vec<Channel>,
    /// Topics with their publishers and subscribers, as a message.
    pub graph: String,
    /// Name of the teleop behavior.
    pub teleop: Option<String>,
    /// Announcement of the channels, as a message.
    pub advertisement: String,
    indices: BTreeMap<String, usize>,
    overlays: Vec<usize>,
    subscribers: Vec<AtomicUsize>,
    lasting: Mutex<BTreeMap<usize, News>>,
    small: broadcast::Sender<News>,
    large: broadcast::Sender<News>,
}

impl Default for Session {
    /// Session without a channel.
    fn default() -> Session {
        Session::new(&RobotManifest::default(), 0)
    }
}

impl Session {
    /// Session of a robot; `number` counts its starts.
    pub fn new(manifest: &RobotManifest, number: u64) -> Session {
        let types = manifest.topics.iter();
        let types = types.filter_map(|topic| Some((topic.name.as_str(), MessageType::find(&topic.message)?)));
        let types: Vec<(&str, &MessageType)> = types.filter(|(_, message)| is_shown(message)).collect();
        let channels = channels(types.iter().copied());
        let topics = channels.iter().map(|channel| channel.topic.clone());
        let drawn = types.iter().filter(|(_, message)| message.name == OVERLAY).map(|(topic, _)| *topic);
        let drawn: Vec<&str> = drawn.collect();
        let is_drawn = |topic: &str| {
            let topic = topic.trim_start_matches('/');
            drawn.iter().any(|overlay| {
                topic.strip_prefix(overlay).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
            })
        };
        Session {
            number,
            robot: manifest.robot.clone(),
            graph: graph::of(manifest, &channels),
            teleop: teleop::behavior(manifest),
            advertisement: protocol::advertise(&channels),
            indices: topics.enumerate().map(|(index, topic)| (topic, index)).collect(),
            overlays: (0..channels.len()).filter(|index| is_drawn(&channels[*index].topic)).collect(),
            subscribers: channels.iter().map(|_| AtomicUsize::new(0)).collect(),
            lasting: Mutex::default(),
            small: broadcast::Sender::new(MAX_SMALL),
            large: broadcast::Sender::new(MAX_LARGE),
            channels,
        }
    }

    /// Follows the small and the large records from now on.
    pub fn follow(&self) -> (broadcast::Receiver<News>, broadcast::Receiver<News>) {
        (self.small.subscribe(), self.large.subscribe())
    }

    /// Counts a subscriber of a channel; returns its newest record if that still holds.
    pub fn subscribe(&self, channel: usize) -> Option<News> {
        self.subscribers[channel].fetch_add(1, Ordering::Relaxed);
        self.lasting.lock().unwrap_or_else(PoisonError::into_inner).get(&channel).cloned()
    }

    /// Counts a subscriber less.
    pub fn unsubscribe(&self, channel: usize) {
        self.subscribers[channel].fetch_sub(1, Ordering::Relaxed);
    }

    /// Returns true if a client wants what the behaviors draw.
    pub fn wants_overlays(&self) -> bool {
        self.overlays.iter().any(|channel| self.is_wanted(*channel))
    }

    /// Sends the time to the clients.
    pub fn send_time(&self, time: Time) {
        // Sending fails only without a client.
        let _ = self.small.send(News::Time(time));
    }

    fn is_wanted(&self, channel: usize) -> bool {
        self.subscribers[channel].load(Ordering::Relaxed) > 0
    }
}

/// Passes the records of an encoder to the clients of a session.
pub(super) struct Publisher {
    session: Arc<Session>,
    newest: Vec<Option<Time>>,
}

impl Publisher {
    pub fn new(session: Arc<Session>) -> Publisher {
        Publisher { newest: vec![None; session.channels.len()], session }
    }

    /// The session.
    pub fn session(&self) -> &Session {
        &self.session
    }
}

impl Records for Publisher {
    fn wants(&mut self, topic: &str, time: Time) -> bool {
        let Some(&index) = self.session.indices.get(topic) else { return false };
        let channel = &self.session.channels[index];
        let is_soon = || {
            let since_s = self.newest[index].map(|newest| time.seconds_after(newest));
            since_s.is_some_and(|since_s| (0.0..MIN_INTERVAL_S).contains(&since_s))
        };
        channel.is_lasting || (self.session.is_wanted(index) && !(channel.may_skip && is_soon()))
    }

    fn take(&mut self, topic: &str, time: Time, _: &dyn Fn() -> Format, data: Vec<u8>) {
        let Some(&channel) = self.session.indices.get(topic) else { return };
        self.newest[channel] = Some(time);
        let is_large = data.len() > LARGE_BYTES;
        let news = News::Record { channel, time, data: data.into() };
        if self.session.channels[channel].is_lasting {
            let mut lasting = self.session.lasting.lock().unwrap_or_else(PoisonError::into_inner);
            lasting.insert(channel, news.clone());
        }
        let _ = if is_large { self.session.large.send(news) } else { self.session.small.send(news) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_runtime::execution::TopicEntry;

    fn session() -> Arc<Session> {
        let topic = |name: &str, message: &str| TopicEntry {
            name: name.to_owned(),
            message: message.to_owned(),
            publisher: String::new(),
            declares: None,
        };
        let topics = vec![
            topic("sensors/wheels", "yamabico.Odometry.v1"),
            topic("goal", "yamabico.Goal.v1"),
            topic("behaviors/a/overlay", "yamabico.OverlayHeader.v1"),
            topic("stranger", "yamabico.Unknown.v9"),
        ];
        Arc::new(Session::new(&RobotManifest { topics, ..RobotManifest::default() }, 1))
    }

    fn find(session: &Session, topic: &str) -> usize {
        session.channels.iter().position(|channel| channel.topic == topic).unwrap()
    }

    #[test]
    fn records_are_made_only_for_subscribers_and_not_too_often() {
        let session = session();
        let mut publisher = Publisher::new(Arc::clone(&session));
        let at = |millis: u64| Time(millis * 1_000_000);
        assert!(!publisher.wants("sensors/wheels", at(0)) && !publisher.wants("stranger", at(0)));
        let wheels = find(&session, "sensors/wheels");
        assert!(session.subscribe(wheels).is_none());
        let (mut small, mut large) = session.follow();
        let format = || -> Format { unreachable!() };
        let taken = (0..20).filter(|i| {
            let is_wanted = publisher.wants("sensors/wheels", at(i * 10));
            if is_wanted {
                publisher.take("sensors/wheels", at(i * 10), &format, vec![1]);
            }
            is_wanted
        });
        assert_eq!(taken.count(), 10);
        assert!(matches!(small.try_recv(), Ok(News::Record { channel, .. }) if channel == wheels));
        publisher.take("sensors/wheels", at(900), &format, vec![0; LARGE_BYTES + 1]);
        assert!(large.try_recv().is_ok());
        session.unsubscribe(wheels);
        assert!(!publisher.wants("sensors/wheels", at(1000)));
    }

    #[test]
    fn a_later_client_receives_what_still_holds() {
        let session = session();
        let mut publisher = Publisher::new(Arc::clone(&session));
        assert!(publisher.wants("/goal/scene", Time::ZERO));
        publisher.take("/goal/scene", Time(7), &|| unreachable!(), vec![3]);
        let goal = session.subscribe(find(&session, "/goal/scene"));
        assert!(matches!(goal, Some(News::Record { time: Time(7), .. })), "{goal:?}");
    }

    #[test]
    fn overlays_are_wanted_by_their_subscribers_alone() {
        let session = session();
        session.subscribe(find(&session, "/tf"));
        assert!(!session.wants_overlays());
        session.subscribe(find(&session, "/behaviors/a/overlay/annotations"));
        assert!(session.wants_overlays());
    }
}
