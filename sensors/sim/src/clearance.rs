//! Clearance of a circular footprint to solids and people.

use crate::scene::{PERSON_RADIUS_M, PersonPose, Solid};
use yamabico_core::geometry::Hypotenuse;

/// Returns the distance from a circle to the nearest solid that reaches below `height_m`, m; negative inside a solid,
/// infinite without solids.
#[must_use]
pub fn to_solids(solids: &[Solid], center: [f64; 2], radius_m: f64, height_m: f64) -> f64 {
    let low = solids.iter().filter(|s| s.z[0] < height_m && s.z[1] > 0.0);
    low.map(|s| to_base(&s.base, center)).fold(f64::INFINITY, f64::min) - radius_m
}

/// Returns the distance from a circle to the nearest person, m; negative if they overlap, infinite without people.
pub fn to_people(people: impl Iterator<Item = PersonPose>, center: [f64; 2], radius_m: f64) -> f64 {
    let gap =
        |p: PersonPose| (p.at[0] - center[0]).hypotenuse(p.at[1] - center[1]) - PERSON_RADIUS_M - radius_m;
    people.map(gap).fold(f64::INFINITY, f64::min)
}

/// Returns the signed distance from a point to a rectangle with counter-clockwise corners.
fn to_base(base: &[[f64; 2]; 4], p: [f64; 2]) -> f64 {
    let middle = [(base[0][0] + base[2][0]) / 2.0, (base[0][1] + base[2][1]) / 2.0];
    let along = [base[1][0] - base[0][0], base[1][1] - base[0][1]];
    let across = [base[3][0] - base[0][0], base[3][1] - base[0][1]];
    let excess = |axis: [f64; 2]| {
        let length = axis[0].hypotenuse(axis[1]);
        let coordinate = ((p[0] - middle[0]) * axis[0] + (p[1] - middle[1]) * axis[1]) / length;
        coordinate.abs() - length / 2.0
    };
    let (u, v) = (excess(along), excess(across));
    if u > 0.0 && v > 0.0 { u.hypotenuse(v) } else { u.max(v) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_to_a_rectangle_beside_at_a_corner_and_inside() {
        let solid = Solid { base: [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]], z: [0.0, 1.0] };
        let at = |x, y| to_solids(&[solid], [x, y], 0.1, 0.5);
        assert!((at(1.0, 1.5) - 0.4).abs() < 1e-12);
        assert!((at(5.0, 5.0) - 4.9).abs() < 1e-12);
        assert!((at(1.0, 0.8) + 0.3).abs() < 1e-12);
        let lintel = Solid { z: [2.0, 2.6], ..solid };
        assert_eq!(to_solids(&[lintel], [1.0, 0.5], 0.1, 1.0), f64::INFINITY);
    }
}
