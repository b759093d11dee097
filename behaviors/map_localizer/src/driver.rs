//! Drives along a path to its end.

use nalgebra::Point2;
use yamabico_core::behavior::BuildError;
use yamabico_core::geometry::{Twist, angle_difference};
use yamabico_core::map::WireFrame;
use yamabico_core::message::{Axes, Goal, Proposal, Reason};

use crate::belief::Belief;
use crate::config::Config;
use crate::pursuit::{JumpFilter, Pursuit, turn_towards};
use crate::route::{MOST_CORNERS, Planner, Route, RouteError, Station};

/// A goal's heading is reached within this, rad.
const HEADING_TOLERANCE_RAD: f64 = 0.05;
/// The robot may be pushed back along its path by this, metres; farther back it is not looked for.
const SLIP_BACK_M: f64 = 0.5;

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
    progress_m: f64,
    refusal: Option<RouteError>,
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
                largest_turn_rad_s: config.largest_turn_rad_s,
            },
            known: corners.iter().copied().take(MOST_CORNERS - 2).collect(),
            route: Route::new(corners, config.tolerance_m),
            tolerance_m: config.tolerance_m,
            clearance_m,
            goal_heading: None,
            progress_m: 0.0,
            refusal: None,
            is_turning: false,
            has_arrived: false,
            jump: JumpFilter::default(),
        })
    }

    /// The path.
    #[must_use]
    pub fn route(&self) -> &Route {
        &self.route
    }

    /// Where the robot stands on it; `None` without a path.
    #[must_use]
    pub fn station(&self, belief: &Belief) -> Option<Station> {
        self.route.station(&belief.pose, self.progress_m)
    }

    /// Takes a goal: a path to it replaces the old one, unless every way is blocked.
    pub fn take_goal(&mut self, goal: &Goal, belief: &Belief, map: &WireFrame) {
        let planner = Planner { map, clearance_m: self.clearance_m };
        match planner.path(belief.pose.position(), &self.known, Point2::new(goal.x, goal.y)) {
            Ok(corners) => {
                let is_usable = goal.tolerance_m.is_finite() && goal.tolerance_m > 0.0;
                let tolerance_m = if is_usable { goal.tolerance_m } else { self.tolerance_m };
                self.route = Route::new(corners, tolerance_m);
                self.goal_heading = goal.theta.is_finite().then_some(goal.theta);
                self.has_arrived = false;
                self.refusal = None;
                self.restart();
            }
            Err(error) => self.refusal = Some(error),
        }
    }

    /// The robot may stand anywhere on its path.
    pub fn restart(&mut self) {
        self.progress_m = 0.0;
        self.jump = JumpFilter::default();
    }

    /// The pose has jumped: by how much the robot has come to stand farther left of the path, metres.
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
        self.progress_m = self.progress_m.max(station.progress_m - SLIP_BACK_M);
        let tolerance_m = self.route.tolerance_m;
        self.has_arrived |= station.distance_m <= tolerance_m && station.to_go_m <= tolerance_m;
        if self.has_arrived {
            return self.stand(belief);
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
            turn_towards(heading, heading + error, self.law.largest_turn_rad_s)
        } else {
            Twist::ZERO
        };
        Proposal::drive(Axes::PLANAR, twist).with_note(format_args!("arrived"))
    }
}
