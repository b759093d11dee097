//! Ten million random and damaged bytes through each parser.

use yamabico_played_devices::plug::Random;
use yamabico_serial::create2::Readings;
use yamabico_serial::framing::{Frame, Framer};
use yamabico_serial::lidar;
use yamabico_serial::microcontroller::{Measurement, ProtocolLine, Sonar};
use yamabico_serial::turtlebot3::{self, BLOCK_LEN};

const BYTES: usize = 10_000_000;

/// Streams random bytes, then whole frames damaged at random, and then checks how fast the parser finds the first whole frame
/// behind damage. Returns the numbers of false frames in noise, and of frames that damage cost.
fn torture<F: Frame>(name: &str, frame: &dyn Fn(u64) -> Vec<u8>) {
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let mut noise = Framer::<F>::default();
    let mut piece = Vec::new();
    for _ in 0..BYTES / 2 / 500 {
        piece.clear();
        piece.extend((0..500).map(|_| random.draw() as u8));
        noise.push(&piece, |_| {});
    }
    assert!(noise.frames() <= 3, "{name}: {} frames in noise", noise.frames());

    // Frames with a damaged byte in every hundred: changed, dropped, doubled, or followed by noise.
    let mut damaged = Framer::<F>::default();
    let (mut sent, mut pushed) = (0, 0);
    while pushed < BYTES / 2 {
        piece.clear();
        for byte in frame(sent) {
            match random.draw() % 400 {
                0 => {}
                1 => piece.extend([byte, byte]),
                2 => piece.push(random.draw() as u8),
                3 => piece.extend((0..random.draw() % 300).map(|_| random.draw() as u8)),
                _ => piece.push(byte),
            }
        }
        sent += 1;
        pushed += piece.len();
        damaged.push(&piece, |_| {});
    }
    let share = damaged.frames() as f64 / sent as f64;
    assert!(share > 0.1, "{name}: {share} of the frames survive");

    let (mut behind, mut late) = (0, 0);
    for round in 0..20_000 {
        let mut framer = Framer::<F>::default();
        let cut = frame(round);
        let mut stream = match round % 3 {
            0 => (0..random.draw() % 300).map(|_| random.draw() as u8).collect(),
            1 => cut[..random.draw() as usize % cut.len()].to_vec(),
            _ => cut.iter().map(|byte| byte ^ u8::from(random.draw().is_multiple_of(8))).collect::<Vec<u8>>(),
        };
        let good = frame(round + 1);
        stream.extend(&good);
        framer.push(&stream, |_| {});
        let at_once = framer.frames();
        framer.push(&frame(round + 2), |_| {});
        framer.push(&frame(round + 3), |_| {});
        let total = framer.frames();
        behind += u64::from(total < 3);
        late += u64::from(at_once == 0);
    }
    println!(
        "{name}: {} false frames in {} random bytes; {share:.3} of {sent} frames survive damage; first whole frame: late \
         in {late}, lost in {behind} of 20000 rounds",
        noise.frames(),
        BYTES / 2
    );
    assert_eq!(behind, 0, "{name}: a whole frame was lost behind damage");
}

#[test]
fn the_parser_of_the_create_survives() {
    let frame =
        |i: u64| Readings { counts: [i as i16, (i / 3) as i16], mode: 2, ..Readings::default() }.encode();
    torture::<Readings>("create2", &frame);
}

#[test]
fn the_parser_of_the_lidar_survives() {
    let frame = |i: u64| {
        let angle = |point: u64| ((i * 12 + point) * 80 % 36_000) as u16;
        let packet = lidar::Packet {
            speed: 3600,
            angles: [angle(0), angle(11)],
            distances: std::array::from_fn(|point| (i as usize * 31 + point * 7) as u16),
            intensities: [200; lidar::POINTS],
            stamp_ms: (i % 30_000) as u16,
        };
        packet.encode()
    };
    torture::<lidar::Packet>("ld06", &frame);
}

#[test]
fn the_parser_of_the_turtlebot_survives() {
    let frame = |i: u64| {
        let mut parameters = vec![0; 1 + usize::from(BLOCK_LEN)];
        parameters[20..28].copy_from_slice(&i.wrapping_mul(0x0101_ffff_fdfd_0777).to_le_bytes());
        let packet = turtlebot3::Packet { id: 200, instruction: turtlebot3::STATUS, parameters };
        let mut bytes = Vec::new();
        packet.encode(&mut bytes);
        bytes
    };
    torture::<turtlebot3::Packet>("turtlebot3", &frame);
}

#[test]
fn the_parser_of_the_line_protocol_survives() {
    let frame = |i: u64| {
        let sonars = vec![Sonar::Echo(i as u16), Sonar::Unchanged, Sonar::Silent];
        let measurement = Measurement {
            sequence: i as u16,
            time_ms: 20 * i as u32,
            counts: [i as i32 * 77, -(i as i32)],
            sonars,
            ..Measurement::default()
        };
        let mut bytes = Vec::new();
        ProtocolLine::Measurement(measurement).encode(&mut bytes);
        bytes
    };
    torture::<ProtocolLine>("microcontroller", &frame);
}
