//! Keeps the roll of a live run's plugins from what they tell: how calls went, who ended, what failed, where walls are.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use yamabico_core::message::{
    CallsHeader, FailureHeader, Heartbeat, Message, MessageType, PluginState, RawMessage, View, WallsHeader,
};
use yamabico_core::time::Time;
use yamabico_host::{BehaviorRecord, Durations};

use crate::record::Tap;

/// What is known of the plugins of a live run.
#[derive(Debug, Default)]
pub struct Roll {
    /// By plugin and start.
    records: BTreeMap<(String, u32), BehaviorRecord>,
    /// How often each plugin that gave a sign of life was started again.
    up: BTreeMap<String, u32>,
    ended: BTreeSet<String>,
    failures: Vec<Failure>,
    walls: BTreeMap<String, Vec<Vec<[f64; 2]>>>,
}

/// A plugin that cannot do what it should.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// Which.
    pub plugin: String,
    /// The key of its table to change, dotted; empty where none is to blame.
    pub key: String,
    /// Why.
    pub words: String,
}

impl Roll {
    /// Whether the plugin of this name has ever given a sign of life.
    pub fn is_up(&self, plugin: &str) -> bool {
        self.up.contains_key(plugin)
    }

    /// How often each plugin was started again, by name.
    pub fn restarts(&self) -> BTreeMap<String, u32> {
        self.up.clone()
    }

    /// Devices that have nothing more to measure.
    pub fn ended(&self) -> usize {
        self.ended.len()
    }

    /// What failed, in the order in which it was told.
    pub fn failures(&self) -> &[Failure] {
        &self.failures
    }

    /// Walls that devices know: polylines on the floor, map frame, meters.
    pub fn walls(&self) -> Vec<Vec<[f64; 2]>> {
        self.walls.values().flatten().cloned().collect()
    }

    /// How each behavior fared, all its starts together.
    pub fn records(&self) -> Vec<(String, BehaviorRecord)> {
        let mut all: BTreeMap<&str, BehaviorRecord> = BTreeMap::new();
        for ((name, _), record) in &self.records {
            let sum = all.entry(name).or_default();
            sum.calls.merge(&record.calls);
            sum.overruns += record.overruns;
            sum.abstentions += record.abstentions;
            sum.panics += record.panics;
        }
        all.into_iter().map(|(name, record)| (name.to_owned(), record)).collect()
    }

    fn hear_calls(&mut self, told: &View<'_, CallsHeader>) {
        let header = told.header;
        let mut calls = Durations::default();
        for bucket in told.items {
            calls.add_bucket(bucket.index as usize, u64::from(bucket.calls));
        }
        calls.raise_max(Duration::from_nanos(header.longest_ns));
        let record = BehaviorRecord {
            calls,
            overruns: header.overruns,
            abstentions: header.abstentions,
            panics: header.panics,
        };
        self.records.insert((header.plugin.as_str().to_owned(), header.restarts), record);
    }
}

impl Tap for Roll {
    fn message(&mut self, _: &str, message: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        let raw = RawMessage { header, items };
        match message.name {
            Heartbeat::NAME => {
                let Some(View { header: beat, .. }) = View::<Heartbeat>::of(raw) else { return };
                let name = beat.plugin.as_str();
                match self.up.get_mut(name) {
                    Some(restarts) => *restarts = (*restarts).max(beat.restarts),
                    None => drop(self.up.insert(name.to_owned(), beat.restarts)),
                }
                if beat.state() == Some(PluginState::Ended) {
                    self.ended.insert(name.to_owned());
                } else if !self.ended.is_empty() {
                    self.ended.remove(name);
                }
            }
            CallsHeader::NAME => {
                if let Some(told) = View::of(raw) {
                    self.hear_calls(&told);
                }
            }
            FailureHeader::NAME => {
                let Some(View { header: told, .. }) = View::<FailureHeader>::of(raw) else { return };
                self.failures.push(Failure {
                    plugin: told.plugin.as_str().to_owned(),
                    key: told.key.as_str().to_owned(),
                    words: String::from_utf8_lossy(items).into_owned(),
                });
            }
            WallsHeader::NAME => {
                let Some(View { header: told, items }) = View::<WallsHeader>::of(raw) else { return };
                let mut lines: BTreeMap<u64, Vec<[f64; 2]>> = BTreeMap::new();
                for corner in items {
                    lines.entry(corner.line).or_default().push([corner.x, corner.y]);
                }
                self.walls.insert(told.device.as_str().to_owned(), lines.into_values().collect());
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::{CallBucket, Name, WallPoint};

    fn hear<M: Message>(roll: &mut Roll, header: &M, items: &[M::Item]) {
        let (header, items) = (bytemuck::bytes_of(header), bytemuck::cast_slice(items));
        roll.message("any", &MessageType::of::<M>(), Time::ZERO, header, items);
    }

    #[test]
    fn the_starts_of_a_behavior_add_up_and_what_is_told_again_does_not() {
        let mut roll = Roll::default();
        for (restarts, calls) in [(0, 5), (0, 7), (1, 2)] {
            let header = CallsHeader { plugin: Name::new("a"), restarts, panics: 1, ..Default::default() };
            hear(
                &mut roll,
                &header,
                &[CallBucket { index: 3, calls }, CallBucket { index: u32::MAX, calls }],
            );
        }
        let records = roll.records();
        let (name, record) = &records[0];
        assert_eq!((name.as_str(), record.calls.count(), record.panics, records.len()), ("a", 9, 2, 1));
    }

    #[test]
    fn a_device_that_measures_again_has_not_ended() {
        let mut roll = Roll::default();
        let beat = |state: PluginState| Heartbeat {
            plugin: Name::new("sim"),
            state: state.code(),
            ..Default::default()
        };
        hear(&mut roll, &beat(PluginState::Ended), &[]);
        assert_eq!(roll.ended(), 1);
        hear(&mut roll, &beat(PluginState::Running), &[]);
        assert_eq!(roll.ended(), 0);
    }

    #[test]
    fn failures_and_walls_are_kept() {
        let mut roll = Roll::default();
        let failure = FailureHeader { plugin: Name::new("sim"), key: "world".into(), ..Default::default() };
        hear(&mut roll, &failure, "no such world".as_bytes());
        let told = &roll.failures()[0];
        assert_eq!((told.key.as_str(), told.words.as_str()), ("world", "no such world"));
        let corner = |line, x| WallPoint { x, y: 0.0, line };
        let walls = WallsHeader { device: Name::new("sim"), ..Default::default() };
        hear(&mut roll, &walls, &[corner(0, 1.0), corner(0, 2.0), corner(1, 3.0)]);
        assert_eq!(roll.walls(), [vec![[1.0, 0.0], [2.0, 0.0]], vec![[3.0, 0.0]]]);
    }
}
