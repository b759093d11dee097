//! How a plugin tells the supervisor that it is alive, how it fares, and what is wrong.

use std::time::Duration;

use super::behavior::BehaviorRecord;
use super::topics;
use crate::bus::{Bus, BusError, Publisher};
use yamabico_core::behavior::MAX_MEMORY_BYTES;
use yamabico_core::message::{
    CallBucket, CallsHeader, FailureHeader, Heartbeat, MemoryHeader, Message, Name, Note, PluginState,
    WallPoint, WallsHeader,
};
use yamabico_core::time::Time;

/// How often a behavior tells how its calls went.
const CALLS_EVERY: Duration = Duration::from_millis(500);
/// Longest reason of a failure, bytes.
pub const MAX_WORDS: usize = 2048;
/// Most corners of walls in one message.
pub const MAX_CORNERS: usize = 4096;

/// The pulse of one plugin. A bus that fails to carry it is told of once: the supervisor then takes the plugin for dead.
pub struct Pulse {
    heartbeats: Publisher<Heartbeat>,
    // Opened when there is something to say: a start must be quick.
    calls: Option<Publisher<CallsHeader>>,
    failures: Option<Publisher<FailureHeader>>,
    memories: Option<Publisher<MemoryHeader>>,
    walls: Option<Publisher<WallsHeader>>,
    bus: Bus,
    plugin: Name,
    restarts: u32,
    every: Duration,
    last: Option<(Time, PluginState)>,
    calls_told: Time,
    buckets: Vec<CallBucket>,
    memory: Vec<u8>,
    beats: u64,
    fails: u64,
    reports: u64,
    remembered: u64,
    shown: u64,
    is_mute: bool,
}

impl Pulse {
    /// That of the plugin `name`, which has been started again so many times, once `every` so long.
    ///
    /// # Errors
    /// Channels that do not open.
    pub fn open(bus: &Bus, name: &str, restarts: u32, every: Duration) -> Result<Pulse, BusError> {
        Ok(Pulse {
            heartbeats: bus.publisher(topics::HEARTBEATS)?,
            calls: None,
            failures: None,
            memories: None,
            walls: None,
            bus: bus.clone(),
            plugin: Name::new(name),
            restarts,
            every,
            last: None,
            calls_told: Time::monotonic_now(),
            buckets: Vec::new(),
            memory: Vec::new(),
            beats: 0,
            fails: 0,
            reports: 0,
            remembered: 0,
            shown: 0,
            is_mute: false,
        })
    }

    /// The bus that it is on.
    pub fn bus(&self) -> &Bus {
        &self.bus
    }

    /// The longest time between two beats of a plugin that is well.
    pub fn every(&self) -> Duration {
        self.every
    }

    /// Beats where it is time to, or where `state` is another one than before.
    pub fn beat(&mut self, state: PluginState, now: Time) {
        if self.last.is_some_and(|(at, before)| before == state && now.since(at) < self.every) {
            return;
        }
        self.last = Some((now, state));
        self.beats += 1;
        let beat = Heartbeat {
            stamp_ns: now.0,
            sequence: self.beats,
            plugin: self.plugin,
            state: state.code(),
            restarts: self.restarts,
        };
        let told = self.heartbeats.publish(&beat, &[]);
        self.note(told);
    }

    /// Tells that the plugin failed, and why; `key` is that of its table to change, empty where none is to blame.
    pub fn fail(&mut self, key: &str, words: &str, now: Time) {
        self.fails += 1;
        let header =
            FailureHeader { stamp_ns: now.0, sequence: self.fails, plugin: self.plugin, key: Note::new(key) };
        let most = words.len().min(MAX_WORDS);
        let told = say(&mut self.failures, &self.bus, topics::FAILURES, &header, &words.as_bytes()[..most]);
        self.note(told);
    }

    /// Tells how the calls of a behavior went, where it is time to.
    pub fn tell_calls(&mut self, record: &BehaviorRecord, now: Time) {
        if now.since(self.calls_told) >= CALLS_EVERY {
            self.tell_last_calls(record, now);
        }
    }

    /// Tells how the calls of a behavior went, for the last time.
    pub fn tell_last_calls(&mut self, record: &BehaviorRecord, now: Time) {
        self.calls_told = now;
        self.reports += 1;
        let header = CallsHeader {
            stamp_ns: now.0,
            sequence: self.reports,
            plugin: self.plugin,
            longest_ns: u64::try_from(record.calls.max().as_nanos()).unwrap_or(u64::MAX),
            overruns: record.overruns,
            abstentions: record.abstentions,
            panics: record.panics,
            restarts: self.restarts,
        };
        self.buckets.clear();
        self.buckets.extend(record.calls.buckets().map(|(index, calls)| CallBucket {
            index: index as u32,
            calls: u32::try_from(calls).unwrap_or(u32::MAX),
        }));
        let told = say(&mut self.calls, &self.bus, topics::CALLS, &header, &self.buckets);
        self.note(told);
    }

    /// Tells what a successor must know, where that is something new; what is longer than [`MAX_MEMORY_BYTES`] is not told.
    pub fn tell_memory(&mut self, memory: &[u8], now: Time) {
        if memory == self.memory || memory.len() > MAX_MEMORY_BYTES {
            return;
        }
        self.memory.clear();
        self.memory.extend_from_slice(memory);
        self.remembered += 1;
        let header = MemoryHeader { stamp_ns: now.0, sequence: self.remembered, plugin: self.plugin };
        let told = say(&mut self.memories, &self.bus, topics::MEMORIES, &header, memory);
        self.note(told);
    }

    /// Tells the walls that a device knows: polylines on the floor, map frame, meters.
    pub fn show_walls(&mut self, walls: &[Vec<[f64; 2]>], now: Time) {
        let lines = (0..).zip(walls);
        let corners: Vec<WallPoint> = lines
            .flat_map(|(line, wall)| wall.iter().map(move |&[x, y]| WallPoint { x, y, line }))
            .take(MAX_CORNERS)
            .collect();
        if corners.is_empty() {
            return;
        }
        self.shown += 1;
        let header = WallsHeader { stamp_ns: now.0, sequence: self.shown, device: self.plugin };
        let told = say(&mut self.walls, &self.bus, topics::WALLS, &header, &corners);
        self.note(told);
    }

    fn note(&mut self, told: Result<(), BusError>) {
        if let Err(error) = told
            && !std::mem::replace(&mut self.is_mute, true)
        {
            tracing::error!("`{}` cannot tell how it fares: {error}", self.plugin);
        }
    }
}

/// Publishes on a topic that is opened for the first message.
fn say<M: Message>(
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
    use crate::bus::Spec;
    use yamabico_core::message::MessageType;

    #[test]
    fn what_is_told_on_one_topic_leaves_no_gap_on_another() {
        let bus = Bus::local("pulse").unwrap();
        let spec = Spec { list_bytes: 1024, depth: 64, ..Spec::default() };
        bus.create::<Heartbeat>(topics::HEARTBEATS, &spec).unwrap();
        bus.create::<CallsHeader>(topics::CALLS, &spec).unwrap();
        bus.create::<MemoryHeader>(topics::MEMORIES, &spec).unwrap();
        let calls = bus.tap(topics::CALLS, &MessageType::of::<CallsHeader>()).unwrap();
        let memories = bus.tap(topics::MEMORIES, &MessageType::of::<MemoryHeader>()).unwrap();
        let mut pulse = Pulse::open(&bus, "walker", 0, Duration::from_millis(50)).unwrap();
        for i in 0..10 {
            pulse.tell_last_calls(&BehaviorRecord::default(), Time(i));
            (0..3).for_each(|j| pulse.tell_memory(format!("[{i}, {j}]").as_bytes(), Time(i)));
            pulse.tell_memory(format!("[{i}, 2]").as_bytes(), Time(i));
        }
        let count =
            |tap: &crate::bus::RawSubscriber| std::iter::from_fn(|| tap.receive().unwrap().map(drop)).count();
        assert_eq!((count(&calls), calls.lost()), (10, 0));
        assert_eq!((count(&memories), memories.lost()), (30, 0), "what is the same is told once");
    }
}
