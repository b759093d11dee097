//! Detection of differences between a frame and the map, in each image region.
//!
//! Ohya, Kosaka & Kak (1998): compares observed edges with those expected at the estimated pose. Differs from \[1\]:
//! only vertical edges of at least five rows count, and horizontal edges and faint vertical steps on the floor are
//! further evidence.

use crate::horizontal_edges::{HorizontalEdges, horizontal_lines};
use crate::regions::Regions;
use crate::vertical_edges::{EdgeDifference, VerticalEdges};
use nalgebra::{Vector2, Vector3};
use yamabico_core::camera::{Distortion, Intrinsics, Mount, Pinhole};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::{GrayImage, ImageView};
use yamabico_core::message::Reason;
use yamabico_vision::bit_image::BitImage;
use yamabico_vision::map::{EdgeKind, ExpectationMap, ExpectationRules, WireFrame};

use crate::floor_steps::{FloorStep, FloorStepFinder};
use crate::obstacle_regions::Sensitivity;
use crate::threshold_learning::{EdgeCounts, FloorEvidence, thresholds};
use crate::threshold_table::Place;

/// Displacement of edges by the uncertainty of the heading above which a frame cannot be compared with the map, px.
const MAX_BLUR_PX: f64 = 6.0;
/// Number of segments that approximate an expected edge under lens distortion.
const BENT_PIECES: usize = 8;
/// Half height of the band around an expected horizontal edge in which edges are explained by it, px.
const LEVEL_ROWS: f64 = 6.0;
/// Minimum strength of a horizontal edge, gray levels; above that of any floor.
const LEVEL_EDGES: u8 = 30;
/// Distance beyond the sides of the image up to which edges are expected, px.
const BESIDE_PX: f64 = 24.0;
/// Maximum position error of the pose, m.
const POSE_ERROR_M: f64 = 0.06;

/// Parameters of the detector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetectorRules {
    /// Number of vertical image regions.
    pub regions: usize,
    /// Maximum column distance between matching observed and expected edges, px.
    pub tolerance_px: usize,
    /// Limit for vertical edges, px.
    pub edges: Sensitivity,
    /// Limit for horizontal edges, px.
    pub level: Sensitivity,
    /// Limit for the strength of a vertical step on the floor, gray levels.
    pub contrast: Sensitivity,
}

impl DetectorRules {
    /// Returns the parameters for images of this size, px.
    #[must_use]
    pub fn for_size(width: u32, height: u32) -> Self {
        Self {
            regions: 5,
            tolerance_px: (2.0 + (f64::from(width) - 256.0) / 384.0).round().clamp(1.0, 8.0) as usize,
            edges: Sensitivity { epsilon: 0.5, min_limit: 60.0 * f64::from(height) / 240.0 },
            level: Sensitivity { epsilon: 0.5, min_limit: 9.0 * f64::from(width) / 256.0 },
            contrast: Sensitivity { epsilon: 0.15, min_limit: 6.5 },
        }
    }
}

/// Result for one region.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RegionResult {
    /// Number of vertical edge pixels that the map does not explain.
    pub extra: u32,
    /// Maximum of `extra` without an obstacle, px.
    pub limit: f64,
    /// Number of horizontal edge pixels that the map does not explain.
    pub level: u32,
    /// Strongest vertical step on the floor.
    pub step: FloorStep,
    /// True if that step indicates an obstacle.
    pub is_step: bool,
    /// True if the region holds an obstacle.
    pub is_obstacle: bool,
}

/// Detector of obstacles in frames, with its buffers.
#[derive(Clone, Debug)]
pub struct Detector {
    camera: Pinhole,
    mount: Mount,
    map: WireFrame,
    rules: DetectorRules,
    regions: Regions,
    expectation: ExpectationMap,
    operator: VerticalEdges,
    horizontal_operator: HorizontalEdges,
    level: BitImage,
    level_counts: Vec<u32>,
    /// First row that is evaluated: the foot of every obstacle on the floor is below it.
    horizon: usize,
    step_finder: FloorStepFinder,
    expected: BitImage,
    explained: BitImage,
    raw: BitImage,
    spare: BitImage,
    seen: BitImage,
    thinned: GrayImage,
    difference: EdgeDifference,
    steps: Vec<FloorStep>,
    results: Vec<RegionResult>,
}

impl Detector {
    /// Creates the detector for a camera, its mount, and the map of a building.
    #[must_use]
    pub fn new(camera: Pinhole, mount: Mount, map: WireFrame, rules: DetectorRules) -> Self {
        let width = camera.intrinsics().width as usize;
        Self {
            step_finder: FloorStepFinder::new(&camera, &mount),
            horizon: horizon(&camera, &mount),
            regions: Regions::new(width, rules.regions),
            expectation: ExpectationMap::new(ExpectationRules::everything()),
            camera,
            mount,
            map,
            rules,
            operator: VerticalEdges::default(),
            horizontal_operator: HorizontalEdges::default(),
            level: BitImage::default(),
            level_counts: Vec::new(),
            expected: BitImage::default(),
            explained: BitImage::default(),
            raw: BitImage::default(),
            spare: BitImage::default(),
            seen: BitImage::default(),
            thinned: GrayImage::default(),
            difference: EdgeDifference::default(),
            steps: Vec::new(),
            results: Vec::new(),
        }
    }

    /// Detects obstacles in a frame captured at `map_from_robot`, by the thresholds of `place`. Returns a result for
    /// each region, from left to right. `heading_sigma`: standard deviation of the heading, rad.
    ///
    /// # Errors
    /// `MalformedInput` if the image has another size or the pose is not finite; `MisRegistered` if the heading is
    /// too uncertain; `LowContrast` if the image has hardly any contrast or shows hardly any of the edges that the
    /// map predicts.
    pub fn detect(
        &mut self,
        image: ImageView,
        map_from_robot: &Pose2,
        heading_sigma: f64,
        place: &Place,
    ) -> Result<&[RegionResult], Reason> {
        let tolerance_px = self.tolerance(image, map_from_robot, heading_sigma)?;
        self.operator.edges(image, place.t0, &mut self.raw);
        self.raw.vertical_lines(&mut self.spare, &mut self.seen);
        self.seen.clear_above(self.horizon);
        self.expect(map_from_robot, tolerance_px);
        self.difference.compare(&self.seen, &self.expected, tolerance_px, &self.regions);
        self.difference.explain(&self.seen, &self.explained, &self.regions);
        self.check_contrast(image)?;
        self.step_finder.find(image, self.map.walls(), map_from_robot, &self.regions, &mut self.steps);
        self.results.clear();
        let learned = f64::from(place.n0_extra);
        self.find_level(image);
        let evidence = self.difference.extra.iter().zip(&self.level_counts).zip(&self.steps);
        for ((&extra, &level), &step) in evidence {
            let is_step = step.contrast > self.rules.contrast.limit(place.contrast);
            let is_obstacle = is_step
                || self.rules.edges.is_obstacle(extra, learned)
                || self.rules.level.is_obstacle(level, f64::from(place.level));
            let limit = self.rules.edges.limit(learned);
            self.results.push(RegionResult { extra, limit, level, step, is_step, is_obstacle });
        }
        Ok(&self.results)
    }

    /// Measures a frame of the empty building, to learn thresholds: edge counts for each of [`thresholds`], and the
    /// evidence on the floor.
    ///
    /// # Errors
    /// `MalformedInput` if the image has another size or the pose is not finite.
    pub fn measure(
        &mut self,
        image: ImageView,
        map_from_robot: &Pose2,
    ) -> Result<(Vec<EdgeCounts>, FloorEvidence), Reason> {
        let tolerance_px = self.tolerance(image, map_from_robot, 0.0)?;
        self.operator.thinned(image, &mut self.thinned);
        self.expect(map_from_robot, tolerance_px);
        let rows = self.sweep(tolerance_px)?;
        self.step_finder.find(image, self.map.walls(), map_from_robot, &self.regions, &mut self.steps);
        let contrast = self.steps.iter().map(|step| step.contrast).fold(0.0, f64::max);
        self.find_level(image);
        let level = self.level_counts.iter().copied().max().unwrap_or(0);
        Ok((rows, FloorEvidence { contrast, level }))
    }

    /// Returns the horizontal edges of the last frame that the map does not explain.
    #[must_use]
    pub fn level(&self) -> &BitImage {
        &self.level
    }

    /// Returns the foot of the obstacle in a region, px: that of its step, otherwise the lowest of its edges
    /// (`min_px`: number of edge pixels that confirm it), or the middle of the region at the horizon if there are too
    /// few. `None` if the region holds no obstacle.
    #[must_use]
    pub fn foot(&self, region: usize, min_px: u32) -> Option<Vector2<f64>> {
        let result = self.results.get(region).filter(|result| result.is_obstacle)?;
        if result.is_step {
            return Some(result.step.foot);
        }
        let columns = self.regions.columns(region);
        let middle = 0.5 * (columns.start + columns.end) as f64;
        let mut left = min_px;
        for v in (self.horizon..self.seen.height()).rev() {
            let is_seen = |u: usize| self.difference.is_extra(&self.seen, u, v) || self.level.get(u, v);
            let lowest = columns.clone().rev().find(|&u| is_seen(u));
            if let Some(u) = lowest {
                left = left.saturating_sub(1);
                if left == 0 {
                    return Some(Vector2::new(u as f64, (v + min_px as usize) as f64));
                }
            }
        }
        Some(Vector2::new(middle, self.horizon as f64))
    }

    /// Returns the results of the last frame, from left to right.
    #[must_use]
    pub fn results(&self) -> &[RegionResult] {
        &self.results
    }

    /// Returns the pixels (column, row) at the upper boundary of the floor that was searched for steps in the last
    /// frame.
    pub fn floor(&self) -> impl Iterator<Item = (usize, usize)> {
        self.step_finder.floor()
    }

    /// Returns the vertical edges expected in the last frame.
    #[must_use]
    pub fn expected(&self) -> &BitImage {
        &self.expected
    }

    /// Returns the vertical edges observed in the last frame.
    #[must_use]
    pub fn seen(&self) -> &BitImage {
        &self.seen
    }

    /// Returns the difference of observed and expected edges in the last frame.
    #[must_use]
    pub fn difference(&self) -> &EdgeDifference {
        &self.difference
    }

    /// Returns the image regions.
    #[must_use]
    pub fn regions(&self) -> &Regions {
        &self.regions
    }

    /// Returns the camera model.
    #[must_use]
    pub fn camera(&self) -> &Pinhole {
        &self.camera
    }

    /// Returns the mount of the camera.
    #[must_use]
    pub fn mount(&self) -> &Mount {
        &self.mount
    }

    /// Returns the map of the building.
    #[must_use]
    pub fn map(&self) -> &WireFrame {
        &self.map
    }

    /// Returns the map, to replace its content.
    pub(crate) fn map_mut(&mut self) -> &mut WireFrame {
        &mut self.map
    }

    fn tolerance(&self, image: ImageView, pose: &Pose2, heading_sigma: f64) -> Result<usize, Reason> {
        let k = self.camera.intrinsics();
        let fits = (image.width(), image.height()) == (k.width as usize, k.height as usize);
        if !fits || !pose.is_finite() {
            return Err(Reason::MalformedInput);
        }
        let blur_px = 3.0 * k.fx * heading_sigma;
        if blur_px.is_nan() || blur_px > MAX_BLUR_PX.max(1.5 * self.rules.tolerance_px as f64) {
            return Err(Reason::MisRegistered);
        }
        Ok(self.rules.tolerance_px.max(blur_px.ceil() as usize))
    }

    /// Counts the horizontal edges that the map does not explain, in each region.
    fn find_level(&mut self, image: ImageView) {
        self.horizontal_operator.edges(image, LEVEL_EDGES, &mut self.raw);
        horizontal_lines(&self.raw, &mut self.spare, &mut self.level);
        self.level.clear_above(self.horizon);
        for (u, v) in self.step_finder.feet() {
            let near_px = v.saturating_sub(self.horizon) as f64 * POSE_ERROR_M / self.mount.z.max(0.1);
            let rows = LEVEL_ROWS + near_px;
            let at = Vector2::new(u as f64, v as f64);
            let (beside, above) = (Vector2::new(1.0, 0.0), Vector2::new(0.0, rows));
            self.explained.fill_quad([
                at - beside - above,
                at + beside - above,
                at + beside + above,
                at - beside + above,
            ]);
        }
        self.level.subtract(&self.explained);
        self.regions.count_columns(&self.level, &mut self.level_counts);
    }

    /// Draws the predictions of the map: the vertical edges, and the bands around all edges in which observed edges
    /// are explained.
    fn expect(&mut self, pose: &Pose2, tolerance_px: usize) {
        let k = *self.camera.intrinsics();
        let (width, height) = (k.width as usize, k.height as usize);
        self.expected.clear(width, height);
        self.explained.clear(width, height);
        let (camera, horizon) = (&self.camera, self.horizon as f64);
        let wide =
            Pinhole::ideal(Intrinsics { cx: k.cx + BESIDE_PX, width: k.width + 2 * BESIDE_PX as u32, ..k });
        let pixel = |ideal: Vector2<f64>| {
            let ideal = ideal - Vector2::new(BESIDE_PX, 0.0);
            let bent = camera.distortion().distort(k.normalized_from_pixel(ideal));
            if *camera.distortion() == Distortion::NONE { ideal } else { k.pixel_from_normalized(bent) }
        };
        let pieces = if *camera.distortion() == Distortion::NONE { 1 } else { BENT_PIECES };
        let edges = self.expectation.compute(&self.map, &wide, &self.mount, pose);
        for edge in edges {
            for piece in 0..pieces {
                let at = |i: usize| pixel(edge.from + (edge.to - edge.from) * (i as f64 / pieces as f64));
                let (from, to) = (at(piece), at(piece + 1));
                if edge.kind == EdgeKind::Vertical {
                    let blur_px = tolerance_px as f64 + k.fx * POSE_ERROR_M / edge.depth_m.max(0.5);
                    self.expected.draw_line(from, to);
                    band(
                        &mut self.explained,
                        (from, to),
                        Vector2::new(blur_px, 0.0),
                        Vector2::new(blur_px, 0.0),
                    );
                } else {
                    // On the floor, the distance in rows from the horizon gives the depth.
                    let blur = |end: Vector2<f64>| {
                        let near_px = (end.y - horizon).abs() * POSE_ERROR_M / self.mount.z.max(0.1);
                        Vector2::new(0.0, LEVEL_ROWS + near_px)
                    };
                    band(&mut self.explained, (from, to), blur(from), blur(to));
                }
            }
        }
        self.expected.clear_above(self.horizon);
    }

    fn sweep(&mut self, tolerance_px: usize) -> Result<Vec<EdgeCounts>, Reason> {
        let image = self.thinned.view().map_err(|_| Reason::MalformedInput)?;
        let rows = thresholds().map(|threshold| {
            self.raw.threshold(image, threshold);
            self.raw.vertical_lines(&mut self.spare, &mut self.seen);
            self.seen.clear_above(self.horizon);
            self.difference.compare(&self.seen, &self.expected, tolerance_px, &self.regions);
            self.difference.explain(&self.seen, &self.explained, &self.regions);
            EdgeCounts {
                threshold,
                differing: self.difference.differing.clone(),
                extra: self.difference.extra.clone(),
                recall: self.difference.recall(),
            }
        });
        Ok(rows.collect())
    }

    /// Refuses a frame with too little contrast: one that lacks the edges of the map would not show obstacles either.
    fn check_contrast(&self, image: ImageView) -> Result<(), Reason> {
        const BLIND_RECALL: f64 = 0.15;
        const MIN_EXPECTED_PX: u32 = 60;
        const MIN_SPREAD: u8 = 24;
        let is_blind = self.difference.expected >= MIN_EXPECTED_PX
            && self.difference.recall().is_some_and(|recall| recall < BLIND_RECALL);
        let (mut low, mut high) = (255, 0);
        for v in (0..image.height()).step_by(16) {
            for &level in image.row(v).iter().step_by(8) {
                (low, high) = (low.min(level), high.max(level));
            }
        }
        let is_flat = high.saturating_sub(low) < MIN_SPREAD;
        if is_blind || is_flat { Err(Reason::LowContrast) } else { Ok(()) }
    }
}

/// Sets the pixels of a band around a line, which extends by `blur_from` and `blur_to` to both sides at the ends.
fn band(
    mask: &mut BitImage,
    line: (Vector2<f64>, Vector2<f64>),
    blur_from: Vector2<f64>,
    blur_to: Vector2<f64>,
) {
    mask.fill_quad([line.0 - blur_from, line.0 + blur_from, line.1 + blur_to, line.1 - blur_to]);
}

/// Returns the row of the horizon straight ahead, clamped to the image.
fn horizon(camera: &Pinhole, mount: &Mount) -> usize {
    let k = camera.intrinsics();
    let ahead = mount.rotation_body_from_camera().transpose() * Vector3::new(1.0, 0.0, 0.0);
    let row = if ahead.z > 0.0 { k.cy + k.fy * ahead.y / ahead.z } else { 0.0 };
    row.clamp(0.0, f64::from(k.height) - 1.0) as usize
}
