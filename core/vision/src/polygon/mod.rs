//! Plane polygons: convex hull, area and moments, point containment.

mod hull;
mod moments;

pub use hull::{convex_hull, hull_of_sorted};
pub use moments::PolygonMoments;

use nalgebra::Point2;

/// Twice the signed area of a triangle, positive if it is counterclockwise.
#[inline]
#[must_use]
pub fn cross(a: Point2<f64>, b: Point2<f64>, c: Point2<f64>) -> f64 {
    (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x)
}

/// Signed area, positive for a counterclockwise polygon; zero for fewer than three corners.
#[must_use]
pub fn signed_area(polygon: &[Point2<f64>]) -> f64 {
    let Some(&first) = polygon.first() else { return 0.0 };
    0.5 * polygon.windows(2).map(|pair| cross(first, pair[0], pair[1])).sum::<f64>()
}

/// Iterates over the sides; the last one runs from the last corner to the first.
pub fn sides(polygon: &[Point2<f64>]) -> impl Iterator<Item = [Point2<f64>; 2]> {
    (0..polygon.len()).map(|i| [polygon[i], polygon[(i + 1) % polygon.len()]])
}

/// Returns true if the point lies inside, by the parity of crossed sides. Undefined for points on a side.
#[must_use]
pub fn contains(polygon: &[Point2<f64>], point: Point2<f64>) -> bool {
    sides(polygon).fold(false, |inside, [a, b]| {
        let crosses =
            (a.y > point.y) != (b.y > point.y) && point.x < (b.x - a.x) * (point.y - a.y) / (b.y - a.y) + a.x;
        inside != crosses
    })
}

/// Returns true if two segments cross between their endpoints.
#[must_use]
pub fn segments_cross([a, b]: [Point2<f64>; 2], [c, d]: [Point2<f64>; 2]) -> bool {
    cross(a, b, c) * cross(a, b, d) < 0.0 && cross(c, d, a) * cross(c, d, b) < 0.0
}

/// Returns true if no two sides cross.
#[must_use]
pub fn is_simple(polygon: &[Point2<f64>]) -> bool {
    let count = polygon.len();
    let side = |i: usize| [polygon[i], polygon[(i + 1) % count]];
    (0..count).all(|i| (i + 1..count).all(|j| !segments_cross(side(i), side(j))))
}

/// Closest point of a segment to `point`.
#[must_use]
pub fn nearest_on_segment([a, b]: [Point2<f64>; 2], point: Point2<f64>) -> Point2<f64> {
    let along = b - a;
    let squared = along.norm_squared();
    let share = if squared > 0.0 { ((point - a).dot(&along) / squared).clamp(0.0, 1.0) } else { 0.0 };
    a + along * share
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(list: &[(f64, f64)]) -> Vec<Point2<f64>> {
        list.iter().map(|&(x, y)| Point2::new(x, y)).collect()
    }

    #[test]
    fn a_bow_tie_is_not_simple() {
        assert!(!is_simple(&points(&[(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)])));
        assert!(is_simple(&points(&[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])));
    }

    #[test]
    fn the_notch_of_an_angle_is_outside() {
        let angle = points(&[(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)]);
        assert!((signed_area(&angle) - 3.0).abs() < 1e-12);
        assert!(contains(&angle, Point2::new(0.5, 1.5)) && !contains(&angle, Point2::new(1.5, 1.5)));
        assert!(!contains(&[], Point2::origin()));
    }

    #[test]
    fn the_nearest_point_stays_on_the_segment() {
        let segment = [Point2::new(0.0, 0.0), Point2::new(2.0, 0.0)];
        assert_eq!(nearest_on_segment(segment, Point2::new(0.5, 3.0)), Point2::new(0.5, 0.0));
        assert_eq!(nearest_on_segment(segment, Point2::new(9.0, 3.0)), Point2::new(2.0, 0.0));
    }
}
