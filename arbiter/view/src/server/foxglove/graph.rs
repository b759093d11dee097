//! Connection graph: who publishes and who receives each topic.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Value, json};
use yamabico_core::message::{Message, Proposal};
use yamabico_runtime::execution::RobotManifest;
use yamabico_runtime::record::Channel;

use super::services::SERVICES;

/// Name of this program in the graph.
const VIEW: &str = "view";
/// Receiver of the proposals.
const ARBITER: &str = "arbiter";

/// Message with the graph of a robot. The standard forms of a topic come from its publisher, the others from this program.
pub(super) fn of(manifest: &RobotManifest, channels: &[Channel]) -> String {
    let publisher = |topic: &str| {
        let topic = topic.trim_start_matches('/');
        let is_of = |name: &str| {
            topic.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
        };
        let entry = manifest.topics.iter().filter(|entry| is_of(&entry.name));
        entry.max_by_key(|entry| entry.name.len()).map_or(VIEW, |entry| entry.publisher.as_str())
    };
    let published: Vec<Value> = channels
        .iter()
        .map(|channel| json!({ "name": channel.topic, "publisherIds": [publisher(&channel.topic)] }))
        .collect();
    let mut receivers: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for plugin in &manifest.plugins {
        for input in &plugin.inputs {
            receivers.entry(input).or_default().insert(&plugin.name);
        }
    }
    for topic in manifest.topics.iter().filter(|topic| topic.message == Proposal::NAME) {
        receivers.entry(&topic.name).or_default().insert(ARBITER);
    }
    let subscribed = receivers.iter().map(|(name, ids)| json!({ "name": name, "subscriberIds": ids }));
    let services = SERVICES.iter().map(|service| json!({ "name": service.name, "providerIds": [VIEW] }));
    let graph = json!({
        "op": "connectionGraphUpdate",
        "publishedTopics": published,
        "subscribedTopics": subscribed.collect::<Vec<_>>(),
        "advertisedServices": services.collect::<Vec<_>>(),
        "removedTopics": [],
        "removedServices": [],
    });
    graph.to_string()
}
