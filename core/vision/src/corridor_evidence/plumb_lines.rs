//! Roll and horizon from the nearly vertical segments of one image.
//!
//! Plumb lines give the camera's tilt, not its principal row: in a cropped frame they do not determine the row of the horizon.

use super::picture::Picture;
use super::scene_lines::{MIN_LENGTH_PX, RESERVED};
use crate::vanishing_point::VotingLine;
use nalgebra::{Matrix2, Vector2};
use yamabico_geometry::camera::Calibration;

/// Maximum angle of a plumb line from the vertical, rad.
const HALF_ANGLE_RAD: f64 = 20.0 * std::f64::consts::PI / 180.0;
/// Scale of the robust weights, and gate of the inliers, rad.
const KERNEL_RAD: f64 = 1.5 * std::f64::consts::PI / 180.0;
/// Standard deviation of a plumb line's direction, rad.
const SIGMA_RAD: f64 = 1.0 * std::f64::consts::PI / 180.0;
/// Standard deviations of a (roll) and b (tilt) before any line is seen, rad.
const PRIOR_SIGMA_RAD: [f64; 2] = [15.0 * std::f64::consts::PI / 180.0, 25.0 * std::f64::consts::PI / 180.0];
/// Number of iterations.
const ROUNDS: usize = 10;
/// Length at which a line has its full weight, px.
const FULL_LENGTH_PX: f64 = 200.0;
/// Standard deviation of a measured principal row, px.
const CENTER_SIGMA_PX: f64 = 3.0;
/// Standard deviation of a guessed principal row, heights of the image.
const CENTER_SIGMA_HEIGHTS: f64 = 0.35;

/// Minimum number of plumb lines, and maximum standard deviation of their roll (rad), for the roll to classify segments.
const MIN_LINES: usize = 6;
const MAX_ROLL_SIGMA_RAD: f64 = 0.035;
/// Minimum roll that is corrected for when segments are classified, rad; the classes are 10 degrees wide.
const MIN_ROLL_RAD: f64 = 5.0 * std::f64::consts::PI / 180.0;

/// Direction of gravity in the camera, from plumb lines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlumbHorizon {
    /// Lateral component of gravity over its downward one: the tangent of the roll.
    pub a: f64,
    /// Forward component of gravity over its downward one: the tangent of the tilt.
    pub b: f64,
    /// Covariance of (a, b).
    pub covariance: Matrix2<f64>,
    /// Number of segments that agree.
    pub inliers: usize,
}

impl PlumbHorizon {
    /// Slope of plumb lines in the image, du/dv, rad.
    #[must_use]
    pub fn roll(&self) -> f64 {
        self.a.atan()
    }

    /// Returns the roll, if it is known well enough and large enough to classify segments by.
    #[must_use]
    pub fn known_roll(&self) -> Option<f64> {
        let is_known = self.inliers >= MIN_LINES && self.covariance.m11.sqrt() <= MAX_ROLL_SIGMA_RAD;
        is_known.then(|| self.roll()).filter(|roll| roll.abs() >= MIN_ROLL_RAD)
    }

    /// Row of the horizon at the principal column, px.
    #[must_use]
    pub fn row(&self, picture: &Picture) -> f64 {
        picture.center.y - picture.focal * self.b
    }

    /// Variance of that row, px^2.
    #[must_use]
    pub fn row_variance(&self, picture: &Picture, calibration: Calibration) -> f64 {
        let center = match calibration {
            Calibration::Measured => CENTER_SIGMA_PX,
            Calibration::Guessed => CENTER_SIGMA_HEIGHTS * picture.height,
        };
        picture.focal * picture.focal * self.covariance.m22 + center * center
    }
}

/// Slope of a nearly vertical segment, with its place in normalized coordinates.
#[derive(Clone, Copy, Debug)]
struct PlumbLine {
    slope: f64,
    at: Vector2<f64>,
    weight: f64,
}

impl PlumbLine {
    /// Row of the linear system for (a, b).
    fn row(&self) -> Vector2<f64> {
        Vector2::new(1.0, self.slope * self.at.y - self.at.x)
    }
}

/// Estimates roll and tilt. Reuses its buffer.
#[derive(Clone, Debug, Default)]
pub struct PlumbLineFit {
    lines: Vec<PlumbLine>,
}

impl PlumbLineFit {
    /// Fits the direction of gravity to the nearly vertical ones of `lines`; `None` with fewer than three.
    pub fn fit(&mut self, lines: &[VotingLine], picture: &Picture) -> Option<PlumbHorizon> {
        self.lines.clear();
        self.lines.reserve(RESERVED);
        self.lines.extend(lines.iter().filter_map(|line| plumb_line(line, picture)));
        if self.lines.len() < 3 {
            return None;
        }
        let prior = Matrix2::from_diagonal(&Vector2::from(PRIOR_SIGMA_RAD).map(|sigma| sigma.powi(-2)));
        let mut state = Vector2::new(self.middle_slope(), 0.0);
        let mut normal = prior;
        for _ in 0..ROUNDS {
            normal = prior;
            let mut right = Vector2::zeros();
            for line in &self.lines {
                let row = line.row();
                let residual = (line.slope - row.dot(&state)) / KERNEL_RAD;
                let weight = line.weight / (1.0 + residual * residual).powi(2) / (SIGMA_RAD * SIGMA_RAD);
                normal += row * row.transpose() * weight;
                right += row * (weight * line.slope);
            }
            state = normal.try_inverse()? * right;
        }
        let agrees = |line: &&PlumbLine| (line.slope - line.row().dot(&state)).abs() <= KERNEL_RAD;
        Some(PlumbHorizon {
            a: state.x,
            b: state.y,
            covariance: normal.try_inverse()?,
            inliers: self.lines.iter().filter(agrees).count(),
        })
    }

    /// Weighted median of the slopes. Leaves the lines sorted by slope.
    fn middle_slope(&mut self) -> f64 {
        self.lines.sort_unstable_by(|a, b| a.slope.total_cmp(&b.slope));
        let half = 0.5 * self.lines.iter().map(|line| line.weight).sum::<f64>();
        let mut sum = 0.0;
        for line in &self.lines {
            sum += line.weight;
            if sum >= half {
                return line.slope;
            }
        }
        0.0
    }
}

fn plumb_line(line: &VotingLine, picture: &Picture) -> Option<PlumbLine> {
    let direction = line.direction();
    let slope = direction.x / direction.y;
    let is_plumb = line.length >= MIN_LENGTH_PX && slope.is_finite() && slope.atan().abs() <= HALF_ANGLE_RAD;
    is_plumb.then(|| PlumbLine {
        slope,
        at: (line.midpoint - picture.center) / picture.focal,
        weight: (line.length.min(FULL_LENGTH_PX) / FULL_LENGTH_PX).powi(2),
    })
}
