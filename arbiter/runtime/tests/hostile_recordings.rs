//! Recordings that are cut, damaged or made to harm: an error or a counted drop, no panic, bounded memory.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use yamabico_core::message::{Encoding, FrameHeader, MessageType, Odometry};
use yamabico_core::time::Time;
use yamabico_runtime::record::{
    Contents, Digest, McapRecorder, Pace, PlaybackError, Recording, Tap, play, repair,
};

/// Records in the file: enough for several kinds.
const MESSAGES: u64 = 60;

fn recorded(folder: &Path) -> Vec<u8> {
    let path = folder.join("whole.mcap");
    let recording = Recording {
        files: vec![("task.toml".into(), "robot = \"r.toml\"\n".repeat(40))],
        facts: BTreeMap::from([("seed".into(), "7".into())]),
        replaces: true,
        ..Recording::new(&path, Pace::Lockstep)
    };
    let mut recorder = McapRecorder::create(recording).unwrap();
    for sequence in 0..MESSAGES {
        let stamp_ns = sequence * 1_000_000;
        let odometry = Odometry { stamp_ns, sequence, ..Default::default() };
        let kind = MessageType::of::<Odometry>();
        recorder.message("sensors/wheels", &kind, Time(stamp_ns), bytemuck::bytes_of(&odometry), &[]);
        let (width, height) = (16, 8);
        let encoding = Encoding::Gray8.code();
        let frame = FrameHeader { stamp_ns, sequence, width, height, stride: width, encoding, exposure: 1.0 };
        let pixels: Vec<u8> = (0..width * height).map(|i| (i * 7 + sequence as u32) as u8).collect();
        let kind = MessageType::of::<FrameHeader>();
        recorder.message("sensors/front", &kind, Time(stamp_ns), bytemuck::bytes_of(&frame), &pixels);
    }
    recorder.finish(BTreeMap::new());
    std::fs::read(path).unwrap()
}

fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("yamabico-hostile-{}-{name}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// Plays, reads and repairs the bytes; returns the number of messages, or the error.
fn read_all(path: &Path, bytes: &[u8]) -> Result<u64, PlaybackError> {
    std::fs::write(path, bytes).unwrap();
    let _ = Contents::read(path).map(|contents| contents.identity().is_ok());
    let played = play(path, &mut Digest::new())?;
    let _ = repair(path);
    Ok(played.messages)
}

#[test]
fn a_cut_or_damaged_recording_gives_an_error_or_its_beginning() {
    let folder = folder("cut");
    let (whole, path) = (recorded(&folder), folder.join("run.mcap"));
    assert_eq!(read_all(&path, &whole).unwrap(), 2 * MESSAGES);
    for end in (0..whole.len()).step_by(whole.len() / 150) {
        if let Ok(messages) = read_all(&path, &whole[..end]) {
            assert!(messages <= 2 * MESSAGES, "{messages} messages of {end} bytes");
        }
    }
    // Pseudo-random damage: one byte, or eight that may be a length.
    let mut random = 1_u64;
    for round in 0..400 {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let at = (random >> 33) as usize % (whole.len() - 8);
        let mut bytes = whole.clone();
        match round % 3 {
            0 => bytes[at] ^= 1 << (random & 7),
            1 => bytes[at..at + 8].copy_from_slice(&u64::MAX.to_le_bytes()),
            _ => bytes[at..at + 4].copy_from_slice(&(u32::MAX / 2).to_le_bytes()),
        }
        if let Ok(messages) = read_all(&path, &bytes) {
            assert!(messages <= 2 * MESSAGES, "{messages} messages with damage at {at}");
        }
    }
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn lengths_that_lie_reserve_no_memory() {
    let folder = folder("lengths");
    let (whole, path) = (recorded(&folder), folder.join("run.mcap"));
    let before = resident_bytes();
    // The length of each record in turn, up to the first chunk, says 2^60 bytes.
    let mut at = 8;
    for _ in 0..6 {
        let length = u64::from_le_bytes(whole[at + 1..at + 9].try_into().unwrap());
        let mut bytes = whole.clone();
        bytes[at + 1..at + 9].copy_from_slice(&(1_u64 << 60).to_le_bytes());
        let _ = read_all(&path, &bytes);
        at += 9 + usize::try_from(length).unwrap();
    }
    let grown = resident_bytes().saturating_sub(before);
    assert!(grown < 300 << 20, "{grown} bytes more");
    std::fs::remove_dir_all(folder).unwrap();
}

/// Memory of this process, bytes.
fn resident_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|line| line.starts_with("VmHWM:")).unwrap();
    line.split_whitespace().nth(1).unwrap().parse::<u64>().unwrap() * 1024
}

#[test]
fn contradictory_images_are_left_out() {
    let folder = folder("images");
    let path = folder.join("run.mcap");
    let mut recorder = McapRecorder::create(Recording::new(&path, Pace::Lockstep)).unwrap();
    let kind = MessageType::of::<FrameHeader>();
    let encoding = Encoding::Gray8.code();
    let frames = [(u32::MAX, u32::MAX, u32::MAX), (16, 8, u32::MAX), (0, 8, 16), (16, 8, 16)];
    for (sequence, (width, height, stride)) in (0..).zip(frames) {
        let frame = FrameHeader { sequence, width, height, stride, encoding, ..Default::default() };
        recorder.message("front", &kind, Time::ZERO, bytemuck::bytes_of(&frame), &[0; 128]);
    }
    recorder.finish(BTreeMap::new());
    let played = play(&path, &mut Digest::new()).unwrap();
    assert_eq!(played.messages, 1, "{played:?}");
    assert!(played.left_out.iter().any(|what| what.contains("was not recorded")), "{played:?}");
    std::fs::remove_dir_all(folder).unwrap();
}
