//! Wheel encoders and their dead reckoning.

use nalgebra::{Matrix3, SMatrix, Vector3};
use rand::RngExt;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;
use schemars::JsonSchema;
use serde::Deserialize;
use smart_default::SmartDefault;
use yamabico_core::geometry::{Hypotenuse, Pose2, Twist};

/// Parameters of wheel encoders.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct EncoderConfig {
    /// Period of the readings.
    #[default(20.0)]
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub period_ms: f64,
    /// Delay from a reading to its delivery.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub latency_ms: f64,
    /// Arrangement of the wheels. Without it: three for a drive that moves sideways, else two.
    pub wheels: Option<Wheels>,
    /// Distance between two wheels, or twice the distance of three wheels from the center.
    #[default(0.36)]
    #[schemars(range(min = 0.05, max = 2.0))]
    pub track_m: f64,
    /// Encoder ticks per meter of a wheel's travel.
    #[default(5000.0)]
    #[schemars(range(min = 10.0, max = 1e6))]
    pub ticks_per_m: f64,
    /// Maximum relative error of a wheel's radius; the seed draws one per wheel.
    #[default(0.005)]
    #[schemars(range(min = 0.0, max = 0.2))]
    pub scale_error: f64,
    /// Standard deviation of a wheel's slip after one meter; grows with the square root of the travel.
    #[default(0.005)]
    #[schemars(range(min = 0.0, max = 0.2))]
    pub slip_m: f64,
    /// Variance of the distance per distance driven, m²/m.
    #[default(1e-4)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub k_ss: f64,
    /// Variance of the heading per angle turned, rad²/rad.
    #[default(1e-3)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub k_tt: f64,
    /// Variance of the heading per distance driven, rad²/m.
    #[default(2e-4)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub k_ts: f64,
}

/// Arrangement of the wheels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Wheels {
    /// Two, left and right.
    #[default]
    Two,
    /// Three omnidirectional ones, 120 degrees apart.
    Three,
}

/// Dead reckoning from wheel encoders.
///
/// Noise model: midpoint motion, M = diag(k_ss |ds|, k_tt |dtheta| + k_ts |ds|).
#[derive(Clone, Debug)]
pub struct Odometer {
    /// Pose estimate in the odometry frame.
    pub pose: Pose2,
    /// Mean twist during the last reading, body frame.
    pub twist: Twist,
    /// Covariance of the pose (x, y, theta): m^2, rad^2.
    pub covariance: Matrix3<f64>,
    config: EncoderConfig,
    rng: Pcg64,
    scale: [f64; 3],
    travel_ticks: [f64; 3],
    counts: [f64; 3],
}

impl Odometer {
    /// Returns an odometer at the origin, with wheel errors from `rng`.
    #[must_use]
    pub fn new(config: EncoderConfig, mut rng: Pcg64) -> Self {
        let scale = std::array::from_fn(|_| 1.0 + config.scale_error * rng.random_range(-1.0..=1.0));
        Self {
            pose: Pose2::IDENTITY,
            twist: Twist::ZERO,
            covariance: Matrix3::zeros(),
            config,
            rng,
            scale,
            travel_ticks: [0.0; 3],
            counts: [0.0; 3],
        }
    }

    /// Measures the true motion `before_from_now` of the last `dt` seconds (> 0) and integrates it.
    pub fn integrate(&mut self, before_from_now: &Pose2, dt: f64) {
        let arc = Twist::logarithm(before_from_now, dt);
        let motion = Vector3::new(arc.linear * dt, arc.lateral * dt, arc.angular * dt);
        let wheels = self.wheel_from_motion() * motion;
        let mut measured = Vector3::zeros();
        for i in 0..3 {
            let slip: f64 = self.rng.sample(StandardNormal);
            let travel = wheels[i] * self.scale[i] + self.config.slip_m * wheels[i].abs().sqrt() * slip;
            self.travel_ticks[i] += travel * self.config.ticks_per_m;
            let count = self.travel_ticks[i].floor();
            measured[i] = (count - self.counts[i]) / self.config.ticks_per_m;
            self.counts[i] = count;
        }
        let d = self.motion_from_wheel() * measured;
        self.twist = Twist::new(d.x / dt, d.y / dt, d.z / dt);
        self.propagate(d);
        self.pose = self.pose.integrate(&self.twist, dt);
    }

    fn propagate(&mut self, d: Vector3<f64>) {
        let distance = d.x.hypotenuse(d.y);
        let (sin, cos) = (self.pose.theta + d.z / 2.0 + d.y.atan2(d.x)).sin_cos();
        let f = Matrix3::new(1.0, 0.0, -distance * sin, 0.0, 1.0, distance * cos, 0.0, 0.0, 1.0);
        let g = SMatrix::<f64, 3, 2>::new(cos, -distance / 2.0 * sin, sin, distance / 2.0 * cos, 0.0, 1.0);
        let k = &self.config;
        let heading = k.k_tt * d.z.abs() + k.k_ts * distance;
        let m = SMatrix::<f64, 2, 2>::new(k.k_ss * distance, 0.0, 0.0, heading);
        self.covariance = f * self.covariance * f.transpose() + g * m * g.transpose();
    }

    /// Returns the matrix from a motion (forward, left, turn) to the travel of each wheel; two wheels leave the third row 0.
    fn wheel_from_motion(&self) -> Matrix3<f64> {
        let b = self.config.track_m / 2.0;
        match self.config.wheels.unwrap_or_default() {
            Wheels::Two => Matrix3::new(1.0, 0.0, -b, 1.0, 0.0, b, 0.0, 0.0, 0.0),
            Wheels::Three => {
                let [p, q, r] = [60.0_f64, 180.0, 300.0].map(|a| a.to_radians().sin_cos());
                Matrix3::new(-p.0, p.1, b, -q.0, q.1, b, -r.0, r.1, b)
            }
        }
    }

    fn motion_from_wheel(&self) -> Matrix3<f64> {
        let b = self.config.track_m / 2.0;
        match self.config.wheels.unwrap_or_default() {
            Wheels::Two => Matrix3::new(0.5, 0.5, 0.0, 0.0, 0.0, 0.0, -0.5 / b, 0.5 / b, 0.0),
            Wheels::Three => {
                let two_thirds = 2.0 / 3.0;
                let mut back = self.wheel_from_motion().transpose() * two_thirds;
                back.set_row(2, &(Vector3::repeat(1.0 / (3.0 * b)).transpose()));
                back
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    fn perfect(wheels: Wheels) -> Odometer {
        let config = EncoderConfig {
            wheels: Some(wheels),
            scale_error: 0.0,
            slip_m: 0.0,
            ticks_per_m: 1e6,
            ..EncoderConfig::default()
        };
        Odometer::new(config, stream(1, "wheels"))
    }

    #[test]
    fn perfect_wheels_follow_an_arc() {
        for (wheels, lateral) in [(Wheels::Two, 0.0), (Wheels::Three, 0.2)] {
            let mut odometer = perfect(wheels);
            let twist = Twist::new(0.4, lateral, 0.3);
            (0..200).for_each(|_| odometer.integrate(&twist.exponential(0.02), 0.02));
            let truth = twist.exponential(4.0);
            assert!(odometer.pose.distance(&truth) < 1e-3, "{:?} {truth:?}", odometer.pose);
            assert!((odometer.pose.theta - truth.theta).abs() < 1e-3);
        }
    }

    #[test]
    fn coarse_encoders_quantize_without_losing_steps() {
        let config =
            EncoderConfig { scale_error: 0.0, slip_m: 0.0, ticks_per_m: 100.0, ..EncoderConfig::default() };
        let mut odometer = Odometer::new(config, stream(1, "wheels"));
        let twist = Twist::new(0.123, 0.0, 0.0);
        (0..1000).for_each(|_| odometer.integrate(&twist.exponential(0.02), 0.02));
        assert!((odometer.pose.x - 2.46).abs() <= 0.01 + 1e-9, "{}", odometer.pose.x);
        assert!((odometer.pose.x * 100.0 - (odometer.pose.x * 100.0).round()).abs() < 1e-6);
    }

    #[test]
    fn errors_agree_with_the_covariance() {
        let mut inside = 0;
        for seed in 0..200 {
            let config = EncoderConfig { scale_error: 0.0, ..EncoderConfig::default() };
            let mut odometer = Odometer::new(config, stream(seed, "wheels"));
            let twist = Twist::new(0.4, 0.0, 0.0);
            (0..500).for_each(|_| odometer.integrate(&twist.exponential(0.02), 0.02));
            let sigma = odometer.covariance[(0, 0)].sqrt();
            assert!(
                (0.0199..0.025).contains(&sigma),
                "4 m of k_ss = 1e-4, and a small contribution of the heading: {sigma}"
            );
            inside += usize::from((odometer.pose.x - 4.0).abs() < 2.0 * sigma);
        }
        assert!(inside > 190, "{inside} of 200");
    }
}
