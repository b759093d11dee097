//! Live recordings that lack messages, as after a recorder that was too slow: how many, and a replay up to the loss.

use std::fs::File;
use std::path::Path;

use mcap::Attachment;
use mcap::records::{MessageHeader, Metadata};
use serde_json::Value;
use yamabico_mcap::{Message, Messages};
use yamabico_runtime::record::Contents;
use yamabico_testkit::config;

use crate::program::{TestFolder, assert_exit, yamabico};

/// Copies the recording `from` without the messages that are lost.
fn copy_without(from: &Path, to: &Path, is_lost: &mut dyn FnMut(&Message<'_>) -> bool) {
    let mut writer = mcap::Writer::new(File::create(to).unwrap()).unwrap();
    let contents = Contents::read(from).unwrap();
    for (name, text) in contents.files {
        let (media_type, data) = ("application/toml".to_owned(), text.as_bytes().into());
        writer.attach(&Attachment { log_time: 0, create_time: 0, name, media_type, data }).unwrap();
    }
    writer.write_metadata(&Metadata { name: "run".into(), metadata: contents.facts }).unwrap();
    let mut messages = Messages::open(from).unwrap();
    while let Some(message) = messages.next().unwrap() {
        if is_lost(&message) {
            continue;
        }
        let Message { channel, sequence, log_time, publish_time, data } = message;
        let schema = channel
            .schema
            .as_ref()
            .map_or(0, |schema| writer.add_schema(&schema.name, &schema.encoding, &schema.data).unwrap());
        let channel_id =
            writer.add_channel(schema, &channel.topic, &channel.encoding, &channel.metadata).unwrap();
        let header = MessageHeader { channel_id, sequence, log_time, publish_time };
        writer.write_to_known_channel(&header, data).unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn a_live_recording_that_lost_messages_is_replayed_up_to_the_loss() {
    let folder = TestFolder::new("lost-messages");
    let robot = format!("robot.name=lost-{}", std::process::id());
    let mut run = yamabico();
    run.args(["run", "--live", "--no-report"]).arg(config("corridor.toml")).arg("--out").arg(folder.path());
    run.args(["--set", "run.duration_s=8", "--set", &robot]);
    assert_exit(&run.output().unwrap(), 1, &[]);
    let (whole, lossy) = (folder.file("run.mcap"), folder.file("lossy.mcap"));
    let replay = |arguments: &[&str]| yamabico().arg("replay").args(arguments).output().unwrap();
    let whole_report = report(&replay(&[whole.to_str().unwrap(), "--json"]).stdout);
    assert!(whole_report["first"].is_null(), "{whole_report:#}");

    // One scan in the middle, and one record of the calls of the wall-follower.
    let mut times = Vec::new();
    let mut messages = Messages::open(&whole).unwrap();
    while let Some(message) = messages.next().unwrap() {
        times.extend((message.channel.topic == "replay/behaviors/wall-follower").then_some(message.log_time));
    }
    let middle_ns = times[times.len() / 2];
    let mut lost = Vec::new();
    copy_without(&whole, &lossy, &mut |message| {
        let topic = message.channel.topic.as_str();
        let is_it = ["sensors/sonar", "replay/behaviors/wall-follower"].contains(&topic)
            && message.log_time > middle_ns
            && !lost.contains(&topic.to_owned());
        lost.extend(is_it.then(|| topic.to_owned()));
        is_it
    });
    assert_eq!(lost.len(), 2, "{lost:?}");
    let lossy = lossy.to_str().unwrap();
    let expected = [
        "the recording lacks 2 messages: 1 on replay/behaviors/wall-follower, 1 on sensors/sonar",
        "sonar-halt is replayed up to",
        "on sensors/sonar is not recorded",
        "wall-follower is replayed up to",
        "1 records of its calls are lost",
    ];
    assert_exit(&replay(&[lossy]), 0, &expected);
    let lossy_report = report(&replay(&[lossy, "--json"]).stdout);
    assert!(lossy_report["first"].is_null(), "{lossy_report:#}");
    let compared = |report: &Value, topic: &str| report["topics"][topic]["compared"].as_u64().unwrap();
    for behavior in ["sonar-halt", "wall-follower"] {
        let topic = format!("behaviors/{behavior}/proposal");
        let (all, up_to) = (compared(&whole_report, &topic), compared(&lossy_report, &topic));
        // Half of the run; what comes later is not compared.
        assert!(up_to * 4 > all && up_to * 4 < all * 3, "{behavior}: {up_to} of {all} proposals");
    }
    // No message was lost that the arbiter heard.
    assert_eq!(compared(&lossy_report, "decision"), compared(&whole_report, "decision"));
}

fn report(json: &[u8]) -> Value {
    serde_json::from_slice(json).unwrap()
}
