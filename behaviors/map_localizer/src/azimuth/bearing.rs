use nalgebra::{Point2, RowVector3, Vector2};
use yamabico_core::geometry::{Pose2, wrap_angle};
use yamabico_vision::azimuth_profile::EdgeSign;

/// Vertical edge of the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgeLandmark {
    /// Position in the map frame, m.
    pub position: Point2<f64>,
    /// Sign of the brightness step across the edge; `None` if unknown.
    pub sign: Option<EdgeSign>,
    /// Standard deviation of the position along each axis, m.
    pub sigma_m: f64,
}

/// Vertical edge observed in an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeenBearing {
    /// Azimuth in the sensor frame, rad; its x axis is parallel to the robot's.
    pub azimuth_rad: f64,
    /// Sign of the brightness step across the edge; `None` if unknown.
    pub sign: Option<EdgeSign>,
    /// Standard deviation of the azimuth, > 0, rad.
    pub sigma_rad: f64,
}

/// Position of the sensor's axis in the robot frame, m.
pub type LeverArm = Vector2<f64>;

/// Predicted azimuth of a map edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BearingPrediction {
    /// Azimuth in the sensor frame, rad.
    pub azimuth_rad: f64,
    /// Derivatives of the azimuth with respect to the robot's x, y and heading.
    pub jacobian: RowVector3<f64>,
    /// Variance of the azimuth due to the landmark's uncertainty, rad².
    pub landmark_variance: f64,
    /// Distance from the sensor, m.
    pub distance_m: f64,
}

/// Predicts the azimuth of a map edge from a pose of the robot in the map frame. The derivatives are not finite at zero
/// distance.
#[inline]
#[must_use]
pub fn predict(landmark: &EdgeLandmark, map_from_robot: &Pose2, lever: LeverArm) -> BearingPrediction {
    let (sin, cos) = map_from_robot.theta.sin_cos();
    predict_from(landmark, map_from_robot, [sin, cos], lever)
}

/// Like [`predict`], but with the sine and cosine of the heading given.
#[inline]
pub(super) fn predict_from(
    landmark: &EdgeLandmark,
    map_from_robot: &Pose2,
    [sin, cos]: [f64; 2],
    lever: LeverArm,
) -> BearingPrediction {
    let arm = Vector2::new(cos * lever.x - sin * lever.y, sin * lever.x + cos * lever.y);
    let away = landmark.position - map_from_robot.position() - arm;
    let squared = away.norm_squared();
    // Turning moves the sensor along (-arm.y, arm.x).
    let swing = (away.x * -arm.x - away.y * arm.y) / squared;
    BearingPrediction {
        azimuth_rad: wrap_angle(away.y.atan2(away.x) - map_from_robot.theta),
        jacobian: RowVector3::new(away.y / squared, -away.x / squared, swing - 1.0),
        landmark_variance: landmark.sigma_m * landmark.sigma_m / squared,
        distance_m: squared.sqrt(),
    }
}

/// Returns true unless the signs of the two edges are known and differ.
#[inline]
#[must_use]
pub fn may_match(landmark: Option<EdgeSign>, seen: Option<EdgeSign>) -> bool {
    match (landmark, seen) {
        (Some(landmark), Some(seen)) => landmark == seen,
        _ => true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::geometry::angle_difference;

    #[test]
    fn derivatives_match_finite_differences() {
        let landmark = EdgeLandmark { position: Point2::new(2.0, -1.0), sign: None, sigma_m: 0.02 };
        let lever = LeverArm::new(0.12, -0.07);
        let pose = Pose2::new(0.4, 0.3, 0.9);
        let found = predict(&landmark, &pose, lever);
        let h = 1e-6;
        for axis in 0..3 {
            let moved = |by: f64| {
                let mut p = [pose.x, pose.y, pose.theta];
                p[axis] += by;
                predict(&landmark, &Pose2 { x: p[0], y: p[1], theta: p[2] }, lever).azimuth_rad
            };
            let slope = angle_difference(moved(h), moved(-h)) / (2.0 * h);
            assert!((slope - found.jacobian[axis]).abs() < 1e-8, "axis {axis}: {slope}");
        }
    }
}
