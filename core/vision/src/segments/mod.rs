//! Straight edge segments of a gray image.
//!
//! Processing steps: smoothing and Scharr gradient, non-maximum suppression with sub-pixel offset, linking into chains
//! of consistent gradient direction, recursive splitting, total least squares fit, merging of collinear pieces.

mod chains;
mod detector;
mod edges;
mod glare;
mod merge;
mod split;

pub use detector::{SegmentConfig, SegmentDetector, SegmentError};

use nalgebra::Vector2;

/// Brighter side of a segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Polarity {
    /// Brighter where normal . p > rho.
    BrighterAlongNormal,
    /// Brighter where normal . p < rho.
    DarkerAlongNormal,
}

/// Straight edge segment in pixels, u to the right, v down, pixel centers at integers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// First endpoint.
    pub p0: Vector2<f64>,
    /// Second endpoint.
    pub p1: Vector2<f64>,
    /// Unit normal of the line normal . p = rho.
    pub normal: Vector2<f64>,
    /// Signed distance of the line from the origin, px.
    pub rho: f64,
    /// Distance between the endpoints, px.
    pub length: f64,
    /// Standard deviation perpendicular to the line at its middle, px.
    pub sigma_mid: f64,
    /// Standard deviation of the direction, rad.
    pub sigma_angle: f64,
    /// Mean gradient across the edge, in gray levels of a step between two adjacent pixels; never negative.
    pub mean_gradient: f64,
    /// Brighter side.
    pub polarity: Polarity,
}

impl Segment {
    /// Creates the segment between two points with independent noise of `sigma_end_px` and zero gradient. `None` if the
    /// endpoints coincide or are not finite.
    #[must_use]
    pub fn between(p0: Vector2<f64>, p1: Vector2<f64>, sigma_end_px: f64) -> Option<Self> {
        let along = p1 - p0;
        let length = along.norm();
        if !length.is_finite() || length <= 0.0 {
            return None;
        }
        let normal = Vector2::new(-along.y, along.x) / length;
        Some(Self {
            p0,
            p1,
            normal,
            rho: normal.dot(&(0.5 * (p0 + p1))),
            length,
            sigma_mid: sigma_end_px * std::f64::consts::FRAC_1_SQRT_2,
            sigma_angle: sigma_end_px * std::f64::consts::SQRT_2 / length,
            mean_gradient: 0.0,
            polarity: Polarity::BrighterAlongNormal,
        })
    }

    /// Midpoint, px.
    #[must_use]
    pub fn midpoint(&self) -> Vector2<f64> {
        0.5 * (self.p0 + self.p1)
    }

    /// Unit vector from `p0` to `p1`.
    #[must_use]
    pub fn direction(&self) -> Vector2<f64> {
        (self.p1 - self.p0) / self.length
    }

    /// Signed distance of `point` from the infinite line, px, positive along the normal.
    #[must_use]
    pub fn distance(&self, point: Vector2<f64>) -> f64 {
        self.normal.dot(&point) - self.rho
    }
}
