//! Total least squares line through edge points, from sums that can be merged without the points.

use nalgebra::Vector2;

/// Smallest root-mean-square distance, in px, that a fit claims: quantization keeps real edges from being better.
pub const RMS_FLOOR_PX: f64 = 0.1;

/// Sums over edge points about an origin near them: count, first and second moments. They add up, so that two segments
/// merge without their points.
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
    /// The sums over `points`, px; all zero for none.
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

    /// The sums over the points of both.
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

    /// The line of least squared perpendicular distances: phi = atan2(2 Suv, Suu - Svv) / 2. `None` when fewer than two
    /// points, or points without extent, give it no direction.
    pub fn line(&self) -> Option<FittedLine> {
        let anisotropy = (self.uu - self.vv).hypot(2.0 * self.uv);
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

/// An endless line with the statistics of its fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedLine {
    /// Mean of the points, px.
    pub centroid: Vector2<f64>,
    /// Direction angle in (-pi/2, pi/2], from u towards v, rad.
    pub angle: f64,
    /// Unit direction (cos, sin) of the angle.
    pub direction: Vector2<f64>,
    /// Unit normal (-sin, cos) of the angle.
    pub normal: Vector2<f64>,
    /// Signed distance of the origin: normal . p = rho on the line, px.
    pub rho: f64,
    /// Root-mean-square distance of the points, px.
    pub rms: f64,
    /// Standard deviation across the line at the centroid, px.
    pub sigma_mid: f64,
    /// Standard deviation of the angle, rad.
    pub sigma_angle: f64,
}

impl FittedLine {
    /// The statistics of `count` points with these sums of squares across and along the line, px^2.
    fn with_residuals(self, across: f64, count: f64, along: f64) -> Self {
        let rms = (across / count).sqrt();
        let noise = rms.max(RMS_FLOOR_PX);
        Self { rms, sigma_mid: noise / count.sqrt(), sigma_angle: noise / along.sqrt(), ..self }
    }

    /// Position of `point`'s foot along the line, px from the centroid.
    pub fn position_of(&self, point: Vector2<f64>) -> f64 {
        self.direction.dot(&(point - self.centroid))
    }

    /// The point of the line `position` px from the centroid.
    pub fn point_at(&self, position: f64) -> Vector2<f64> {
        self.centroid + self.direction * position
    }

    /// Signed distance of `point` from the line along the normal, px.
    pub fn distance_of(&self, point: Vector2<f64>) -> f64 {
        self.normal.dot(&point) - self.rho
    }
}

/// A fitted line that ends at the outermost feet of its points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedSegment {
    /// The line.
    pub line: FittedLine,
    /// End with the smallest position along the line, px.
    pub p0: Vector2<f64>,
    /// End with the largest position along the line, px.
    pub p1: Vector2<f64>,
}

/// Fits a segment to `points` (px). `None` when they give no direction.
pub fn fit_segment(points: impl Iterator<Item = Vector2<f64>> + Clone) -> Option<FittedSegment> {
    let moments = Moments::of(points.clone());
    let line = moments.line()?;
    let (mut first, mut last) = (f64::INFINITY, f64::NEG_INFINITY);
    let (mut across, mut along) = (0.0, 0.0);
    for p in points {
        let t = line.position_of(p);
        first = first.min(t);
        last = last.max(t);
        // From the points themselves: the difference of large moments would leave 1e-9 px of a perfect line.
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
