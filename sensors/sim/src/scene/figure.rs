//! Surfaces of a person: frustums around upright axes.

use nalgebra::Vector3;

use super::surface::{LightGrid, Material, Surface};
use super::walker::PersonPose;
use crate::world::{Color, Person};

/// Radius of the circle that a person occupies on the floor, m.
pub const PERSON_RADIUS_M: f64 = 0.22;

const SKIN: Color = [0.55, 0.36, 0.26];
const HAIR: Color = [0.05, 0.035, 0.025];
const SHOES: Color = [0.03, 0.03, 0.03];

/// Facet with the normals at its left and right edge, so that light varies smoothly around the body.
pub struct Facet {
    /// Surface; u runs around the body, v upward.
    pub surface: Surface,
    /// Unit normals at u = 0 and at u = size.
    pub outward: [Vector3<f64>; 2],
}

/// Appends the facets of `person` at `pose`.
pub fn facets(person: &Person, pose: &PersonPose, out: &mut Vec<Facet>) {
    let h = person.height_m;
    let (sin, cos) = pose.heading.sin_cos();
    let spot = |ahead: f64, left: f64| {
        Vector3::new(pose.at[0] + cos * ahead - sin * left, pose.at[1] + sin * ahead + cos * left, 0.0)
    };
    for (side, ahead) in [(1.0, pose.stride), (-1.0, -pose.stride)] {
        let foot = spot(ahead + 0.03, side * 0.09);
        let hip = spot(0.0, side * 0.085);
        limb(foot, foot, [0.0, 0.045 * h], [0.065, 0.06], 8, SHOES, out);
        limb(foot, hip, [0.045 * h, 0.50 * h], [0.055, 0.085], 10, person.trousers, out);
        let hand = spot(-0.7 * ahead, side * 0.25);
        let shoulder = spot(0.0, side * 0.20);
        limb(hand, hand, [0.41 * h, 0.46 * h], [0.04, 0.035], 8, SKIN, out);
        limb(hand, shoulder, [0.46 * h, 0.81 * h], [0.04, 0.055], 8, person.shirt, out);
    }
    let axis = spot(0.0, 0.0);
    let torso = [(0.47, 0.145), (0.56, 0.14), (0.72, 0.165), (0.80, 0.175), (0.835, 0.10), (0.85, 0.05)];
    for pair in torso.windows(2) {
        limb(axis, axis, [pair[0].0 * h, pair[1].0 * h], [pair[0].1, pair[1].1], 14, person.shirt, out);
    }
    let head = [(0.84, 0.055), (0.875, 0.075), (0.925, 0.088), (0.965, 0.08), (0.99, 0.05), (1.0, 0.005)];
    for (i, pair) in head.windows(2).enumerate() {
        let color = if i < 2 { SKIN } else { HAIR };
        limb(axis, axis, [pair[0].0 * h, pair[1].0 * h], [pair[0].1, pair[1].1], 12, color, out);
    }
}

/// Appends a frustum with `sides` facets between circles around `bottom` and `top`, at heights `z`, with radii `radius` (m).
fn limb(
    bottom: Vector3<f64>,
    top: Vector3<f64>,
    z: [f64; 2],
    radius: [f64; 2],
    sides: usize,
    color: Color,
    out: &mut Vec<Facet>,
) {
    let material = Material::matte(color);
    let around = |i: usize| {
        let angle = std::f64::consts::TAU * i as f64 / sides as f64;
        Vector3::new(angle.cos(), angle.sin(), 0.0)
    };
    for i in 0..sides {
        let (a, b) = (around(i), around((i + 1) % sides));
        let low = |d: Vector3<f64>| bottom + d * radius[0] + Vector3::z() * z[0];
        let high = |d: Vector3<f64>| top + d * radius[1] + Vector3::z() * z[1];
        let corners = [low(a), low(b), high(b), high(a)];
        let u = (corners[1] + corners[2] - corners[0] - corners[3]).normalize();
        let rise = corners[2] + corners[3] - corners[0] - corners[1];
        let v = (rise - u * u.dot(&rise)).normalize();
        let extent = |axis: Vector3<f64>| {
            let along = corners.map(|c| axis.dot(&(c - corners[0])));
            (along.iter().copied().fold(f64::MAX, f64::min), along.iter().copied().fold(f64::MIN, f64::max))
        };
        let ((u0, u1), (v0, v1)) = (extent(u), extent(v));
        out.push(Facet {
            surface: Surface {
                corners,
                origin: corners[0] + u * u0 + v * v0,
                axes: [u, v],
                size: [u1 - u0, v1 - v0],
                material,
                light: LightGrid::default(),
                part_of: None,
            },
            outward: [a, b],
        });
    }
}
