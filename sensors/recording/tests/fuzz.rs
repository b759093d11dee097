//! Recordings of any bytes are read, refused or counted: no panic, no hang. See `yamabico_testkit::fuzz` for longer runs.

#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use std::path::{Path, PathBuf};

use yamabico_core::message::{Bumper, FrameHeader, Imu, Message, Odometry, RangeScanHeader};
use yamabico_recording::robot_file::robot_file;
use yamabico_recording::ros2::camera_info::camera_info;
use yamabico_recording::ros2::transforms::Frames;
use yamabico_recording::ros2::{frame_id, measurement, twist};
use yamabico_recording::storage::{Messages, is_mcap};
use yamabico_recording::{Measurement, TopicReader};
use yamabico_testkit::fuzz;

/// Maximum number of messages that an input of the fuzzer may seem to hold.
const MAX_MESSAGES: usize = 100_000;
const TYPES: [&str; 9] = [
    "sensor_msgs/msg/CompressedImage",
    "sensor_msgs/msg/Image",
    "sensor_msgs/msg/LaserScan",
    "sensor_msgs/msg/Range",
    "nav_msgs/msg/Odometry",
    "sensor_msgs/msg/Imu",
    "sensor_msgs/msg/JointState",
    "std_msgs/msg/Bool",
    "neato2_interfaces/msg/Bump",
];
const MESSAGES: [&str; 5] =
    [FrameHeader::NAME, RangeScanHeader::NAME, Odometry::NAME, Imu::NAME, Bumper::NAME];

fn seeds(folder: &str) -> Vec<Vec<u8>> {
    fuzz::seeds(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/seeds").join(folder))
}

/// Reads a file in every way that there is.
fn read_all(path: &Path) {
    let _ = is_mcap(path);
    let mut topics = std::collections::BTreeSet::new();
    if let Ok(messages) = Messages::open(path) {
        for message in messages.take(MAX_MESSAGES).flatten() {
            topics.insert(message.topic.name.clone());
        }
    }
    for topic in topics.iter().take(8) {
        for message in MESSAGES {
            if let Ok(mut reader) = TopicReader::open(path, topic, message) {
                let read = reader
                    .by_ref()
                    .take(MAX_MESSAGES)
                    .inspect(|recorded| assert_sound(&recorded.measurement));
                let _ = read.count();
                let _ = (reader.left_out(), reader.broken_off());
            }
        }
    }
    let _ = (robot_file(path), Frames::of(path));
}

/// Measurements are finite wherever a behavior relies on it.
fn assert_sound(measurement: &Measurement) {
    match measurement {
        Measurement::Frame(header, pixels) => {
            assert_eq!(pixels.len(), header.stride as usize * header.height as usize);
        }
        Measurement::Scan(_, beams) => {
            assert!(beams.iter().all(|beam| beam.azimuth_rad.is_finite() && beam.range_m.is_finite()));
        }
        Measurement::Odometry(odometry) => assert!(odometry.x.is_finite() && odometry.theta.is_finite()),
        Measurement::Imu(imu) => assert!(imu.angular_velocity[2].is_finite()),
        Measurement::Bumper(_) => {}
        Measurement::Joints { angles, .. } => assert!(angles.iter().all(|(_, angle)| angle.is_finite())),
    }
}

fn as_file(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("yamabico-fuzz-{}-{name}", std::process::id()))
}

#[test]
fn fuzz_mcap() {
    let path = as_file("mcap");
    fuzz::run("mcap", &seeds("mcap"), |bytes| {
        std::fs::write(&path, bytes).unwrap();
        read_all(&path);
    });
    std::fs::remove_file(path).unwrap();
}

#[test]
fn fuzz_sqlite() {
    let path = as_file("sqlite");
    fuzz::run("sqlite", &seeds("sqlite"), |bytes| {
        std::fs::write(&path, bytes).unwrap();
        read_all(&path);
    });
    std::fs::remove_file(path).unwrap();
}

#[test]
fn fuzz_cdr() {
    fuzz::run("cdr", &seeds("cdr"), |bytes| {
        for kind in TYPES {
            if let Ok(measurement) = measurement(kind, bytes) {
                assert_sound(&measurement);
            }
        }
        let _ = (camera_info(bytes), twist(bytes), frame_id(bytes));
        let mut frames = Frames::default();
        if frames.add(bytes).is_ok() {
            let names: Vec<String> = frames.names().map(|(child, _)| child.to_owned()).collect();
            names.iter().for_each(|name| {
                let _ = frames.body_from(name);
            });
        }
    });
}

#[test]
fn fuzz_images() {
    fuzz::run("image", &seeds("image"), |bytes| {
        // A CompressedImage in CDR: stamp, two short texts, and the picture.
        let mut message =
            vec![0, 1, 0, 0, 5, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0];
        message.extend((bytes.len() as u32).to_le_bytes());
        message.extend(bytes);
        if let Ok(measurement) = measurement(TYPES[0], &message) {
            assert_sound(&measurement);
        }
    });
}

#[test]
fn the_seeds_are_read_completely() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/seeds");
    for (file, scans, left_out) in [
        ("mcap/none.mcap", 4, 0),
        ("mcap/lz4.mcap", 4, 0),
        ("mcap/zstd.mcap", 4, 0),
        ("sqlite/bag.db3", 8, 1),
    ] {
        let path = folder.join(file);
        let mut reader = TopicReader::open(&path, "/scan", RangeScanHeader::NAME).unwrap();
        assert_eq!((reader.by_ref().count(), reader.left_out().0), (scans, left_out), "{file}");
        let mut joints = TopicReader::open(&path, "/joint_states", Odometry::NAME).unwrap();
        assert_eq!(joints.by_ref().count(), scans, "{file}");
        let text = robot_file(&path).unwrap();
        for line in [
            "[sensors.scan]",
            "x_m = 0.1000",
            "kind = \"wheel-joints\"",
            "left = \"wheel_left\"",
            "[sensors.camera-mono8]",
        ] {
            assert!(text.contains(line), "{file}: no {line} in\n{text}");
        }
    }
}

#[test]
fn empty_and_cut_files_are_refused_or_read_up_to_the_cut() {
    let path = as_file("cut");
    let refused = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        Messages::open(&path).and_then(Iterator::collect::<Result<Vec<_>, _>>).unwrap_err()
    };
    assert!(refused(b"").contains("empty"));
    assert!(refused(b"neither of them").contains("neither"));
    assert!(refused(&[0x28, 0xb5, 0x2f, 0xfd, 0]).contains("zstd -d"));
    assert!(refused(b"SQLite format 3\0 cut").contains("no SQLite"));
    let bag = &seeds("sqlite")[0];
    let error = refused(&bag[..bag.len() - 1024]);
    assert!(error.contains("missing") || error.contains("damaged"), "{error}");
    std::fs::write(&path, &bag[..]).unwrap();
    let beside = path.with_file_name(format!("{}-wal", path.file_name().unwrap().to_string_lossy()));
    std::fs::write(&beside, b"changes").unwrap();
    assert!(Messages::open(&path).err().unwrap().contains("wal_checkpoint"));
    std::fs::remove_file(beside).unwrap();
    std::fs::remove_file(path).unwrap();
}
