use nalgebra::Point2;
use yamabico_geometry::Hypotenuse;

/// Area moments of a polygon, independent of its orientation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PolygonMoments {
    /// Area, > 0.
    pub area: f64,
    /// Integral of x.
    pub m10: f64,
    /// Integral of y.
    pub m01: f64,
    /// Integral of x squared.
    pub m20: f64,
    /// Integral of y squared.
    pub m02: f64,
    /// Integral of x y.
    pub m11: f64,
    center: Point2<f64>,
    /// Central moments of x squared, y squared and x y.
    central: [f64; 3],
}

impl PolygonMoments {
    /// Computes the moments; `None` for fewer than three corners, and for an area that is zero or not finite.
    #[must_use]
    pub fn of(polygon: &[Point2<f64>]) -> Option<Self> {
        let [first, _, _, ..] = *polygon else { return None };
        // Relative to the first corner, to preserve precision far from the origin.
        let mut sums = [0.0; 6];
        let mut a = polygon[polygon.len() - 1] - first;
        for corner in polygon {
            let b = corner - first;
            let c = a.x * b.y - b.x * a.y;
            sums[0] += c;
            sums[1] += c * (a.x + b.x);
            sums[2] += c * (a.y + b.y);
            sums[3] += c * (a.x * a.x + a.x * b.x + b.x * b.x);
            sums[4] += c * (a.y * a.y + a.y * b.y + b.y * b.y);
            sums[5] += c * (a.x * b.y + 2.0 * (a.x * a.y + b.x * b.y) + b.x * a.y);
            a = b;
        }
        let sign = if sums[0] < 0.0 { -1.0 } else { 1.0 };
        let area = sign * sums[0] / 2.0;
        if !(area > 0.0 && area.is_finite()) {
            return None;
        }
        let [m10, m01] = [sums[1], sums[2]].map(|sum| sign * sum / 6.0);
        let [m20, m02, m11] = [sums[3] / 12.0, sums[4] / 12.0, sums[5] / 24.0].map(|sum| sign * sum);
        let (x, y) = (m10 / area, m01 / area);
        let central = [m20 - x * m10, m02 - y * m01, m11 - x * m01];
        let center = Point2::new(first.x + x, first.y + y);
        Some(Self {
            area,
            m10: center.x * area,
            m01: center.y * area,
            m20: central[0] + center.x * center.x * area,
            m02: central[1] + center.y * center.y * area,
            m11: central[2] + center.x * center.y * area,
            center,
            central,
        })
    }

    /// Centroid.
    #[must_use]
    pub fn center(&self) -> Point2<f64> {
        self.center
    }

    /// Direction of the major axis, rad in (-pi/2, pi/2]; 0 for a rotationally symmetric shape.
    #[must_use]
    pub fn long_axis_rad(&self) -> f64 {
        let [xx, yy, xy] = self.central;
        0.5 * (2.0 * xy).atan2(xx - yy)
    }

    /// Minimum and maximum second moment about an axis through the centroid.
    #[must_use]
    pub fn principal(&self) -> [f64; 2] {
        let [xx, yy, xy] = self.central;
        let (middle, half) = (0.5 * (xx + yy), (0.5 * (xx - yy)).hypotenuse(xy));
        [middle - half, middle + half]
    }

    /// Returns true if the major axis is defined: the principal moments differ by more than a relative 1e-9.
    #[must_use]
    pub fn has_axis(&self) -> bool {
        let [smallest, largest] = self.principal();
        largest - smallest > 1e-9 * largest
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Rotation2, Vector2};
    use proptest::prelude::*;

    proptest! {
        /// Moving and rotating a polygon moves and rotates its center and axis, and preserves the principal moments.
        #[test]
        fn moments_move_with_the_polygon(
            x in -100.0..100.0, y in -100.0..100.0, turn in -3.0..3.0, tip in 0.2..3.0, is_reversed in prop::bool::ANY,
        ) {
            let polygon = [(0.0, 0.0), (4.0, 0.0), (4.0, 1.0), (tip, 1.5), (0.0, 1.0)].map(|(x, y)| Point2::new(x, y));
            let still = PolygonMoments::of(&polygon).unwrap();
            let rotation = Rotation2::new(turn);
            let shift = Vector2::new(x, y);
            let mut moved = polygon.map(|p| rotation * p + shift);
            if is_reversed {
                moved.reverse();
            }
            let moved = PolygonMoments::of(&moved).unwrap();
            prop_assert!((moved.area - still.area).abs() < 1e-9);
            prop_assert!((moved.center() - (rotation * still.center() + shift)).norm() < 1e-9);
            let axis = moved.long_axis_rad() - still.long_axis_rad() - turn;
            prop_assert!(axis.sin().abs() < 1e-8);
            for (a, b) in moved.principal().into_iter().zip(still.principal()) {
                prop_assert!((a - b).abs() < 1e-8);
            }
        }
    }

    #[test]
    fn the_triangles_of_a_fan_add_up() {
        let polygon = [(1.0, 0.5), (3.0, 0.0), (4.0, 2.0), (2.0, 3.0)].map(|(x, y)| Point2::new(x, y));
        let whole = PolygonMoments::of(&polygon).unwrap();
        let parts: Vec<_> =
            (1..3).map(|i| PolygonMoments::of(&[polygon[0], polygon[i], polygon[i + 1]]).unwrap()).collect();
        for (of, expected) in [
            ((|m: &PolygonMoments| m.area) as fn(&PolygonMoments) -> f64, whole.area),
            (|m| m.m10, whole.m10),
            (|m| m.m02, whole.m02),
            (|m| m.m11, whole.m11),
            (|m| m.m20, whole.m20),
        ] {
            assert!((parts.iter().map(of).sum::<f64>() - expected).abs() < 1e-12);
        }
        assert_eq!(PolygonMoments::of(&polygon[..2]), None);
        assert_eq!(PolygonMoments::of(&[Point2::new(f64::NAN, 0.0); 4]), None);
    }
}
