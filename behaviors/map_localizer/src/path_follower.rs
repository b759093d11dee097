//! Path following: plans paths around walls and obstacles and drives along them to the goal.

use std::borrow::Cow;

use nalgebra::Point2;
use serde::{Deserialize, Serialize};
use yamabico_core::behavior::ParameterError;
use yamabico_core::geometry::{Twist, angle_difference};
use yamabico_core::message::{Axes, Goal, Proposal, Reason};
use yamabico_vision::azimuth_map::{Inflation, PathError, VisibilityGraph, inflate};
use yamabico_vision::map::{Wall, WireFrame};

use crate::belief::Belief;
use crate::config::Config;
use crate::pursuit::{JumpFilter, PurePursuit, SteerInput, turn_toward};
use crate::route::{MAX_CORNERS, PathProgress, Planner, Route, RouteError};

/// Tolerance of the goal's heading, rad.
const GOAL_HEADING_TOLERANCE_RAD: f64 = 0.05;
/// Number of sides of the polygon that approximates the circle around the end of a wall.
const WALL_SIDES: u32 = 8;

/// Corners of a convex obstacle, counterclockwise, map frame, m.
pub type Polygon = Vec<Point2<f64>>;

/// Saved state of a [`PathFollower`], restored after a restart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PathState<'a> {
    #[serde(with = "coordinates")]
    corners: Cow<'a, [Point2<f64>]>,
    /// Corners of the configured route.
    #[serde(with = "coordinates")]
    configured: Cow<'a, [Point2<f64>]>,
    /// Tolerance that the goal stated, m.
    stated_tolerance_m: Option<f64>,
    goal_heading: Option<f64>,
    max_progress_m: Option<f64>,
    has_arrived: bool,
}

/// Follower of a path.
#[derive(Clone, Debug)]
pub struct PathFollower {
    law: PurePursuit,
    route: Route,
    /// Corners of the configured route, used as waypoints of new paths.
    waypoints: Vec<Point2<f64>>,
    /// Configured tolerance, used if a goal states none.
    tolerance_m: f64,
    /// Tolerance that the goal stated, m.
    stated_tolerance_m: Option<f64>,
    /// Minimum distance of a path from walls.
    clearance_m: f64,
    goal_heading: Option<f64>,
    /// Maximum progress along the path so far, m; `None` if the robot may be anywhere on the path.
    max_progress_m: Option<f64>,
    /// Reason for the rejection of the last goal.
    rejection: Option<RouteError>,
    /// Walls of the map, inflated by the clearance.
    walls: Vec<Polygon>,
    graph: VisibilityGraph,
    /// Reason why no path leads around the obstacles on the current one.
    blocked: Option<PathError>,
    is_turning: bool,
    has_arrived: bool,
    jump: JumpFilter,
}

impl PathFollower {
    /// Creates a follower of the configured route.
    ///
    /// # Errors
    /// The route crosses a wall of the map or passes too close to one.
    pub fn new(config: &Config, map: &WireFrame, radius_m: f64) -> Result<Self, ParameterError> {
        let clearance_m = radius_m + config.wall_margin_m;
        let mut corners = vec![Point2::new(config.start.x_m, config.start.y_m)];
        corners.extend(config.route.iter().map(|&[x, y]| Point2::new(x, y)));
        let planner = Planner { map, clearance_m };
        for (i, pair) in corners.windows(2).enumerate() {
            if !planner.is_free(pair[0], pair[1]) {
                let corner = i + 1;
                let problem = format!(
                    "the leg to corner {corner} must stay at least {clearance_m:.2} m away from the walls of the map, \
                     but passes closer or crosses one: move the corner or reduce `wall_margin_m`"
                );
                return Err(ParameterError::new("route", problem));
            }
        }
        Ok(Self {
            law: PurePursuit {
                speed_mps: config.speed_mps,
                look_ahead_m: config.look_ahead_m,
                max_turn_radps: config.max_turn_radps,
            },
            waypoints: corners.iter().copied().take(MAX_CORNERS - 2).collect(),
            route: Route::new(corners, config.tolerance_m),
            tolerance_m: config.tolerance_m,
            stated_tolerance_m: None,
            clearance_m,
            goal_heading: None,
            max_progress_m: None,
            rejection: None,
            walls: map.walls().iter().map(|wall| inflated(wall, clearance_m)).collect(),
            graph: VisibilityGraph::default(),
            blocked: None,
            is_turning: false,
            has_arrived: false,
            jump: JumpFilter::default(),
        })
    }

    /// Returns the state to save for a restart.
    #[must_use]
    pub fn state(&self) -> PathState<'_> {
        PathState {
            corners: Cow::Borrowed(self.route.corners()),
            configured: Cow::Borrowed(&self.waypoints),
            stated_tolerance_m: self.stated_tolerance_m,
            goal_heading: self.goal_heading,
            max_progress_m: self.max_progress_m,
            has_arrived: self.has_arrived,
        }
    }

    /// Restores a saved state, unless the configured route has changed since.
    pub fn restore(&mut self, state: PathState<'_>) {
        if *state.configured != *self.waypoints {
            return;
        }
        self.stated_tolerance_m = state.stated_tolerance_m;
        let tolerance_m = self.stated_tolerance_m.unwrap_or(self.tolerance_m);
        self.route = Route::new(state.corners.into_owned(), tolerance_m);
        self.goal_heading = state.goal_heading;
        self.max_progress_m = state.max_progress_m;
        self.has_arrived = state.has_arrived;
    }

    /// Returns the current path.
    #[must_use]
    pub fn route(&self) -> &Route {
        &self.route
    }

    /// Returns true if there is a path whose end is not reached yet.
    #[must_use]
    pub fn is_underway(&self) -> bool {
        self.route.corners().len() > 1 && !self.has_arrived
    }

    /// Returns the robot's progress along the path; `None` without a path.
    #[must_use]
    pub fn progress(&self, belief: &Belief) -> Option<PathProgress> {
        self.route.progress(&belief.pose, self.max_progress_m)
    }

    /// Plans a path to a goal, which replaces the current path. The current path stays if no path leads to the goal.
    pub fn set_goal(&mut self, goal: &Goal, belief: &Belief, map: &WireFrame) {
        let planner = Planner { map, clearance_m: self.clearance_m };
        let (from, to) = (belief.pose.position(), Point2::new(goal.x, goal.y));
        let along_waypoints = planner.path(from, &self.waypoints, to);
        match along_waypoints.or_else(|blocked| self.detour(from, to, &[]).map_err(|_| blocked)) {
            Ok(corners) => {
                let is_usable = goal.tolerance_m.is_finite() && goal.tolerance_m > 0.0;
                self.stated_tolerance_m = is_usable.then_some(goal.tolerance_m);
                self.route = Route::new(corners, self.stated_tolerance_m.unwrap_or(self.tolerance_m));
                self.goal_heading = goal.theta.is_finite().then_some(goal.theta);
                self.has_arrived = false;
                self.rejection = None;
                self.restart(Some(0.0));
            }
            Err(error) => self.rejection = Some(error),
        }
    }

    /// Plans a path around obstacles that block the current path. `hard` are the obstacles that block a path;
    /// `inflated` are the same ones with a larger margin, which a new path keeps. Corners of the path that remain
    /// reachable are kept.
    pub fn avoid(&mut self, hard: &[Polygon], inflated: &[Polygon], belief: &Belief) {
        let Some(progress) = self.progress(belief).filter(|_| !self.has_arrived) else { return };
        let ahead = self.route.corners_after(progress.progress_m);
        let from = |leg: usize| if leg == 0 { belief.pose.position() } else { ahead[leg - 1] };
        let is_crossed = |leg: &usize| !VisibilityGraph::is_open([from(*leg), ahead[*leg]], hard);
        let Some(leg) = (0..ahead.len()).find(is_crossed) else {
            self.blocked = None;
            return;
        };
        let is_reachable =
            |corner: &usize| VisibilityGraph::nearest_exit(ahead[*corner], inflated) == ahead[*corner];
        let to = (leg..ahead.len()).find(is_reachable).unwrap_or(ahead.len() - 1);
        let mut corners = vec![belief.pose.position()];
        corners.extend_from_slice(&ahead[..leg]);
        let (begin, end, rest) = (from(leg), ahead[to], ahead[to + 1..].to_vec());
        match self.detour(begin, end, inflated) {
            Ok(detour) if corners.len() + detour.len() + rest.len() <= MAX_CORNERS => {
                corners.extend_from_slice(&detour[1..]);
                corners.extend_from_slice(&rest);
                self.route = Route::new(corners, self.route.tolerance_m);
                self.blocked = None;
                self.restart(Some(0.0));
            }
            Ok(_) => self.blocked = Some(PathError::Enclosed),
            Err(error) => self.blocked = Some(error),
        }
    }

    /// Finds the shortest path around the walls and these obstacles. A path that begins inside of one leads out first;
    /// a path to a point inside of one ends at its boundary.
    fn detour(
        &mut self,
        from: Point2<f64>,
        to: Point2<f64>,
        obstacles: &[Polygon],
    ) -> Result<Vec<Point2<f64>>, PathError> {
        let all: Vec<&[Point2<f64>]> = self.walls.iter().chain(obstacles).map(Vec::as_slice).collect();
        let (out, goal) =
            (VisibilityGraph::nearest_exit(from, &all), VisibilityGraph::nearest_exit(to, &all));
        let (path, _) = self.graph.shortest(out, goal, &all)?;
        let mut corners = vec![from];
        corners.extend(path.iter().skip(usize::from(out == from)));
        if corners.len() > MAX_CORNERS { Err(PathError::Enclosed) } else { Ok(corners) }
    }

    /// Discards the progress along the path after the pose was lost: the robot may be anywhere on the path.
    pub fn forget_progress(&mut self) {
        self.restart(None);
    }

    fn restart(&mut self, max_progress_m: Option<f64>) {
        self.max_progress_m = max_progress_m;
        self.jump = JumpFilter::default();
    }

    /// Records a jump of the lateral error caused by a correction of the pose, m, positive to the left.
    pub fn add_jump(&mut self, lateral_m: f64) {
        self.jump.add(lateral_m);
    }

    /// Advances the time by `elapsed_s`.
    pub fn advance_time(&mut self, elapsed_s: f64) {
        self.jump.advance_time(elapsed_s);
    }

    /// Returns the proposal along the path, at `speed_factor` (0 to 1) times the cruising speed.
    pub fn drive(&mut self, belief: &Belief, speed_factor: f64) -> Proposal {
        let Some(progress) = self.progress(belief) else {
            return Proposal::abstain(Reason::None).with_note(format_args!("no route and no goal"));
        };
        self.max_progress_m = Some(self.max_progress_m.unwrap_or(0.0).max(progress.progress_m));
        let tolerance_m = self.route.tolerance_m;
        self.has_arrived |= progress.distance_m <= tolerance_m && progress.to_go_m <= tolerance_m;
        if self.has_arrived {
            return self.hold_at_goal(belief);
        }
        if let Some(blocked) = self.blocked {
            return Proposal::drive(Axes::PLANAR, Twist::ZERO)
                .with_reason(Reason::PassageBlocked)
                .with_note(format_args!("{blocked}"));
        }
        let input =
            SteerInput { pose: belief.pose, lateral_offset_m: self.jump.lateral_offset_m(), speed_factor };
        let twist = self.law.steer(&self.route, &progress, &input, &mut self.is_turning);
        let proposal = Proposal::drive(Axes::PLANAR, twist)
            .with_confidence(1.0 / (1.0 + (belief.sigma_xy_m() / 0.1).powi(2)));
        let proposal = if self.is_turning { proposal.uncoupled() } else { proposal };
        match self.rejection {
            Some(rejection) => proposal.with_note(format_args!("goal refused, old route kept: {rejection}")),
            None => proposal.with_note(format_args!(
                "{:.2} m to go, {:+.2} m left of the path, {:+.1} deg",
                progress.to_go_m,
                progress.lateral_error_m,
                progress.heading_error_rad.to_degrees()
            )),
        }
    }

    /// Turns to the goal's heading, then stands still.
    fn hold_at_goal(&self, belief: &Belief) -> Proposal {
        let heading = belief.pose.theta;
        let error = self.goal_heading.map_or(0.0, |goal| angle_difference(goal, heading));
        let proposal = if error.abs() > GOAL_HEADING_TOLERANCE_RAD {
            let turn = turn_toward(heading, heading + error, self.law.max_turn_radps);
            Proposal::drive(Axes::PLANAR, turn).uncoupled()
        } else {
            Proposal::drive(Axes::PLANAR, Twist::ZERO)
        };
        proposal.with_note(format_args!("arrived"))
    }
}

/// Serialization of points as pairs of coordinates.
mod coordinates {
    use std::borrow::Cow;

    use nalgebra::Point2;
    use serde::{Deserialize, Deserializer, Serializer};

    pub fn serialize<S: Serializer>(points: &[Point2<f64>], serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(points.iter().map(|point| [point.x, point.y]))
    }

    pub fn deserialize<'a, 'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Cow<'a, [Point2<f64>]>, D::Error> {
        let points = Vec::<[f64; 2]>::deserialize(deserializer)?;
        Ok(points.into_iter().map(Point2::from).collect())
    }
}

fn inflated(wall: &Wall, by_m: f64) -> Polygon {
    let inflation = Inflation { radius_m: by_m, sides: WALL_SIDES };
    let (mut corners, mut polygon) = (Vec::new(), Vec::new());
    inflate([wall.from, wall.to], &inflation, &mut corners, &mut polygon);
    polygon
}
