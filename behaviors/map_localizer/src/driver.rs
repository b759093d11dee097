//! Drives along a path to its end.

use std::borrow::Cow;

use nalgebra::Point2;
use serde::{Deserialize, Serialize};
use yamabico_core::behavior::BuildError;
use yamabico_core::geometry::{Twist, angle_difference};
use yamabico_core::message::{Axes, Goal, Proposal, Reason};
use yamabico_vision::azimuth_map::{Inflation, PathError, VisibilityGraph, inflate};
use yamabico_vision::map::{Wall, WireFrame};

use crate::belief::Belief;
use crate::config::Config;
use crate::pursuit::{JumpFilter, Pursuit, turn_towards};
use crate::route::{MAX_CORNERS, Planner, Route, RouteError, Station};

/// A goal's heading is reached within this, rad.
const HEADING_TOLERANCE_RAD: f64 = 0.05;
/// A path goes round the end of a wall along so many sides of a polygon.
const WALL_SIDES: u32 = 8;

/// Corners of a convex obstacle, counterclockwise, meters.
pub type Polygon = Vec<Point2<f64>>;

/// A path and how far the robot came along it, to go on from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Journey<'a> {
    #[serde(with = "places")]
    corners: Cow<'a, [Point2<f64>]>,
    /// Those of the configuration.
    #[serde(with = "places")]
    configured: Cow<'a, [Point2<f64>]>,
    tolerance_m: f64,
    goal_heading: Option<f64>,
    farthest_m: Option<f64>,
    has_arrived: bool,
}

/// The path, and what has been driven of it.
#[derive(Clone, Debug)]
pub struct Driver {
    law: Pursuit,
    route: Route,
    /// Places that a new path may go by.
    known: Vec<Point2<f64>>,
    tolerance_m: f64,
    clearance_m: f64,
    goal_heading: Option<f64>,
    /// How far along the path the robot came, meters; `None` where it may stand anywhere on it.
    farthest_m: Option<f64>,
    refusal: Option<RouteError>,
    /// The walls of the map, grown by what a path keeps from them.
    walls: Vec<Polygon>,
    graph: VisibilityGraph,
    /// Why there is no way round what stands in the path.
    blocked: Option<PathError>,
    is_turning: bool,
    has_arrived: bool,
    jump: JumpFilter,
}

impl Driver {
    /// One on the route of the configuration.
    ///
    /// # Errors
    /// A route through a wall of the map, or too near to one.
    pub fn new(config: &Config, map: &WireFrame, radius_m: f64) -> Result<Self, BuildError> {
        let clearance_m = radius_m + config.wall_margin_m;
        let mut corners = vec![Point2::new(config.start.x_m, config.start.y_m)];
        corners.extend(config.route.iter().map(|&[x, y]| Point2::new(x, y)));
        let planner = Planner { map, clearance_m };
        for (i, pair) in corners.windows(2).enumerate() {
            if !planner.is_free(pair[0], pair[1]) {
                let corner = i + 1;
                return Err(BuildError::new(
                    "route",
                    format!(
                        "the way to its corner {corner} crosses a wall of the map, or passes one nearer than \
                         {clearance_m:.2} m"
                    ),
                ));
            }
        }
        Ok(Self {
            law: Pursuit {
                speed_mps: config.speed_mps,
                look_ahead_m: config.look_ahead_m,
                largest_turn_radps: config.largest_turn_radps,
            },
            known: corners.iter().copied().take(MAX_CORNERS - 2).collect(),
            route: Route::new(corners, config.tolerance_m),
            tolerance_m: config.tolerance_m,
            clearance_m,
            goal_heading: None,
            farthest_m: None,
            refusal: None,
            walls: map.walls().iter().map(|wall| grown(wall, clearance_m)).collect(),
            graph: VisibilityGraph::default(),
            blocked: None,
            is_turning: false,
            has_arrived: false,
            jump: JumpFilter::default(),
        })
    }

    /// What a successor must know.
    #[must_use]
    pub fn memory(&self) -> Journey<'_> {
        Journey {
            corners: Cow::Borrowed(self.route.corners()),
            configured: Cow::Borrowed(&self.known),
            tolerance_m: self.route.tolerance_m,
            goal_heading: self.goal_heading,
            farthest_m: self.farthest_m,
            has_arrived: self.has_arrived,
        }
    }

    /// Goes on where a predecessor stopped, unless another way is configured since.
    pub fn recall(&mut self, journey: Journey<'_>) {
        if *journey.configured != *self.known {
            return;
        }
        self.route = Route::new(journey.corners.into_owned(), journey.tolerance_m);
        self.goal_heading = journey.goal_heading;
        self.farthest_m = journey.farthest_m;
        self.has_arrived = journey.has_arrived;
    }

    /// The path.
    #[must_use]
    pub fn route(&self) -> &Route {
        &self.route
    }

    /// Where the robot stands on it; `None` without a path.
    #[must_use]
    pub fn station(&self, belief: &Belief) -> Option<Station> {
        self.route.station(&belief.pose, self.farthest_m)
    }

    /// Takes a goal: a path to it replaces the old one, unless every way is blocked.
    pub fn take_goal(&mut self, goal: &Goal, belief: &Belief, map: &WireFrame) {
        let planner = Planner { map, clearance_m: self.clearance_m };
        let (from, to) = (belief.pose.position(), Point2::new(goal.x, goal.y));
        let straight = planner.path(from, &self.known, to);
        match straight.or_else(|blocked| self.way_round(from, to, &[]).map_err(|_| blocked)) {
            Ok(corners) => {
                let is_usable = goal.tolerance_m.is_finite() && goal.tolerance_m > 0.0;
                let tolerance_m = if is_usable { goal.tolerance_m } else { self.tolerance_m };
                self.route = Route::new(corners, tolerance_m);
                self.goal_heading = goal.theta.is_finite().then_some(goal.theta);
                self.has_arrived = false;
                self.refusal = None;
                self.restart(Some(0.0));
            }
            Err(error) => self.refusal = Some(error),
        }
    }

    /// Finds a way round obstacles that stand in the path: `near`, which it must not cross, and the same ones larger by some
    /// more, `grown`, which the new way keeps from. Corners that can be reached are gone by as before.
    pub fn avoid(&mut self, near: &[Polygon], grown: &[Polygon], belief: &Belief) {
        let Some(station) = self.station(belief).filter(|_| !self.has_arrived) else { return };
        let ahead = self.route.corners_after(station.progress_m);
        let from = |leg: usize| if leg == 0 { belief.pose.position() } else { ahead[leg - 1] };
        let is_crossed = |leg: &usize| !VisibilityGraph::is_open([from(*leg), ahead[*leg]], near);
        let Some(leg) = (0..ahead.len()).find(is_crossed) else {
            self.blocked = None;
            return;
        };
        let is_reachable = |corner: &usize| VisibilityGraph::way_out(ahead[*corner], grown) == ahead[*corner];
        let to = (leg..ahead.len()).find(is_reachable).unwrap_or(ahead.len() - 1);
        let mut corners = vec![belief.pose.position()];
        corners.extend_from_slice(&ahead[..leg]);
        let (begin, end, rest) = (from(leg), ahead[to], ahead[to + 1..].to_vec());
        match self.way_round(begin, end, grown) {
            Ok(way) if corners.len() + way.len() + rest.len() <= MAX_CORNERS => {
                corners.extend_from_slice(&way[1..]);
                corners.extend_from_slice(&rest);
                self.route = Route::new(corners, self.route.tolerance_m);
                self.blocked = None;
                self.restart(Some(0.0));
            }
            Ok(_) => self.blocked = Some(PathError::Enclosed),
            Err(error) => self.blocked = Some(error),
        }
    }

    /// The shortest way between the walls and these obstacles. From within one it leads out first; a goal within one is
    /// approached as far as it goes.
    fn way_round(
        &mut self,
        from: Point2<f64>,
        to: Point2<f64>,
        obstacles: &[Polygon],
    ) -> Result<Vec<Point2<f64>>, PathError> {
        let all: Vec<&[Point2<f64>]> = self.walls.iter().chain(obstacles).map(Vec::as_slice).collect();
        let (out, goal) = (VisibilityGraph::way_out(from, &all), VisibilityGraph::way_out(to, &all));
        let (path, _) = self.graph.shortest(out, goal, &all)?;
        let mut corners = vec![from];
        corners.extend(path.iter().skip(usize::from(out == from)));
        if corners.len() > MAX_CORNERS { Err(PathError::Enclosed) } else { Ok(corners) }
    }

    /// The pose was lost: the robot may stand anywhere on its path.
    pub fn forget_station(&mut self) {
        self.restart(None);
    }

    fn restart(&mut self, farthest_m: Option<f64>) {
        self.farthest_m = farthest_m;
        self.jump = JumpFilter::default();
    }

    /// The pose has jumped: by how much the robot has come to stand farther left of the path, meters.
    pub fn jump(&mut self, by_m: f64) {
        self.jump.jump(by_m);
    }

    /// Time has passed, s.
    pub fn pass(&mut self, elapsed_s: f64) {
        self.jump.pass(elapsed_s);
    }

    /// What to do next, with this share (0 to 1) of the cruising speed.
    pub fn drive(&mut self, belief: &Belief, share: f64) -> Proposal {
        let Some(station) = self.station(belief) else {
            return Proposal::abstain(Reason::None).with_note(format_args!("no route and no goal"));
        };
        self.farthest_m = Some(self.farthest_m.unwrap_or(0.0).max(station.progress_m));
        let tolerance_m = self.route.tolerance_m;
        self.has_arrived |= station.distance_m <= tolerance_m && station.to_go_m <= tolerance_m;
        if self.has_arrived {
            return self.stand(belief);
        }
        if let Some(blocked) = self.blocked {
            return Proposal::drive(Axes::PLANAR, Twist::ZERO)
                .because(Reason::PassageBlocked)
                .with_note(format_args!("{blocked}"));
        }
        let aside_m = self.jump.aside_m();
        let twist = self.law.steer(&self.route, &station, &belief.pose, aside_m, share, &mut self.is_turning);
        let proposal = Proposal::drive(Axes::PLANAR, twist)
            .with_confidence(1.0 / (1.0 + (belief.sigma_xy_m() / 0.1).powi(2)));
        let proposal = if self.is_turning { proposal.uncoupled() } else { proposal };
        match self.refusal {
            Some(refusal) => proposal.with_note(format_args!("goal refused, old route kept: {refusal}")),
            None => proposal.with_note(format_args!(
                "{:.2} m to go, {:+.2} m left of the path, {:+.1} deg",
                station.to_go_m,
                station.lateral_error_m,
                station.heading_error_rad.to_degrees()
            )),
        }
    }

    /// At the goal: turned to its heading, then still.
    fn stand(&self, belief: &Belief) -> Proposal {
        let heading = belief.pose.theta;
        let error = self.goal_heading.map_or(0.0, |goal| angle_difference(goal, heading));
        let twist = if error.abs() > HEADING_TOLERANCE_RAD {
            turn_towards(heading, heading + error, self.law.largest_turn_radps)
        } else {
            Twist::ZERO
        };
        Proposal::drive(Axes::PLANAR, twist).with_note(format_args!("arrived"))
    }
}

/// Places as pairs of coordinates.
mod places {
    use std::borrow::Cow;

    use nalgebra::Point2;
    use serde::{Deserialize, Deserializer, Serializer};

    pub fn serialize<S: Serializer>(places: &[Point2<f64>], serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(places.iter().map(|place| [place.x, place.y]))
    }

    pub fn deserialize<'a, 'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Cow<'a, [Point2<f64>]>, D::Error> {
        let places = Vec::<[f64; 2]>::deserialize(deserializer)?;
        Ok(places.into_iter().map(Point2::from).collect())
    }
}

fn grown(wall: &Wall, by_m: f64) -> Polygon {
    let inflation = Inflation { radius_m: by_m, sides: WALL_SIDES };
    let (mut corners, mut polygon) = (Vec::new(), Vec::new());
    inflate([wall.from, wall.to], &inflation, &mut corners, &mut polygon);
    polygon
}
