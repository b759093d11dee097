//! Intersections of surfaces with the half-planes of a mirror camera, one half-plane per azimuth.

use std::f64::consts::{PI, TAU};

use nalgebra::{Matrix3, Vector2, Vector3};

use super::project::Pass;
use super::spans::Outline;
use crate::scene::Surface;

/// Minimum distance from the axis of the mirror at which surfaces are rendered, m.
const MIN_AXIS_DISTANCE_M: f64 = 0.03;
/// Angle around the axis (rad) below which an edge is nearly radial: it is sampled finely, since it runs almost along a row.
const NEARLY_RADIAL_RAD: f64 = 0.06;
/// Angle around the axis (rad) below which an edge is radial: it runs along a row.
const RADIAL_RAD: f64 = 1e-6;
/// Number of sectors of the circle with a list of surfaces each.
const SECTORS: usize = 360;

/// Pose of a mirror camera in the world.
#[derive(Clone, Copy, Debug)]
pub struct PosedMirror {
    /// Origin of the mirror frame in the world frame, m.
    pub at: Vector3<f64>,
    /// Rotation from the world frame to the mirror frame (z along its axis).
    pub mirror_from_world: Matrix3<f64>,
    /// Point where the rays of a half-plane meet: distance from the axis (negative: on the other side) and height, m.
    pub viewpoint: Vector2<f64>,
}

/// Azimuth of a half-plane, outward from the axis of the mirror.
#[derive(Clone, Copy, Debug)]
pub struct Azimuth {
    pub sin: f64,
    pub cos: f64,
}

/// Components of a vector relative to a half-plane.
#[derive(Clone, Copy, Debug)]
pub struct InPlane {
    /// Outward from the axis.
    pub out: f64,
    /// Along the axis.
    pub up: f64,
    /// Normal to the half-plane, toward increasing azimuth.
    pub aside: f64,
}

/// Surface in the mirror frame.
#[derive(Clone, Copy, Debug)]
pub struct Facet {
    /// Index of the surface.
    pub surface: usize,
    /// Unit normal on the visible side.
    pub normal: Vector3<f64>,
    /// Unit vectors along u and v.
    pub axes: [Vector3<f64>; 2],
    /// Origin of u and v, m.
    pub origin: Vector3<f64>,
    corners: [Vector3<f64>; 4],
    /// First azimuth and extent, rad; the whole circle if the axis intersects the surface.
    sector: [f64; 2],
    nearest: f64,
}

/// Intersection of a half-plane with a facet, as seen from the viewpoint: x is the tangent of the elevation.
#[derive(Clone, Copy, Debug, Default)]
pub struct Slice {
    span: Option<(f64, f64)>,
    inverse_depth: (f64, f64),
}

/// Facets that may be visible, indexed by azimuth.
#[derive(Default)]
pub struct VisibleFacets {
    /// Facets, nearest first.
    pub facets: Vec<Facet>,
    /// Indices of the facets in each sector.
    sectors: Vec<Vec<u16>>,
    /// Azimuths of the corners of the facets, 0 to 2 pi, ascending.
    pub corners: Vec<f64>,
    /// First azimuth (0 to 2 pi) and extent of the nearly radial edges, rad.
    pub oblique: Vec<[f64; 2]>,
}

impl Azimuth {
    pub fn new(azimuth_rad: f64) -> Self {
        let (sin, cos) = azimuth_rad.sin_cos();
        Self { sin, cos }
    }

    #[inline]
    pub fn split(self, v: &Vector3<f64>) -> InPlane {
        InPlane { out: self.cos * v.x + self.sin * v.y, up: v.z, aside: self.cos * v.y - self.sin * v.x }
    }
}

impl VisibleFacets {
    /// Finds the facets that may be visible.
    pub fn update(&mut self, posed: &PosedMirror, surfaces: &[Surface], pass: Pass) {
        self.facets.clear();
        let facets = surfaces.iter().enumerate().map(|(i, s)| Facet::new(i, s, posed, pass));
        self.facets.extend(facets.filter(|facet| facet.may_face(posed.viewpoint)));
        self.facets.sort_by(|a, b| a.nearest.total_cmp(&b.nearest).then(a.surface.cmp(&b.surface)));
        self.facets.truncate(usize::from(super::spans::NOTHING) - 1);

        self.sectors.resize_with(SECTORS, Vec::new);
        self.sectors.iter_mut().for_each(Vec::clear);
        self.corners.clear();
        self.oblique.clear();
        let width = TAU / SECTORS as f64;
        for (i, facet) in self.facets.iter().enumerate() {
            let [start, extent] = facet.sector;
            let first = (start / width).floor() as i64;
            let last = (((start + extent) / width).floor() as i64).min(first + SECTORS as i64 - 1);
            for sector in first..=last {
                self.sectors[sector.rem_euclid(SECTORS as i64) as usize].push(i as u16);
            }
            let azimuths = facet.corners.map(|c| c.y.atan2(c.x).rem_euclid(TAU));
            self.corners.extend(azimuths);
            for i in 0..4 {
                let (a, b) = (azimuths[i], azimuths[(i + 1) % 4]);
                let turn = (b - a + PI).rem_euclid(TAU) - PI;
                if (RADIAL_RAD..NEARLY_RADIAL_RAD).contains(&turn.abs()) {
                    self.oblique.push([if turn > 0.0 { a } else { b }, turn.abs()]);
                }
            }
        }
        self.corners.sort_by(f64::total_cmp);
    }

    /// Removes all facets.
    pub fn clear(&mut self) {
        self.facets.clear();
    }

    /// Returns the indices of the facets in the sector of an azimuth.
    pub fn around(&self, azimuth_rad: f64) -> &[u16] {
        let share = azimuth_rad.rem_euclid(TAU) / TAU;
        &self.sectors[((share * SECTORS as f64) as usize).min(SECTORS - 1)]
    }
}

impl Facet {
    fn new(index: usize, s: &Surface, posed: &PosedMirror, pass: Pass) -> Self {
        let sign = if pass == Pass::Mirrored { -1.0 } else { 1.0 };
        let flip = |p: Vector3<f64>| Vector3::new(p.x, p.y, sign * p.z);
        let turn = |p: Vector3<f64>| posed.mirror_from_world * flip(p);
        let transform = |p: Vector3<f64>| posed.mirror_from_world * (flip(p) - posed.at);
        let corners = s.corners.map(transform);
        let nearest = corners.iter().map(Vector3::norm_squared).fold(f64::MAX, f64::min);
        Self {
            surface: index,
            normal: turn(s.normal()),
            axes: s.axes.map(turn),
            origin: transform(s.origin),
            sector: sector(&corners),
            corners,
            nearest,
        }
    }

    /// Returns true if any viewpoint on the circle is in front of the facet.
    fn may_face(&self, viewpoint: Vector2<f64>) -> bool {
        let reach = viewpoint.x.abs() * self.normal.xy().norm();
        self.normal.dot(&self.origin) - self.normal.z * viewpoint.y - reach < -1e-9
    }

    /// Returns the signed distance from the viewpoint of a half-plane to the plane of the facet, m; negative if the viewpoint
    /// is on the visible side.
    #[inline]
    pub fn height(&self, normal: InPlane, viewpoint: Vector2<f64>) -> f64 {
        self.normal.dot(&self.origin) - normal.out * viewpoint.x - normal.up * viewpoint.y
    }

    /// Returns the intersection with the half-plane of an azimuth.
    #[inline]
    pub fn slice(&self, azimuth: Azimuth, viewpoint: Vector2<f64>) -> Slice {
        let sides = self.corners.map(|c| azimuth.cos * c.y - azimuth.sin * c.x);
        let mut ends = [(0.0, 0.0); 2];
        let mut count = 0;
        for i in 0..4 {
            let j = (i + 1) % 4;
            if (sides[i] >= 0.0) != (sides[j] >= 0.0) && count < 2 {
                let share = sides[i] / (sides[i] - sides[j]);
                let (a, b) = (&self.corners[i], &self.corners[j]);
                let out = |c: &Vector3<f64>| azimuth.cos * c.x + azimuth.sin * c.y;
                let from = out(a);
                ends[count] = (from + share * (out(b) - from), a.z + share * (b.z - a.z));
                count += 1;
            }
        }
        let (mut near, mut far) = (ends[0], ends[1]);
        if near.0 > far.0 {
            std::mem::swap(&mut near, &mut far);
        }
        if count < 2 || far.0 <= MIN_AXIS_DISTANCE_M {
            return Slice::default();
        }
        let normal = azimuth.split(&self.normal);
        let height = self.height(normal, viewpoint);
        if height > -1e-9 {
            return Slice::default();
        }
        if near.0 < MIN_AXIS_DISTANCE_M {
            let share = (MIN_AXIS_DISTANCE_M - near.0) / (far.0 - near.0);
            near = (MIN_AXIS_DISTANCE_M, near.1 + share * (far.1 - near.1));
        }
        let tangent = |p: (f64, f64)| (p.1 - viewpoint.y) / (p.0 - viewpoint.x);
        let (a, b) = (tangent(near), tangent(far));
        Slice { span: Some((a.min(b), a.max(b))), inverse_depth: (normal.up / height, normal.out / height) }
    }
}

impl Outline for Slice {
    #[inline]
    fn span(&self, _: f64) -> Option<(f64, f64)> {
        self.span
    }

    #[inline]
    fn inverse_depth(&self, _: f64) -> (f64, f64) {
        self.inverse_depth
    }
}

/// Returns the first azimuth and the extent of a convex outline around the axis, rad.
fn sector(corners: &[Vector3<f64>; 4]) -> [f64; 2] {
    let turns = [0, 1, 2, 3].map(|i| {
        let (a, b) = (corners[i].xy(), corners[(i + 1) % 4].xy());
        a.perp(&b).atan2(a.dot(&b))
    });
    // A full turn means that the axis intersects the outline.
    if turns.iter().sum::<f64>().abs() > PI {
        return [0.0, TAU];
    }
    let (mut low, mut high, mut at) = (0.0_f64, 0.0_f64, 0.0);
    for turn in &turns[..3] {
        at += turn;
        low = low.min(at);
        high = high.max(at);
    }
    let slack = 1e-9;
    let start = corners[0].y.atan2(corners[0].x);
    [start + low - slack, high - low + 2.0 * slack]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Material;

    fn mirror() -> PosedMirror {
        PosedMirror {
            at: Vector3::new(0.0, 0.0, 0.5),
            mirror_from_world: Matrix3::identity(),
            viewpoint: Vector2::new(-0.1, 0.15),
        }
    }

    /// Returns a wall 2 m ahead, 1 m wide and 1 m high, that faces the mirror.
    fn wall() -> Surface {
        let (origin, u, v) = (Vector3::new(2.0, 0.5, 0.0), -Vector3::y(), Vector3::z());
        Surface::rectangle(origin, u, v, Material::matte([0.5; 3]))
    }

    #[test]
    fn a_wall_is_intersected_at_its_position_from_a_viewpoint_behind_the_axis() {
        let mut around = VisibleFacets::default();
        around.update(&mirror(), &[wall()], Pass::Direct);
        assert_eq!((around.facets.len(), around.around(0.1), around.around(1.0)), (1, &[0_u16][..], &[][..]));
        let slice = around.facets[0].slice(Azimuth::new(0.0), mirror().viewpoint);
        let (low, high) = slice.span.unwrap();
        assert!((low + 0.65 / 2.1).abs() < 1e-12 && (high - 0.35 / 2.1).abs() < 1e-12);
        let (slope, offset) = slice.inverse_depth;
        assert!(slope.abs() < 1e-12 && (offset - 1.0 / 2.1).abs() < 1e-12);
        assert!(around.facets[0].slice(Azimuth::new(3.1), mirror().viewpoint).span.is_none());
    }

    #[test]
    fn the_floor_below_the_mirror_is_visible_at_every_azimuth() {
        let origin = Vector3::new(-3.0, -3.0, 0.0);
        let floor =
            Surface::rectangle(origin, Vector3::x() * 6.0, Vector3::y() * 6.0, Material::matte([0.5; 3]));
        let mut around = VisibleFacets::default();
        around.update(&mirror(), &[floor], Pass::Direct);
        for azimuth in [0.0, 1.0, 3.0, 5.0, 6.25] {
            assert_eq!(around.around(azimuth), &[0]);
            assert!(around.facets[0].slice(Azimuth::new(azimuth), mirror().viewpoint).span.is_some());
        }
        around.update(&mirror(), &[floor], Pass::Mirrored);
        assert!(around.facets.is_empty(), "the back of the floor is not visible");
    }
}
