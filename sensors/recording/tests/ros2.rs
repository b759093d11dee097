//! Recordings of ROS 2 as sensors: values, stamps and counts, and files that lie.

#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use std::path::{Path, PathBuf};

use yamabico_core::behavior::Outputs;
use yamabico_core::driver::{DeviceSpec, PartSpec};
use yamabico_core::message::{FrameHeader, Message, Odometry, RangeScanHeader};
use yamabico_core::sensor::{Due, Robot};
use yamabico_core::testing::Published;
use yamabico_core::time::Time;
use yamabico_recording::{Measurement, RecordingError, TopicReader, driver};
use yamabico_testkit::data::data_set;

fn write(path: &Path, topic: &str, schema: &str, messages: &[(u64, Vec<u8>)]) {
    let mut writer = mcap::Writer::new(std::fs::File::create(path).unwrap()).unwrap();
    let schema = writer.add_schema(schema, "ros2msg", b"").unwrap();
    let channel = writer.add_channel(schema, topic, "cdr", &std::collections::BTreeMap::new()).unwrap();
    for (i, (log_time, data)) in messages.iter().enumerate() {
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence: i as u32,
            log_time: *log_time,
            publish_time: *log_time,
        };
        writer.write_to_known_channel(&header, data).unwrap();
    }
    writer.finish().unwrap();
}

/// CDR, little endian: values after their alignment.
#[derive(Default)]
struct Cdr(Vec<u8>);

impl Cdr {
    fn put<const N: usize>(mut self, bytes: [u8; N]) -> Cdr {
        while !self.0.len().is_multiple_of(N) {
            self.0.push(0);
        }
        self.0.extend(bytes);
        self
    }

    fn text(self, text: &str) -> Cdr {
        let mut next = self.put((text.len() as u32 + 1).to_le_bytes());
        next.0.extend(text.bytes().chain([0]));
        next
    }

    fn header(stamp_ns: u64) -> Cdr {
        let (sec, nanosec) = ((stamp_ns / 1_000_000_000) as i32, (stamp_ns % 1_000_000_000) as u32);
        Cdr::default().put(sec.to_le_bytes()).put(nanosec.to_le_bytes()).text("laser")
    }

    fn message(self) -> Vec<u8> {
        [vec![0, 1, 0, 0], self.0].concat()
    }
}

fn scan(stamp_ns: u64, ranges: &[f32]) -> Vec<u8> {
    let head = Cdr::header(stamp_ns);
    let numbers = [-0.5_f32, 0.5, 0.25, 0.0, 0.2, 0.1, 5.0];
    let head = numbers.iter().fold(head, |cdr, number| cdr.put(number.to_le_bytes()));
    let body = head.put((ranges.len() as u32).to_le_bytes());
    let body = ranges.iter().fold(body, |cdr, range| cdr.put(range.to_le_bytes()));
    body.put(0_u32.to_le_bytes()).message()
}

fn file(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("yamabico-recording-{}-{name}.mcap", std::process::id()))
}

#[test]
fn a_scan_keeps_its_angles_ranges_and_delays() {
    let path = file("scan");
    let at = |ms: u64| 1_000_000_000_000 + ms * 1_000_000;
    let ranges = [1.0, 0.05, f32::INFINITY, 4.0, f32::NAN];
    let messages: Vec<_> = (0..5).map(|i| (at(100 * i), scan(at(100 * i) - 30_000_000, &ranges))).collect();
    write(&path, "/scan", "sensor_msgs/msg/LaserScan", &messages);

    let part = PartSpec {
        name: "laser".into(),
        kind: "range".into(),
        table: toml::from_str("topic = \"/scan\"\nx_m = 0.1\nyaw_deg = 90").unwrap(),
    };
    let spec = DeviceSpec {
        name: "bag".into(),
        table: toml::from_str(&format!("file = {path:?}\npace = 2.0\nfrom_s = 0.1")).unwrap(),
        sensors: vec![part],
        drive: None,
        folder: PathBuf::new(),
        seed: 1,
        robot: Robot::default(),
    };
    let mut device = driver().open(spec).unwrap();
    let mut published = Published::default();
    let sensor = &mut device.sensors[0].1;
    let begin = Time::from_secs_f64(7.0);
    let due = sensor.poll(begin, &mut Outputs::new(&mut published)).unwrap();
    assert_eq!(due, Due::At(Time::from_secs_f64(7.05)), "twice as fast");
    let scans = published.of::<RangeScanHeader>("laser");
    assert_eq!(scans.len(), 1, "the first scan is before the start");
    let (header, beams) = &scans[0];
    assert_eq!(header.stamp_ns, begin.0 - 15_000_000, "half of the recorded delay");
    let echoes: Vec<Option<f64>> = beams.iter().map(yamabico_core::message::Beam::echo_m).collect();
    assert_eq!(echoes, [Some(1.0), None, None, Some(4.0), None]);
    assert!((beams[0].azimuth_rad - (std::f64::consts::FRAC_PI_2 - 0.5)).abs() < 1e-6);
    assert_eq!((beams[0].x_m, beams[0].cone_rad), (0.1, 0.25));
    let end = sensor.poll(Time::from_secs_f64(9.0), &mut Outputs::new(&mut published)).unwrap();
    assert_eq!((end, published.of::<RangeScanHeader>("laser").len()), (Due::Ended, 4));
    std::fs::remove_file(path).unwrap();
}

#[test]
fn cut_and_hostile_messages_are_counted_with_their_number() {
    let path = file("cut");
    let whole = scan(5, &[1.0; 8]);
    let mut messages: Vec<_> = (0..whole.len() - 4).map(|end| (5, whole[..end].to_vec())).collect();
    let mut long = whole.clone();
    // The number of ranges.
    long[52..56].copy_from_slice(&u32::MAX.to_le_bytes());
    messages.push((5, long));
    messages.push((5, whole));
    let count = messages.len() as u64;
    write(&path, "/scan", "sensor_msgs/msg/LaserScan", &messages);
    let mut reader = TopicReader::open(&path, "/scan", RangeScanHeader::NAME).unwrap();
    let read = reader.by_ref().count() as u64;
    let (left_out, first) = reader.left_out();
    assert!(
        read >= 1 && read + left_out == count && left_out > count / 2,
        "{read} read, {left_out} left out"
    );
    assert!(first.unwrap().starts_with("message 1 on /scan: malformed"));

    let wrong = TopicReader::open(&path, "/scan", Odometry::NAME).err().unwrap();
    assert!(matches!(wrong, RecordingError::Type { .. }), "{wrong}");
    let missing = TopicReader::open(&path, "/odom", Odometry::NAME).err().unwrap();
    assert!(missing.to_string().contains("it has: /scan"), "{missing}");
    std::fs::write(&path, "no recording").unwrap();
    assert!(matches!(TopicReader::open(&path, "/scan", Odometry::NAME), Err(RecordingError::File { .. })));
    std::fs::remove_file(path).unwrap();
}

#[test]
fn files_of_another_program_are_read_completely() {
    let Some(folder) = data_set("mcap") else { return };
    let path = folder.join("intel_300s_scan_odom.mcap");
    let stamps_grow = |reader: &mut TopicReader| {
        let stamps: Vec<u64> = reader.map(|recorded| recorded.stamp_ns).collect();
        assert!(stamps.windows(2).all(|pair| pair[0] <= pair[1]));
        stamps.len()
    };
    let mut scans = TopicReader::open(&path, "/scan", RangeScanHeader::NAME).unwrap();
    let first = scans.next().unwrap();
    let Measurement::Scan(_, beams) = first.measurement else { panic!("no scan") };
    assert_eq!((beams.len(), stamps_grow(&mut scans)), (180, 77));
    let mut odometry = TopicReader::open(&path, "/odom", Odometry::NAME).unwrap();
    assert_eq!((stamps_grow(&mut odometry), odometry.left_out().0), (2425, 0));

    let path = folder.join("corridor_test_frames_2hz.mcap");
    let info = mcap::Summary::read(&std::fs::read(&path).unwrap()).unwrap().unwrap();
    let topic = info.channels.values().next().unwrap().topic.clone();
    let images = TopicReader::open(&path, &topic, FrameHeader::NAME).unwrap();
    let sizes: Vec<_> = images
        .map(|recorded| match recorded.measurement {
            Measurement::Frame(header, pixels) => (header.width, header.height, pixels.len()),
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(sizes, [(960, 540, 960 * 540); 28]);
}
