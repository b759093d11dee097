//! Files that the crate `mcap` has written, whole, cut and with lengths that lie.

#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use std::collections::BTreeMap;
use std::io::{Cursor, Read};
use std::path::PathBuf;

use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions};
use yamabico_mcap::{
    Channel, MAGIC, MAX_RECORD_BYTES, Messages, MessagesAhead, Opcode, ReadError, Record, Records,
};

const MESSAGES: u32 = 40;

/// A file with two channels, in several chunks or in none.
fn file(compression: Option<Compression>, chunk_bytes: Option<u64>) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let options = WriteOptions::new().compression(compression).chunk_size(chunk_bytes);
    let mut writer = options.create(&mut bytes).unwrap();
    let schema = writer.add_schema("std_msgs/msg/String", "ros2msg", b"string data").unwrap();
    let facts = BTreeMap::from([("frame".to_owned(), "map".to_owned())]);
    let channels = [
        writer.add_channel(schema, "/talk", "cdr", &facts).unwrap(),
        writer.add_channel(0, "/other", "json", &BTreeMap::new()).unwrap(),
    ];
    for sequence in 0..MESSAGES {
        let log_time = u64::from(sequence) * 10;
        let channel_id = channels[sequence as usize % 2];
        let header = MessageHeader { channel_id, sequence, log_time, publish_time: log_time + 1 };
        writer.write_to_known_channel(&header, &[sequence as u8; 100]).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    bytes.into_inner()
}

fn every_kind() -> Vec<Vec<u8>> {
    let compressions = [None, Some(Compression::Lz4), Some(Compression::Zstd)];
    let chunked = compressions.into_iter().map(|compression| file(compression, Some(1000)));
    chunked.chain([file(None, None)]).collect()
}

fn path(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("yamabico-mcap-{}-{name}", std::process::id()))
}

/// Number of readable messages, and the error behind them.
fn read(name: &str, bytes: &[u8]) -> (u32, Option<ReadError>) {
    let path = path(name);
    std::fs::write(&path, bytes).unwrap();
    let mut count = 0;
    let outcome = Messages::open(&path).and_then(|mut messages| {
        while let Some(message) = messages.next()? {
            assert_eq!((message.sequence, message.log_time), (count, u64::from(count) * 10));
            assert_eq!(message.publish_time, message.log_time + 1);
            assert_eq!(message.data, [count as u8; 100]);
            let channel = message.channel;
            let schema = channel.schema.as_ref().map(|schema| (&*schema.name, &*schema.data));
            match count % 2 {
                0 => {
                    assert_eq!((&*channel.topic, &*channel.encoding), ("/talk", "cdr"));
                    assert_eq!(schema, Some(("std_msgs/msg/String", &b"string data"[..])));
                    assert_eq!(channel.metadata["frame"], "map");
                }
                _ => assert_eq!((&*channel.topic, schema), ("/other", None)),
            }
            count += 1;
        }
        Ok(())
    });
    std::fs::remove_file(path).unwrap();
    (count, outcome.err())
}

#[test]
fn every_message_is_read_with_its_channel() {
    for bytes in every_kind() {
        let (count, error) = read("whole", &bytes);
        assert!(count == MESSAGES && error.is_none(), "{count} messages, {error:?}");
    }
}

/// Numbers of the messages on `topic`, or on all, and the error behind them.
fn read_ahead(name: &str, bytes: &[u8], topic: Option<&str>) -> (Vec<u32>, Option<ReadError>) {
    let path = path(name);
    std::fs::write(&path, bytes).unwrap();
    let mut numbers = Vec::new();
    let is_wanted = |channel: &Channel| topic.is_none_or(|topic| channel.topic == topic);
    let outcome = MessagesAhead::open(&path, is_wanted).and_then(|mut messages| {
        while let Some(message) = messages.next()? {
            assert_eq!(message.data, [message.sequence as u8; 100]);
            numbers.push(message.sequence);
        }
        assert!(messages.next()?.is_none(), "it is over");
        Ok(())
    });
    std::fs::remove_file(path).unwrap();
    (numbers, outcome.err())
}

#[test]
fn a_thread_ahead_reads_the_same() {
    for bytes in every_kind() {
        let (all, error) = read_ahead("ahead", &bytes, None);
        assert!(all == (0..MESSAGES).collect::<Vec<_>>() && error.is_none(), "{all:?}, {error:?}");
        let (talk, error) = read_ahead("ahead", &bytes, Some("/talk"));
        assert!(
            talk == (0..MESSAGES).step_by(2).collect::<Vec<_>>() && error.is_none(),
            "{talk:?}, {error:?}"
        );
        for end in (0..bytes.len()).step_by(37) {
            let (cut, error) = read_ahead("ahead", &bytes[..end], Some("/other"));
            let expected = read("cut-ahead", &bytes[..end]).0 / 2;
            assert!(cut.len() as u32 == expected && error.is_some(), "{cut:?} of {end} bytes");
        }
    }
}

#[test]
fn a_cut_file_is_read_up_to_the_cut() {
    for bytes in every_kind() {
        let mut last = 0;
        for end in 0..bytes.len() {
            let (count, error) = read("cut", &bytes[..end]);
            assert!(count >= last && error.is_some(), "{count} of {end} bytes");
            last = count;
        }
        assert_eq!(last, MESSAGES);
    }
    for bytes in [&b""[..], b"text that is no recording", &MAGIC[..7]] {
        assert!(matches!(read("none", bytes), (0, Some(ReadError::Magic))));
    }
    assert!(matches!(read("none", &MAGIC), (0, Some(ReadError::NoEnd))));
}

#[test]
fn damage_of_a_chunk_gives_an_error_and_never_a_wrong_message() {
    for bytes in every_kind().into_iter().take(3) {
        let path = path("places");
        std::fs::write(&path, &bytes).unwrap();
        let mut records = Records::open(&path).unwrap();
        let chunk =
            std::iter::from_fn(|| records.next().unwrap()).find(|record| record.opcode == Opcode::CHUNK);
        let Record { at, bytes: length, .. } = chunk.unwrap();
        // Its times, which nothing depends on, come first.
        let begin = at as usize + 9 + 16;
        for at in begin..begin + length as usize - 16 {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x20;
            let (count, error) = read("damaged", &damaged);
            assert!(count == 0 && error.is_some() || count == MESSAGES, "{count} with damage at {at}");
        }
        std::fs::remove_file(path).unwrap();
    }
}

/// A record.
fn record(opcode: Opcode, body: &[u8]) -> Vec<u8> {
    [&[opcode.0][..], &(body.len() as u64).to_le_bytes(), body].concat()
}

/// A chunk that claims `bytes` unpacked bytes.
fn chunk(method: &str, bytes: u64, packed: &[u8]) -> Vec<u8> {
    let mut body = vec![0; 16];
    body.extend(bytes.to_le_bytes());
    body.extend([0; 4]);
    body.extend((method.len() as u32).to_le_bytes());
    body.extend(method.as_bytes());
    body.extend((packed.len() as u64).to_le_bytes());
    body.extend(packed);
    record(Opcode::CHUNK, &body)
}

#[test]
fn claims_are_refused_before_memory_is_reserved() {
    let of = |records: &[u8]| read("claims", &[&MAGIC[..], records].concat()).1.unwrap();
    // A text of 4 GB in a schema and in a channel; the same in a chunk.
    for opcode in [Opcode::SCHEMA, Opcode::CHANNEL] {
        let lie = record(opcode, &[1, 0, 0xf0, 0xff, 0xff, 0xff, b'a', b'b', 0, 0, 0, 0]);
        assert!(matches!(of(&lie), ReadError::Malformed { opcode: found, at: 8 } if found == opcode));
        let within = of(&chunk("", lie.len() as u64, &lie));
        assert!(matches!(within, ReadError::Malformed { opcode: found, at: 8 } if found == opcode));
    }
    let long = [&[Opcode::MESSAGE.0][..], &(1_u64 << 60).to_le_bytes(), &[0; 40]].concat();
    assert!(matches!(of(&long), ReadError::CutOff { at: 8 }));
    assert!(matches!(of(&chunk("", long.len() as u64, &long)), ReadError::Malformed { .. }));
    assert!(matches!(of(&chunk("", 1 << 60, &[])), ReadError::TooLong { bytes, .. } if bytes == 1 << 60));
    assert!(matches!(of(&chunk("lz4", 1 << 20, &[0; 20])), ReadError::Malformed { .. }));
    assert!(matches!(of(&chunk("zstd", 1 << 20, &[0; 20])), ReadError::Malformed { .. }));
    assert!(
        matches!(of(&chunk("\u{1b}[2J", 1, &[0])), ReadError::Compression { method, .. } if method == "\\u{1b}[2J")
    );
    // A bomb that claims to be small: what it claims is unpacked, and is no record.
    let bomb = zstd::encode_all(std::io::repeat(0).take(2 * MAX_RECORD_BYTES as u64), 1).unwrap();
    assert!(bomb.len() < 100_000 && matches!(of(&chunk("zstd", 4096, &bomb)), ReadError::Malformed { .. }));
    assert!(matches!(of(&chunk("zstd", 1 << 40, &bomb)), ReadError::TooLong { .. }));
}

#[test]
fn definitions_are_bounded() {
    // Each chunk of a few bytes holds a schema of 16 MiB.
    let packed = |id: u8| {
        let length = 16 << 20;
        let mut body = vec![id, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        body.extend((length as u32).to_le_bytes());
        body.resize(body.len() + length, 0);
        let schema = record(Opcode::SCHEMA, &body);
        chunk("zstd", schema.len() as u64, &zstd::encode_all(&schema[..], 1).unwrap())
    };
    let bytes: Vec<u8> = MAGIC.into_iter().chain((1..=5).flat_map(packed)).collect();
    assert!(bytes.len() < 100_000, "{} bytes", bytes.len());
    assert!(matches!(read("definitions", &bytes), (0, Some(ReadError::Definitions { .. }))));
}

#[test]
fn records_are_passed_over_without_reading_them() {
    let path = path("records");
    std::fs::write(&path, file(Some(Compression::Lz4), Some(1000))).unwrap();
    let mut records = Records::open(&path).unwrap();
    let (mut chunks, mut last) = (Vec::new(), None);
    while let Some(record) = records.next().unwrap() {
        chunks.extend((record.opcode == Opcode::CHUNK).then_some(record));
        last = Some(record.opcode);
    }
    assert!(chunks.len() > 3 && last == Some(Opcode::FOOTER) && records.next().unwrap().is_none());
    // Chunks can be read in any order, once their channels are known.
    let mut messages = Messages::of(records);
    let mut numbers = |index: usize| {
        let mut numbers = Vec::new();
        messages.of_chunk(&chunks[index], &mut |message| numbers.push(message.sequence)).map(|()| numbers)
    };
    let first = numbers(0).unwrap();
    let second = numbers(1).unwrap();
    assert!(first[0] == 0 && second[0] == first[first.len() - 1] + 1);
    assert_eq!(numbers(0).unwrap(), first);
    std::fs::remove_file(path).unwrap();
}
