use yamabico_core::behavior::{ParameterError, Setup};
use yamabico_core::geometry::{Pose2, wrap_angle};
use yamabico_core::image::GrayImage;
use yamabico_core::message::{FrameHeader, Reason, View};
use yamabico_core::overlay::Overlay;
use yamabico_core::sensor::MountedMirror;
use yamabico_vision::azimuth_map::{EdgeMap, ObservedEdge};
use yamabico_vision::azimuth_profile::{AzimuthEdge, ProfileRule};
use yamabico_vision::map::{Wall, WireFrame};
use yamabico_vision::radial_edges::{RadialEdgeRule, RadialEdges};

use super::bearing::{EdgeLandmark, LeverArm, SeenBearing};
use super::localizer::{AzimuthFix, AzimuthLocalizer, AzimuthProblem, AzimuthRule};
use super::solver::{BearingPair, most_likely_pose};
use crate::CAMERA;
use crate::belief::Belief;
use crate::config::Config;
use crate::fix::{Fix, NoiseFactors, PoseFinder};
use crate::obstacles::{Foot, UnknownEdge, UnknownEdges};

/// Standard deviation of a point of an edge, px.
const POINT_SIGMA_PX: f64 = 0.3;
/// Standard deviation of the lower end of an edge, px.
const FOOT_SIGMA_PX: f64 = 4.0;
/// Distance from the inner radius of the detector below which the lower end of an edge counts as hidden, px.
const HIDDEN_FOOT_PX: f64 = 6.0;
/// Minimum number of pairs of a fix.
const MIN_PAIRS: usize = 3;
/// Minimum number of pairs of a search, and minimum fraction of the edges that should be in view.
const MIN_SEARCH_PAIRS: (usize, f64) = (4, 0.5);
/// Minimum standard deviations of position (m) and heading (rad) after a search.
const AZIMUTH_SEARCH_SIGMA: [f64; 2] = [0.02, 0.01];

/// Pose finder that matches the azimuths of vertical edges in the image of a mirror camera.
#[derive(Clone, Debug)]
pub struct AzimuthFinder {
    walls: WireFrame,
    robot_from_camera: Pose2,
    mirror: MountedMirror,
    inner_radius_px: f64,
    gray: GrayImage,
    edges: RadialEdges,
    sigma_rad: f64,
    sway_rad: f64,
    localizer: AzimuthLocalizer,
    rule: AzimuthRule,
    seen: Vec<SeenBearing>,
    /// Pose of the camera in the map frame at the last fix, including its sway.
    camera: Option<Pose2>,
    unknown: UnknownEdges,
    unmatched: Vec<ObservedEdge>,
    feet: Vec<Option<Foot>>,
    pairs: Vec<BearingPair>,
}

impl AzimuthFinder {
    /// Creates a finder for the configured map and the robot's mirror camera.
    ///
    /// # Errors
    /// The camera is of another kind, or the map is missing or invalid.
    pub fn new(config: &Config, setup: &Setup) -> Result<Self, ParameterError> {
        let mirror = setup.mirror_camera(&CAMERA)?;
        let map = EdgeMap::read(&config.file("edge_map", config.edge_map.as_ref(), setup)?)
            .map_err(|error| ParameterError::new("edge_map", error.to_string()))?;
        let walls: Vec<_> = map.walls().collect();
        let landmarks = map.edges.iter().map(|edge| {
            let edge = edge.located();
            let variance = 0.5 * edge.covariance.trace() + config.map_sigma_m.powi(2);
            EdgeLandmark { position: edge.position, sign: edge.sign, sigma_m: variance.sqrt() }
        });
        let rule = AzimuthRule::default();
        let image = *mirror.camera.image();
        let edge_rule = RadialEdgeRule::within(&image);
        let hiding = walls.clone();
        Ok(Self {
            robot_from_camera: Pose2::new(mirror.mount.x, mirror.mount.y, mirror.mount.pan),
            gray: GrayImage::default(),
            edges: RadialEdges::new(&image, &edge_rule, ProfileRule::default()),
            inner_radius_px: edge_rule.inner_radius_px,
            mirror,
            sigma_rad: config.azimuth_sigma_deg.to_radians(),
            sway_rad: config.sway_deg.to_radians(),
            localizer: AzimuthLocalizer::new(landmarks.collect(), hiding, LeverArm::zeros(), rule),
            rule,
            seen: Vec::new(),
            camera: None,
            unknown: UnknownEdges::new(&map),
            unmatched: Vec::new(),
            feet: Vec::new(),
            pairs: Vec::new(),
            walls: WireFrame::new(
                Vec::new(),
                walls.into_iter().map(|[from, to]| Wall { from, to }).collect(),
            ),
        })
    }

    /// Returns the edges of the last image.
    #[must_use]
    pub fn seen(&self) -> &[AzimuthEdge] {
        self.edges.profile().edges()
    }

    /// Returns the localizer that pairs observed edges with map edges.
    #[must_use]
    pub fn localizer(&self) -> &AzimuthLocalizer {
        &self.localizer
    }

    /// Converts the edges of the last image to measurements, with this factor on their variance.
    fn prepare_bearings(&mut self, scale: f64) {
        let sigma = |edge: &AzimuthEdge| edge.sigma_rad(POINT_SIGMA_PX, self.sigma_rad) * scale.sqrt();
        self.seen.clear();
        self.seen.extend(self.edges.profile().edges().iter().map(|edge| SeenBearing {
            azimuth_rad: edge.azimuth_rad,
            sign: Some(edge.sign),
            sigma_rad: sigma(edge),
        }));
    }

    /// Repeats the last fix with the variance of its pairs multiplied by `correlation`.
    fn with_correlation(&mut self, swayed: &Belief, fix: &AzimuthFix, correlation: f64) -> Option<Belief> {
        if correlation <= 1.0 {
            return Some(fix.belief);
        }
        self.pairs.clear();
        self.pairs.extend_from_slice(self.localizer.pairs());
        for pair in &mut self.pairs {
            pair.seen.sigma_rad *= correlation.sqrt();
            pair.landmark.sigma_m *= correlation.sqrt();
        }
        let guess = &fix.belief.pose;
        let found =
            most_likely_pose(&self.pairs, guess, Some(swayed), &self.rule.solver, LeverArm::zeros()).ok()?;
        Some(found.belief)
    }
}

impl PoseFinder for AzimuthFinder {
    fn walls(&self) -> &WireFrame {
        &self.walls
    }

    fn observe(&mut self, frame: &View<'_, FrameHeader>) -> Result<(), Reason> {
        self.camera = None;
        let image =
            frame.gray(self.mirror.camera.image().size(), &mut self.gray).ok_or(Reason::MalformedInput)?;
        let found = self.edges.find(image).map_err(|_| Reason::MalformedInput)?;
        if found.is_empty() { Err(Reason::TooFewSegments) } else { Ok(()) }
    }

    fn fix(&mut self, prior: &Belief, noise: NoiseFactors) -> Fix {
        self.prepare_bearings(noise.scale);
        let still = prior.of_mounted(&self.robot_from_camera);
        let swayed = still.with_sway(self.sway_rad);
        let located = self.localizer.locate(&swayed, &self.seen);
        let expected = self.localizer.visible();
        let without_update =
            |reason, lines| Fix { expected, uprights: [expected, lines], ..Fix::none(prior, reason) };
        let fix = match located {
            Ok(fix) => fix,
            Err(problem) => return without_update(reason(&problem), 0),
        };
        let Some(after) = self.with_correlation(&swayed, &fix, noise.correlation) else {
            return without_update(Reason::Degenerate, 0);
        };
        self.camera = Some(after.pose);
        let camera = still.corrected_without_sway(&swayed, &after);
        let is_enough = fix.pairs >= MIN_PAIRS;
        Fix {
            posterior: camera.of_mounted(&self.robot_from_camera.inverse()),
            verdict: if is_enough { Ok(()) } else { Err(Reason::TooFewMatches) },
            lines: fix.pairs,
            nis: fix.chi_squared,
            ..without_update(Reason::None, fix.pairs)
        }
    }

    fn search(&mut self, prior: &Belief, noise: NoiseFactors) -> Option<Belief> {
        self.prepare_bearings(noise.scale);
        let wide = prior.of_mounted(&self.robot_from_camera).with_sway(self.sway_rad);
        let fix = self.localizer.search(&wide, &self.seen).ok()?;
        let (pairs, fraction) = MIN_SEARCH_PAIRS;
        let is_found = fix.pairs >= pairs && fix.pairs as f64 >= fraction * self.localizer.visible() as f64;
        is_found.then(|| {
            let mut found = fix.belief.with_sway(self.sway_rad).of_mounted(&self.robot_from_camera.inverse());
            let [position, heading] = AZIMUTH_SEARCH_SIGMA;
            found.raise_variances([position * position, position * position, heading * heading]);
            found
        })
    }

    fn draw(&self, overlay: &mut Overlay) {
        let known = self.localizer.edge_of_seen().iter().map(Option::is_some).chain(std::iter::repeat(false));
        let seen = self.seen().iter().zip(known);
        let landmarks = self.localizer.expected().iter().map(|landmark| landmark.position);
        super::overlay::draw(overlay, &self.mirror.camera, seen, landmarks, self.camera.as_ref());
    }

    fn track_unknown(&mut self) {
        let Some(camera) = self.camera else { return };
        self.unmatched.clear();
        self.feet.clear();
        let map_edges = self.localizer.edge_of_seen();
        for (edge, known) in self.edges.profile().edges().iter().zip(map_edges) {
            if known.is_none() {
                self.unmatched.push(ObservedEdge {
                    azimuth_rad: wrap_angle(edge.azimuth_rad),
                    sign: edge.sign,
                    length_px: edge.length_px,
                });
                self.feet.push(foot(&self.mirror, self.inner_radius_px, edge));
            }
        }
        self.unknown.track(&self.unmatched, &self.feet, &camera);
    }

    fn forget_unknown(&mut self) {
        self.unknown.clear();
    }

    fn unknown_edges(&self) -> &[UnknownEdge] {
        self.unknown.edges()
    }
}

/// Returns the foot of an edge on the floor; `None` if its lower end is not in view.
fn foot(mirror: &MountedMirror, min_radius_px: f64, edge: &AzimuthEdge) -> Option<Foot> {
    let radius_px = edge.inner_radius_px().filter(|radius| *radius > min_radius_px + HIDDEN_FOOT_PX)?;
    let distance_m = mirror.camera.floor_radius_m(radius_px, mirror.mount.z)?;
    let slope = mirror.camera.floor_slope_m_per_px(radius_px, mirror.mount.z)?;
    Some(Foot { distance_m, sigma_m: FOOT_SIGMA_PX * slope })
}

fn reason(problem: &AzimuthProblem) -> Reason {
    match problem {
        AzimuthProblem::NoEdges => Reason::TooFewSegments,
        AzimuthProblem::BadPrediction => Reason::Inconsistent,
        AzimuthProblem::NoneInView => Reason::NoModel,
        AzimuthProblem::AllUnknown { seen } if *seen < MIN_PAIRS => Reason::TooFewMatches,
        AzimuthProblem::Singular => Reason::Degenerate,
        AzimuthProblem::AllUnknown { .. }
        | AzimuthProblem::Inconsistent { .. }
        | AzimuthProblem::Jump { .. } => Reason::Gated,
    }
}
