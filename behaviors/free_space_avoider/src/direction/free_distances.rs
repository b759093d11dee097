//! Free distance of the floor in each direction, and the clearance between the robot and occluded floor.

use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::Vector2;
use yamabico_core::geometry::wrap_angle;
use yamabico_core::message::FreeDirection;

/// Number of edges processed at a time.
const EDGE_LANES: usize = 4;

/// Sectors around a viewpoint. In each sector the floor is free up to a distance; behind it, up to the maximum
/// distance, it is occluded. Sectors that are free up to the maximum distance, and directions outside all sectors,
/// occlude nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct FreeDistances {
    viewpoint: Vector2<f64>,
    /// Azimuths of the borders from right to left, rad; one more than sectors.
    borders: Vec<f64>,
    /// Unit vectors of the borders.
    outward: Vec<Vector2<f64>>,
    is_round: bool,
    farthest_m: f64,
    free_m: Vec<f64>,
    edges: Edges,
}

/// Radial edges of occluded floor, from `near` to the maximum distance, as one array per component.
#[derive(Clone, Debug, Default, PartialEq)]
struct Edges {
    x: Vec<[f64; EDGE_LANES]>,
    y: Vec<[f64; EDGE_LANES]>,
    near: Vec<[f64; EDGE_LANES]>,
    len: usize,
}

impl FreeDistances {
    /// Creates equal sectors all around a viewpoint (robot frame, m); the first begins straight ahead and extends to
    /// the left. All sectors are free.
    #[must_use]
    pub fn all_around(viewpoint: Vector2<f64>, sectors: usize, farthest_m: f64) -> Self {
        let sectors = sectors.max(3);
        let borders = (0..=sectors).map(|k| TAU * k as f64 / sectors as f64).collect();
        Self::new(viewpoint, borders, true, farthest_m)
    }

    /// Creates sectors between azimuths (robot frame, rad, increasing, spanning less than a full turn). All sectors are
    /// free.
    #[must_use]
    pub fn between(viewpoint: Vector2<f64>, borders: Vec<f64>, farthest_m: f64) -> Self {
        Self::new(viewpoint, borders, false, farthest_m)
    }

    fn new(viewpoint: Vector2<f64>, borders: Vec<f64>, is_round: bool, farthest_m: f64) -> Self {
        let outward = borders.iter().map(|azimuth| Vector2::new(azimuth.cos(), azimuth.sin())).collect();
        let sectors = borders.len().saturating_sub(1);
        let groups = borders.len().div_ceil(EDGE_LANES);
        let empty = || Vec::with_capacity(groups);
        Self {
            viewpoint,
            borders,
            outward,
            is_round,
            farthest_m,
            free_m: vec![farthest_m; sectors],
            edges: Edges { x: empty(), y: empty(), near: empty(), len: 0 },
        }
    }

    /// Sets the free distance (m) of each sector, from right to left. Sectors with at least the maximum distance are
    /// free; sectors without a distance are occluded entirely.
    pub fn set(&mut self, free_m: impl IntoIterator<Item = f64>) {
        let mut distances = free_m.into_iter();
        for free in &mut self.free_m {
            *free = distances.next().map_or(0.0, |free| free.max(0.0));
        }
        self.place_edges();
    }

    /// Lowers the free distance of each sector to `limit_m`, a function of the viewpoint (robot frame, m) and of the sector's
    /// right and left border (rad); distances in m from the viewpoint.
    pub fn bound(&mut self, limit_m: impl Fn(Vector2<f64>, (f64, f64)) -> f64) {
        for sector in 0..self.len() {
            let limit_m = limit_m(self.viewpoint, self.borders(sector));
            self.free_m[sector] = self.free_m[sector].min(limit_m).max(0.0);
        }
        self.place_edges();
    }

    fn place_edges(&mut self) {
        self.edges.clear();
        let sectors = self.free_m.len();
        let occluded_from = |sector: usize| match self.free_m.get(sector) {
            Some(&free) if free < self.farthest_m => free,
            _ => f64::INFINITY,
        };
        for border in 0..sectors + usize::from(!self.is_round) {
            let right = match border {
                0 if self.is_round => occluded_from(sectors - 1),
                0 => f64::INFINITY,
                _ => occluded_from(border - 1),
            };
            let near = right.min(occluded_from(border));
            if near.is_finite() {
                self.edges.push(self.outward[border], near);
            }
        }
    }

    /// Returns the number of sectors.
    #[must_use]
    pub fn len(&self) -> usize {
        self.free_m.len()
    }

    /// Returns true if there is no sector.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.free_m.is_empty()
    }

    /// Returns the free distances from the viewpoint, m, from right to left.
    #[must_use]
    pub fn free_m(&self) -> &[f64] {
        &self.free_m
    }

    /// Returns the maximum distance, m.
    #[must_use]
    pub fn farthest_m(&self) -> f64 {
        self.farthest_m
    }

    /// Returns the azimuths of the right and the left border of a sector, rad.
    #[must_use]
    pub fn borders(&self, sector: usize) -> (f64, f64) {
        (self.borders[sector], self.borders[sector + 1])
    }

    /// Returns the azimuth of the middle of a sector, rad.
    #[must_use]
    pub fn middle(&self, sector: usize) -> f64 {
        0.5 * (self.borders[sector] + self.borders[sector + 1])
    }

    /// Returns the end of free floor in each sector relative to the robot's center, from right to left; sectors all
    /// around begin behind the robot.
    pub fn ends(&self) -> impl Iterator<Item = FreeDirection> {
        let first = if self.is_round { self.len().div_ceil(2) } else { 0 };
        (first..self.len()).chain(0..first).map(|sector| {
            let middle = self.middle(sector);
            let end = self.viewpoint + Vector2::new(middle.cos(), middle.sin()) * self.free_m[sector];
            let azimuth_rad =
                if self.viewpoint == Vector2::zeros() { wrap_angle(middle) } else { end.y.atan2(end.x) };
            FreeDirection { azimuth_rad, distance_m: end.norm() }
        })
    }

    /// Returns the distance (m) from a point (robot frame) to the nearest occluded floor: 0 inside it, infinite if
    /// there is none.
    #[must_use]
    pub fn clearance_m(&self, point: Vector2<f64>) -> f64 {
        let p = point - self.viewpoint;
        let beside = self.edges.square_distance(p, self.farthest_m).sqrt();
        match self.sector_of(p) {
            Some(sector) if self.free_m[sector] < self.farthest_m => {
                let r = p.norm();
                (self.free_m[sector] - r).max(r - self.farthest_m).max(0.0).min(beside)
            }
            _ => beside,
        }
    }

    fn sector_of(&self, p: Vector2<f64>) -> Option<usize> {
        let azimuth = p.y.atan2(p.x);
        if self.is_round {
            let sectors = self.free_m.len();
            let share = if azimuth < 0.0 { azimuth + TAU } else { azimuth } / TAU;
            return Some(((share * sectors as f64) as usize).min(sectors - 1));
        }
        let (first, last) = (*self.borders.first()?, *self.borders.last()?);
        let azimuth = first + wrap_angle(azimuth - first - FRAC_PI_2 * 2.0) + FRAC_PI_2 * 2.0;
        (first..last)
            .contains(&azimuth)
            .then(|| self.borders.partition_point(|&border| border <= azimuth) - 1)
    }
}

impl Edges {
    fn clear(&mut self) {
        self.x.clear();
        self.y.clear();
        self.near.clear();
        self.len = 0;
    }

    fn push(&mut self, outward: Vector2<f64>, near_m: f64) {
        let lane = self.len % EDGE_LANES;
        if lane == 0 {
            // Unused lanes repeat the first edge of their group.
            self.x.push([outward.x; EDGE_LANES]);
            self.y.push([outward.y; EDGE_LANES]);
            self.near.push([near_m; EDGE_LANES]);
        } else if let (Some(x), Some(y), Some(near)) =
            (self.x.last_mut(), self.y.last_mut(), self.near.last_mut())
        {
            (x[lane], y[lane], near[lane]) = (outward.x, outward.y, near_m);
        }
        self.len += 1;
    }

    /// Returns the square of the distance to the nearest edge; infinite without edges.
    #[inline]
    fn square_distance(&self, p: Vector2<f64>, far_m: f64) -> f64 {
        let mut min = [f64::INFINITY; EDGE_LANES];
        for ((x, y), near) in self.x.iter().zip(&self.y).zip(&self.near) {
            for i in 0..EDGE_LANES {
                let along = p.x * x[i] + p.y * y[i];
                let along = if along > near[i] { along } else { near[i] };
                let along = if along < far_m { along } else { far_m };
                let (dx, dy) = (p.x - along * x[i], p.y - along * y[i]);
                let square = dx * dx + dy * dy;
                min[i] = if square < min[i] { square } else { min[i] };
            }
        }
        min.into_iter().fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use yamabico_core::geometry::Hypotenuse;

    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;
    use std::f64::consts::PI;

    /// Reference implementation of the clearance by its definition, sector by sector.
    fn plain(free: &FreeDistances, point: Vector2<f64>) -> f64 {
        let p = point - free.viewpoint;
        let (r, phi) = (p.norm(), p.y.atan2(p.x));
        let mut min_m = f64::INFINITY;
        for sector in 0..free.len() {
            let near = free.free_m()[sector];
            if near >= free.farthest_m() {
                continue;
            }
            let (right, left) = free.borders(sector);
            if wrap_angle(phi - free.middle(sector)).abs() <= 0.5 * (left - right) {
                min_m = min_m.min((near - r).max(r - free.farthest_m()).max(0.0));
            } else {
                for border in [right, left] {
                    let outward = Vector2::new(border.cos(), border.sin());
                    let along = p.dot(&outward).clamp(near, free.farthest_m());
                    min_m = min_m.min((p - outward * along).norm());
                }
            }
        }
        min_m
    }

    #[test]
    fn the_clearance_is_the_distance_to_the_nearest_sector() {
        let mut random = Pcg64::seed_from_u64(7);
        for case in 0..200 {
            let viewpoint = Vector2::new(random.random_range(-0.1..0.1), 0.05);
            let mut free = if case % 2 == 0 {
                FreeDistances::all_around(viewpoint, random.random_range(3..40), 1.2)
            } else {
                let first = random.random_range(-9.0..9.0);
                FreeDistances::between(viewpoint, (0..9).map(|k| first + 0.3 * f64::from(k)).collect(), 1.2)
            };
            let distances: Vec<f64> = (0..free.len()).map(|_| random.random_range(0.0..2.0)).collect();
            free.set(distances);
            for _ in 0..50 {
                let point = Vector2::new(random.random_range(-2.0..2.0), random.random_range(-2.0..2.0));
                let (fast, plain) = (free.clearance_m(point), plain(&free, point));
                assert!(fast == plain || (fast - plain).abs() < 1e-12, "{fast} {plain} at {point}");
            }
        }
    }

    #[test]
    fn free_sectors_and_directions_outside_the_view_occlude_nothing() {
        let mut free = FreeDistances::all_around(Vector2::zeros(), 8, 1.0);
        assert_eq!(free.clearance_m(Vector2::new(0.3, 0.2)), f64::INFINITY);
        free.set([1.0; 7]);
        assert_eq!(free.free_m()[7], 0.0, "a sector without a distance is not free");
        let mut ahead = FreeDistances::between(Vector2::zeros(), vec![-0.5, 0.0, 0.5], 1.0);
        ahead.set([0.5, 0.5]);
        assert!((ahead.clearance_m(Vector2::new(-1.0, 0.0)) - 1.5_f64.hypotenuse(0.0)).abs() < 0.1);
        assert!((ahead.clearance_m(Vector2::new(0.0, 0.0)) - 0.5).abs() < 1e-12);
        assert!(
            ahead.clearance_m(Vector2::new(-0.5, 0.0)) > 0.9
                && ahead.sector_of(Vector2::new(-1.0, 0.1)).is_none()
        );
    }

    #[test]
    fn ends_are_relative_to_the_robots_center() {
        let mut free = FreeDistances::all_around(Vector2::new(0.1, 0.0), 4, 1.0);
        free.set([0.2, 0.4, 0.6, 0.8]);
        let ends: Vec<_> = free.ends().collect();
        let expected: Vector2<f64> = Vector2::new(0.1, 0.0) + Vector2::new(1.0, 1.0).normalize() * 0.2;
        assert!((ends[2].distance_m - expected.norm()).abs() < 1e-12);
        assert!((ends[2].azimuth_rad - expected.y.atan2(expected.x)).abs() < 1e-12);
        assert!(ends.is_sorted_by(|a, b| a.azimuth_rad < b.azimuth_rad));
        assert!((free.middle(3) - 1.75 * PI).abs() < 1e-12);
    }
}
