use nalgebra::Point2;

use super::adjacency::AdjacencyTable;
use yamabico_geometry::angle_difference;

/// Writes to `out` the located edges in the order of the adjacency table. If this polygon is simple
/// ([`is_simple`](crate::polygon::is_simple)), its interior is free space.
///
/// Yagi et al. (1995), section IV.
pub fn table_polygon(
    table: &AdjacencyTable,
    position: impl Fn(u32) -> Option<Point2<f64>>,
    out: &mut Vec<Point2<f64>>,
) {
    out.clear();
    out.extend(table.rows().iter().filter_map(|&number| position(number)));
}

/// Writes to `out` the free-space polygon of one frame: the edges visible from `robot`, sorted by azimuth. The robot
/// itself is a corner between two edges that are pi or more apart. Empty for fewer than three edges.
///
/// Sorts `edges`.
pub fn star_polygon(robot: Point2<f64>, edges: &mut [Point2<f64>], out: &mut Vec<Point2<f64>>) {
    out.clear();
    let azimuth = |point: &Point2<f64>| (point.y - robot.y).atan2(point.x - robot.x);
    edges.sort_unstable_by(|a, b| azimuth(a).total_cmp(&azimuth(b)));
    if edges.len() < 3 {
        return;
    }
    for (i, edge) in edges.iter().enumerate() {
        out.push(*edge);
        let next = &edges[(i + 1) % edges.len()];
        let gap = angle_difference(azimuth(next), azimuth(edge)).rem_euclid(std::f64::consts::TAU);
        if gap >= std::f64::consts::PI {
            out.push(robot);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::polygon::{contains, signed_area};

    #[test]
    fn space_behind_the_robot_is_unknown() {
        let mut edges = [(2.0, 1.0), (2.0, -1.0), (2.5, 0.0)].map(|(x, y)| Point2::new(x, y));
        let mut polygon = Vec::new();
        star_polygon(Point2::origin(), &mut edges, &mut polygon);
        assert_eq!(polygon.len(), 4);
        assert!(signed_area(&polygon) > 0.0);
        assert!(contains(&polygon, Point2::new(1.0, 0.0)) && !contains(&polygon, Point2::new(-0.1, 0.0)));
        star_polygon(Point2::origin(), &mut edges[..2], &mut polygon);
        assert!(polygon.is_empty());
    }

    /// In a convex room with all corners visible, the polygon is the room.
    #[test]
    fn a_convex_room_is_recovered() {
        let corners = [(2.0, 2.0), (-2.0, 2.5), (-2.0, -2.0), (2.0, -2.0)].map(|(x, y)| Point2::new(x, y));
        let mut edges = corners;
        let mut polygon = Vec::new();
        star_polygon(Point2::new(0.5, -1.0), &mut edges, &mut polygon);
        assert!((signed_area(&polygon) - signed_area(&corners)).abs() < 1e-12);
    }
}
