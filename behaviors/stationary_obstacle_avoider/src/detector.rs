//! What a picture shows that the map does not, region by region.
//!
//! Ohya, Kosaka & Kak (1998): edges seen against edges expected at the localized pose. Differs from \[1\]: only edges that run
//! upright over five rows count, and faint upright steps on the bare floor are evidence of their own.

use nalgebra::{Vector2, Vector3};
use yamabico_core::camera::{Distortion, Intrinsics, Mount, Pinhole};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::{GrayImage, ImageView};
use yamabico_core::message::Reason;
use yamabico_vision::bit_image::BitImage;
use yamabico_vision::level_edges::LevelEdges;
use yamabico_vision::map::{EdgeKind, ExpectationMap, ExpectationRules, WireFrame};
use yamabico_vision::vertical_edges::{EdgeDifference, Regions, VerticalEdges};

use crate::obstacle_regions::Sensitivity;
use crate::threshold_learning::{FloorLook, Row, thresholds};
use crate::threshold_table::Place;
use crate::uprights::{Upright, Uprights};

/// A heading that blurs the picture by more pixels than this registers with no map.
const LARGEST_BLUR_PX: f64 = 6.0;
/// Pieces that an expected edge is drawn in where the lens bends it.
const BENT_PIECES: usize = 8;
/// Rows around an expected level edge in which what seems upright is its staircase.
const LEVEL_ROWS: f64 = 6.0;
/// Level edges (gray levels) that no floor has.
const LEVEL_EDGES: u8 = 30;
/// Edges so far beyond the picture's sides are expected as well, columns.
const BESIDE_PX: f64 = 24.0;
/// What the robot may be beside its pose, meters.
const POSE_ERROR_M: f64 = 0.06;

/// What counts as an obstacle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetectorRules {
    /// Vertical regions.
    pub regions: usize,
    /// Columns by which an edge seen may differ from one expected, pixels.
    pub tolerance_px: usize,
    /// How much difference of edges is no obstacle.
    pub edges: Sensitivity,
    /// How many pixels of level edges are no obstacle.
    pub level: Sensitivity,
    /// How strong a faint upright step is no obstacle; in gray levels.
    pub contrast: Sensitivity,
}

impl DetectorRules {
    /// For pictures of this size.
    #[must_use]
    pub fn for_size(width: u32, height: u32) -> Self {
        Self {
            regions: 5,
            tolerance_px: (2.0 + (f64::from(width) - 256.0) / 384.0).round().clamp(1.0, 8.0) as usize,
            edges: Sensitivity { epsilon: 0.5, floor_px: 60.0 * f64::from(height) / 240.0 },
            level: Sensitivity { epsilon: 0.5, floor_px: 9.0 * f64::from(width) / 256.0 },
            contrast: Sensitivity { epsilon: 0.15, floor_px: 6.5 },
        }
    }
}

/// What one region shows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RegionSight {
    /// Pixels of edges that the map does not have.
    pub extra: u32,
    /// Largest number of them that is no obstacle, pixels.
    pub limit: f64,
    /// Pixels of level edges that the map does not have.
    pub level: u32,
    /// The strongest upright step on the floor.
    pub upright: Upright,
    /// Whether that step is an obstacle's.
    pub is_step: bool,
    /// Whether something is there that the map does not have.
    pub is_obstacle: bool,
}

/// Looks at pictures; keeps its buffers.
#[derive(Clone, Debug)]
pub struct Detector {
    camera: Pinhole,
    mount: Mount,
    map: WireFrame,
    rules: DetectorRules,
    regions: Regions,
    expectation: ExpectationMap,
    operator: VerticalEdges,
    level_operator: LevelEdges,
    level: BitImage,
    level_counts: Vec<u32>,
    /// The first row that is looked at: what stands on the floor has its foot below.
    horizon: usize,
    uprights: Uprights,
    expected: BitImage,
    explained: BitImage,
    raw: BitImage,
    spare: BitImage,
    seen: BitImage,
    thinned: GrayImage,
    difference: EdgeDifference,
    steps: Vec<Upright>,
    sights: Vec<RegionSight>,
}

impl Detector {
    /// For a camera with its mount in the building of `map`.
    #[must_use]
    pub fn new(camera: Pinhole, mount: Mount, map: WireFrame, rules: DetectorRules) -> Self {
        let width = camera.intrinsics().width as usize;
        Self {
            uprights: Uprights::new(&camera, &mount),
            horizon: horizon(&camera, &mount),
            regions: Regions::new(width, rules.regions),
            expectation: ExpectationMap::new(ExpectationRules::everything()),
            camera,
            mount,
            map,
            rules,
            operator: VerticalEdges::default(),
            level_operator: LevelEdges::default(),
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
            sights: Vec::new(),
        }
    }

    /// What each region shows, from the left, in a picture taken at `map_from_robot`, by the thresholds of `place`.
    ///
    /// # Errors
    /// `MalformedInput` for a picture of another size or a pose that is not finite, `MisRegistered` for a heading that is too
    /// uncertain (`heading_sigma`, rad), `LowContrast` where hardly any of the edges that the map has in view is seen.
    pub fn look(
        &mut self,
        image: ImageView,
        map_from_robot: &Pose2,
        heading_sigma: f64,
        place: &Place,
    ) -> Result<&[RegionSight], Reason> {
        let tolerance_px = self.tolerance(image, map_from_robot, heading_sigma)?;
        self.operator.edges(image, place.t0, &mut self.raw);
        self.raw.upright(&mut self.spare, &mut self.seen);
        self.seen.clear_above(self.horizon);
        self.expect(map_from_robot, tolerance_px);
        self.difference.compare(&self.seen, &self.expected, tolerance_px, &self.regions);
        self.difference.explain(&self.seen, &self.explained, &self.regions);
        self.check_contrast(image)?;
        self.uprights.find(image, self.map.walls(), map_from_robot, &self.regions, &mut self.steps);
        self.sights.clear();
        let learned = f64::from(place.n0_extra);
        self.find_level(image);
        let evidence = self.difference.extra.iter().zip(&self.level_counts).zip(&self.steps);
        for ((&extra, &level), &upright) in evidence {
            let is_step = upright.contrast > self.rules.contrast.limit(place.contrast);
            let is_obstacle = is_step
                || self.rules.edges.is_obstacle(extra, learned)
                || self.rules.level.is_obstacle(level, f64::from(place.level));
            let limit = self.rules.edges.limit(learned);
            self.sights.push(RegionSight { extra, limit, level, upright, is_step, is_obstacle });
        }
        Ok(&self.sights)
    }

    /// What a picture of the empty place teaches: the counts for each of [`thresholds`], and what else is seen.
    ///
    /// # Errors
    /// `MalformedInput` for a picture of another size or a pose that is not finite.
    pub fn learn(
        &mut self,
        image: ImageView,
        map_from_robot: &Pose2,
    ) -> Result<(Vec<Row>, FloorLook), Reason> {
        let tolerance_px = self.tolerance(image, map_from_robot, 0.0)?;
        self.operator.thinned(image, &mut self.thinned);
        self.expect(map_from_robot, tolerance_px);
        let rows = self.sweep(tolerance_px)?;
        self.uprights.find(image, self.map.walls(), map_from_robot, &self.regions, &mut self.steps);
        let contrast = self.steps.iter().map(|step| step.contrast).fold(0.0, f64::max);
        self.find_level(image);
        let level = self.level_counts.iter().copied().max().unwrap_or(0);
        Ok((rows, FloorLook { contrast, level }))
    }

    /// The level edges in the last picture that the map does not have.
    #[must_use]
    pub fn level(&self) -> &BitImage {
        &self.level
    }

    /// Where the foot of what a region holds is, pixels: that of a faint step, else the lowest place of the edges that the map does
    /// not have. `None` where the region holds nothing; the horizon where no edge tells.
    #[must_use]
    pub fn foot(&self, region: usize, min_px: u32) -> Option<Vector2<f64>> {
        let sight = self.sights.get(region).filter(|sight| sight.is_obstacle)?;
        if sight.is_step {
            return Some(sight.upright.foot);
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

    /// What each region of the last picture showed.
    #[must_use]
    pub fn sights(&self) -> &[RegionSight] {
        &self.sights
    }

    /// Columns and rows where the bare floor begins that faint steps were looked for on in the last picture.
    pub fn floor(&self) -> impl Iterator<Item = (usize, usize)> {
        self.uprights.floor()
    }

    /// The edges expected in the last picture.
    #[must_use]
    pub fn expected(&self) -> &BitImage {
        &self.expected
    }

    /// The upright edges seen in the last picture.
    #[must_use]
    pub fn seen(&self) -> &BitImage {
        &self.seen
    }

    /// The difference in the last picture.
    #[must_use]
    pub fn difference(&self) -> &EdgeDifference {
        &self.difference
    }

    /// The regions.
    #[must_use]
    pub fn regions(&self) -> &Regions {
        &self.regions
    }

    /// The camera.
    #[must_use]
    pub fn camera(&self) -> &Pinhole {
        &self.camera
    }

    /// Where it sits.
    #[must_use]
    pub fn mount(&self) -> &Mount {
        &self.mount
    }

    /// The building.
    #[must_use]
    pub fn map(&self) -> &WireFrame {
        &self.map
    }

    fn tolerance(&self, image: ImageView, pose: &Pose2, heading_sigma: f64) -> Result<usize, Reason> {
        let k = self.camera.intrinsics();
        let fits = (image.width(), image.height()) == (k.width as usize, k.height as usize);
        if !fits || !pose.is_finite() {
            return Err(Reason::MalformedInput);
        }
        let blur_px = 3.0 * k.fx * heading_sigma;
        if blur_px.is_nan() || blur_px > LARGEST_BLUR_PX.max(1.5 * self.rules.tolerance_px as f64) {
            return Err(Reason::MisRegistered);
        }
        Ok(self.rules.tolerance_px.max(blur_px.ceil() as usize))
    }

    /// Counts the level edges that the map does not have, region by region.
    fn find_level(&mut self, image: ImageView) {
        self.level_operator.edges(image, LEVEL_EDGES, &mut self.raw);
        self.raw.level(&mut self.spare, &mut self.level);
        self.level.clear_above(self.horizon);
        for (u, v) in self.uprights.feet() {
            let near_px = v.saturating_sub(self.horizon) as f64 * POSE_ERROR_M / self.mount.z.max(0.1);
            let rows = LEVEL_ROWS + near_px;
            let at = Vector2::new(u as f64, v as f64);
            let (beside, above) = (Vector2::new(1.0, 0.0), Vector2::new(0.0, rows));
            self.explained.quad([
                at - beside - above,
                at + beside - above,
                at + beside + above,
                at - beside + above,
            ]);
        }
        self.level.remove(&self.explained);
        self.regions.count_columns(&self.level, &mut self.level_counts);
    }

    /// Draws what the map lets expect: the upright edges, and the bands around all edges in which edges seen are theirs.
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
                    self.expected.line(from, to);
                    band(
                        &mut self.explained,
                        (from, to),
                        Vector2::new(blur_px, 0.0),
                        Vector2::new(blur_px, 0.0),
                    );
                } else {
                    // On the floor the rows below the horizon tell how near a place is.
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

    fn sweep(&mut self, tolerance_px: usize) -> Result<Vec<Row>, Reason> {
        let image = self.thinned.view().map_err(|_| Reason::MalformedInput)?;
        let rows = thresholds().map(|threshold| {
            self.raw.threshold(image, threshold);
            self.raw.upright(&mut self.spare, &mut self.seen);
            self.seen.clear_above(self.horizon);
            self.difference.compare(&self.seen, &self.expected, tolerance_px, &self.regions);
            self.difference.explain(&self.seen, &self.explained, &self.regions);
            Row {
                threshold,
                differing: self.difference.differing.clone(),
                extra: self.difference.extra.clone(),
                recall: self.difference.recall(),
            }
        });
        Ok(rows.collect())
    }

    /// A picture that shows next to nothing of the edges that must be there shows no obstacles either.
    fn check_contrast(&self, image: ImageView) -> Result<(), Reason> {
        const MIN_RECALL: f64 = 0.15;
        const MIN_EXPECTED_PX: u32 = 60;
        const MIN_SPREAD: u8 = 24;
        let is_blind = self.difference.expected >= MIN_EXPECTED_PX
            && self.difference.recall().is_some_and(|recall| recall < MIN_RECALL);
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

/// Sets the band around a line: `blur_from` and `blur_to` to either side at its ends.
fn band(
    mask: &mut BitImage,
    line: (Vector2<f64>, Vector2<f64>),
    blur_from: Vector2<f64>,
    blur_to: Vector2<f64>,
) {
    mask.quad([line.0 - blur_from, line.0 + blur_from, line.1 + blur_to, line.1 - blur_to]);
}

/// The row of the horizon straight ahead, within the picture.
fn horizon(camera: &Pinhole, mount: &Mount) -> usize {
    let k = camera.intrinsics();
    let ahead = mount.rotation_body_from_camera().transpose() * Vector3::new(1.0, 0.0, 0.0);
    let row = if ahead.z > 0.0 { k.cy + k.fy * ahead.y / ahead.z } else { 0.0 };
    row.clamp(0.0, f64::from(k.height) - 1.0) as usize
}
