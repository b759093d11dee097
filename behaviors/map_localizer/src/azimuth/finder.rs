use yamabico_core::behavior::{BuildError, Setup};
use yamabico_core::geometry::{Pose2, wrap_angle};
use yamabico_core::image::GrayImage;
use yamabico_core::message::{FrameHeader, Reason, View};
use yamabico_core::sensor::MountedMirror;
use yamabico_vision::azimuth_map::{EdgeMap, SeenEdge};
use yamabico_vision::azimuth_profile::{AzimuthEdge, ProfileRule};
use yamabico_vision::map::{Wall, WireFrame};
use yamabico_vision::radial_edges::{RadialEdgeRule, RadialEdges};

use super::bearing::{EdgeLandmark, LeverArm, SeenBearing};
use super::localizer::{AzimuthFix, AzimuthLocalizer, AzimuthProblem, AzimuthRule};
use super::solver::{BearingPair, most_likely_pose};
use crate::CAMERA;
use crate::belief::Belief;
use crate::config::Config;
use crate::fix::{Fix, PoseFinder, Trust};
use crate::obstacles::{Foot, UnknownEdge, UnknownEdges};

/// How sharp a point of an edge is seen, pixels.
const POINT_SIGMA_PX: f64 = 0.3;
/// How well the lower end of an edge is seen, pixels.
const FOOT_SIGMA_PX: f64 = 4.0;
/// An edge that ends this near to where edges are looked for goes on, pixels.
const HIDDEN_FOOT_PX: f64 = 6.0;
/// Fewer edges than this do not fix a pose.
const MIN_PAIRS: usize = 3;
/// A search needs so many, and this share of the edges that should be in view.
const MIN_FOUND: (usize, f64) = (4, 0.5);
/// Least standard deviations of a robot that was found again: meters, radians.
const FOUND_SIGMA: [f64; 2] = [0.02, 0.01];

/// Finds the robot by the azimuths of vertical edges.
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
    /// Where the camera stood at the last fix, with its sway.
    camera: Option<Pose2>,
    unknown: UnknownEdges,
    unmatched: Vec<SeenEdge>,
    feet: Vec<Option<Foot>>,
    pairs: Vec<BearingPair>,
}

impl AzimuthFinder {
    /// One for the configuration's map and the robot's mirror camera.
    ///
    /// # Errors
    /// Another kind of camera, no map, or one that cannot be read.
    pub fn new(config: &Config, setup: &Setup) -> Result<Self, BuildError> {
        let mirror = setup.mirror_camera(&CAMERA)?;
        let map = EdgeMap::read(&config.file("edge_map", config.edge_map.as_ref(), setup)?)
            .map_err(|error| BuildError::new("edge_map", error.to_string()))?;
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

    /// The edges of the last picture.
    #[must_use]
    pub fn seen(&self) -> &[AzimuthEdge] {
        self.edges.profile().edges()
    }

    /// What pairs them with the map's.
    #[must_use]
    pub fn localizer(&self) -> &AzimuthLocalizer {
        &self.localizer
    }

    /// What is known of edges that the map does not explain.
    #[must_use]
    pub fn unknown(&self) -> &UnknownEdges {
        &self.unknown
    }

    /// The edges of the last picture as measurements of this variance's factor.
    fn see(&mut self, scale: f64) {
        let sigma = |edge: &AzimuthEdge| edge.sigma_rad(POINT_SIGMA_PX, self.sigma_rad) * scale.sqrt();
        self.seen.clear();
        self.seen.extend(self.edges.profile().edges().iter().map(|edge| SeenBearing {
            azimuth_rad: edge.azimuth_rad,
            sign: Some(edge.sign),
            sigma_rad: sigma(edge),
        }));
    }

    /// The pose with the pairs of the localizer's last call, where they tell so many times less.
    fn repeated(&mut self, swayed: &Belief, fix: &AzimuthFix, repetition: f64) -> Option<Belief> {
        if repetition <= 1.0 {
            return Some(fix.belief);
        }
        self.pairs.clear();
        self.pairs.extend_from_slice(self.localizer.pairs());
        for pair in &mut self.pairs {
            pair.seen.sigma_rad *= repetition.sqrt();
            pair.landmark.sigma_m *= repetition.sqrt();
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

    fn take(&mut self, frame: &View<'_, FrameHeader>) -> Result<(), Reason> {
        self.camera = None;
        let picture =
            frame.gray(self.mirror.camera.image().size(), &mut self.gray).ok_or(Reason::MalformedInput)?;
        let found = self.edges.find(picture).map_err(|_| Reason::MalformedInput)?;
        if found.is_empty() { Err(Reason::TooFewSegments) } else { Ok(()) }
    }

    fn fix(&mut self, prior: &Belief, trust: Trust) -> Fix {
        self.see(trust.scale);
        let still = prior.carried(&self.robot_from_camera);
        let swayed = still.swayed(self.sway_rad);
        let located = self.localizer.locate(&swayed, &self.seen);
        let expected = self.localizer.visible();
        let told = |reason, lines| Fix { expected, uprights: [expected, lines], ..Fix::none(prior, reason) };
        let fix = match located {
            Ok(fix) => fix,
            Err(problem) => return told(reason(&problem), 0),
        };
        let Some(after) = self.repeated(&swayed, &fix, trust.repetition) else {
            return told(Reason::Degenerate, 0);
        };
        self.camera = Some(after.pose);
        let camera = still.without_sway(&swayed, &after);
        let is_enough = fix.pairs >= MIN_PAIRS;
        Fix {
            posterior: camera.carried(&self.robot_from_camera.inverse()),
            verdict: if is_enough { Ok(()) } else { Err(Reason::TooFewMatches) },
            lines: fix.pairs,
            surprise: fix.chi_squared,
            ..told(Reason::None, fix.pairs)
        }
    }

    fn search(&mut self, prior: &Belief, trust: Trust) -> Option<Belief> {
        self.see(trust.scale);
        let wide = prior.carried(&self.robot_from_camera).swayed(self.sway_rad);
        let fix = self.localizer.search(&wide, &self.seen).ok()?;
        let (pairs, share) = MIN_FOUND;
        let is_found = fix.pairs >= pairs && fix.pairs as f64 >= share * self.localizer.visible() as f64;
        is_found.then(|| {
            let mut found = fix.belief.swayed(self.sway_rad).carried(&self.robot_from_camera.inverse());
            let [place, heading] = FOUND_SIGMA;
            found.floor([place * place, place * place, heading * heading]);
            found
        })
    }

    fn follow_unknown(&mut self) {
        let Some(camera) = self.camera else { return };
        self.unmatched.clear();
        self.feet.clear();
        let of_map = self.localizer.edge_of_seen();
        for (edge, known) in self.edges.profile().edges().iter().zip(of_map) {
            if known.is_none() {
                self.unmatched.push(SeenEdge {
                    azimuth_rad: wrap_angle(edge.azimuth_rad),
                    sign: edge.sign,
                    length_px: edge.length_px,
                });
                self.feet.push(foot(&self.mirror, self.inner_radius_px, edge));
            }
        }
        self.unknown.take(&self.unmatched, &self.feet, &camera);
    }

    fn unknown_edges(&self) -> &[UnknownEdge] {
        self.unknown.edges()
    }
}

/// Where an edge meets the floor; `None` where its lower end is not in the picture.
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
        AzimuthProblem::AllUnknown { seen } if *seen < MIN_PAIRS => Reason::TooFewMatches,
        AzimuthProblem::Singular => Reason::Degenerate,
        AzimuthProblem::AllUnknown { .. }
        | AzimuthProblem::Inconsistent { .. }
        | AzimuthProblem::Jump { .. } => Reason::Gated,
    }
}
