//! A recording holds every message once, opens in other programs, and never stops a run.

use std::collections::BTreeMap;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::process::Command as Process;
use std::time::Instant;

use foxglove::Encode;
use foxglove::messages::{CompressedImage, LaserScan, Log, PoseInFrame, SceneUpdate};
use yamabico_core::message::{
    Axes, Beam, Command, DecisionHeader, Encoding, FrameHeader, Kind, Message, MessageType, Mode, Name,
    Odometry, Pose, Proposal, RangeScanHeader, Reason, Truth, Twist, Verdict,
};
use yamabico_core::time::Time;
use yamabico_runtime::record::{
    Contents, Digest, McapRecorder, Pace, PlaybackError, RecordError, Recording, RecordingResult, Tap, Tee,
    play, utc,
};

const STEPS: u64 = 100;

fn send<M: Message>(tap: &mut dyn Tap, topic: &str, time: Time, header: &M, items: &[M::Item]) {
    let (header, items) = (bytemuck::bytes_of(header), bytemuck::cast_slice(items));
    tap.message(topic, &MessageType::of::<M>(), time, header, items);
}

/// Messages of a robot with a camera and sonars that drives for 2 s and halts for an echo in between.
fn drive(tap: &mut dyn Tap) {
    for step in 0..STEPS {
        let time = Time(step * 20_000_000);
        let (stamp_ns, sequence, x) = (time.0, step, 0.008 * step as f64);
        let halted = (40..60).contains(&step);
        if step % 5 == 0 {
            let (width, height) = (256, 240);
            let encoding = Encoding::Gray8.code();
            let header =
                FrameHeader { stamp_ns, sequence, width, height, stride: width, encoding, exposure: 1.0 };
            let pixels: Vec<u8> = (0..width * height).map(|i| (i * 7 + step as u32) as u8).collect();
            send(tap, "front", time, &header, &pixels);
        }
        let beams = [-20.0_f64, 0.0, 20.0].map(|azimuth_deg| Beam {
            azimuth_rad: azimuth_deg.to_radians(),
            cone_rad: 25_f64.to_radians(),
            range_m: if halted { 0.4 } else { 2.5 },
            ..Beam::default()
        });
        let scan = RangeScanHeader { stamp_ns, sequence, min_m: 0.1, max_m: 3.0 };
        send(tap, "sonar", time, &scan, &beams);
        send(tap, "odometry", time, &Odometry { stamp_ns, sequence, x, ..Default::default() }, &[]);
        let truth = Truth { stamp_ns, sequence, x, person_m: f64::INFINITY, ..Default::default() };
        send(tap, "truth", time, &truth, &[]);
        let follower = Proposal {
            behavior: Name::new("wall-follower"),
            stamp_ns,
            ..Proposal::drive(Axes::PLANAR, Twist::planar(0.4, 0.1 / 3.0))
        };
        send(tap, "proposal/wall-follower", time, &follower, &[]);
        let sonar =
            if halted { Proposal::halt(Axes::ALL, Reason::Echo) } else { Proposal::abstain(Reason::Clear) };
        let sonar = Proposal { behavior: Name::new("sonar-halt"), stamp_ns, ..sonar };
        send(tap, "proposal/sonar-halt", time, &sonar, &[]);
        let mode = if halted { Mode::Halted } else { Mode::Driving };
        let decision = DecisionHeader { stamp_ns, sequence, mode: mode.code(), ..Default::default() };
        send(tap, "decision", time, &decision, &[Verdict::default(); 2]);
        send(tap, "command", time, &Command { stamp_ns, sequence, ..Default::default() }, &[]);
    }
}

fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("yamabico-recording-{}-{name}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn record(path: &Path, pace: Pace) -> (Digest, RecordingResult) {
    let recording = Recording {
        files: vec![("task.toml".into(), "robot = \"sim\"\n".into())],
        facts: BTreeMap::from([("seed".into(), "7".into())]),
        ..Recording::new(path, pace)
    };
    let mut recorder = McapRecorder::create(recording).unwrap();
    let mut digest = Digest::new();
    drive(&mut Tee(vec![&mut digest, &mut recorder]));
    let facts = BTreeMap::from([("digest".into(), digest.hex())]);
    (digest, recorder.finish(facts))
}

struct Read {
    counts: BTreeMap<String, u64>,
    schemas: BTreeMap<String, String>,
    messages: Vec<(String, u64, Vec<u8>)>,
}

fn read(path: &Path) -> Read {
    read_bytes(&std::fs::read(path).unwrap())
}

fn read_bytes(bytes: &[u8]) -> Read {
    let mut read = Read { counts: BTreeMap::new(), schemas: BTreeMap::new(), messages: Vec::new() };
    for message in mcap::MessageStream::new(bytes).unwrap() {
        let message = message.unwrap();
        let topic = message.channel.topic.clone();
        *read.counts.entry(topic.clone()).or_default() += 1;
        let schema = message.channel.schema.as_ref().unwrap();
        read.schemas.insert(topic.clone(), schema.name.clone());
        read.messages.push((topic, message.log_time, message.data.into_owned()));
    }
    read
}

#[test]
fn a_recording_plays_back_to_the_byte() {
    let folder = folder("playback");
    let path = folder.join("run.mcap");
    let (recorded, _) = record(&path, Pace::Lockstep);
    let mut again = Digest::new();
    let played = play(&path, &mut again).unwrap();
    assert_eq!(again.hex(), recorded.hex());
    assert_eq!((played.left_out.len(), played.broken_off), (0, None));
    assert_eq!(played.messages, recorded.counts().values().sum::<u64>());

    // Half of a file, as after kill -9.
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    let half = play(&path, &mut Digest::new()).unwrap();
    assert!(half.broken_off.is_some() && half.messages < played.messages && half.messages > 0, "{half:?}");

    std::fs::write(&path, "no recording").unwrap();
    let error = play(&path, &mut Digest::new()).unwrap_err();
    assert!(matches!(error, PlaybackError::NoRecording { .. }), "{error}");
    std::fs::remove_dir_all(&folder).unwrap();
    assert!(matches!(play(&path, &mut Digest::new()).unwrap_err(), PlaybackError::NotReadable { .. }));
}

#[test]
fn times_count_from_the_first_message_and_the_start_is_known() {
    let folder = folder("origin");
    let path = folder.join("run.mcap");
    let origin = 1_286_000_000_000;
    let mut recorder = McapRecorder::create(Recording::new(&path, Pace::Live)).unwrap();
    for stamp_ns in [origin, origin + 40_000_000] {
        let pose = Pose { stamp_ns, ..Default::default() };
        send(&mut recorder, "pose", Time(stamp_ns), &pose, &[]);
    }
    recorder.finish(BTreeMap::new());
    let read = read(&path);
    let times: Vec<u64> =
        read.messages.iter().filter(|(topic, ..)| topic == "/pose/pose").map(|(_, time, _)| *time).collect();
    assert_eq!(times, [0, 40_000_000]);
    assert!(read.messages.iter().all(|(_, time, _)| *time <= 40_000_000), "every topic has this base");
    let (_, _, last) = read.messages.iter().rfind(|(topic, ..)| topic == "/pose/pose").unwrap();
    let stamp = PoseInFrame::decode_from(last).timestamp.unwrap();
    assert_eq!((stamp.sec(), stamp.nsec()), (0, 40_000_000));
    let contents = Contents::read(&path).unwrap();
    assert_eq!(contents.origin(), Time(origin));
    let (started, now) = (&contents.facts["started"], utc(std::time::SystemTime::now()));
    assert_eq!((started.len(), &started[..4]), (now.len(), &now[..4]));
    assert_eq!(contents.facts["program_sha256"].len(), 64);

    // A playback has the times of the run again.
    #[derive(Default)]
    struct Times(Vec<Time>);
    impl Tap for Times {
        fn message(&mut self, _: &str, _: &MessageType, time: Time, _: &[u8], _: &[u8]) {
            self.0.push(time);
        }
    }
    let mut times = Times::default();
    play(&path, &mut times).unwrap();
    assert_eq!(times.0, [Time(origin), Time(origin + 40_000_000)]);
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn an_existing_recording_is_replaced_only_on_request() {
    let folder = folder("exists");
    let path = folder.join("run.mcap");
    std::fs::write(&path, "precious").unwrap();
    let refused = McapRecorder::create(Recording::new(&path, Pace::Lockstep)).err().unwrap();
    assert!(matches!(refused, RecordError::Exists { .. }), "{refused}");
    assert_eq!(std::fs::read(&path).unwrap(), b"precious");
    let replacing = Recording { replaces: true, ..Recording::new(&path, Pace::Lockstep) };
    assert!(McapRecorder::create(replacing).unwrap().finish(BTreeMap::new()).bytes > 0);
    std::fs::remove_dir_all(folder).unwrap();
}

fn bus_topics(counts: &BTreeMap<String, u64>) -> BTreeMap<String, u64> {
    counts.iter().filter(|(topic, _)| !topic.starts_with('/')).map(|(t, c)| (t.clone(), *c)).collect()
}

#[test]
fn every_message_is_there_once_under_its_own_topic() {
    let folder = folder("counts");
    let path = folder.join("run.mcap");
    let (digest, recorded) = record(&path, Pace::Lockstep);
    assert!(recorded.error.is_none(), "{:?}", recorded.error);
    assert_eq!((recorded.images_dropped, recorded.messages_dropped), (0, 0));
    assert_eq!(&recorded.messages, digest.counts());
    assert_eq!(recorded.bytes, path.metadata().unwrap().len());

    let read = read(&path);
    assert_eq!(&bus_topics(&read.counts), digest.counts());
    let expected = [
        ("front", FrameHeader::NAME, STEPS / 5),
        ("/front/image", "foxglove.CompressedImage", STEPS / 5),
        ("/sonar/scan", "foxglove.LaserScan", STEPS),
        ("/sonar/scene", "foxglove.SceneUpdate", STEPS),
        ("/odometry/pose", "foxglove.PoseInFrame", STEPS),
        ("/truth/pose", "foxglove.PoseInFrame", STEPS),
        ("/tf", "foxglove.FrameTransforms", STEPS),
        ("/proposal/wall-follower/scene", "foxglove.SceneUpdate", STEPS),
        ("/robot/scene", "foxglove.SceneUpdate", 1),
        // One line of the follower, three each of the sonar halt and the arbiter: nominal, halted, nominal.
        ("/log", "foxglove.Log", 7),
    ];
    for (topic, schema, count) in expected {
        assert_eq!((read.schemas[topic].as_str(), read.counts[topic]), (schema, count), "{topic}");
    }
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn numbers_images_and_texts_are_kept() {
    let folder = folder("content");
    let path = folder.join("run.mcap");
    record(&path, Pace::Lockstep);
    let read = read(&path);
    let nth = |topic: &str, n: usize| {
        let found = read.messages.iter().filter(|(name, ..)| name == topic).nth(n);
        found.unwrap_or_else(|| panic!("{topic} {n}")).2.as_slice()
    };
    let odometry: serde_json::Value = serde_json::from_slice(nth("odometry", 37)).unwrap();
    assert_eq!(odometry["x"].as_f64(), Some(0.008 * 37.0));
    let proposal: serde_json::Value = serde_json::from_slice(nth("proposal/wall-follower", 3)).unwrap();
    assert_eq!(proposal["twist"]["angular"].as_f64(), Some(0.1 / 3.0));
    assert_eq!((&proposal["kind"], &proposal["kind_text"]), (&Kind::Drive.code().into(), &"drive".into()));
    let decision: serde_json::Value = serde_json::from_slice(nth("decision", 50)).unwrap();
    assert_eq!((&decision["mode_text"], decision["items"].as_array().unwrap().len()), (&"halted".into(), 2));

    let image = CompressedImage::decode_from(nth("/front/image", 3));
    let image_read = image::load_from_memory(&image.data).unwrap().into_luma8();
    assert!(image_read.iter().enumerate().all(|(i, &value)| value == (i as u32 * 7 + 15) as u8));
    let scan = LaserScan::decode_from(nth("/sonar/scan", 45));
    assert!(scan.ranges.iter().all(|&range| range == 0.4) && scan.ranges.len() > 20);
    let pose = PoseInFrame::decode_from(nth("/truth/pose", 99));
    assert_eq!((pose.frame_id.as_str(), pose.pose.unwrap().position.unwrap().x), ("map", 0.008 * 99.0));
    let lines: Vec<_> = (0..7).map(|n| Log::decode_from(nth("/log", n)).message).collect();
    assert!(lines.iter().any(|line| line == "halt: echo"), "{lines:?}");
    assert_eq!(SceneUpdate::decode_from(nth("/proposal/sonar-halt/scene", 0)).deletions.len(), 1);
    assert!(read.messages.windows(2).all(|pair| pair[0].1 <= pair[1].1), "times go back");

    let bytes = std::fs::read(&path).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    assert_eq!(summary.attachment_indexes.len(), 1);
    let task = mcap::read::attachment(&bytes, &summary.attachment_indexes[0]).unwrap();
    assert_eq!((task.name.as_str(), &*task.data), ("task.toml", &b"robot = \"sim\"\n"[..]));
    let names: Vec<_> = summary.metadata_indexes.iter().map(|index| index.name.as_str()).collect();
    assert_eq!(names, ["run", "result"]);
    std::fs::remove_dir_all(folder).unwrap();
}

/// Short form of `foxglove`'s decoding.
trait DecodeFrom: Sized {
    fn decode_from(bytes: &[u8]) -> Self;
}

impl<T: Encode + foxglove::Decode> DecodeFrom for T {
    fn decode_from(bytes: &[u8]) -> T {
        T::decode(bytes).unwrap_or_else(|_| panic!("does not decode"))
    }
}

#[test]
fn a_full_disk_ends_the_recording_and_not_the_run() {
    for pace in [Pace::Lockstep, Pace::Live] {
        let mut recorder = McapRecorder::create(Recording::new("/dev/full", pace)).unwrap();
        let mut digest = Digest::new();
        let begin = Instant::now();
        while !recorder.has_failed() {
            assert!(begin.elapsed().as_secs() < 60, "the full disk was not noticed");
            drive(&mut Tee(vec![&mut digest, &mut recorder]));
        }
        let before = digest.counts().values().sum::<u64>();
        drive(&mut Tee(vec![&mut digest, &mut recorder]));
        let offered = digest.counts().values().sum::<u64>();
        let recorded = recorder.finish(BTreeMap::new());
        assert!(matches!(recorded.error, Some(RecordError::Full { .. })), "{:?}", recorded.error);
        let written = recorded.messages.values().sum::<u64>();
        assert_eq!(written + recorded.messages_dropped, offered, "each is written or counted as lost");
        assert!(recorded.messages_dropped >= offered - before, "the rest of the run is counted as lost");
    }
}

#[test]
fn a_file_that_cannot_be_opened_is_refused_with_a_remedy() {
    let folder = folder("refused");
    let refused = |path: PathBuf| match McapRecorder::create(Recording::new(path, Pace::Lockstep)) {
        Err(error) => error,
        Ok(_) => panic!("was opened"),
    };
    let missing = refused(folder.join("not-there/run.mcap"));
    assert!(matches!(&missing, RecordError::FolderMissing { folder, .. } if folder.ends_with("not-there")));
    assert!(missing.to_string().contains("create it"), "{missing}");
    assert!(matches!(refused(folder.clone()), RecordError::IsAFolder { .. }));
    std::fs::write(folder.join("file"), "").unwrap();
    assert!(matches!(refused(folder.join("file/run.mcap")), RecordError::NotWritable { .. }));
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_live_run_never_waits_and_counts_dropped_images() {
    let folder = folder("live");
    // A disk that blocks until the channel is used.
    let path = folder.join("run.mcap");
    assert!(Process::new("mkfifo").arg(&path).status().unwrap().success());
    let (read, may_read) = std::sync::mpsc::channel();
    let reader = std::thread::spawn({
        let path = path.clone();
        move || {
            let (mut file, mut bytes) = (std::fs::File::open(path).unwrap(), Vec::new());
            let _ = may_read.recv_timeout(std::time::Duration::from_secs(60));
            file.read_to_end(&mut bytes).unwrap();
            bytes
        }
    });
    let mut recorder = McapRecorder::create(Recording::new(&path, Pace::Live)).unwrap();
    let (width, height) = (1920_u32, 1080_u32);
    let encoding = Encoding::Rgb8.code();
    let header = FrameHeader { width, height, stride: 3 * width, encoding, ..Default::default() };
    let pixels: Vec<u8> =
        (0..3 * width * height).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    for _ in 0..60 {
        send(&mut recorder, "front", Time::ZERO, &header, &pixels);
    }
    // None of them waited, since nothing reaches the disk before this.
    read.send(()).unwrap();
    let recorded = recorder.finish(BTreeMap::new());
    assert!(recorded.images_dropped > 0 && recorded.messages_dropped == 0, "{recorded:?}");
    let read = read_bytes(&reader.join().unwrap());
    assert_eq!(read.counts["front"], 60, "headers are kept");
    assert_eq!(read.counts["/front/image"], 60 - recorded.images_dropped);
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn python_reads_the_same_counts() {
    let folder = folder("python");
    let path = folder.join("run.mcap");
    let (digest, _) = record(&path, Pace::Lockstep);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/mcap_python.py");
    let Some(python) = python_with_mcap(&folder) else {
        println!("skipped: no Python with the packages mcap and mcap-protobuf-support");
        std::fs::remove_dir_all(folder).unwrap();
        return;
    };
    let output = Process::new(python).arg(script).arg(&path).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let counts: BTreeMap<String, u64> = serde_json::from_value(report["counts"].clone()).unwrap();
    assert_eq!(&bus_topics(&counts), digest.counts());
    assert_eq!(counts, read(&path).counts);
    assert_eq!(report["metadata"]["result"]["digest"], digest.hex());
    assert_eq!(report["images"], STEPS / 5);
    std::fs::remove_dir_all(folder).unwrap();
}

/// Python of a new environment in `folder`; `None` if it or its packages cannot be installed. `YAMABICO_PYTHON` names an
/// existing one with the packages.
fn python_with_mcap(folder: &Path) -> Option<PathBuf> {
    if let Some(python) = std::env::var_os("YAMABICO_PYTHON") {
        return Some(python.into());
    }
    let succeeds = |program: &Path, arguments: &[&str]| {
        let output = Process::new(program).args(arguments).output();
        output.is_ok_and(|output| output.status.success())
    };
    let environment = folder.join("venv");
    let made = succeeds(Path::new("python3"), &["-m", "venv", environment.to_str()?]);
    let python = environment.join("bin/python");
    let packages = [
        "-m",
        "pip",
        "install",
        "--quiet",
        "--retries",
        "0",
        "--timeout",
        "5",
        "mcap",
        "mcap-protobuf-support",
    ];
    (made && succeeds(&python, &packages)).then_some(python)
}
