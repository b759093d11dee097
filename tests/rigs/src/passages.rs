//! Gaps between two obstacles that sonar readings tell from surfaces that fill them.
//!
//! Two boxes stand a random width apart, 0.5 to 1.2 m. The gap between them is empty, with or without a wall behind it, or closed by a
//! panel nearly flush with both. The robot knows the two edges to a few centimeters, has turned towards the middle between them to
//! within a few degrees, and drives there at 5 cm/s from the distance at which the sonar cone fits between the edges, or from nearer.

use rand::RngExt;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;
use yamabico_core::geometry::Pose2;
use yamabico_sim::random::stream;
use yamabico_sim::sonar::{SonarConfig, measure_range};
use yamabico_sim::{Scene, World};
use yamabico_vision::azimuth_map::{RangeReading, SurfaceCheck, SurfaceCheckRule, SurfaceState};

/// A sonar, and the number of readings without an echo that make a passage.
pub struct Sonar {
    /// Description for a table.
    pub name: &'static str,
    noise_m: f64,
    dropout: f64,
    min_beyond: u32,
}

/// The default sonar of the simulator.
pub const CLEAN: Sonar =
    Sonar { name: "5 mm of noise, 2 % of the echoes lost", noise_m: 0.005, dropout: 0.02, min_beyond: 3 };
/// A sonar that loses more echoes and therefore needs more readings without one.
pub const POOR: Sonar =
    Sonar { name: "2 cm of noise, 10 % of the echoes lost", noise_m: 0.02, dropout: 0.1, min_beyond: 5 };

const SPEED_MPS: f64 = 0.05;
const PERIOD_S: f64 = 0.05;
/// Distance at which the robot stops, m.
const MIN_DISTANCE_M: f64 = 0.3;
/// Standard deviation of the edges' positions and of the robot's, m.
const EDGE_SIGMA_M: f64 = 0.015;
/// Maximum range of the sonar, m.
const MAX_RANGE_M: f64 = 4.0;

/// Classifications of many gaps.
#[derive(Debug, Default)]
pub struct Tally {
    /// Number of worlds.
    pub cases: u32,
    /// Number classified correctly.
    pub correct: u32,
    /// Number not decided.
    pub undecided: u32,
    /// Passages classified as surfaces, or as obstacles in front of one.
    pub passages_missed: u32,
    /// Surfaces classified as passages, or as obstacles in front of one.
    pub surfaces_missed: u32,
    /// Durations until the decision, ascending, s.
    pub decided_s: Vec<f64>,
}

impl Tally {
    /// Classifies the worlds of the seeds; those with an even seed have a passage.
    ///
    /// # Errors
    /// If a world is invalid.
    pub fn of(sonar: &Sonar, seeds: std::ops::Range<u64>) -> Result<Self, String> {
        let mut tally = Self::default();
        for seed in seeds {
            tally.cases += 1;
            let is_passage = seed.is_multiple_of(2);
            let (state, after_s) = approach(sonar, is_passage, seed)?;
            match (state, is_passage) {
                (SurfaceState::Unknown, _) => tally.undecided += 1,
                (SurfaceState::Empty, true) | (SurfaceState::Solid, false) => tally.correct += 1,
                (_, true) => tally.passages_missed += 1,
                (_, false) => tally.surfaces_missed += 1,
            }
            if state != SurfaceState::Unknown {
                tally.decided_s.push(after_s);
            }
        }
        tally.decided_s.sort_by(f64::total_cmp);
        Ok(tally)
    }
}

/// Returns the classification, and the time until the decision, s.
fn approach(sonar_kind: &Sonar, is_passage: bool, seed: u64) -> Result<(SurfaceState, f64), String> {
    let rng = &mut stream(seed, "passage");
    let width_m = rng.random_range(0.5..1.2);
    let world = World::from_toml(&world(rng, is_passage, width_m)).map_err(|e| e.to_string())?;
    let scene = Scene::new(&world, seed).map_err(|e| e.to_string())?;
    let sonar = SonarConfig {
        noise_m: sonar_kind.noise_m,
        dropout: sonar_kind.dropout,
        max_m: MAX_RANGE_M,
        x_m: 0.0,
        ..SonarConfig::default()
    };
    let rule = SurfaceCheckRule {
        min_beyond: sonar_kind.min_beyond,
        farthest_m: MAX_RANGE_M,
        beam_half_angle_rad: 0.5 * sonar.cone_deg.to_radians(),
        ..SurfaceCheckRule::default()
    };
    let mut known = |y: f64| {
        let mut error = || rng.sample::<f64, _>(StandardNormal) * EDGE_SIGMA_M;
        nalgebra::Point2::new(error(), y + error())
    };
    let mut check = SurfaceCheck::new([known(-0.5 * width_m), known(0.5 * width_m)], rule);
    let fits_m = (width_m - rule.beam_spare_m) / (2.0 * rule.beam_half_angle_rad.tan());
    let mut distance_m = fits_m * rng.random_range(0.7..1.0);
    let aside_m = rng.random_range(-0.05..0.05);
    let heading_rad = rng.random_range(-4.0_f64..4.0).to_radians();
    let noise = &mut stream(seed, "sonar");
    let mut time_s = 0.0;
    while check.state() == SurfaceState::Unknown && distance_m > MIN_DISTANCE_M {
        let sensor = Pose2::new(-distance_m, aside_m, heading_rad);
        let range_m = measure_range(&sonar, 0.0, &scene, scene.people(), &sensor, noise);
        check.update(&RangeReading { sensor, range_m, sigma_m: EDGE_SIGMA_M + sonar_kind.noise_m });
        distance_m -= SPEED_MPS * PERIOD_S;
        time_s += PERIOD_S;
    }
    Ok((check.state(), time_s))
}

/// Returns a world with two boxes whose fronts are at x = 0, an optional wall behind them and an optional panel between them.
fn world(rng: &mut Pcg64, is_passage: bool, width_m: f64) -> String {
    let item = |x_m: f64, y_m: f64, deep_m: f64, wide_m: f64| {
        format!(
            "[[box]]\nat_m = [{:.4}, {y_m:.4}]\nsize_m = [{deep_m:.4}, {wide_m:.4}, 1.0]\n",
            x_m + 0.5 * deep_m
        )
    };
    let mut text = String::new();
    for side in [-1.0, 1.0] {
        let (deep_m, wide_m) = (rng.random_range(0.1..0.6), rng.random_range(0.3..1.0));
        text += &item(0.0, side * 0.5 * (width_m + wide_m), deep_m, wide_m);
    }
    let behind_m = rng.random_range(0.6..3.0);
    if rng.random_bool(0.7) {
        text += &format!("[[wall]]\nfrom_m = [{behind_m:.4}, -4.0]\nto_m = [{behind_m:.4}, 4.0]\n");
    }
    let recess_m = rng.random_range(-0.02..0.03);
    if !is_passage {
        text += &item(recess_m, 0.0, 0.05, width_m);
    }
    text
}
