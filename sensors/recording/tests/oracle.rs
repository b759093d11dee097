//! Recordings as the Python packages `rosbags` and `mcap` read them: counts, times, stamps and values are equal.
//!
//! Needs both packages in the Python of `YAMABICO_ROSBAGS_PYTHON`, or in `python3`, and the recordings of `YAMABICO_DATA`.

#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use yamabico_core::geometry::angle_difference;
use yamabico_core::message::{Beam, Bumper, FrameHeader, Message, Odometry, RangeScanHeader};
use yamabico_recording::storage::Messages;
use yamabico_recording::{Measurement, TopicReader};
use yamabico_testkit::data::data_set;

/// Delay from which on a stamp is not believed, ns.
const MAX_LATENCY_NS: u64 = 2_000_000_000;

fn python() -> Option<String> {
    let python = std::env::var("YAMABICO_ROSBAGS_PYTHON").unwrap_or("python3".to_owned());
    let found = Command::new(&python).args(["-c", "import rosbags, mcap"]).output();
    if found.is_ok_and(|output| output.status.success()) {
        return Some(python);
    }
    println!("skipped: {python} has no packages rosbags and mcap");
    None
}

/// Messages of a recording as Python reads them.
fn expected(python: &str, path: &Path) -> Vec<Value> {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/read_recording.py");
    let output = Command::new(python).arg(script).arg(path).output().unwrap();
    assert!(output.status.success(), "{}: {}", path.display(), String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// Message type of this program for a type of ROS 2.
fn of_type(kind: &str) -> Option<&'static str> {
    Some(match kind {
        "sensor_msgs/msg/LaserScan" => RangeScanHeader::NAME,
        "nav_msgs/msg/Odometry" => Odometry::NAME,
        "sensor_msgs/msg/CompressedImage" => FrameHeader::NAME,
        "neato2_interfaces/msg/Bump" => Bumper::NAME,
        _ => return None,
    })
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

fn assert_equal(measurement: &Measurement, expected: &Value, place: &str) {
    match measurement {
        Measurement::Scan(header, beams) => {
            assert_eq!(
                [header.min_m, header.max_m],
                [&expected[0], &expected[1]].map(|n| n.as_f64().unwrap())
            );
            let echoes: Vec<Option<f64>> =
                expected[2].as_array().unwrap().iter().map(Value::as_f64).collect();
            assert_eq!(beams.iter().map(Beam::echo_m).collect::<Vec<_>>(), echoes, "{place}");
            for (beam, angle) in beams.iter().zip(numbers(&expected[3])) {
                assert!(angle_difference(beam.azimuth_rad, angle).abs() < 1e-12, "{place}");
            }
        }
        Measurement::Odometry(o) => {
            let read: Vec<f64> =
                [o.x, o.y, o.theta, o.vx, o.vy, o.omega].into_iter().chain(o.covariance).collect();
            assert_eq!(read, numbers(expected), "{place}");
        }
        Measurement::Bumper(bumper) => assert_eq!(Some(bumper.pressed), expected[0].as_u64(), "{place}"),
        Measurement::Frame(header, pixels) => {
            let [width, height, mean] = numbers(expected)[..] else { panic!("{place}") };
            assert_eq!((f64::from(header.width), f64::from(header.height)), (width, height), "{place}");
            let read = pixels.iter().map(|pixel| f64::from(*pixel)).sum::<f64>() / pixels.len() as f64;
            // Two decoders of JPEG differ by rounding.
            assert!((read - mean).abs() < 1.0, "{place}: mean gray level {read}, and not {mean}");
        }
        other => panic!("{place}: {other:?}"),
    }
}

/// Compares a recording; returns the number of its messages, and that of the measurements whose values were compared.
fn compare(python: &str, path: &Path) -> (usize, usize) {
    let expected = expected(python, path);
    let mut by_topic: BTreeMap<String, Vec<&Value>> = BTreeMap::new();
    for message in &expected {
        by_topic.entry(message["topic"].as_str().unwrap().to_owned()).or_default().push(message);
    }
    let mut read: BTreeMap<String, Vec<(u64, u64)>> = BTreeMap::new();
    for message in Messages::open(path).unwrap() {
        let message = message.unwrap();
        read.entry(message.topic.name.clone())
            .or_default()
            .push((message.log_time, message.data.len() as u64));
    }
    let begin_ns = expected.iter().map(|message| message["time"].as_u64().unwrap()).min().unwrap();
    let mut compared = 0;
    assert_eq!(read.keys().collect::<Vec<_>>(), by_topic.keys().collect::<Vec<_>>());
    for (topic, messages) in &by_topic {
        let number = |message: &Value, key: &str| message[key].as_u64().unwrap();
        let times: Vec<_> =
            messages.iter().map(|message| (number(message, "time"), number(message, "bytes"))).collect();
        let mut own = read[topic].clone();
        own.sort_by_key(|(time, _)| *time);
        assert_eq!(own, times, "{topic}");
        let Some(kind) = of_type(messages[0]["type"].as_str().unwrap()) else { continue };
        let mut reader = TopicReader::open(path, topic, kind).unwrap();
        for (i, (message, own)) in messages.iter().zip(reader.by_ref()).enumerate() {
            let place = format!("{}, {topic}, message {i}", path.display());
            let (time, stamp) = (number(message, "time"), number(message, "stamp"));
            let is_plausible = stamp <= time && time - stamp < MAX_LATENCY_NS;
            let stamp = if is_plausible { stamp } else { time };
            assert_eq!(own.arrived_ns, time - begin_ns, "{place}");
            assert_eq!(own.stamp_ns, stamp.saturating_sub(begin_ns), "{place}");
            if !message["values"].is_null() {
                assert_equal(&own.measurement, &message["values"], &place);
                compared += 1;
            }
        }
        assert_eq!(reader.left_out(), (0, None), "{topic}");
        assert_eq!(reader.count(), 0, "{topic}");
    }
    (expected.len(), compared)
}

#[test]
fn recordings_are_read_as_python_reads_them() {
    let (Some(bags), Some(mcap), Some(python)) = (data_set("bags"), data_set("mcap"), python()) else {
        return;
    };
    let entries = |folder: &Path| -> Vec<PathBuf> {
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect()
    };
    let is_recording = |path: &PathBuf| {
        path.join("metadata.yaml").is_file() || path.extension().is_some_and(|extension| extension == "mcap")
    };
    let mut all: Vec<PathBuf> =
        [bags.clone(), bags.join("rosbag2_tests"), mcap].iter().flat_map(|folder| entries(folder)).collect();
    all.retain(is_recording);
    all.sort();
    assert!(all.len() >= 11, "{all:?}");
    for path in all {
        let (messages, compared) = compare(&python, &path);
        println!("{}: {messages} messages, the values of {compared} measurements are equal", path.display());
    }
}
