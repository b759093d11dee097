//! Candidates along the parallax line of one point: compared with all baselines, best of each class, refined.

use nalgebra::{Vector2, Vector3};
use yamabico_geometry::Hypotenuse;

use super::parallax_search::{
    EXPECTED_COST, MAX_BASELINES, MAX_CANDIDATES, Points, SearchPoint, SearchResult,
};
use super::patch::{SAMPLES, patch};
use super::patch_projection::Projection;

/// Range of foot ratios.
const RATIOS: std::ops::Range<f32> = 0.08..12.0;
/// Heights within this are floor, m.
const FLOOR_M: f32 = 0.06;
/// Height above which a patch is taken as upright, m.
const LEVEL_M: f32 = 0.03;
/// Noise of a gray level.
const NOISE: f32 = 2.5;
/// Error of a patch's model, as a share of its contrast.
const MODEL_ERROR: f32 = 0.1;
/// Advantage from which a baseline by itself prefers a candidate, and from which it contradicts.
const MIN_AGREEMENT: f32 = 1.0;
const MAX_CONTRADICTION: f32 = 4.0;
/// Cost of a candidate that was not or could not be compared.
const NONE: f32 = 1e9;
/// Parallax (px for each unit of w) below which nothing can be decided.
const MIN_PARALLAX: f32 = 1e-3;

/// Candidates of one point.
pub(super) struct Sweep<'a> {
    points: &'a Points<'a>,
    pixel: Vector3<f32>,
    patch: [f32; SAMPLES],
    /// Sums of squares weigh with the inverse of the patch's variance.
    weight: f32,
    /// Inverse depth of the floor, and its product with the distance of each plane.
    inverse_depth: f32,
    level: f32,
    upright: f32,
    /// Steps of w between candidates.
    ratio_step: f32,
    parallax: f32,
    /// Uncertainty of the floor along the parallax line, px.
    slack_px: f32,
    tolerance_px: f32,
    costs: [f32; MAX_CANDIDATES],
    of_baselines: [[f32; MAX_BASELINES]; MAX_CANDIDATES],
}

impl<'a> Sweep<'a> {
    /// Prepares the search for a point; `None` if the geometry allows no comparison.
    #[inline(always)]
    pub fn new(points: &'a Points<'a>, point: SearchPoint) -> Option<Self> {
        let at = point.pixel;
        let Points { search, view, planes, .. } = points;
        let at_pixel = at.cast::<f64>();
        let ray = view.ray(at_pixel);
        let inverse_depth = (-ray.z / view.position().z) as f32;
        let warped = view.warp_jacobian(&points.motion, at_pixel)?;
        let longest = points.projections.last()?;
        let pixel = at.push(1.0);
        let (one, more) = (longest.pixel(&pixel, inverse_depth), longest.pixel(&pixel, 1.05 * inverse_depth));
        let line = more - one;
        let parallax = (line.norm() / 0.05).max(MIN_PARALLAX);
        // Uncertainty of the floor along the line; an edge that is not square to it turns errors across into such along.
        let along = line.cast::<f64>() / f64::from(line.norm().max(1e-9));
        let across = Vector2::new(-along.y, along.x);
        let felt = along + across * f64::from(point.skew);
        let slope = warped.jacobian.fixed_columns::<5>(0).tr_mul(&felt);
        let slack = slope.dot(&(points.covariance * slope)).max(0.0).sqrt() as f32;
        let identity = [search.spacing_px, 0.0, 0.0, search.spacing_px];
        let patch = patch(points.current, at, &identity)?;
        let mean = patch.iter().sum::<f32>() / SAMPLES as f32;
        let contrast = patch.iter().map(|level| (level - mean).powi(2)).sum::<f32>() / SAMPLES as f32;
        let variance = 2.0 * NOISE * NOISE + MODEL_ERROR * MODEL_ERROR * contrast;
        Some(Self {
            points,
            pixel,
            patch,
            weight: EXPECTED_COST / (SAMPLES as f32 * variance),
            inverse_depth,
            level: planes.level.dot(&pixel),
            upright: planes.upright.dot(&pixel),
            ratio_step: search.step_px / parallax,
            parallax,
            slack_px: slack,
            tolerance_px: search.tolerance_px * point.skew.hypotenuse(1.0) + 2.0 * slack,
            costs: [NONE; MAX_CANDIDATES],
            of_baselines: [[NONE; MAX_BASELINES]; MAX_CANDIDATES],
        })
    }

    #[inline(always)]
    fn ratio(&self, candidate: i32) -> f32 {
        1.0 + candidate as f32 * self.ratio_step
    }

    #[inline(always)]
    fn height_m(&self, ratio: f32) -> f32 {
        self.points.view.position().z as f32 * (1.0 - 1.0 / ratio)
    }

    #[inline(always)]
    fn index(&self, candidate: i32) -> usize {
        (candidate + self.points.search.half) as usize
    }

    #[inline(always)]
    fn cost(&self, candidate: i32) -> f32 {
        self.costs.get(self.index(candidate)).copied().unwrap_or(NONE)
    }

    /// Every second candidate and those around the floor, then those around the best of each class.
    #[inline(always)]
    pub fn run(&mut self) -> SearchResult {
        let half = self.points.search.half;
        let mut lowest = [NONE; 3];
        for candidate in -half..=half {
            let is_first = candidate % 2 == 0 || candidate.abs() == 1;
            if let (true, Some(class)) = (is_first, self.class(candidate)) {
                // Only the best one and its neighbors matter, which are compared below.
                self.compare(candidate, lowest[class]);
                lowest[class] = lowest[class].min(self.cost(candidate));
            }
        }
        self.best().into_iter().for_each(|best| self.compare_around(best));
        let [floor, above, below] = self.best();
        self.compare_around(above);
        let (ratio, ratio_sigma) = self.refine(above);
        SearchResult {
            costs: [self.cost(floor), self.cost(above), self.cost(below)],
            ratio,
            ratio_sigma,
            is_at_end: above >= half - 1,
            is_agreed: self.is_agreed(above, floor),
        }
    }

    /// Compares the neighbors of a candidate that were not yet compared in full.
    #[inline(always)]
    fn compare_around(&mut self, candidate: i32) {
        for neighbor in [candidate - 1, candidate + 1] {
            if neighbor.abs() <= self.points.search.half && self.cost(neighbor) >= NONE {
                self.compare(neighbor, NONE);
            }
        }
    }

    /// Class of a candidate: 0 on the floor, 1 above it, 2 below it; `None` between them.
    #[inline(always)]
    fn class(&self, candidate: i32) -> Option<usize> {
        let offset_px = candidate as f32 * self.points.search.step_px;
        let height_m = self.height_m(self.ratio(candidate));
        if offset_px.abs() <= self.tolerance_px {
            Some(0)
        } else if offset_px > 0.0 && height_m > FLOOR_M {
            Some(1)
        } else if offset_px < 0.0 && height_m < -FLOOR_M {
            Some(2)
        } else {
            None
        }
    }

    /// Best candidates on the floor, above and below it; beyond the range if there is none.
    #[inline(always)]
    fn best(&self) -> [i32; 3] {
        let half = self.points.search.half;
        let none = MAX_CANDIDATES as i32;
        let (mut best, mut costs) = ([none; 3], [NONE; 3]);
        for candidate in -half..=half {
            let cost = self.cost(candidate);
            if cost >= NONE {
                continue;
            }
            if let Some(class) = self.class(candidate).filter(|&class| cost < costs[class]) {
                (best[class], costs[class]) = (candidate, cost);
            }
        }
        best
    }

    /// True if two baselines prefer a candidate to another one, and none the other to it.
    #[inline(always)]
    fn is_agreed(&self, candidate: i32, other: i32) -> bool {
        let of = |candidate: i32| self.of_baselines.get(self.index(candidate));
        let (Some(costs), Some(others)) = (of(candidate), of(other)) else { return false };
        let (mut agreed, mut is_contradicted) = (0, false);
        for (cost, other) in costs.iter().zip(others).filter(|(a, b)| a.max(**b) < NONE) {
            agreed += u32::from(other - cost > MIN_AGREEMENT);
            is_contradicted |= cost - other > MAX_CONTRADICTION;
        }
        agreed >= 2 && !is_contradicted
    }

    /// Foot ratio at the vertex of the parabola through three costs, and its standard deviation from their curvature.
    #[inline(always)]
    fn refine(&self, candidate: i32) -> (f32, f32) {
        if candidate.abs() > self.points.search.half {
            return (1.0, f32::INFINITY);
        }
        let [left, here, right] = [candidate - 1, candidate, candidate + 1].map(|i| match i {
            i if i.abs() <= self.points.search.half => self.cost(i),
            _ => NONE,
        });
        let curvature = left - 2.0 * here + right;
        if left >= NONE || right >= NONE || curvature < 1e-9 {
            return (self.ratio(candidate), self.slack_px.hypotenuse(10.0) / self.parallax);
        }
        let shift = (0.5 * (left - right) / curvature).clamp(-0.5, 0.5);
        let step = self.points.search.step_px;
        let sigma_px = 1.0 / (curvature / (step * step)).max(1e-2).sqrt();
        (
            1.0 + (candidate as f32 + shift) * self.ratio_step,
            self.slack_px.hypotenuse(sigma_px) / self.parallax,
        )
    }

    /// Compares the patch with all baselines under a candidate, unless those of the longest show that its cost exceeds `limit`.
    #[inline(always)]
    fn compare(&mut self, candidate: i32, limit: f32) {
        let ratio = self.ratio(candidate);
        if !RATIOS.contains(&ratio) {
            return;
        }
        let inverse_depth = ratio * self.inverse_depth;
        let is_level = self.height_m(ratio) <= LEVEL_M;
        let planes = &self.points.planes;
        let (plane, across) =
            if is_level { (&planes.level, self.level) } else { (&planes.upright, self.upright) };
        let across = if across.abs() < 1e-4 { 1e-4 } else { across };
        let limit = limit * self.points.projections.len() as f32;
        let (mut sum, mut count) = (0.0, 0);
        let mut of_baselines = [NONE; MAX_BASELINES];
        let baselines =
            self.points.projections.iter().zip(self.points.baselines).zip(&mut of_baselines).rev();
        for ((projection, baseline), of_baseline) in baselines {
            let Projection { turn, shift, gain } = projection;
            let p = turn * self.pixel + shift * inverse_depth;
            if p.z * ratio < 0.05 * ratio.max(inverse_depth) {
                continue;
            }
            let inverse = 1.0 / p.z;
            let center = p.xy() * inverse;
            let scale = inverse_depth / across;
            let spacing = self.points.search.spacing_px * inverse;
            let column = |k: usize, plane: f32| {
                let slope = turn.column(k) + shift * (scale * plane);
                (slope.xy() - center * slope.z) * spacing
            };
            let (a, b) = (column(0, plane.x), column(1, plane.y));
            let Some(patch) = patch(baseline.image, center, &[a.x, b.x, a.y, b.y]) else { continue };
            let (mut total, mut squares) = ([0_f32; 8], [0_f32; 8]);
            let rows = patch.as_chunks::<8>().0.iter().zip(self.patch.as_chunks::<8>().0);
            for (theirs, ours) in rows {
                for lane in 0..8 {
                    let difference = gain * theirs[lane] - ours[lane];
                    total[lane] += difference;
                    squares[lane] += difference * difference;
                }
            }
            let (total, squares) = (total.iter().sum::<f32>(), squares.iter().sum::<f32>());
            *of_baseline = (squares - total * total / SAMPLES as f32) * self.weight;
            sum += *of_baseline;
            count += 1;
            if sum > limit {
                return;
            }
        }
        if count >= self.points.projections.len().saturating_sub(1).max(1) {
            let index = self.index(candidate);
            let costs = of_baselines.iter().filter(|&&cost| cost < NONE);
            self.costs[index] = costs.sum::<f32>() / count as f32;
            self.of_baselines[index] = of_baselines;
        }
    }
}

#[cfg(test)]
mod tests {
    use yamabico_geometry::Pose2;
    use yamabico_geometry::camera::{Intrinsics, Mount};
    use yamabico_geometry::image::ImageView;

    use super::*;
    use crate::plane_motion::floor_view::FloorView;
    use crate::plane_motion::motion_prior::CommonCovariance;
    use crate::plane_motion::parallax_search::{Baseline, ParallaxSearch};
    use crate::plane_motion::patch_projection::Planes;
    use crate::plane_motion::quad_image::QuadImage;

    const SIZE: (u32, u32) = (128, 96);

    /// Random blots of 4 px, shifted.
    fn picture(shift: usize) -> QuadImage {
        let (width, height) = (SIZE.0 as usize, SIZE.1 as usize);
        let blot = |u: usize, v: usize| ((u / 4) * 7919 + (v / 4) * 104_729) % 251;
        let data: Vec<u8> = (0..width * height).map(|i| blot(i % width, i / width + shift) as u8).collect();
        let mut image = QuadImage::new(width, height);
        image.copy(ImageView::new(&data, width, height, width).unwrap());
        image
    }

    /// The search without limits on the costs.
    fn run_in_full(sweep: &mut Sweep) -> SearchResult {
        let half = sweep.points.search.half;
        let first = (-half..=half).filter(|candidate| candidate % 2 == 0 || candidate.abs() == 1);
        first.for_each(|candidate| sweep.compare(candidate, NONE));
        sweep.best().into_iter().for_each(|best| sweep.compare_around(best));
        let [floor, above, below] = sweep.best();
        let (ratio, ratio_sigma) = sweep.refine(above);
        SearchResult {
            costs: [sweep.cost(floor), sweep.cost(above), sweep.cost(below)],
            ratio,
            ratio_sigma,
            is_at_end: above >= half - 1,
            is_agreed: sweep.is_agreed(above, floor),
        }
    }

    #[test]
    fn candidates_that_are_given_up_change_no_result() {
        let mount = Mount::tilted(0.55, 12_f64.to_radians());
        let view = FloorView::new(Intrinsics::from_horizontal_fov(SIZE.0, SIZE.1, 1.0), mount);
        let (current, older) = (picture(0), [picture(2), picture(5), picture(7)]);
        let motions = [0.16, 0.32, 0.48].map(|x| Pose2::new(x, 0.0, 0.0));
        let baselines: Vec<_> =
            older.iter().zip(motions).map(|(image, motion)| Baseline { image, motion }).collect();
        let projections: Vec<_> =
            baselines.iter().map(|baseline| Projection::new(&view, baseline, current.mean())).collect();
        let search = ParallaxSearch::new(SIZE.0);
        let points = Points {
            search: &search,
            view: &view,
            motion: motions[2],
            covariance: &(CommonCovariance::identity() * 1e-6),
            current: &current,
            baselines: &baselines,
            projections: &projections,
            planes: Planes::new(&view),
            points: &[],
            results: &mut Vec::new(),
        };
        let (mut compared, mut given_up) = (0, 0);
        for (u, v) in (30..90).step_by(6).flat_map(|v| (10..120).step_by(5).map(move |u| (u, v))) {
            let point = SearchPoint { pixel: Vector2::new(u as f32, v as f32), skew: 0.2 };
            let (Some(mut pruned), Some(mut full)) = (Sweep::new(&points, point), Sweep::new(&points, point))
            else {
                continue;
            };
            assert_eq!(pruned.run(), run_in_full(&mut full), "at {u} {v}");
            let costs = |sweep: &Sweep| sweep.costs.iter().filter(|&&cost| cost < NONE).count();
            compared += costs(&full);
            given_up += costs(&full) - costs(&pruned);
        }
        assert!(compared > 1000 && given_up > compared / 5, "{given_up} of {compared}");
    }
}
