//! One picture against the map: the belief before it becomes the belief after it.

use nalgebra::Vector2;
use yamabico_core::camera::{Distortion, Mount, Pinhole};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::ImageView;
use yamabico_core::message::Reason;
use yamabico_vision::map::{EdgeKind, ExpectationMap, ExpectationRules, ExpectedEdge, WireFrame};
use yamabico_vision::segments::{Segment, SegmentConfig, SegmentDetector};

use super::association::GATE;
use super::matching::{Gates, LineNoise, Match, Matcher, Scene};
use super::projected_line::LineCamera;
use crate::belief::{Belief, Update, gate_distance};
use crate::fix::Fix;

/// A picture whose fix moves the image by more (pixels) is matched once more.
const REMATCH_PX: f64 = 5.0;
/// Uprights whose columns differ by less (pixels) count as one.
const SAME_COLUMN_PX: f64 = 8.0;
/// With a smaller share of the expected edges it is not known whether the matches are right.
pub const MIN_SHARE: f64 = 0.35;
/// Where this share of the expected edges is matched, no other match is looked for.
const WELL_SEEN: f64 = 0.75;
/// Otherwise the robot's heading is looked from so many standard deviations to either side.
const ASIDE_SIGMAS: f64 = 1.5;
/// With a prior wider than this the match is looked for from places this far apart (m, rad) ...
const START_STEP_M: f64 = 0.07;
const START_STEP_RAD: f64 = 0.0175;
/// ... each with these standard deviations.
const START_SIGMAS: (f64, f64) = (0.1, 0.012);
/// At most so many steps to either side; what lies farther away makes them longer.
const START_STEPS: i32 = 6;
/// Least number of lines of a fix.
const MIN_LINES: usize = 3;

/// Looks for the map in pictures; keeps its buffers.
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
    /// One for this map and camera.
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

    /// The map.
    #[must_use]
    pub fn map(&self) -> &WireFrame {
        &self.map
    }

    /// The camera's lens and image.
    #[must_use]
    pub fn pinhole(&self) -> &Pinhole {
        &self.pinhole
    }

    /// Where the camera sits.
    #[must_use]
    pub fn mount(&self) -> &Mount {
        &self.mount
    }

    /// What should have been in view in the last picture, from the last pose that it was computed for.
    #[must_use]
    pub fn expected(&self) -> &[ExpectedEdge] {
        self.expectation.expected()
    }

    /// The segments of the last picture, undistorted.
    #[must_use]
    pub fn segments(&self) -> &[Segment] {
        &self.segments
    }

    /// The pairs of expected edges and segments that moved the belief at the last picture.
    #[must_use]
    pub fn used(&self) -> &[Match] {
        &self.used
    }

    /// Takes a picture's segments.
    ///
    /// # Errors
    /// `TooFewSegments`: it is blank, dark or blurred.
    pub fn take(&mut self, image: ImageView<'_>) -> Result<(), Reason> {
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

    /// What the segments taken last make of a belief.
    pub fn fix(&mut self, prior: &Belief, noise: &LineNoise) -> Fix {
        let sigma_across_m = across_sigma_m(prior);
        let is_wide = prior.sigma_theta_rad() > START_STEP_RAD || sigma_across_m > START_STEP_M;
        let mut fix = self.fix_from(prior, prior, noise);
        if is_wide {
            let aside = within(1.5 * sigma_across_m, START_STEP_M);
            let turns = within(2.0 * prior.sigma_theta_rad(), START_STEP_RAD);
            fix = self.best_start(prior, noise, fix, START_SIGMAS, &|i| {
                let (column, row) = (i % aside.len(), i / aside.len());
                (row < turns.len()).then(|| (aside.at(column), turns.at(row)))
            });
        } else if (fix.lines as f64) < WELL_SEEN * fix.expected as f64 {
            let turn = ASIDE_SIGMAS * prior.sigma_theta_rad();
            let sigmas = (0.5 * prior.sigma_xy_m(), 0.5 * prior.sigma_theta_rad());
            fix =
                self.best_start(prior, noise, fix, sigmas, &|i| [(0.0, turn), (0.0, -turn)].get(i).copied());
        }
        if fix.verdict.is_ok() && self.image_shift(&fix.posterior.pose) > REMATCH_PX {
            // The new pose only tells which line is which edge: the measurements act on the prior, once.
            fix = self.fix_from(prior, &fix.posterior, noise);
        }
        fix
    }

    /// Matches from other poses than the prior's too, and keeps what matches most: `start` gives by how much they lie to the
    /// left (m) and are turned (rad), `sigmas` how wide is looked from each (m, rad).
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
            let score = |fix: &Fix| fix.lines as f64 - fix.surprise;
            if score(&fix) > score(&best.0) {
                best = (fix, about);
            }
        }
        // Leaves behind what belongs to the best.
        self.fix_from(prior, &best.1, noise)
    }

    /// Matches as seen from `about`, and applies what was matched to `prior`.
    fn fix_from(&mut self, prior: &Belief, about: &Belief, noise: &LineNoise) -> Fix {
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
            let of_picture = noise.of(scene.focal_px, expected.depth_m);
            let residual = line.residual([segment.p0, segment.p1]);
            let distance = gate_distance(&residual, &fix.posterior.covariance, &of_picture);
            if distance > GATE {
                continue;
            }
            let of_news = of_picture * noise.repetition;
            if let Update::Applied(_) = fix.posterior.update(&residual, &of_news, f64::INFINITY) {
                self.used.push(Match { distance_squared: distance, ..*pair });
                fix.lines += 1;
                fix.surprise += 0.5 * distance;
                fix.uprights[1] += usize::from(expected.kind == EdgeKind::Vertical);
            }
        }
        fix.verdict = self.verdict(fix.lines);
        fix
    }

    /// Whether the lines in use make a fix: three, of two directions or in two columns.
    fn verdict(&self, lines: usize) -> Result<(), Reason> {
        let near = self.matcher.edges_with_segments_near();
        if lines == 0 && near >= MIN_LINES {
            return Err(Reason::Gated);
        }
        if lines < MIN_LINES {
            return Err(Reason::TooFewMatches);
        }
        let expected = self.expectation.expected();
        if (lines as f64) < MIN_SHARE * expected.len() as f64 {
            // A few lines agree on something by chance.
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
            // Lines of one direction leave the way along them open.
            Err(Reason::Degenerate)
        }
    }

    /// How far (pixels) the expected edges' middles lie from their lines as seen from another pose, at most.
    fn image_shift(&self, to: &Pose2) -> f64 {
        let view = self.camera.at(to);
        let shift = |expected: &ExpectedEdge| {
            let line = view.project(self.map.edges().get(expected.edge)?)?;
            Some(line.distance(0.5 * (expected.from + expected.to)).0.abs())
        };
        self.expectation.expected().iter().filter_map(shift).fold(0.0, f64::max)
    }
}

/// Standard deviation of the place across the robot's heading, meters.
fn across_sigma_m(belief: &Belief) -> f64 {
    let (sin, cos) = belief.pose.theta.sin_cos();
    let across = Vector2::new(-sin, cos);
    let covariance = belief.covariance.fixed_view::<2, 2>(0, 0);
    across.dot(&(covariance * across)).max(0.0).sqrt()
}

/// Steps to both sides of zero.
#[derive(Clone, Copy)]
struct Steps {
    to_either_side: i32,
    step: f64,
}

/// Steps of this length, or longer, that reach as far.
fn within(reach: f64, step: f64) -> Steps {
    let step = step.max(reach / f64::from(START_STEPS));
    Steps { to_either_side: ((reach / step) as i32).min(START_STEPS), step }
}

impl Steps {
    fn len(self) -> usize {
        2 * self.to_either_side.unsigned_abs() as usize + 1
    }

    fn at(self, i: usize) -> f64 {
        f64::from(i as i32 - self.to_either_side) * self.step
    }
}

/// The segment as a camera without distortion would see it; `None` where the lens model ends.
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
