//! Reports of a plugin to the supervisor: heartbeats, call statistics, failures, saved state.

use std::time::Duration;

use crate::behavior_host::CallStats;
use crate::bus::{Bus, BusError, Publisher};
use crate::topics;
use yamabico_core::behavior::MAX_SAVED_STATE_BYTES;
use yamabico_core::message::{
    CallBucket, CallsHeader, FailureHeader, Heartbeat, Message, Name, Note, PluginState, SavedStateHeader,
    WallPoint, WallsHeader,
};
use yamabico_core::time::Time;

/// Period of the call statistics.
const CALLS_PERIOD: Duration = Duration::from_millis(500);
/// Maximum length of the text of a failure, bytes; a longer text is cut.
pub const MAX_FAILURE_TEXT_BYTES: usize = 2048;
/// Maximum number of points in one message with walls; further points are left out.
pub const MAX_WALL_POINTS: usize = 4096;

/// Publishes the reports of one plugin. A bus that fails is logged once: the missing heartbeats then make the
/// supervisor restart the plugin.
pub struct PluginReporter {
    heartbeats: Publisher<Heartbeat>,
    // Opened for the first message, since a start must be quick.
    calls: Option<Publisher<CallsHeader>>,
    failures: Option<Publisher<FailureHeader>>,
    states: Option<Publisher<SavedStateHeader>>,
    walls: Option<Publisher<WallsHeader>>,
    bus: Bus,
    plugin: Name,
    restarts: u32,
    heartbeat_period: Duration,
    last_heartbeat: Option<(Time, PluginState)>,
    last_calls: Time,
    buckets: Vec<CallBucket>,
    saved_state: Vec<u8>,
    sequences: Sequences,
    has_failed: bool,
}

/// Sequence number of the last message on each topic.
#[derive(Default)]
struct Sequences {
    heartbeats: u64,
    calls: u64,
    failures: u64,
    states: u64,
    walls: u64,
}

impl PluginReporter {
    /// Opens the reporter of the plugin `name`, which was restarted `restarts` times.
    ///
    /// # Errors
    /// The topic of heartbeats cannot be opened.
    pub fn open(
        bus: &Bus,
        name: &str,
        restarts: u32,
        heartbeat_period: Duration,
    ) -> Result<PluginReporter, BusError> {
        Ok(PluginReporter {
            heartbeats: bus.publisher(topics::HEARTBEATS)?,
            calls: None,
            failures: None,
            states: None,
            walls: None,
            bus: bus.clone(),
            plugin: Name::new(name),
            restarts,
            heartbeat_period,
            last_heartbeat: None,
            last_calls: Time::monotonic_now(),
            buckets: Vec::new(),
            saved_state: Vec::new(),
            sequences: Sequences::default(),
            has_failed: false,
        })
    }

    /// Bus that the reports are published on.
    pub fn bus(&self) -> &Bus {
        &self.bus
    }

    /// Longest time between two heartbeats of a healthy plugin.
    pub fn heartbeat_period(&self) -> Duration {
        self.heartbeat_period
    }

    /// Publishes a heartbeat if its period is over or `state` has changed.
    pub fn publish_heartbeat(&mut self, state: PluginState, now: Time) {
        if self
            .last_heartbeat
            .is_some_and(|(at, last)| last == state && now.since(at) < self.heartbeat_period)
        {
            return;
        }
        self.last_heartbeat = Some((now, state));
        self.sequences.heartbeats += 1;
        let heartbeat = Heartbeat {
            stamp_ns: now.0,
            sequence: self.sequences.heartbeats,
            plugin: self.plugin,
            state: state.code(),
            restarts: self.restarts,
        };
        let published = self.heartbeats.publish(&heartbeat, &[]);
        // Programs that connect later see the walls, too.
        let resent = self.walls.as_ref().map_or(Ok(()), Publisher::resend_to_new_subscribers);
        self.log_first_error(published.and(resent));
    }

    /// Publishes a failure of the plugin. `key` is the key of its table to change; empty if no key is the cause.
    pub fn publish_failure(&mut self, key: &str, text: &str, now: Time) {
        self.sequences.failures += 1;
        let header = FailureHeader {
            stamp_ns: now.0,
            sequence: self.sequences.failures,
            plugin: self.plugin,
            key: Note::new(key),
        };
        let text = &text.as_bytes()[..text.len().min(MAX_FAILURE_TEXT_BYTES)];
        let published = publish(&mut self.failures, &self.bus, topics::FAILURES, &header, text);
        self.log_first_error(published);
    }

    /// Publishes a behavior's call statistics if their period is over.
    pub fn publish_calls(&mut self, stats: &CallStats, now: Time) {
        if now.since(self.last_calls) >= CALLS_PERIOD {
            self.publish_final_calls(stats, now);
        }
    }

    /// Publishes a behavior's call statistics at once, at the end of its run.
    pub fn publish_final_calls(&mut self, stats: &CallStats, now: Time) {
        self.last_calls = now;
        self.sequences.calls += 1;
        let header = CallsHeader {
            stamp_ns: now.0,
            sequence: self.sequences.calls,
            plugin: self.plugin,
            longest_ns: u64::try_from(stats.calls.max().as_nanos()).unwrap_or(u64::MAX),
            overruns: stats.overruns,
            abstentions: stats.abstentions,
            panics: stats.panics,
            restarts: self.restarts,
        };
        self.buckets.clear();
        self.buckets.extend(stats.calls.buckets().map(|(index, calls)| CallBucket {
            index: index as u32,
            calls: u32::try_from(calls).unwrap_or(u32::MAX),
        }));
        let published = publish(&mut self.calls, &self.bus, topics::CALLS, &header, &self.buckets);
        self.log_first_error(published);
    }

    /// Publishes a behavior's saved state if it has changed. A state longer than [`MAX_SAVED_STATE_BYTES`] is not
    /// published.
    pub fn publish_saved_state(&mut self, state: &[u8], now: Time) {
        if state == self.saved_state || state.len() > MAX_SAVED_STATE_BYTES {
            return;
        }
        self.saved_state.clear();
        self.saved_state.extend_from_slice(state);
        self.sequences.states += 1;
        let header =
            SavedStateHeader { stamp_ns: now.0, sequence: self.sequences.states, plugin: self.plugin };
        let published = publish(&mut self.states, &self.bus, topics::SAVED_STATES, &header, state);
        self.log_first_error(published);
    }

    /// Publishes the walls of a device's simulated world: polylines on the floor, map frame, m.
    pub fn publish_walls(&mut self, walls: &[Vec<[f64; 2]>], now: Time) {
        let lines = (0..).zip(walls);
        let points: Vec<WallPoint> = lines
            .flat_map(|(line, wall)| wall.iter().map(move |&[x, y]| WallPoint { x, y, line }))
            .take(MAX_WALL_POINTS)
            .collect();
        if points.is_empty() {
            return;
        }
        self.sequences.walls += 1;
        let header = WallsHeader { stamp_ns: now.0, sequence: self.sequences.walls, device: self.plugin };
        let published = publish(&mut self.walls, &self.bus, topics::WALLS, &header, &points);
        self.log_first_error(published);
    }

    fn log_first_error(&mut self, published: Result<(), BusError>) {
        if let Err(error) = published
            && !std::mem::replace(&mut self.has_failed, true)
        {
            tracing::error!("`{}` cannot report to the supervisor: {error}", self.plugin);
        }
    }
}

/// Publishes on a topic that is opened for its first message.
fn publish<M: Message>(
    publisher: &mut Option<Publisher<M>>,
    bus: &Bus,
    topic: &str,
    header: &M,
    items: &[M::Item],
) -> Result<(), BusError> {
    let publisher = match publisher {
        Some(publisher) => publisher,
        None => publisher.insert(bus.publisher(topic)?),
    };
    publisher.publish(header, items)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::TopicSpec;
    use yamabico_core::message::MessageType;

    #[test]
    fn each_topic_has_sequence_numbers_of_its_own() {
        let bus = Bus::local("reporter").unwrap();
        let spec = TopicSpec { list_bytes: 1024, depth: 64, ..TopicSpec::default() };
        bus.create::<Heartbeat>(topics::HEARTBEATS, &spec).unwrap();
        bus.create::<CallsHeader>(topics::CALLS, &spec).unwrap();
        bus.create::<SavedStateHeader>(topics::SAVED_STATES, &spec).unwrap();
        let calls = bus.tap(topics::CALLS, &MessageType::of::<CallsHeader>()).unwrap();
        let states = bus.tap(topics::SAVED_STATES, &MessageType::of::<SavedStateHeader>()).unwrap();
        let mut reporter = PluginReporter::open(&bus, "walker", 0, Duration::from_millis(50)).unwrap();
        for i in 0..10 {
            reporter.publish_final_calls(&CallStats::default(), Time(i));
            (0..3).for_each(|j| reporter.publish_saved_state(format!("[{i}, {j}]").as_bytes(), Time(i)));
            reporter.publish_saved_state(format!("[{i}, 2]").as_bytes(), Time(i));
        }
        let count =
            |tap: &crate::bus::RawSubscriber| std::iter::from_fn(|| tap.receive().unwrap().map(drop)).count();
        assert_eq!((count(&calls), calls.lost()), (10, 0));
        assert_eq!((count(&states), states.lost()), (30, 0), "an unchanged state is published once");
    }
}
