//! Total least squares line fit from moments, which can be merged without the points.

use nalgebra::Vector2;
use yamabico_geometry::Hypotenuse;

/// Lower bound of a fit's root mean square distance, px: quantization limits the accuracy of real edges.
pub const RMS_FLOOR_PX: f64 = 0.1;

/// Count, mean and central second moments of edge points. Additive: two segments can be merged without their points.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    /// Number of points.
    pub count: f64,
    /// Mean of the points, px.
    pub mean: Vector2<f64>,
    /// Sum of (u - mean)^2, px^2.
    pub uu: f64,
    /// Sum of (u - mean)(v - mean), px^2.
    pub uv: f64,
    /// Sum of (v - mean)^2, px^2.
    pub vv: f64,
}

impl Moments {
    /// Computes the moments of `points`, px; all zero without points.
    pub fn of(points: impl Iterator<Item = Vector2<f64>> + Clone) -> Self {
        let mut sum = Vector2::zeros();
        let mut count = 0.0;
        for p in points.clone() {
            sum += p;
            count += 1.0;
        }
        if count == 0.0 {
            return Self::default();
        }
        let mean = sum / count;
        let mut moments = Self { count, mean, ..Self::default() };
        for p in points {
            let d = p - mean;
            moments.uu += d.x * d.x;
            moments.uv += d.x * d.y;
            moments.vv += d.y * d.y;
        }
        moments
    }

    /// Returns the moments of the union of both point sets.
    pub fn merged(&self, other: &Self) -> Self {
        let count = self.count + other.count;
        if count == 0.0 {
            return Self::default();
        }
        let step = other.mean - self.mean;
        let between = self.count * other.count / count;
        Self {
            count,
            mean: self.mean + step * (other.count / count),
            uu: self.uu + other.uu + between * step.x * step.x,
            uv: self.uv + other.uv + between * step.x * step.y,
            vv: self.vv + other.vv + between * step.y * step.y,
        }
    }

    /// Fits the line with the minimum sum of squared perpendicular distances: angle atan2(2 Suv, Suu - Svv) / 2. `None`
    /// for fewer than two points, or for points without a dominant direction.
    pub fn line(&self) -> Option<FittedLine> {
        let anisotropy = (self.uu - self.vv).hypotenuse(2.0 * self.uv);
        let total = self.uu + self.vv;
        if self.count < 2.0 || anisotropy.is_nan() || anisotropy <= 1e-12 * total || total <= 0.0 {
            return None;
        }
        let angle = 0.5 * (2.0 * self.uv).atan2(self.uu - self.vv);
        let (sin, cos) = angle.sin_cos();
        let normal = Vector2::new(-sin, cos);
        let squares_across = (self.uu * sin * sin - 2.0 * self.uv * sin * cos + self.vv * cos * cos).max(0.0);
        let line = FittedLine {
            centroid: self.mean,
            angle,
            direction: Vector2::new(cos, sin),
            normal,
            rho: normal.dot(&self.mean),
            rms: 0.0,
            sigma_mid: 0.0,
            sigma_angle: 0.0,
        };
        Some(line.with_residuals(squares_across, self.count, 0.5 * (total + anisotropy)))
    }
}

/// Infinite line with the statistics of its fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedLine {
    /// Mean of the points, px.
    pub centroid: Vector2<f64>,
    /// Direction angle from u toward v, rad in (-pi/2, pi/2].
    pub angle: f64,
    /// Unit direction (cos, sin) of the angle.
    pub direction: Vector2<f64>,
    /// Unit normal (-sin, cos) of the angle.
    pub normal: Vector2<f64>,
    /// Signed distance from the origin, px: normal . p = rho on the line.
    pub rho: f64,
    /// Root mean square distance of the points, px.
    pub rms: f64,
    /// Standard deviation perpendicular to the line at the centroid, px.
    pub sigma_mid: f64,
    /// Standard deviation of the angle, rad.
    pub sigma_angle: f64,
}

impl FittedLine {
    /// Sets the statistics from the sums of squares across and along the line, px^2.
    fn with_residuals(self, across: f64, count: f64, along: f64) -> Self {
        let rms = (across / count).sqrt();
        let noise = rms.max(RMS_FLOOR_PX);
        Self { rms, sigma_mid: noise / count.sqrt(), sigma_angle: noise / along.sqrt(), ..self }
    }

    /// Position of the projection of `point` along the line, px from the centroid.
    pub fn position_of(&self, point: Vector2<f64>) -> f64 {
        self.direction.dot(&(point - self.centroid))
    }

    /// Point on the line at `position`, px from the centroid.
    pub fn point_at(&self, position: f64) -> Vector2<f64> {
        self.centroid + self.direction * position
    }

    /// Signed distance of `point` from the line along the normal, px.
    pub fn distance_of(&self, point: Vector2<f64>) -> f64 {
        self.normal.dot(&point) - self.rho
    }
}

/// Fitted line that ends at the outermost projections of its points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedSegment {
    /// Infinite line.
    pub line: FittedLine,
    /// Endpoint with the smallest position along the line, px.
    pub p0: Vector2<f64>,
    /// Endpoint with the largest position along the line, px.
    pub p1: Vector2<f64>,
}

/// Fits a segment to `points` (px). `None` if they have no dominant direction.
pub fn fit_segment(points: impl Iterator<Item = Vector2<f64>> + Clone) -> Option<FittedSegment> {
    let moments = Moments::of(points.clone());
    let line = moments.line()?;
    let (mut first, mut last) = (f64::INFINITY, f64::NEG_INFINITY);
    let (mut across, mut along) = (0.0, 0.0);
    for p in points {
        let t = line.position_of(p);
        first = first.min(t);
        last = last.max(t);
        // Computed from the points: the difference of large moments would leave an error of 1e-9 px for a perfect line.
        across += line.normal.dot(&(p - line.centroid)).powi(2);
        along += t * t;
    }
    let line = line.with_residuals(across, moments.count, along);
    Some(FittedSegment { line, p0: line.point_at(first), p1: line.point_at(last) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn merged_sums_are_the_sums_of_all_points() {
        let points: Vec<_> =
            (0..40).map(|i| Vector2::new(500.0 + f64::from(i), 300.0 + (f64::from(i) * 0.7).sin())).collect();
        let whole = Moments::of(points.iter().copied());
        let parts =
            Moments::of(points[..13].iter().copied()).merged(&Moments::of(points[13..].iter().copied()));
        for (a, b) in
            [(whole.uu, parts.uu), (whole.uv, parts.uv), (whole.vv, parts.vv), (whole.mean.x, parts.mean.x)]
        {
            assert!((a - b).abs() < 1e-9 * a.abs().max(1.0), "{a} {b}");
        }
    }

    #[test]
    fn points_without_direction_give_no_line() {
        let p = Vector2::new(3.0, 4.0);
        assert_eq!(Moments::default().line(), None);
        assert_eq!(Moments::of([p].into_iter()).line(), None);
        assert_eq!(Moments::of([p, p, p].into_iter()).line(), None);
        let square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(u, v)| Vector2::new(u, v));
        assert_eq!(Moments::of(square.into_iter()).line(), None);
        assert_eq!(Moments::of([p, Vector2::new(f64::NAN, 0.0)].into_iter()).line(), None);
    }
}
