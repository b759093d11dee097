//! How near the pose from odometry and the azimuths of landmarks stays to the truth, on recordings of five robots of a quarter
//! of an hour each.
//!
//! `evaluate_landmarks [DIR]`
//!
//! DIR holds `mrclam/dataset6/`; without it `YAMABICO_DATA`, else `../shared/data` beside the workspace. The landmarks are known
//! by their bar codes and surveyed; the measured ranges are not used, and neither is what a robot sees of another. The camera
//! looks ahead only and often sees no landmark. A robot starts where it truly is. Beside it: dead reckoning alone. NEES is the
//! squared error over its covariance in three degrees of freedom: 3 where the covariance is right.

use std::collections::HashMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use flate2::read::GzDecoder;
use nalgebra::Point2;
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_map_localizer::azimuth::{BearingPair, EdgeLandmark, LeverArm, SeenBearing, filter};
use yamabico_map_localizer::belief::Belief;
use yamabico_map_localizer::motion::{Increment, MotionNoise};

/// The odometry is what was commanded, on small wheels that slip.
const NOISE: MotionNoise =
    MotionNoise { way_per_way_m: 0.01, turn_per_turn_rad: 0.09, turn_per_way: 0.04, drift_per_way: 0.0 };
/// Standard deviation of an azimuth, rad: 1.5 degrees, much of it from stamps that differ.
const SIGMA_RAD: f64 = 0.026;
/// Azimuths farther off than the root of this many standard deviations are left out.
const GATE: f64 = 12.0;
/// Of the start, m and rad.
const START_SIGMA: (f64, f64) = (0.02, 0.0175);
/// 95 % of right poses are within this squared Mahalanobis distance.
const CHI_SQUARE_95: f64 = 7.815;
/// The first subject that is a landmark and not a robot.
const FIRST_LANDMARK: f64 = 6.0;
const ROBOTS: [u32; 5] = [1, 2, 3, 4, 5];

fn main() -> ExitCode {
    match evaluate() {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            eprintln!("{problem}");
            ExitCode::FAILURE
        }
    }
}

fn evaluate() -> Result<(), String> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let given = std::env::args_os().nth(1).or_else(|| std::env::var_os("YAMABICO_DATA"));
    let folder = given.map_or(beside, PathBuf::from).join("mrclam/dataset6");
    if !folder.is_dir() {
        println!("no {}: skipped", folder.display());
        return Ok(());
    }
    let landmarks: HashMap<u32, EdgeLandmark> = rows::<6>(&folder.join("landmarks.csv"))?
        .into_iter()
        .map(|[subject, _, x, y, ..]| {
            (subject as u32, EdgeLandmark { position: Point2::new(x, y), sign: None, sigma_m: 0.0 })
        })
        .collect();
    for robot in ROBOTS {
        let file = |what: &str| folder.join(format!("robot{robot}_{what}.csv.gz"));
        let events = events(
            &rows(&file("odometry"))?,
            &rows(&file("measurement"))?,
            &rows(&file("groundtruth_20hz"))?,
            &landmarks,
        );
        let tally = follow(&events).ok_or(format!("robot {robot}: no truth"))?;
        println!("robot {robot}: {}", tally.text());
    }
    Ok(())
}

/// What happens to a robot, with its time in seconds.
enum Event {
    /// It is told to drive, m/s, and to turn, rad/s.
    Command(f64, f64),
    /// It sees a landmark.
    Seen(BearingPair),
    /// It is truly here.
    Truth(Pose2),
}

/// In the order of time, from the first truth on.
fn events(
    odometry: &[[f64; 3]],
    measurements: &[[f64; 5]],
    truth: &[[f64; 4]],
    landmarks: &HashMap<u32, EdgeLandmark>,
) -> Vec<(f64, Event)> {
    let commands = odometry.iter().map(|&[t, speed, turn]| (t, Event::Command(speed, turn)));
    let seen = measurements.iter().filter_map(|&[t, _, subject, _, azimuth_rad]| {
        let landmark = landmarks.get(&(subject.max(0.0) as u32)).filter(|_| subject >= FIRST_LANDMARK)?;
        let seen = SeenBearing { azimuth_rad, sign: None, sigma_rad: SIGMA_RAD };
        Some((t, Event::Seen(BearingPair { landmark: *landmark, seen })))
    });
    let truth = truth.iter().map(|&[t, x, y, theta]| (t, Event::Truth(Pose2::new(x, y, theta))));
    let mut events: Vec<_> = commands.chain(seen).chain(truth).collect();
    events.sort_by(|a, b| a.0.total_cmp(&b.0));
    events
}

/// What became of a robot.
#[derive(Default)]
struct Tally {
    /// Squared errors of the belief and of dead reckoning, m^2 and rad^2, summed.
    belief: [f64; 2],
    reckoned: [f64; 2],
    nees: f64,
    within: usize,
    compared: usize,
    used: usize,
    seen: usize,
}

/// Follows a robot by its events; `None` without any truth.
fn follow(events: &[(f64, Event)]) -> Option<Tally> {
    let first_command =
        events.iter().find_map(|(t, event)| matches!(event, Event::Command(..)).then_some(*t))?;
    let (start, truth) = events.iter().enumerate().find_map(|(number, (t, event))| match event {
        Event::Truth(truth) if *t >= first_command => Some((number, *truth)),
        _ => None,
    })?;
    let mut belief = Belief::new(truth, START_SIGMA.0, START_SIGMA.1);
    let mut reckoned = truth;
    let mut tally = Tally::default();
    let (mut last_s, mut speed, mut turn) = (events[start].0, 0.0, 0.0);
    for (t, event) in &events[start..] {
        let step_s = t - last_s;
        last_s = *t;
        let motion = Increment { forward_m: speed * step_s, turn_rad: turn * step_s };
        belief = motion.move_belief(&belief, 0.0, &NOISE);
        reckoned = motion.move_pose(&reckoned);
        match event {
            Event::Command(new_speed, new_turn) => (speed, turn) = (*new_speed, *new_turn),
            Event::Seen(pair) => {
                tally.seen += 1;
                tally.used += filter(&mut belief, &[*pair], GATE, LeverArm::zeros());
            }
            Event::Truth(truth) => tally.add(&belief, &reckoned, truth),
        }
    }
    Some(tally)
}

impl Tally {
    fn add(&mut self, belief: &Belief, reckoned: &Pose2, truth: &Pose2) {
        for (sums, pose) in [(&mut self.belief, &belief.pose), (&mut self.reckoned, reckoned)] {
            sums[0] += pose.distance(truth).powi(2);
            sums[1] += angle_difference(pose.theta, truth.theta).powi(2);
        }
        let nees = belief.distance_squared(truth);
        self.nees += nees;
        self.within += usize::from(nees <= CHI_SQUARE_95);
        self.compared += 1;
    }

    fn text(&self) -> String {
        let count = self.compared as f64;
        let rms = |sums: [f64; 2]| {
            let [squares_m, squares_rad] = sums;
            format!(
                "{:.2} m, {:.1} deg",
                (squares_m / count).sqrt(),
                (squares_rad / count).sqrt().to_degrees()
            )
        };
        format!(
            "RMSE {}; dead reckoning {}; NEES {:.1}, {:.0} % in the 95 % ellipsoid; {} of {} azimuths used",
            rms(self.belief),
            rms(self.reckoned),
            self.nees / count,
            100.0 * self.within as f64 / count,
            self.used,
            self.seen,
        )
    }
}

/// The numbers of a table with one row of names, compressed or not, each row at least so long.
fn rows<const N: usize>(path: &Path) -> Result<Vec<[f64; N]>, String> {
    let cannot = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
    let mut file = File::open(path).map_err(|error| cannot(&error))?;
    let mut text = String::new();
    let is_compressed = path.extension().is_some_and(|extension| extension == "gz");
    let read = if is_compressed {
        GzDecoder::new(file).read_to_string(&mut text)
    } else {
        file.read_to_string(&mut text)
    };
    read.map_err(|error| cannot(&error))?;
    let parse = |line: &str| -> Result<[f64; N], String> {
        let mut row = [f64::NAN; N];
        let mut values = line.split(',');
        for place in &mut row {
            let value = values.next().ok_or_else(|| cannot(&"a row is too short"))?;
            *place = value.trim().parse().map_err(|error: std::num::ParseFloatError| cannot(&error))?;
        }
        Ok(row)
    };
    text.lines().skip(1).filter(|line| !line.trim().is_empty()).map(parse).collect()
}
