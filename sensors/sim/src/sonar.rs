//! Sonars: cones of rays, of which the nearest that sends an echo back counts.

use nalgebra::Vector3;
use parry3d::math::{Pose, Vector};
use parry3d::query::{Ray, RayCast};
use parry3d::shape::Capsule;
use rand::RngExt;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;
use schemars::JsonSchema;
use serde::Deserialize;
use yamabico_core::geometry::Pose2;

use crate::scene::{Place, Scene, glam};

/// Radius in meters of what a person echoes with.
const PERSON_ECHO_M: f64 = 0.18;

/// A row of sonars and how good they are.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SonarConfig {
    /// Time from one scan to the next, ms, 5 to 1000.
    #[schemars(range(min = 5.0, max = 1000.0))]
    pub period_ms: f64,
    /// Time from a scan to its arrival, ms, 0 to 1000.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub latency_ms: f64,
    /// Directions of the sonars in the robot frame, degrees, + to the left, -180 to 180.
    pub azimuths_deg: Vec<f64>,
    /// Full opening angle of each, degrees, 1 to 90.
    #[schemars(range(min = 1.0, max = 90.0))]
    pub cone_deg: f64,
    /// Position in the robot frame, forward, meters.
    #[schemars(range(min = -5.0, max = 5.0))]
    pub x_m: f64,
    /// Position in the robot frame, left, meters.
    #[schemars(range(min = -5.0, max = 5.0))]
    pub y_m: f64,
    /// Height above the floor, meters, 0.02 to 3.
    #[schemars(range(min = 0.02, max = 3.0))]
    pub z_m: f64,
    /// Nearest range, meters, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_m: f64,
    /// Range gate: what is farther is not reported, meters, 0.1 to 20.
    #[schemars(range(min = 0.1, max = 20.0))]
    pub max_m: f64,
    /// Rays across the cone, 1 to 31; about three quarters of their square are cast.
    #[schemars(range(min = 1, max = 31))]
    pub rays: u32,
    /// A smooth surface sends no echo back when it is met more obliquely than this, degrees, 0 to 90.
    #[schemars(range(min = 0.0, max = 90.0))]
    pub specular_deg: f64,
    /// Share of the readings that are lost, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub dropout: f64,
    /// Standard deviation of the range, meters, 0 to 0.2.
    #[schemars(range(min = 0.0, max = 0.2))]
    pub noise_m: f64,
}

impl Default for SonarConfig {
    fn default() -> Self {
        Self {
            period_ms: 50.0,
            latency_ms: 10.0,
            azimuths_deg: vec![20.0, 0.0, -20.0],
            cone_deg: 25.0,
            x_m: 0.2,
            y_m: 0.0,
            z_m: 0.3,
            min_m: 0.03,
            max_m: 2.0,
            rays: 7,
            specular_deg: 25.0,
            dropout: 0.02,
            noise_m: 0.005,
        }
    }
}

/// The range in meters that the sonar at `azimuth_rad` reads from `robot`, or none: too far, lost, or mirrored away.
pub fn reading(
    config: &SonarConfig,
    azimuth_rad: f64,
    scene: &Scene,
    people: &[Place],
    robot: &Pose2,
    rng: &mut Pcg64,
) -> Option<f64> {
    // Both numbers are drawn at every reading, so that what is seen does not move the stream.
    let lost = rng.random::<f64>() < config.dropout;
    let noise: f64 = rng.sample(StandardNormal);
    let range = nearest_echo(config, azimuth_rad, scene, people, robot)? + config.noise_m * noise;
    (!lost && range <= config.max_m).then_some(range.max(config.min_m))
}

/// The nearest echo in the cone without noise, meters.
fn nearest_echo(
    config: &SonarConfig,
    azimuth_rad: f64,
    scene: &Scene,
    people: &[Place],
    robot: &Pose2,
) -> Option<f64> {
    let at = robot.transform_point(nalgebra::Point2::new(config.x_m, config.y_m));
    let origin = Vector3::new(at.x, at.y, config.z_m);
    let half = config.cone_deg.to_radians() / 2.0;
    let n = config.rays.max(1);
    let tilt = |i: u32| if n == 1 { 0.0 } else { half * (2.0 * f64::from(i) / f64::from(n - 1) - 1.0) };
    let mut nearest: Option<f64> = None;
    for i in 0..n * n {
        let (across, up) = (tilt(i % n), tilt(i / n));
        if across.hypot(up) > half * 1.0001 {
            continue;
        }
        let (sin, cos) = (robot.theta + azimuth_rad + across).sin_cos();
        let direction = Vector3::new(cos * up.cos(), sin * up.cos(), up.sin());
        let reach = nearest.unwrap_or(config.max_m + 0.2);
        if let Some(range) = echo(scene, people, origin, direction, reach, config.specular_deg.to_radians()) {
            nearest = Some(range);
        }
    }
    nearest
}

/// The distance of what the ray meets first, if that is within `reach` and sends sound back.
fn echo(
    scene: &Scene,
    people: &[Place],
    origin: Vector3<f64>,
    direction: Vector3<f64>,
    reach: f64,
    specular_rad: f64,
) -> Option<f64> {
    let ray = Ray::new(glam(origin), glam(direction));
    let wall = scene.building().cast_local_ray_and_get_normal(&ray, reach as f32, false);
    let reach = wall.map_or(reach, |w| f64::from(w.time_of_impact));
    let person = people
        .iter()
        .zip(scene.walkers())
        .filter_map(|(place, walker)| {
            let r = PERSON_ECHO_M as f32;
            let top = walker.person.height_m as f32 - r;
            let body = Capsule::new(Vector::new(0.0, 0.0, r), Vector::new(0.0, 0.0, top), r);
            let pose = Pose::translation(place.at[0] as f32, place.at[1] as f32, 0.0);
            body.cast_ray(&pose, &ray, reach as f32, false).map(f64::from)
        })
        .min_by(f64::total_cmp);
    if person.is_some() {
        return person;
    }
    let wall = wall?;
    let obliqueness = wall.normal.dot(glam(direction)).abs().clamp(0.0, 1.0).acos();
    (f64::from(obliqueness) <= specular_rad).then_some(f64::from(wall.time_of_impact))
}
