//! Update of a belief by one image: matches the segments with the map and applies the pairs.

use nalgebra::Vector2;
use yamabico_core::camera::{Distortion, Mount, Pinhole};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::ImageView;
use yamabico_core::message::Reason;
use yamabico_vision::map::{EdgeKind, ExpectationMap, ExpectationRules, ExpectedEdge, WireFrame};
use yamabico_vision::segments::{Segment, SegmentConfig, SegmentDetector};

use super::association::GATE_99;
use super::matching::{Gates, LineNoise, Match, Matcher, Scene};
use super::projected_line::LineCamera;
use crate::belief::{Belief, Update, gate_distance};
use crate::fix::Fix;

/// Displacement of the expected edges by a fix above which the image is matched again, px.
const REMATCH_PX: f64 = 5.0;
/// Difference of the columns of two vertical edges below which they count as one, px.
const SAME_COLUMN_PX: f64 = 8.0;
/// Minimum matched fraction of the expected edges; with less, the match is ambiguous.
const MIN_MATCHED: f64 = 0.35;
/// Matched fraction of the expected edges above which no alternative match is tried.
const WELL_MATCHED: f64 = 0.75;
/// Offset of the heading of the alternative matches, in standard deviations.
const ALTERNATIVE_SIGMAS: f64 = 1.5;
/// Standard deviation across the heading above which several start positions are tried, and their spacing, m.
const START_STEP_M: f64 = 0.07;
/// Standard deviation of the heading above which several start headings are tried, and their spacing, rad.
const START_STEP_RAD: f64 = 0.0175;
/// Standard deviations of each start pose, m and rad.
const START_SIGMAS: (f64, f64) = (0.1, 0.012);
/// Maximum number of steps to each side; a wider range makes the steps longer.
const MAX_START_STEPS: i32 = 6;
/// Minimum number of lines of a fix.
const MIN_LINES: usize = 3;

/// Matcher of images with a wire-frame map that updates a belief. Reuses its buffers.
#[derive(Clone, Debug)]
pub struct Fixer {
    map: WireFrame,
    pinhole: Pinhole,
    mount: Mount,
    camera: LineCamera,
    expectation: ExpectationMap,
    detector: SegmentDetector,
    segments: Vec<Segment>,
    matcher: Matcher,
    used: Vec<Match>,
    gates: Gates,
}

impl Fixer {
    /// Creates a fixer for this map and camera.
    #[must_use]
    pub fn new(map: WireFrame, pinhole: Pinhole, mount: Mount) -> Self {
        let rules = ExpectationRules::for_width(pinhole.intrinsics().width);
        Self {
            map,
            pinhole,
            mount,
            camera: LineCamera::new(pinhole.intrinsics(), &mount),
            expectation: ExpectationMap::new(rules),
            detector: SegmentDetector::new(SegmentConfig::default()),
            segments: Vec::new(),
            matcher: Matcher::default(),
            used: Vec::new(),
            gates: Gates::default(),
        }
    }

    /// Returns the map.
    #[must_use]
    pub fn map(&self) -> &WireFrame {
        &self.map
    }

    /// Returns the camera model.
    #[must_use]
    pub fn pinhole(&self) -> &Pinhole {
        &self.pinhole
    }

    /// Returns the pose of the camera on the robot.
    #[must_use]
    pub fn mount(&self) -> &Mount {
        &self.mount
    }

    /// Returns the edges expected in view from the last evaluated pose.
    #[must_use]
    pub fn expected(&self) -> &[ExpectedEdge] {
        self.expectation.expected()
    }

    /// Returns the segments of the last image, undistorted.
    #[must_use]
    pub fn segments(&self) -> &[Segment] {
        &self.segments
    }

    /// Returns the pairs of expected edges and segments that updated the belief in the last call of [`Fixer::fix`].
    #[must_use]
    pub fn used(&self) -> &[Match] {
        &self.used
    }

    /// Extracts the segments of an image.
    ///
    /// # Errors
    /// `TooFewSegments`: the image is blank, dark or blurred.
    pub fn observe(&mut self, image: ImageView<'_>) -> Result<(), Reason> {
        self.segments.clear();
        self.used.clear();
        let found = self.detector.detect(image).map_err(|_| Reason::TooFewSegments)?;
        if *self.pinhole.distortion() == Distortion::NONE {
            self.segments.extend_from_slice(found);
        } else {
            let pinhole = &self.pinhole;
            self.segments.extend(found.iter().filter_map(|segment| undistorted(segment, pinhole)));
        }
        Ok(())
    }

    /// Updates a belief with the segments of the last image.
    pub fn fix(&mut self, prior: &Belief, noise: &LineNoise) -> Fix {
        let sigma_across_m = across_sigma_m(prior);
        let is_wide = prior.sigma_theta_rad() > START_STEP_RAD || sigma_across_m > START_STEP_M;
        let mut fix = self.fix_from(prior, prior, noise);
        if is_wide {
            let offsets = within(1.5 * sigma_across_m, START_STEP_M);
            let turns = within(2.0 * prior.sigma_theta_rad(), START_STEP_RAD);
            fix = self.best_start(prior, noise, fix, START_SIGMAS, &|i| {
                let (column, row) = (i % offsets.len(), i / offsets.len());
                (row < turns.len()).then(|| (offsets.at(column), turns.at(row)))
            });
        } else if (fix.lines as f64) < WELL_MATCHED * fix.expected as f64 {
            let turn = ALTERNATIVE_SIGMAS * prior.sigma_theta_rad();
            let sigmas = (0.5 * prior.sigma_xy_m(), 0.5 * prior.sigma_theta_rad());
            fix =
                self.best_start(prior, noise, fix, sigmas, &|i| [(0.0, turn), (0.0, -turn)].get(i).copied());
        }
        if fix.verdict.is_ok() && self.image_shift(&fix.posterior.pose) > REMATCH_PX {
            // The new pose serves for association only: the measurements are applied once, to the prior.
            fix = self.fix_from(prior, &fix.posterior, noise);
        }
        fix
    }

    /// Matches from several start poses and keeps the best match. `start` returns the offset of the start pose with
    /// this index from the prior, to the left (m) and in heading (rad); `sigmas` are the standard deviations of each
    /// (m, rad).
    fn best_start(
        &mut self,
        prior: &Belief,
        noise: &LineNoise,
        first: Fix,
        sigmas: (f64, f64),
        start: &dyn Fn(usize) -> Option<(f64, f64)>,
    ) -> Fix {
        let mut best = (first, *prior);
        let Pose2 { x, y, theta } = prior.pose;
        let (sin, cos) = theta.sin_cos();
        for (left_m, turn) in (0..).map_while(start) {
            let pose = Pose2::new(x - sin * left_m, y + cos * left_m, theta + turn);
            let about = Belief::new(
                pose,
                sigmas.0.min(prior.sigma_xy_m()).max(1e-3),
                sigmas.1.min(prior.sigma_theta_rad()).max(1e-4),
            );
            let fix = self.fix_from(prior, &about, noise);
            let score = |fix: &Fix| fix.lines as f64 - fix.nis;
            if score(&fix) > score(&best.0) {
                best = (fix, about);
            }
        }
        // Repeated so that the buffers contain the best match.
        self.fix_from(prior, &best.1, noise)
    }

    /// Matches from the pose of `about` and applies the pairs to `prior`.
    pub(super) fn fix_from(&mut self, prior: &Belief, about: &Belief, noise: &LineNoise) -> Fix {
        self.used.clear();
        self.expectation.compute(&self.map, &self.pinhole, &self.mount, &about.pose);
        let expected = self.expectation.expected();
        let upright = |edge: &&ExpectedEdge| edge.kind == EdgeKind::Vertical;
        let mut fix = Fix {
            expected: expected.len(),
            uprights: [expected.iter().filter(upright).count(), 0],
            ..Fix::none(prior, Reason::TooFewMatches)
        };
        if expected.is_empty() {
            fix.verdict = Err(Reason::NoModel);
            return fix;
        }
        let scene = Scene {
            map: &self.map,
            expected,
            segments: &self.segments,
            camera: &self.camera,
            focal_px: self.pinhole.intrinsics().fx,
        };
        self.matcher.pair(&scene, about, noise, &self.gates);
        for pair in self.matcher.matches() {
            let expected = &scene.expected[pair.expected];
            let segment = &scene.segments[pair.segment];
            let view = scene.camera.at(&fix.posterior.pose);
            let Some(line) = scene.edge(expected).and_then(|edge| view.project(edge)) else { continue };
            let gate_noise = noise.covariance(scene.focal_px, expected.depth_m);
            let residual = line.residual([segment.p0, segment.p1]);
            let distance = gate_distance(&residual, &fix.posterior.covariance, &gate_noise);
            if distance > GATE_99 {
                continue;
            }
            let update_noise = gate_noise * noise.correlation;
            if let Update::Applied(_) = fix.posterior.update(&residual, &update_noise, f64::INFINITY) {
                self.used.push(Match { distance_squared: distance, ..*pair });
                fix.lines += 1;
                fix.nis += 0.5 * distance;
                fix.uprights[1] += usize::from(expected.kind == EdgeKind::Vertical);
            }
        }
        fix.verdict = self.verdict(fix.lines);
        fix
    }

    /// Returns `Ok` if the matched lines fix the pose: at least three, in two directions or two columns.
    fn verdict(&self, lines: usize) -> Result<(), Reason> {
        let near = self.matcher.edges_with_candidates();
        if lines == 0 && near >= MIN_LINES {
            return Err(Reason::Gated);
        }
        if lines < MIN_LINES {
            return Err(Reason::TooFewMatches);
        }
        let expected = self.expectation.expected();
        if (lines as f64) < MIN_MATCHED * expected.len() as f64 {
            // A few lines may agree on a wrong pose by chance.
            return Err(Reason::Ambiguous);
        }
        let kinds = || self.used.iter().map(|pair| &expected[pair.expected]);
        let has_level = kinds().any(|edge| edge.kind != EdgeKind::Vertical);
        let columns = || kinds().filter(|edge| edge.kind == EdgeKind::Vertical).map(|edge| edge.from.x);
        let (left, right) =
            columns().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, r), u| (l.min(u), r.max(u)));
        let has_upright = left.is_finite();
        if (has_upright && has_level) || right - left > SAME_COLUMN_PX {
            Ok(())
        } else {
            // Lines in one direction do not determine the position along them.
            Err(Reason::Degenerate)
        }
    }

    /// Returns the maximum distance of the expected edges' midpoints from their lines seen from another pose, px.
    fn image_shift(&self, to: &Pose2) -> f64 {
        let view = self.camera.at(to);
        let shift = |expected: &ExpectedEdge| {
            let line = view.project(self.map.edges().get(expected.edge)?)?;
            Some(line.distance(0.5 * (expected.from + expected.to)).0.abs())
        };
        self.expectation.expected().iter().filter_map(shift).fold(0.0, f64::max)
    }
}

/// Returns the standard deviation of the position across the robot's heading, m.
fn across_sigma_m(belief: &Belief) -> f64 {
    let (sin, cos) = belief.pose.theta.sin_cos();
    let across = Vector2::new(-sin, cos);
    let covariance = belief.covariance.fixed_view::<2, 2>(0, 0);
    across.dot(&(covariance * across)).max(0.0).sqrt()
}

/// Equidistant values on both sides of zero.
#[derive(Clone, Copy)]
struct Steps {
    per_side: i32,
    step: f64,
}

/// Returns values within ±`reach`, spaced by `step` or more.
fn within(reach: f64, step: f64) -> Steps {
    let step = step.max(reach / f64::from(MAX_START_STEPS));
    Steps { per_side: ((reach / step) as i32).min(MAX_START_STEPS), step }
}

impl Steps {
    fn len(self) -> usize {
        2 * self.per_side.unsigned_abs() as usize + 1
    }

    fn at(self, i: usize) -> f64 {
        f64::from(i as i32 - self.per_side) * self.step
    }
}

/// Returns the segment without lens distortion; `None` outside the valid range of the lens model.
fn undistorted(segment: &Segment, pinhole: &Pinhole) -> Option<Segment> {
    let ends: [Vector2<f64>; 2] =
        [pinhole.undistort_pixel(segment.p0)?, pinhole.undistort_pixel(segment.p1)?];
    let straight = Segment::between(ends[0], ends[1], 1.0)?;
    Some(Segment {
        p0: ends[0],
        p1: ends[1],
        normal: straight.normal,
        rho: straight.rho,
        length: straight.length,
        ..*segment
    })
}
