//! Statistics of a live run's plugins, from their own reports: calls, restarts, ends, failures, walls.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use yamabico_core::message::{
    CallsHeader, FailureHeader, Heartbeat, Message, MessageType, PluginState, RawMessage, View, WallsHeader,
};
use yamabico_core::time::Time;
use yamabico_host::{CallStats, DurationHistogram};

use crate::record::Tap;

/// Statistics and reports of the plugins of a live run.
#[derive(Debug, Default)]
pub(super) struct PluginStats {
    /// Calls by plugin and number of restarts.
    records: BTreeMap<(String, u32), CallStats>,
    /// Number of restarts of each plugin that has sent a heartbeat.
    up: BTreeMap<String, u32>,
    ended: BTreeSet<String>,
    failures: Vec<PluginFailure>,
    walls: BTreeMap<String, Vec<Vec<[f64; 2]>>>,
}

/// Failure that a plugin reported.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct PluginFailure {
    /// Name of the plugin.
    pub plugin: String,
    /// Key of its table to change, dotted; empty if no key is wrong.
    pub key: String,
    /// Cause.
    pub problem: String,
}

impl PluginStats {
    /// Returns true if the plugin has ever sent a heartbeat.
    pub fn is_up(&self, plugin: &str) -> bool {
        self.up.contains_key(plugin)
    }

    /// Number of restarts of each plugin, by name.
    pub fn restarts(&self) -> BTreeMap<String, u32> {
        self.up.clone()
    }

    /// Number of devices that have ended.
    pub fn ended(&self) -> usize {
        self.ended.len()
    }

    /// Failures in the order of their reports.
    pub fn failures(&self) -> &[PluginFailure] {
        &self.failures
    }

    /// Walls reported by devices: polylines on the floor, map frame, m.
    pub fn walls(&self) -> Vec<Vec<[f64; 2]>> {
        self.walls.values().flatten().cloned().collect()
    }

    /// Call statistics of each behavior, over all its restarts.
    pub fn records(&self) -> Vec<(String, CallStats)> {
        let mut all: BTreeMap<&str, CallStats> = BTreeMap::new();
        for ((name, _), record) in &self.records {
            let sum = all.entry(name).or_default();
            sum.calls.merge(&record.calls);
            sum.overruns += record.overruns;
            sum.abstentions += record.abstentions;
            sum.panics += record.panics;
        }
        all.into_iter().map(|(name, record)| (name.to_owned(), record)).collect()
    }

    fn add_calls(&mut self, report: &View<'_, CallsHeader>) {
        let header = report.header;
        let mut calls = DurationHistogram::default();
        for bucket in report.items {
            calls.add_bucket(bucket.index as usize, u64::from(bucket.calls));
        }
        calls.raise_max(Duration::from_nanos(header.longest_ns));
        let record = CallStats {
            calls,
            overruns: header.overruns,
            abstentions: header.abstentions,
            panics: header.panics,
        };
        self.records.insert((header.plugin.as_str().to_owned(), header.restarts), record);
    }
}

impl Tap for PluginStats {
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
                if let Some(report) = View::of(raw) {
                    self.add_calls(&report);
                }
            }
            FailureHeader::NAME => {
                let Some(View { header: report, .. }) = View::<FailureHeader>::of(raw) else { return };
                self.failures.push(PluginFailure {
                    plugin: report.plugin.as_str().to_owned(),
                    key: report.key.as_str().to_owned(),
                    problem: String::from_utf8_lossy(items).into_owned(),
                });
            }
            WallsHeader::NAME => {
                let Some(View { header: report, items }) = View::<WallsHeader>::of(raw) else { return };
                let mut lines: BTreeMap<u64, Vec<[f64; 2]>> = BTreeMap::new();
                for corner in items {
                    lines.entry(corner.line).or_default().push([corner.x, corner.y]);
                }
                self.walls.insert(report.device.as_str().to_owned(), lines.into_values().collect());
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::{CallBucket, Name, WallPoint};

    fn receive<M: Message>(stats: &mut PluginStats, header: &M, items: &[M::Item]) {
        let (header, items) = (bytemuck::bytes_of(header), bytemuck::cast_slice(items));
        stats.message("any", &MessageType::of::<M>(), Time::ZERO, header, items);
    }

    #[test]
    fn calls_add_up_over_restarts_and_a_repeated_report_replaces_the_last() {
        let mut stats = PluginStats::default();
        for (restarts, calls) in [(0, 5), (0, 7), (1, 2)] {
            let header = CallsHeader { plugin: Name::new("a"), restarts, panics: 1, ..Default::default() };
            receive(
                &mut stats,
                &header,
                &[CallBucket { index: 3, calls }, CallBucket { index: u32::MAX, calls }],
            );
        }
        let records = stats.records();
        let (name, record) = &records[0];
        assert_eq!((name.as_str(), record.calls.count(), record.panics, records.len()), ("a", 9, 2, 1));
    }

    #[test]
    fn a_device_that_measures_again_has_not_ended() {
        let mut stats = PluginStats::default();
        let beat = |state: PluginState| Heartbeat {
            plugin: Name::new("sim"),
            state: state.code(),
            ..Default::default()
        };
        receive(&mut stats, &beat(PluginState::Ended), &[]);
        assert_eq!(stats.ended(), 1);
        receive(&mut stats, &beat(PluginState::Running), &[]);
        assert_eq!(stats.ended(), 0);
    }

    #[test]
    fn failures_and_walls_are_kept() {
        let mut stats = PluginStats::default();
        let failure = FailureHeader { plugin: Name::new("sim"), key: "world".into(), ..Default::default() };
        receive(&mut stats, &failure, "no such world".as_bytes());
        let failure = &stats.failures()[0];
        assert_eq!((failure.key.as_str(), failure.problem.as_str()), ("world", "no such world"));
        let corner = |line, x| WallPoint { x, y: 0.0, line };
        let walls = WallsHeader { device: Name::new("sim"), ..Default::default() };
        receive(&mut stats, &walls, &[corner(0, 1.0), corner(0, 2.0), corner(1, 3.0)]);
        assert_eq!(stats.walls(), [vec![[1.0, 0.0], [2.0, 0.0]], vec![[3.0, 0.0]]]);
    }
}
