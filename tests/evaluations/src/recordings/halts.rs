//! Halts of sonar-halt on recorded laser scans, beside the commands that the robot was given.

use std::path::{Path, PathBuf};

use clap::Args;
use nalgebra::{Vector2, Vector3};
use yamabico_core::behavior::Setup;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{
    Beam, Bumper, DecisionHeader, Kind, Message, Odometry, Proposal, RangeScanHeader, Twist,
};
use yamabico_core::sensor::{Robot, SensorInfo, SensorKind};
use yamabico_core::testing::Bench;
use yamabico_drawing::font;
use yamabico_drawing::palette::{GRID, INK};
use yamabico_drawing::{Canvas, Color};
use yamabico_recording::ros2::transforms::Frames;
use yamabico_recording::ros2::{frame_id, twist};
use yamabico_recording::storage::Messages;
use yamabico_recording::{Measurement, TopicReader};
use yamabico_sonar_halt::{BUMPER, DECISION, ODOMETRY, SONAR, SonarHalt};

use crate::arguments::{Data, Parameters};
use crate::images::Output;
use crate::report::{Report, Table, number};

/// Radius of the robot, m.
const RADIUS_M: f64 = 0.17;
/// Parameters for a scanner of 5 Hz whose scans arrive 0.2 s late.
const DEFAULTS: &str = "stale_ms = 700\nreaction_ms = 300";
/// Age above which a command no longer counts, s.
const COMMAND_S: f64 = 0.6;
/// Commanded speed from which the robot is to drive forward, m/s.
const FORWARD_MPS: f64 = 0.02;
/// Half of the angle ahead in which the nearest range is plotted, rad.
const AHEAD_RAD: f64 = 0.35;

/// Halts of sonar-halt on the laser scans of a real robot (`bags/`), beside the recorded commands and bumps.
///
/// The recording does not react: where sonar-halt would have stopped, the robot drove on as its command said.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    data: Data,
    #[command(flatten)]
    parameters: Parameters,
}

/// A message of one of the topics that count.
enum Event {
    Scan(RangeScanHeader, Vec<Beam>),
    Odometry(Odometry),
    Bumper(Bumper),
    Command(Twist),
}

/// State after one scan.
struct Moment {
    time_s: f64,
    commanded: Twist,
    measured_mps: f64,
    ahead_m: f64,
    bumped: bool,
    proposal: Proposal,
}

impl Moment {
    fn halts(&self) -> bool {
        self.proposal.kind() == Some(Kind::Halt)
    }

    /// True if the robot was commanded to drive into what made sonar-halt stop it.
    fn would_stop(&self) -> bool {
        self.halts() && self.commanded.linear > FORWARD_MPS
    }
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        let Some(folder) = self.data.set("bags") else { return Ok(Report::default()) };
        let entries = std::fs::read_dir(&folder).map_err(|error| error.to_string())?;
        let mut bags: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
        bags.retain(|path| path.join("metadata.yaml").is_file());
        bags.sort();
        let parameters = self.parameters.over(DEFAULTS)?.to_string();
        let mut table = Table::new(
            "sonar-halt on recorded laser scans",
            &[
                "recording",
                "scans",
                "time, s",
                "commanded forward, s",
                "would have stopped, s",
                "times",
                "slowed, s",
                "bumps",
                "stopped before a bump",
                "first cause",
            ],
        );
        for bag in bags {
            let name = bag.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let moments = replay(&bag, &parameters).map_err(|problem| format!("{name}: {problem}"))?;
            if out.is_on() {
                plot(out, &name, &moments)?;
            }
            let seconds = |counts: &dyn Fn(&Moment) -> bool| -> f64 {
                let steps = moments.windows(2).filter(|pair| counts(&pair[0]));
                steps
                    .map(|pair| (pair[1].time_s - pair[0].time_s).min(COMMAND_S))
                    .fold(0.0, |sum, step_s| sum + step_s)
            };
            let begins = |is: &dyn Fn(&Moment) -> bool| {
                moments.windows(2).filter(|pair| !is(&pair[0]) && is(&pair[1])).count()
            };
            let bumps: Vec<f64> = moments
                .windows(2)
                .filter(|pair| !pair[0].bumped && pair[1].bumped)
                .map(|pair| pair[1].time_s)
                .collect();
            // A halt in the second before the bump.
            let foreseen = |at_s: &&f64| {
                moments.iter().any(|moment| {
                    (*at_s - 1.0..**at_s).contains(&moment.time_s) && moment.halts() && !moment.bumped
                })
            };
            let foreseen = bumps.iter().filter(foreseen).count();
            let first = moments.iter().skip(3).find(|moment| moment.would_stop());
            let span_s = moments.last().map_or(0.0, |last| last.time_s - moments[0].time_s);
            table.row([
                name.into(),
                moments.len().into(),
                number(span_s, 1),
                number(seconds(&|moment| moment.commanded.linear > FORWARD_MPS), 1),
                number(seconds(&Moment::would_stop), 1),
                begins(&Moment::would_stop).into(),
                number(seconds(&|moment| moment.proposal.kind() == Some(Kind::Limit)), 1),
                bumps.len().into(),
                foreseen.into(),
                first
                    .map_or("-".into(), |moment| {
                        format!("{:.1} s: {}", moment.time_s, moment.proposal.note.as_str())
                    })
                    .into(),
            ]);
        }
        Ok(Report::new([table]))
    }
}

/// Runs sonar-halt on a recording.
fn replay(bag: &Path, parameters: &str) -> Result<Vec<Moment>, String> {
    let events = events(bag)?;
    let sensor = SensorInfo {
        name: "laser".into(),
        message: RangeScanHeader::NAME,
        period_s: 0.2,
        latency_s: 0.2,
        kind: SensorKind::Range { min_m: 0.1, max_m: 5.0 },
    };
    let robot = Robot { radius_m: RADIUS_M, ..Robot::default() };
    let setup = Setup { robot, sensors: vec![("sonar".into(), sensor)], ..Setup::default() };
    let mut bench = Bench::<SonarHalt>::new(parameters, setup).map_err(|error| error.to_string())?;
    let (mut command, mut measured_mps, mut bumped) = (None::<(f64, Twist)>, 0.0, false);
    let mut moments = Vec::new();
    for (arrived_ns, event) in events {
        let now_s = arrived_ns as f64 * 1e-9;
        bench.at(now_s);
        match event {
            Event::Command(twist) => command = Some((now_s, twist)),
            Event::Odometry(odometry) => {
                measured_mps = odometry.vx;
                bench.feed(&ODOMETRY, &odometry, &[]);
            }
            Event::Bumper(bumper) => {
                bumped = bumper.pressed != 0;
                bench.feed(&BUMPER, &bumper, &[]);
            }
            Event::Scan(header, beams) => {
                let fresh = command.filter(|(at_s, _)| now_s - at_s < COMMAND_S);
                let commanded = fresh.map_or(Twist::ZERO, |(_, twist)| twist);
                let decision =
                    DecisionHeader { stamp_ns: arrived_ns, wished: commanded, ..DecisionHeader::default() };
                let is_ahead = |beam: &&Beam| beam.azimuth_rad.abs() < AHEAD_RAD;
                let ahead =
                    beams.iter().filter(is_ahead).filter_map(Beam::echo_m).fold(f64::INFINITY, f64::min);
                bench.feed(&DECISION, &decision, &[]).feed(&SONAR, &header, &beams);
                let proposal = bench.propose();
                moments.push(Moment {
                    time_s: now_s,
                    commanded,
                    measured_mps,
                    ahead_m: ahead,
                    bumped,
                    proposal,
                });
            }
        }
    }
    if moments.is_empty() { Err("no scans".to_owned()) } else { Ok(moments) }
}

/// Reads scans (in the robot frame), odometry, bumpers and commands in the order in which they arrived, ns after the beginning.
fn events(bag: &Path) -> Result<Vec<(u64, Event)>, String> {
    let mut events = Vec::new();
    let mount = mount(bag)?;
    let topics = [("/scan", RangeScanHeader::NAME), ("/odom", Odometry::NAME), ("/bump", Bumper::NAME)];
    for (topic, message) in topics {
        for recorded in TopicReader::open(bag, topic, message).map_err(|error| error.to_string())? {
            let stamp_ns = recorded.stamp_ns;
            let event = match recorded.measurement {
                Measurement::Scan(header, mut beams) => {
                    for beam in &mut beams {
                        let at = mount * Pose2::new(beam.x_m, beam.y_m, beam.azimuth_rad);
                        (beam.x_m, beam.y_m, beam.azimuth_rad) = (at.x, at.y, at.theta);
                    }
                    Event::Scan(RangeScanHeader { stamp_ns, ..header }, beams)
                }
                Measurement::Odometry(odometry) => Event::Odometry(Odometry { stamp_ns, ..odometry }),
                Measurement::Bumper(bumper) => Event::Bumper(Bumper { stamp_ns, ..bumper }),
                _ => continue,
            };
            events.push((recorded.arrived_ns, event));
        }
    }
    let messages: Vec<_> = Messages::open(bag)?.collect::<Result<_, String>>()?;
    let begin_ns = messages.iter().map(|message| message.log_time).min().unwrap_or(0);
    for message in messages.iter().filter(|message| message.topic.name == "/cmd_vel") {
        let twist = twist(&message.data).map_err(|error| error.to_string())?;
        events.push((message.log_time - begin_ns, Event::Command(twist)));
    }
    events.sort_by_key(|(arrived_ns, _)| *arrived_ns);
    Ok(events)
}

/// Pose of the scanner on the robot.
fn mount(bag: &Path) -> Result<Pose2, String> {
    let scan = Messages::open(bag)?.flatten().find(|message| message.topic.name == "/scan");
    let frame = scan.and_then(|message| frame_id(&message.data)).ok_or("no frame of the scans")?;
    let found = Frames::of(bag)?.body_from(&frame);
    let body_from_laser = found.ok_or_else(|| format!("no mount of `{frame}` on /tf_static"))?;
    let ahead = body_from_laser * Vector3::x();
    Ok(Pose2::new(body_from_laser.translation.x, body_from_laser.translation.y, ahead.y.atan2(ahead.x)))
}

const SIZE: (usize, usize) = (1200, 430);
const LEFT: f64 = 60.0;
const WIDTH: f64 = 1120.0;
const COMMANDED: Color = [30, 90, 200];
const MEASURED: Color = [140, 140, 140];
const RANGE: Color = [20, 140, 90];
const HALT: Color = [250, 190, 180];
const SLOW: Color = [255, 228, 170];
const BUMP: Color = [200, 30, 30];

/// Draws speed and nearest range ahead over time, with the times of halts behind them.
fn plot(out: &Output, name: &str, moments: &[Moment]) -> Result<(), String> {
    let mut pixels = vec![255; 3 * SIZE.0 * SIZE.1];
    let mut canvas = Canvas::new(&mut pixels, SIZE.0, SIZE.1).ok_or("an image without pixels")?;
    let end_s = moments.last().map_or(1.0, |last| last.time_s);
    let x = |time_s: f64| LEFT + WIDTH * time_s / end_s;
    let speed_y = |mps: f64| 200.0 - 150.0 * (mps.clamp(-0.4, 0.4) + 0.4) / 0.8;
    let range_y = |m: f64| 390.0 - 150.0 * m.clamp(0.0, 3.0) / 3.0;
    for pair in moments.windows(2) {
        let color = match pair[0].proposal.kind() {
            Some(Kind::Halt) => HALT,
            Some(Kind::Limit) => SLOW,
            _ => continue,
        };
        for column in x(pair[0].time_s) as usize..x(pair[1].time_s) as usize {
            for (top, bottom) in [(50.0, 200.0), (240.0, 390.0)] {
                canvas.line(Vector2::new(column as f64, top), Vector2::new(column as f64, bottom), color);
            }
        }
    }
    let mut level = |y: f64, label: String| {
        canvas.line(Vector2::new(LEFT, y), Vector2::new(LEFT + WIDTH, y), GRID);
        canvas.text(Vector2::new(LEFT - 8.0 - font::width(&label, font::TEXT_PX), y - 4.0), &label, INK);
    };
    [-0.4, -0.2, 0.0, 0.2, 0.4].into_iter().for_each(|mps| level(speed_y(mps), format!("{mps:.1}")));
    [0.0, 1.0, 2.0, 3.0].into_iter().for_each(|m| level(range_y(m), format!("{m:.0}")));
    for tens in 0..=(end_s / 10.0) as u32 {
        let at = x(10.0 * f64::from(tens));
        canvas.line(Vector2::new(at, 50.0), Vector2::new(at, 390.0), GRID);
        canvas.text(Vector2::new(at - 8.0, 398.0), &format!("{} s", 10 * tens), INK);
    }
    let curve = |canvas: &mut Canvas<'_>, color: Color, y: &dyn Fn(&Moment) -> f64| {
        for pair in moments.windows(2) {
            canvas.stroke(
                Vector2::new(x(pair[0].time_s), y(&pair[0])),
                Vector2::new(x(pair[1].time_s), y(&pair[1])),
                1.5,
                color,
            );
        }
    };
    curve(&mut canvas, MEASURED, &|moment| speed_y(moment.measured_mps));
    curve(&mut canvas, COMMANDED, &|moment| speed_y(moment.commanded.linear));
    curve(&mut canvas, RANGE, &|moment| range_y(moment.ahead_m));
    for moment in moments.iter().filter(|moment| moment.bumped) {
        canvas.cross(Vector2::new(x(moment.time_s), 222.0), 4.0, BUMP);
    }
    let mut legend = LEFT;
    let entries = [
        ("commanded speed, m/s", COMMANDED),
        ("measured speed, m/s", MEASURED),
        ("nearest range ahead, m", RANGE),
        ("sonar-halt halts", HALT),
        ("sonar-halt slows", SLOW),
        ("bumper pressed", BUMP),
    ];
    for (text, color) in entries {
        canvas.stroke(Vector2::new(legend, 30.0), Vector2::new(legend + 20.0, 30.0), 6.0, color);
        canvas.text(Vector2::new(legend + 26.0, 26.0), text, INK);
        legend += 46.0 + font::width(text, font::TEXT_PX);
    }
    canvas.text(
        Vector2::new(LEFT, 8.0),
        &format!("{name}: recorded drive, and when sonar-halt would have stopped it"),
        INK,
    );
    out.rgb(&format!("halts-{name}"), &pixels, SIZE.0 as u32, SIZE.1 as u32)
}
