//! Pose error from odometry and azimuths of landmarks on recordings of five robots.

use std::collections::HashMap;
use std::path::Path;

use clap::Args;
use nalgebra::Point2;
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_map_localizer::azimuth::{BearingPair, EdgeLandmark, LeverArm, SeenBearing, filter};
use yamabico_map_localizer::belief::Belief;
use yamabico_map_localizer::motion::{Increment, MotionNoise, SlipNoise};

use crate::arguments::Data;
use crate::report::{Report, Table, number, percent};

/// Noise of the odometry, which is the commanded motion of small wheels that slip.
const NOISE: MotionNoise = MotionNoise {
    distance_per_distance_m: 0.01,
    turn_per_turn_rad: 0.09,
    turn_per_distance: 0.04,
    drift_per_distance: 0.0,
    delay_s: 0.0,
    slip: SlipNoise { from_mps2: 0.0, gain: 0.0 },
};
/// Standard deviation of an azimuth, rad: 1.5 degrees, mostly caused by time stamps that differ.
const SIGMA_RAD: f64 = 0.026;
/// Squared Mahalanobis distance above which an azimuth is rejected.
const GATE: f64 = 12.0;
/// Standard deviations of the initial pose, m and rad.
const START_SIGMA: (f64, f64) = (0.02, 0.0175);
/// 95 % quantile of the chi-square distribution with three degrees of freedom.
const CHI_SQUARE_95: f64 = 7.815;
/// Number of the first subject that is a landmark and not a robot.
const FIRST_LANDMARK: f64 = 6.0;
const ROBOTS: [u32; 5] = [1, 2, 3, 4, 5];

/// Pose error from odometry and azimuths of landmarks on recordings of five robots, a quarter of an hour each (`mrclam/`).
///
/// The landmarks are identified by their bar codes and surveyed; measured ranges and observations of other robots are not used. The
/// camera looks ahead only and often observes no landmark. Each robot starts at its true pose. Baseline: dead reckoning. NEES:
/// normalized estimation error squared in three degrees of freedom, 3 if the covariance is right.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    data: Data,
}

impl Arguments {
    pub fn run(&self) -> Result<Report, String> {
        let Some(folder) = self.data.set("mrclam") else { return Ok(Report::default()) };
        let folder = folder.join("dataset6");
        let landmarks: HashMap<u32, EdgeLandmark> = rows::<6>(&folder.join("landmarks.csv"))?
            .into_iter()
            .map(|[subject, _, x, y, ..]| {
                (subject as u32, EdgeLandmark { position: Point2::new(x, y), sign: None, sigma_m: 0.0 })
            })
            .collect();
        let mut table = Table::new(
            "MRCLAM data set 6",
            &[
                "robot",
                "RMSE, m",
                "RMSE, deg",
                "dead reckoning, m",
                "dead reckoning, deg",
                "NEES",
                "in 95 % ellipsoid, %",
                "azimuths",
                "used",
            ],
        );
        for robot in ROBOTS {
            let file = |name: &str| folder.join(format!("robot{robot}_{name}.csv.gz"));
            let events = events(
                &rows(&file("odometry"))?,
                &rows(&file("measurement"))?,
                &rows(&file("groundtruth_20hz"))?,
                &landmarks,
            );
            let tally = track(&events).ok_or(format!("robot {robot}: no ground truth"))?;
            tally.row(&mut table, robot);
        }
        Ok(Report::new([table]))
    }
}

/// An entry of a recording.
enum Event {
    /// Commanded speed, m/s, and turn rate, rad/s.
    Command(f64, f64),
    /// Observation of a landmark.
    Observation(BearingPair),
    /// True pose.
    Truth(Pose2),
}

/// Merges the recordings of a robot in the order of time, s.
fn events(
    odometry: &[[f64; 3]],
    measurements: &[[f64; 5]],
    truth: &[[f64; 4]],
    landmarks: &HashMap<u32, EdgeLandmark>,
) -> Vec<(f64, Event)> {
    let commands = odometry.iter().map(|&[t, speed, turn]| (t, Event::Command(speed, turn)));
    let observations = measurements.iter().filter_map(|&[t, _, subject, _, azimuth_rad]| {
        let landmark = landmarks.get(&(subject.max(0.0) as u32)).filter(|_| subject >= FIRST_LANDMARK)?;
        let seen = SeenBearing { azimuth_rad, sign: None, sigma_rad: SIGMA_RAD };
        Some((t, Event::Observation(BearingPair { landmark: *landmark, seen })))
    });
    let truth = truth.iter().map(|&[t, x, y, theta]| (t, Event::Truth(Pose2::new(x, y, theta))));
    let mut events: Vec<_> = commands.chain(observations).chain(truth).collect();
    events.sort_by(|a, b| a.0.total_cmp(&b.0));
    events
}

/// Errors of a robot's pose estimate.
#[derive(Default)]
struct Tally {
    /// Sums of the squared errors of the estimate, m^2 and rad^2.
    estimate: [f64; 2],
    /// Sums of the squared errors of dead reckoning, m^2 and rad^2.
    reckoning: [f64; 2],
    nees: f64,
    within: usize,
    compared: usize,
    used: usize,
    observed: usize,
}

/// Tracks a robot through its recording; `None` without ground truth.
fn track(events: &[(f64, Event)]) -> Option<Tally> {
    let first_command =
        events.iter().find_map(|(t, event)| matches!(event, Event::Command(..)).then_some(*t))?;
    let (start, truth) = events.iter().enumerate().find_map(|(index, (t, event))| match event {
        Event::Truth(truth) if *t >= first_command => Some((index, *truth)),
        _ => None,
    })?;
    let mut belief = Belief::new(truth, START_SIGMA.0, START_SIGMA.1);
    let mut reckoned = truth;
    let mut tally = Tally::default();
    let (mut last_s, mut speed, mut turn) = (events[start].0, 0.0, 0.0);
    for (t, event) in &events[start..] {
        let step_s = t - last_s;
        last_s = *t;
        let motion = Increment { forward_m: speed * step_s, turn_rad: turn * step_s, ..Increment::default() };
        belief = motion.move_belief(&belief, 0.0, &NOISE);
        reckoned = motion.move_pose(&reckoned);
        match event {
            Event::Command(new_speed, new_turn) => (speed, turn) = (*new_speed, *new_turn),
            Event::Observation(pair) => {
                tally.observed += 1;
                tally.used += filter(&mut belief, &[*pair], GATE, LeverArm::zeros());
            }
            Event::Truth(truth) => tally.add(&belief, &reckoned, truth),
        }
    }
    Some(tally)
}

impl Tally {
    fn add(&mut self, belief: &Belief, reckoned: &Pose2, truth: &Pose2) {
        for (sums, pose) in [(&mut self.estimate, &belief.pose), (&mut self.reckoning, reckoned)] {
            sums[0] += pose.distance(truth).powi(2);
            sums[1] += angle_difference(pose.theta, truth.theta).powi(2);
        }
        let nees = belief.distance_squared(truth);
        self.nees += nees;
        self.within += usize::from(nees <= CHI_SQUARE_95);
        self.compared += 1;
    }

    fn row(&self, table: &mut Table, robot: u32) {
        let count = self.compared as f64;
        let rms = |sum: f64| (sum / count).sqrt();
        table.row([
            robot.into(),
            number(rms(self.estimate[0]), 2),
            number(rms(self.estimate[1]).to_degrees(), 1),
            number(rms(self.reckoning[0]), 2),
            number(rms(self.reckoning[1]).to_degrees(), 1),
            number(self.nees / count, 1),
            percent(self.within as f64, count),
            self.observed.into(),
            self.used.into(),
        ]);
    }
}

/// Reads the first `N` columns of a table.
fn rows<const N: usize>(path: &Path) -> Result<Vec<[f64; N]>, String> {
    let first = |row: Vec<f64>| row.get(..N).and_then(|row| row.try_into().ok());
    let rows = super::rows(path)?.into_iter().map(first);
    rows.collect::<Option<_>>().ok_or_else(|| format!("{}: a row has fewer than {N} columns", path.display()))
}
