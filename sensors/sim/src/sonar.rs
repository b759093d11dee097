//! Sonar model: a cone of rays, of which the nearest echo counts.

use nalgebra::Vector3;
use parry3d::math::{Pose, Vector};
use parry3d::query::{Ray, RayCast};
use parry3d::shape::Capsule;
use rand::RngExt;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;
use schemars::JsonSchema;
use serde::Deserialize;
use smart_default::SmartDefault;
use yamabico_core::geometry::{Hypotenuse, Pose2};

use crate::scene::{PersonPose, Scene, glam};

/// Radius of the capsule that reflects sound for a person, m.
const PERSON_ECHO_M: f64 = 0.18;

/// Parameters of a row of sonars.
#[derive(Clone, Debug, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct SonarConfig {
    /// Period of the scans.
    #[default(50.0)]
    #[schemars(range(min = 5.0, max = 1000.0))]
    pub period_ms: f64,
    /// Delay from a scan to its delivery.
    #[default(10.0)]
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub latency_ms: f64,
    /// Directions of the sonars in the robot frame, positive to the left.
    #[default(_code = "vec![20.0, 0.0, -20.0]")]
    pub azimuths_deg: Vec<f64>,
    /// Full opening angle of each cone.
    #[default(25.0)]
    #[schemars(range(min = 1.0, max = 90.0))]
    pub cone_deg: f64,
    /// Position forward of the robot's center.
    #[default(0.2)]
    #[schemars(range(min = -5.0, max = 5.0))]
    pub x_m: f64,
    /// Position left of the robot's center.
    #[schemars(range(min = -5.0, max = 5.0))]
    pub y_m: f64,
    /// Height above the floor.
    #[default(0.3)]
    #[schemars(range(min = 0.02, max = 3.0))]
    pub z_m: f64,
    /// Minimum range; nearer echoes are reported at this range.
    #[default(0.03)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_m: f64,
    /// Maximum range; farther echoes are not reported.
    #[default(2.0)]
    #[schemars(range(min = 0.1, max = 20.0))]
    pub max_m: f64,
    /// Number of rays across the cone; about three quarters of its square are cast.
    #[default(7)]
    #[schemars(range(min = 1, max = 31))]
    pub rays: u32,
    /// Maximum angle of incidence at which a smooth surface returns an echo.
    #[default(25.0)]
    #[schemars(range(min = 0.0, max = 90.0))]
    pub specular_deg: f64,
    /// Fraction of readings that are lost.
    #[default(0.02)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub dropout: f64,
    /// Standard deviation of the range.
    #[default(0.005)]
    #[schemars(range(min = 0.0, max = 0.2))]
    pub noise_m: f64,
}

/// Returns the range that the sonar at `azimuth_rad` measures for this robot pose, m; `None` if there is no echo: out of
/// range, lost, or reflected away.
pub fn measure_range(
    config: &SonarConfig,
    azimuth_rad: f64,
    scene: &Scene,
    people: &[PersonPose],
    robot: &Pose2,
    rng: &mut Pcg64,
) -> Option<f64> {
    // Every reading draws both numbers, so that the random stream does not depend on the scene.
    let lost = rng.random::<f64>() < config.dropout;
    let noise: f64 = rng.sample(StandardNormal);
    let range = nearest_echo(config, azimuth_rad, scene, people, robot)? + config.noise_m * noise;
    (!lost && range <= config.max_m).then_some(range.max(config.min_m))
}

/// Returns the range of the nearest echo in the cone without noise, m.
fn nearest_echo(
    config: &SonarConfig,
    azimuth_rad: f64,
    scene: &Scene,
    people: &[PersonPose],
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
        if across.hypotenuse(up) > half * 1.0001 {
            continue;
        }
        let (sin, cos) = (robot.theta + azimuth_rad + across).sin_cos();
        let direction = Vector3::new(cos * up.cos(), sin * up.cos(), up.sin());
        let reach = nearest.unwrap_or(config.max_m + 0.2);
        if let Some(range) =
            first_hit(scene, people, origin, direction, reach, config.specular_deg.to_radians())
        {
            nearest = Some(range);
        }
    }
    nearest
}

/// Returns the distance of the first hit of a ray (m), if it is within `reach` (m) and its angle of incidence is at most
/// `specular_rad`.
pub(crate) fn first_hit(
    scene: &Scene,
    people: &[PersonPose],
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
        .filter_map(|(pose, walker)| {
            let r = PERSON_ECHO_M as f32;
            let top = walker.person.height_m as f32 - r;
            let body = Capsule::new(Vector::new(0.0, 0.0, r), Vector::new(0.0, 0.0, top), r);
            let pose = Pose::translation(pose.at[0] as f32, pose.at[1] as f32, 0.0);
            body.cast_ray(&pose, &ray, reach as f32, false).map(f64::from)
        })
        .min_by(f64::total_cmp);
    if person.is_some() {
        return person;
    }
    let wall = wall?;
    let obliqueness = f64::from(wall.normal.dot(glam(direction)).abs()).min(1.0).acos();
    (obliqueness <= specular_rad).then_some(f64::from(wall.time_of_impact))
}
