use nalgebra::Point2;

use super::cross;

/// Computes the convex hull: counterclockwise from the smallest point by x and then y, without collinear points. Fewer
/// than three corners if all points are collinear. Sorts `points`, which must be finite.
pub fn convex_hull(points: &mut [Point2<f64>], out: &mut Vec<Point2<f64>>) {
    points.sort_unstable_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    hull_of_sorted(points, out);
}

/// Like [`convex_hull`], but for points already sorted by x and then y.
pub fn hull_of_sorted(points: &[Point2<f64>], out: &mut Vec<Point2<f64>>) {
    out.clear();
    chain(points.iter(), 0, out);
    if out.len() < 2 {
        return;
    }
    // The last point starts the upper chain, and the first one ends it.
    let below = out.len() - 1;
    chain(points.iter().rev().skip(1), below, out);
    out.pop();
}

/// Appends points so that the chain from index `start` turns left only.
fn chain<'a>(points: impl Iterator<Item = &'a Point2<f64>>, start: usize, out: &mut Vec<Point2<f64>>) {
    for &point in points {
        if out.last() == Some(&point) {
            continue;
        }
        while let [.., a, b] = out[start..]
            && cross(a, b, point) <= 0.0
        {
            out.pop();
        }
        out.push(point);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::polygon::{contains, signed_area};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_point_is_inside_and_corners_turn_left(
            list in prop::collection::vec((-9_i32..9, -9_i32..9), 0..40),
        ) {
            let mut points: Vec<_> =
                list.iter().map(|&(x, y)| Point2::new(f64::from(x), f64::from(y))).collect();
            let mut hull = Vec::new();
            convex_hull(&mut points, &mut hull);
            let count = hull.len();
            if count >= 3 {
                for i in 0..count {
                    prop_assert!(cross(hull[i], hull[(i + 1) % count], hull[(i + 2) % count]) > 0.0);
                    prop_assert!(points.iter().all(|p| cross(hull[i], hull[(i + 1) % count], *p) >= 0.0));
                }
                prop_assert!(signed_area(&hull) > 0.0);
                let middle = Point2::from(hull.iter().map(|p| p.coords).sum::<nalgebra::Vector2<f64>>() / count as f64);
                prop_assert!(contains(&hull, middle));
            } else {
                prop_assert!(points.windows(3).all(|p| cross(p[0], p[1], p[2]) == 0.0));
            }
        }
    }
}
