//! From surfaces in the world to what the half-plane of one azimuth of a mirror camera cuts out of them.

use std::f64::consts::{PI, TAU};

use nalgebra::{Matrix3, Vector2, Vector3};

use super::project::Side;
use super::spans::Outline;
use crate::scene::Surface;

/// Nothing nearer to the mirror's axis than this is drawn, meters.
const NEAR_M: f64 = 0.03;
/// Edges that turn less than this around the axis, radians, are cut finely: they run nearly along a row.
const NEARLY_RADIAL_RAD: f64 = 0.06;
/// Edges that turn less than this run along a row, radians.
const RADIAL_RAD: f64 = 1e-6;
/// Sectors of the circle that know their surfaces.
const SECTORS: usize = 360;

/// Where a mirror camera is in the world.
#[derive(Clone, Copy, Debug)]
pub struct MirrorEye {
    /// Origin of the mirror's frame, world, meters.
    pub at: Vector3<f64>,
    /// Turns world vectors into the mirror's frame (z along its axis).
    pub mirror_from_world: Matrix3<f64>,
    /// In every half-plane: distance from the axis (negative: beyond it) and height where the rays meet.
    pub viewpoint: Vector2<f64>,
}

/// The direction of a half-plane from the mirror's axis outwards.
#[derive(Clone, Copy, Debug)]
pub struct Azimuth {
    pub sin: f64,
    pub cos: f64,
}

/// A vector as a half-plane sees it: outwards, up, and out of the plane towards growing azimuth.
#[derive(Clone, Copy, Debug)]
pub struct InPlane {
    pub out: f64,
    pub up: f64,
    pub aside: f64,
}

/// A surface in the mirror's frame.
#[derive(Clone, Copy, Debug)]
pub struct Facet {
    /// Index of the surface.
    pub surface: usize,
    /// Unit vector away from its seen side.
    pub normal: Vector3<f64>,
    /// Unit vectors along its u and v.
    pub axes: [Vector3<f64>; 2],
    /// Origin of u and v.
    pub origin: Vector3<f64>,
    corners: [Vector3<f64>; 4],
    /// First azimuth and extent, radians; the whole circle where the axis meets the surface.
    sector: [f64; 2],
    nearest: f64,
}

/// What a half-plane cuts out of a facet, seen from its viewpoint: x is the tangent of the elevation.
#[derive(Clone, Copy, Debug, Default)]
pub struct Slice {
    span: Option<(f64, f64)>,
    inverse_depth: (f64, f64),
}

/// The facets that can be seen at all, the nearest first, and where around the axis they are.
#[derive(Default)]
pub struct Surroundings {
    pub facets: Vec<Facet>,
    sectors: Vec<Vec<u16>>,
    /// Azimuths of the facets' corners, 0 to 2 pi, growing.
    pub corners: Vec<f64>,
    /// First azimuth (0 to 2 pi) and extent of edges that are nearly radial, radians.
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

impl Surroundings {
    /// Finds what is there.
    pub fn look(&mut self, eye: &MirrorEye, surfaces: &[Surface], side: Side) {
        self.facets.clear();
        let facets = surfaces.iter().enumerate().map(|(i, s)| Facet::new(i, s, eye, side));
        self.facets.extend(facets.filter(|facet| facet.may_face(eye.viewpoint)));
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

    /// Nothing is there.
    pub fn clear(&mut self) {
        self.facets.clear();
    }

    /// Indices of the facets around an azimuth.
    pub fn around(&self, azimuth_rad: f64) -> &[u16] {
        let share = azimuth_rad.rem_euclid(TAU) / TAU;
        &self.sectors[((share * SECTORS as f64) as usize).min(SECTORS - 1)]
    }
}

impl Facet {
    fn new(index: usize, s: &Surface, eye: &MirrorEye, side: Side) -> Self {
        let sign = if side == Side::Mirrored { -1.0 } else { 1.0 };
        let flip = |p: Vector3<f64>| Vector3::new(p.x, p.y, sign * p.z);
        let turn = |p: Vector3<f64>| eye.mirror_from_world * flip(p);
        let place = |p: Vector3<f64>| eye.mirror_from_world * (flip(p) - eye.at);
        let corners = s.corners.map(place);
        let nearest = corners.iter().map(Vector3::norm_squared).fold(f64::MAX, f64::min);
        Self {
            surface: index,
            normal: turn(s.normal()),
            axes: s.axes.map(turn),
            origin: place(s.origin),
            sector: sector(&corners),
            corners,
            nearest,
        }
    }

    /// Whether any viewpoint of the circle is before it.
    fn may_face(&self, viewpoint: Vector2<f64>) -> bool {
        let reach = viewpoint.x.abs() * self.normal.xy().norm();
        self.normal.dot(&self.origin) - self.normal.z * viewpoint.y - reach < -1e-9
    }

    /// How far the facet's plane is behind the viewpoint of a half-plane, meters; negative before the seen side.
    #[inline]
    pub fn height(&self, normal: InPlane, viewpoint: Vector2<f64>) -> f64 {
        self.normal.dot(&self.origin) - normal.out * viewpoint.x - normal.up * viewpoint.y
    }

    /// What the half-plane of an azimuth cuts out.
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
        if count < 2 || far.0 <= NEAR_M {
            return Slice::default();
        }
        let normal = azimuth.split(&self.normal);
        let height = self.height(normal, viewpoint);
        if height > -1e-9 {
            return Slice::default();
        }
        if near.0 < NEAR_M {
            let share = (NEAR_M - near.0) / (far.0 - near.0);
            near = (NEAR_M, near.1 + share * (far.1 - near.1));
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

/// First azimuth (rad) and extent of a convex outline around the axis.
fn sector(corners: &[Vector3<f64>; 4]) -> [f64; 2] {
    let turns = [0, 1, 2, 3].map(|i| {
        let (a, b) = (corners[i].xy(), corners[(i + 1) % 4].xy());
        a.perp(&b).atan2(a.dot(&b))
    });
    // All the way round means that the axis goes through it.
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

    fn eye() -> MirrorEye {
        MirrorEye {
            at: Vector3::new(0.0, 0.0, 0.5),
            mirror_from_world: Matrix3::identity(),
            viewpoint: Vector2::new(-0.1, 0.15),
        }
    }

    /// A wall 2 m ahead, 1 m wide and 1 m high, which faces back.
    fn wall() -> Surface {
        let (origin, u, v) = (Vector3::new(2.0, 0.5, 0.0), -Vector3::y(), Vector3::z());
        Surface::rectangle(origin, u, v, Material::matt([0.5; 3]))
    }

    #[test]
    fn a_wall_is_cut_where_it_stands_and_seen_from_beyond_the_axis() {
        let mut around = Surroundings::default();
        around.look(&eye(), &[wall()], Side::Direct);
        assert_eq!((around.facets.len(), around.around(0.1), around.around(1.0)), (1, &[0_u16][..], &[][..]));
        let slice = around.facets[0].slice(Azimuth::new(0.0), eye().viewpoint);
        let (low, high) = slice.span.unwrap();
        assert!((low + 0.65 / 2.1).abs() < 1e-12 && (high - 0.35 / 2.1).abs() < 1e-12);
        let (slope, offset) = slice.inverse_depth;
        assert!(slope.abs() < 1e-12 && (offset - 1.0 / 2.1).abs() < 1e-12);
        assert!(around.facets[0].slice(Azimuth::new(3.1), eye().viewpoint).span.is_none());
    }

    #[test]
    fn the_floor_below_the_mirror_is_seen_all_around() {
        let origin = Vector3::new(-3.0, -3.0, 0.0);
        let floor =
            Surface::rectangle(origin, Vector3::x() * 6.0, Vector3::y() * 6.0, Material::matt([0.5; 3]));
        let mut around = Surroundings::default();
        around.look(&eye(), &[floor], Side::Direct);
        for azimuth in [0.0, 1.0, 3.0, 5.0, 6.25] {
            assert_eq!(around.around(azimuth), &[0]);
            assert!(around.facets[0].slice(Azimuth::new(azimuth), eye().viewpoint).span.is_some());
        }
        around.look(&eye(), &[floor], Side::Mirrored);
        assert!(around.facets.is_empty(), "the floor's back is not seen");
    }
}
