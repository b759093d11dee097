//! Slowdown of a lockstep run by digest, summary and recording.

#![allow(clippy::unwrap_used, reason = "the measurement stops at the first surprise")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use yamabico_core::message::{
    Axes, Beam, Command, DecisionHeader, Encoding, FrameHeader, Message, MessageType, Name, Odometry,
    Proposal, RangeScanHeader, Reason, Truth, Twist, Verdict,
};
use yamabico_core::time::Time;
use yamabico_runtime::record::{Digest, ImageFormat, McapRecorder, Pace, Recording, Tap, Tee};
use yamabico_runtime::report::{ReferenceLine, SummaryTap, Trace};

use crate::report::{Cell, Report, Table, number};

const SECONDS: u64 = 60;

/// Camera of the synthetic robot.
#[derive(Clone, Copy)]
struct Camera {
    width: u32,
    height: u32,
    /// Images per second.
    image_hz: u64,
    /// Ticks of the arbiter per second, a multiple of the rate of the images.
    tick_hz: u64,
}

const SMALL: Camera = Camera { width: 256, height: 240, image_hz: 10, tick_hz: 50 };
const LARGE: Camera = Camera { width: 640, height: 480, image_hz: 60, tick_hz: 60 };

/// Speed of digest, summary and recording, relative to real time, and their share of one processor core.
///
/// Sends the messages of 60 s of a robot with a camera of 256 x 240 pixels at 10 Hz, sonars, odometry, ground truth, two behaviors,
/// decisions and commands at 50 Hz, as fast as the taps receive them: for each tap alone, and for all. Then those of a robot with a camera
/// of 640 x 480 pixels, everything at 60 Hz. The share is the processor time of all threads over the 60 s.
#[derive(Args)]
pub struct Arguments {
    /// Recording to write; removed at the end [default: in the temporary folder].
    #[arg(value_name = "FILE.mcap")]
    file: Option<PathBuf>,
}

impl Arguments {
    pub fn run(&self) -> Result<Report, String> {
        let default = || std::env::temp_dir().join("yamabico_recording_speed.mcap");
        let path = self.file.clone().unwrap_or_else(default);
        let _ = std::fs::remove_file(&path);
        let mut table = Table::new(
            format!("{SECONDS} s of messages"),
            &["taps", "time, s", "x real time", "of one core, %", "messages", "recorded, MB", "problem"],
        );
        let mut measure = |taps: &str, run: &mut dyn FnMut() -> Option<Written>| {
            let (begin, before_s) = (Instant::now(), processor_s());
            let written = run();
            let seconds = begin.elapsed().as_secs_f64();
            let share = (processor_s() - before_s) / SECONDS as f64;
            let row = |count: Cell, megabytes: Cell, problem: Cell| {
                [
                    taps.into(),
                    number(seconds, 3),
                    number(SECONDS as f64 / seconds, 0),
                    number(100.0 * share, 1),
                    count,
                    megabytes,
                    problem,
                ]
            };
            table.row(match written {
                None => row(Cell::None, Cell::None, Cell::None),
                Some(Written { messages, megabytes, error }) => {
                    row(messages.into(), number(megabytes, 1), error.map_or(Cell::None, Cell::from))
                }
            });
        };
        let [small, large] = [SMALL, LARGE].map(Robot::new);
        let plain = |tap: &mut dyn Tap| {
            small.drive(tap);
            None
        };
        measure("digest", &mut || plain(&mut Digest::new()));
        measure("summary with digest", &mut || plain(&mut SummaryTap::new(ReferenceLine::default())));
        measure("trace", &mut || plain(&mut Trace::default()));
        for (name, images) in
            [("recording, png", ImageFormat::Png), ("recording, jpeg 85", ImageFormat::Jpeg(85))]
        {
            measure(name, &mut || Some(record(&path, images, &small, &mut Tee::default())));
        }
        measure("all, png", &mut || {
            let (mut summary, mut trace) = (SummaryTap::new(ReferenceLine::default()), Trace::default());
            let mut others = Tee(vec![&mut summary, &mut trace]);
            Some(record(&path, ImageFormat::Png, &small, &mut others))
        });
        measure("recording, png, 640 x 480 at 60 Hz", &mut || {
            Some(record(&path, ImageFormat::Png, &large, &mut Tee::default()))
        });
        let _ = std::fs::remove_file(path);
        Ok(Report::new([table]))
    }
}

/// Contents of a recording.
struct Written {
    messages: u64,
    megabytes: f64,
    error: Option<String>,
}

fn record(path: &Path, images: ImageFormat, robot: &Robot, others: &mut dyn Tap) -> Written {
    let recording = Recording { images, replaces: true, ..Recording::new(path, Pace::Lockstep) };
    let mut recorder = McapRecorder::create(recording).unwrap();
    robot.drive(&mut Tee(vec![&mut recorder, others]));
    let recorded = recorder.finish(BTreeMap::new());
    Written {
        messages: recorded.messages.values().sum(),
        megabytes: recorded.bytes as f64 * 1e-6,
        error: recorded.error.map(|error| error.to_string()),
    }
}

/// Processor time of this program with all threads that it has had, s; in steps of 10 ms.
fn processor_s() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // The name of the program, in parentheses, may contain spaces.
    let fields = text.rsplit(')').next().unwrap_or_default().split_whitespace();
    let ticks: u64 = fields.skip(11).take(2).filter_map(|field| field.parse::<u64>().ok()).sum();
    ticks as f64 / 100.0
}

/// The synthetic robot.
struct Robot {
    camera: Camera,
    frames: Vec<Vec<u8>>,
}

impl Robot {
    fn new(camera: Camera) -> Robot {
        Robot { camera, frames: (0..8).map(|number| frame(camera, number)).collect() }
    }
}

/// Returns a synthetic image: smooth shading, two edges and noise of a few levels.
fn frame(Camera { width, height, .. }: Camera, number: u32) -> Vec<u8> {
    let level = |i: u32| {
        let (x, y) = (i % width, i / width);
        let noise = (i ^ number.wrapping_mul(977)).wrapping_mul(2_654_435_761) >> 30;
        let shade = 60 + x / 4 + y / 4 + if x > 90 + y / 4 { 40 } else { 0 } + if y > 160 { 30 } else { 0 };
        (shade + noise).min(255) as u8
    };
    (0..width * height).map(level).collect()
}

impl Robot {
    fn drive(&self, tap: &mut dyn Tap) {
        let Camera { width, height, image_hz, tick_hz } = self.camera;
        for step in 0..SECONDS * tick_hz {
            let time = Time(step * 1_000_000_000 / tick_hz);
            let (stamp_ns, sequence, x) = (time.0, step, 0.4 * time.as_secs_f64());
            if step % (tick_hz / image_hz) == 0 {
                let encoding = Encoding::Gray8.code();
                let header =
                    FrameHeader { stamp_ns, sequence, width, height, stride: width, encoding, exposure: 1.0 };
                let image = step * image_hz / tick_hz;
                send(tap, "sensors/front", time, &header, &self.frames[image as usize % self.frames.len()]);
            }
            if step % 5 < 2 {
                let scan = RangeScanHeader { stamp_ns, sequence, min_m: 0.1, max_m: 3.0 };
                let beam = |i: i32| Beam {
                    azimuth_rad: 0.35 * f64::from(i),
                    cone_rad: 0.44,
                    range_m: 2.0,
                    ..Beam::default()
                };
                send(tap, "sensors/sonar", time, &scan, &[beam(-1), beam(0), beam(1)]);
            }
            send(
                tap,
                "sensors/odometry",
                time,
                &Odometry { stamp_ns, sequence, x, ..Default::default() },
                &[],
            );
            let truth = Truth { stamp_ns, sequence, x, person_m: f64::INFINITY, ..Default::default() };
            send(tap, "truth", time, &truth, &[]);
            let proposals = [
                ("sonar-halt", Proposal::abstain(Reason::Clear)),
                ("wall-follower", Proposal::drive(Axes::PLANAR, Twist::planar(0.4, 0.01))),
            ];
            for (name, proposal) in proposals {
                let proposal = Proposal { behavior: Name::new(name), stamp_ns, sequence, ..proposal };
                send(tap, &format!("behaviors/{name}/proposal"), time, &proposal, &[]);
            }
            let decision = DecisionHeader { stamp_ns, sequence, ..Default::default() };
            send(tap, "decision", time, &decision, &[Verdict::default(); 2]);
            send(tap, "command", time, &Command { stamp_ns, sequence, ..Default::default() }, &[]);
        }
    }
}

fn send<M: Message>(tap: &mut dyn Tap, topic: &str, time: Time, header: &M, items: &[M::Item]) {
    let (header, items) = (bytemuck::bytes_of(header), bytemuck::cast_slice(items));
    tap.message(topic, &MessageType::of::<M>(), time, header, items);
}
