//! Planar poses and transforms.

use std::ops::Mul;

use bytemuck::{Pod, Zeroable};
use nalgebra::{Matrix3, Point2, Vector2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Hypotenuse;
use crate::{Twist, wrap_angle};

/// A planar pose: position and heading of frame b in frame a, which is also the transform `a_from_b`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema, Pod, Zeroable)]
#[serde(deny_unknown_fields)]
pub struct Pose2 {
    /// Position along x of the outer frame, m.
    pub x: f64,
    /// Position along y of the outer frame, m, positive to the left.
    pub y: f64,
    /// Heading in the outer frame, rad, positive to the left.
    pub theta: f64,
}

impl Pose2 {
    /// The identity transform.
    pub const IDENTITY: Self = Self { x: 0.0, y: 0.0, theta: 0.0 };

    /// Creates a pose from a position (m) and a heading (rad, wrapped to (-pi, pi]).
    #[must_use]
    pub fn new(x: f64, y: f64, theta: f64) -> Self {
        Self { x, y, theta: wrap_angle(theta) }
    }

    /// Composes `self` = `a_from_b` with `b_from_c` and returns `a_from_c`.
    #[must_use]
    pub fn compose(&self, b_from_c: &Self) -> Self {
        let p = self.transform_point(Point2::new(b_from_c.x, b_from_c.y));
        Self::new(p.x, p.y, self.theta + b_from_c.theta)
    }

    /// Returns `b_from_a` of `self` = `a_from_b`.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let (sin, cos) = self.theta.sin_cos();
        Self::new(-cos * self.x - sin * self.y, sin * self.x - cos * self.y, -self.theta)
    }

    /// Returns the pose `other`, given in the same outer frame, relative to `self`: `self.inverse() * other`.
    #[must_use]
    pub fn relative(&self, other: &Self) -> Self {
        self.inverse().compose(other)
    }

    /// Transforms a point from this pose's frame to the outer frame.
    #[must_use]
    pub fn transform_point(&self, point_in_b: Point2<f64>) -> Point2<f64> {
        let (sin, cos) = self.theta.sin_cos();
        Point2::new(
            self.x + cos * point_in_b.x - sin * point_in_b.y,
            self.y + sin * point_in_b.x + cos * point_in_b.y,
        )
    }

    /// Rotates a vector from this pose's frame to the outer frame, without translation.
    #[must_use]
    pub fn rotate_vector(&self, vector_in_b: Vector2<f64>) -> Vector2<f64> {
        let (sin, cos) = self.theta.sin_cos();
        Vector2::new(cos * vector_in_b.x - sin * vector_in_b.y, sin * vector_in_b.x + cos * vector_in_b.y)
    }

    /// Returns the position in the outer frame, m.
    #[must_use]
    pub fn position(&self) -> Point2<f64> {
        Point2::new(self.x, self.y)
    }

    /// Returns the distance between the two positions, m.
    #[must_use]
    pub fn distance(&self, other: &Self) -> f64 {
        (self.x - other.x).hypotenuse(self.y - other.y)
    }

    /// Returns the pose after moving with the constant twist for `duration_s`, which may be negative: an exact arc.
    #[must_use]
    pub fn integrate(&self, twist: &Twist, duration_s: f64) -> Self {
        self.compose(&twist.exponential(duration_s))
    }

    /// Returns the homogeneous 3x3 matrix of this transform, which acts on (x, y, 1).
    #[must_use]
    pub fn matrix(&self) -> Matrix3<f64> {
        let (sin, cos) = self.theta.sin_cos();
        Matrix3::new(cos, -sin, self.x, sin, cos, self.y, 0.0, 0.0, 1.0)
    }

    /// Returns true if all numbers are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.x.is_finite() && self.y.is_finite() && self.theta.is_finite()
    }
}

impl Mul for Pose2 {
    type Output = Self;

    fn mul(self, b_from_c: Self) -> Self {
        self.compose(&b_from_c)
    }
}
