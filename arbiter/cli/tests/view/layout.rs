//! The layout for Foxglove and Lichtblick names topics that a run records.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::BufReader;

use serde_json::Value;
use yamabico_testkit::config;

use super::find_recording;
use crate::program::{TestFolder, yamabico};

const LAYOUT: &str = include_str!("../../../view/layouts/yamabico.json");

/// Fields of a layout that hold a topic, or a path that begins with one.
const FIELDS: [&str; 5] = ["imageTopic", "calibrationTopic", "value", "topicToRender", "topicPath"];

#[test]
fn every_topic_of_the_layout_is_recorded() {
    let folder = TestFolder::new("layout");
    let mut run = yamabico();
    run.arg("run")
        .arg(config("hallway.toml"))
        .args(["--set", "run.duration_s=3"])
        .arg("--out")
        .arg(folder.path());
    run.output().unwrap();
    let file = File::open(find_recording(folder.path()).expect("a recording")).unwrap();
    let messages = mcap::io::MessageReader::new(BufReader::new(file));
    let recorded: BTreeSet<String> = messages.map(|message| message.unwrap().channel.topic.clone()).collect();
    let mut topics = BTreeSet::new();
    collect(&serde_json::from_str(LAYOUT).unwrap(), &mut topics);
    assert!(topics.len() > 10, "{topics:?}");
    let missing: Vec<_> = topics.difference(&recorded).collect();
    assert!(missing.is_empty(), "not recorded: {missing:?}; recorded: {recorded:?}");
}

fn collect(value: &Value, topics: &mut BTreeSet<String>) {
    match value {
        Value::Object(fields) => {
            for (name, value) in fields {
                match (name.as_str(), value) {
                    ("topics" | "annotations", Value::Object(shown)) => topics.extend(shown.keys().cloned()),
                    (name, Value::String(path)) if FIELDS.contains(&name) => {
                        topics.extend(path.split(['.', '[']).next().map(str::to_owned));
                    }
                    (_, value) => collect(value, topics),
                }
            }
        }
        Value::Array(items) => items.iter().for_each(|item| collect(item, topics)),
        _ => {}
    }
}
