//! Passages and surfaces, and the robot that drives up to them.
//!
//! Two things stand a random width apart, 0.5 to 1.2 m. Between them is nothing, with a wall somewhere behind or none at all, or a
//! panel nearly flush with both. The robot knows the two edges to a few centimeters, has turned to the middle between them to a
//! few degrees, and drives there at 5 cm/s from where the cone of its sonar fits between the edges, or from nearer.

use rand::RngExt;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;
use yamabico_core::geometry::Pose2;
use yamabico_sim::random::stream;
use yamabico_sim::sonar::{SonarConfig, reading};
use yamabico_sim::{Scene, World};
use yamabico_vision::azimuth_map::{RangeReading, SurfaceCheck, SurfaceCheckRule, SurfaceState};

/// A sonar, and how many readings without an echo make a passage.
pub struct Kind {
    /// In words.
    pub name: &'static str,
    noise_m: f64,
    dropout: f64,
    min_beyond: u32,
}

/// As the simulator has it.
pub const CLEAN: Kind =
    Kind { name: "5 mm of noise, 2 % of the echoes lost", noise_m: 0.005, dropout: 0.02, min_beyond: 3 };
/// One that loses so many echoes that more of them make a passage.
pub const POOR: Kind =
    Kind { name: "2 cm of noise, 10 % of the echoes lost", noise_m: 0.02, dropout: 0.1, min_beyond: 5 };

const SPEED_MPS: f64 = 0.05;
const PERIOD_S: f64 = 0.05;
/// The robot comes no nearer than this, m.
const NEAREST_M: f64 = 0.3;
/// How well the edges and the robot's own place are known, m.
const EDGE_SIGMA_M: f64 = 0.015;
/// The farthest that is told, m.
const FARTHEST_M: f64 = 4.0;

/// What was told.
#[derive(Debug, Default)]
pub struct Tally {
    /// Worlds.
    pub cases: u32,
    /// Told as they are.
    pub right: u32,
    /// Not told.
    pub undecided: u32,
    /// Passages taken for surfaces, or for something in front of one.
    pub passages_missed: u32,
    /// Surfaces taken for passages, or for something in front of them.
    pub surfaces_missed: u32,
    decided_s: Vec<f64>,
}

impl Tally {
    /// So many worlds, every other one a passage.
    ///
    /// # Errors
    /// A world that cannot be, which none is.
    pub fn of(kind: &Kind, cases: u32) -> Result<Self, String> {
        let mut tally = Self { cases, ..Self::default() };
        for case in 0..cases {
            let is_passage = case % 2 == 0;
            let (state, after_s) = approach(kind, is_passage, u64::from(case))?;
            match (state, is_passage) {
                (SurfaceState::Unknown, _) => tally.undecided += 1,
                (SurfaceState::Empty, true) | (SurfaceState::Solid, false) => tally.right += 1,
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

    /// The time within which this share of the decisions fell, seconds.
    #[must_use]
    pub fn quantile_s(&self, share: f64) -> f64 {
        let last = self.decided_s.len().saturating_sub(1);
        self.decided_s.get((share * last as f64).round() as usize).copied().unwrap_or(f64::NAN)
    }
}

/// What the robot tells, and after how long, seconds.
fn approach(kind: &Kind, is_passage: bool, seed: u64) -> Result<(SurfaceState, f64), String> {
    let rng = &mut stream(seed, "passage");
    let width_m = rng.random_range(0.5..1.2);
    let world = World::from_toml(&world(rng, is_passage, width_m)).map_err(|e| e.to_string())?;
    let scene = Scene::new(&world, seed).map_err(|e| e.to_string())?;
    let sonar = SonarConfig {
        noise_m: kind.noise_m,
        dropout: kind.dropout,
        max_m: FARTHEST_M,
        x_m: 0.0,
        ..SonarConfig::default()
    };
    let rule = SurfaceCheckRule {
        min_beyond: kind.min_beyond,
        farthest_m: FARTHEST_M,
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
    while check.state() == SurfaceState::Unknown && distance_m > NEAREST_M {
        let sensor = Pose2::new(-distance_m, aside_m, heading_rad);
        let range_m = reading(&sonar, 0.0, &scene, scene.places(), &sensor, noise);
        check.take(&RangeReading { sensor, range_m, sigma_m: EDGE_SIGMA_M + kind.noise_m });
        distance_m -= SPEED_MPS * PERIOD_S;
        time_s += PERIOD_S;
    }
    Ok((check.state(), time_s))
}

/// Two boxes whose fronts are at x = 0, on either side of the middle; behind them a wall, or none; between them a panel, or none.
fn world(rng: &mut Pcg64, is_passage: bool, width_m: f64) -> String {
    let thing = |x_m: f64, y_m: f64, deep_m: f64, wide_m: f64| {
        format!(
            "[[box]]\nat_m = [{:.4}, {y_m:.4}]\nsize_m = [{deep_m:.4}, {wide_m:.4}, 1.0]\n",
            x_m + 0.5 * deep_m
        )
    };
    let mut text = String::new();
    for side in [-1.0, 1.0] {
        let (deep_m, wide_m) = (rng.random_range(0.1..0.6), rng.random_range(0.3..1.0));
        text += &thing(0.0, side * 0.5 * (width_m + wide_m), deep_m, wide_m);
    }
    let behind_m = rng.random_range(0.6..3.0);
    if rng.random_bool(0.7) {
        text += &format!("[[wall]]\nfrom_m = [{behind_m:.4}, -4.0]\nto_m = [{behind_m:.4}, 4.0]\n");
    }
    let recess_m = rng.random_range(-0.02..0.03);
    if !is_passage {
        text += &thing(recess_m, 0.0, 0.05, width_m);
    }
    text
}
