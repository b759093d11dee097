//! Decision of the avoider: the lane, the step of the drive, and the proposal with its evidence.

use nalgebra::{Point2, Rotation2};
use yamabico_core::geometry::{Hypotenuse, Pose2, Twist};
use yamabico_core::message::{Axes, Kind, Proposal, Reason};
use yamabico_core::time::Time;

use super::drive::{self, AIM_STATION};
use super::planner::Scene;
use super::situation::Situation;
use super::stations::PathAhead;
use super::unseen::UnseenGround;
use super::{AHEAD_RAD, ASIDE_RAD, LaneAvoider, MAX_CELLS, WALL_M};

/// Part of the error of the grid that is risked in a narrow gap, m; the speed there, m/s; and the free length below which narrow
/// gaps are tried, and that one must add, m.
const NARROW_M: f64 = 0.04;
const NARROW_MPS: f64 = 0.12;
const NARROW_FREE_M: (f64, f64) = (1.0, 0.4);
/// Area around the robot whose obstacles matter for planning, m, along the path: behind, ahead, and to each side.
const AROUND_M: (f64, f64, f64) = (-1.2, 2.7, 2.0);
/// Distance from the end of the path at which the robot has arrived, m.
const ARRIVED_M: f64 = 0.35;
/// Age of the newest picture above which the speed is limited, s.
const PICTURE_STALE_S: f64 = 0.5;

impl LaneAvoider {
    /// Plans, and returns the proposal.
    pub(super) fn step(&mut self, now: Time) -> Proposal {
        let Some(newest) = self.odometry.newest().copied() else {
            return Proposal::abstain(Reason::NoInput);
        };
        let proposal = match self.lost_reason(now) {
            // Another behavior may turn to find the place; without a map one may look for a corridor.
            Some(reason) => {
                self.drive.interrupt();
                Proposal::halt(Axes::LINEAR.union(Axes::LATERAL), reason)
                    .with_note(format_args!("the place on the map is not known: {reason}"))
                    .with_evidence(now)
            }
            None => self.drive_or_leave(now, &newest.pose),
        };
        Proposal { stamp_ns: newest.stamp.0, ..proposal }
    }

    /// Proposes to drive a robot at `robot` (odometry frame) along the best lane, or leaves it to others where the path is free.
    fn drive_or_leave(&mut self, now: Time, robot: &Pose2) -> Proposal {
        let blind = self.blindness(now);
        if blind.is_some() {
            self.covered.forget();
        }
        let on_map = self.map_from_odometry();
        self.gather_occupied(robot, on_map.as_ref());
        self.path = PathAhead::of(&self.guidance, on_map.map(|on_map| on_map * *robot).as_ref());
        self.watch_crossing(now, robot);
        let situation = self.plan(now, robot, on_map.as_ref(), blind.is_some());
        let proposal = match (self.drive.step(&situation), blind) {
            (Some(proposal), _) => proposal,
            (None, Some(reason)) => {
                Proposal::limit(Axes::LINEAR, Twist::planar(self.config.blind_speed_mps, 0.0), reason)
                    .with_note(format_args!("no frame was evaluated: {reason}"))
            }
            (None, None) => Proposal::abstain(Reason::Clear),
        };
        if self.drive.doubts() {
            self.grid.doubt(robot.position());
        }
        // A drive without pictures rests on the scans; standing and limits rest on the present.
        let evidence = match blind {
            _ if proposal.twist == Twist::ZERO || proposal.kind() != Some(Kind::Drive) => Some(now),
            Some(_) => self.last_scan,
            None => self.last_picture,
        };
        proposal.with_evidence(evidence.unwrap_or(now).min(now))
    }

    /// Takes in where something has come to a moment ago.
    fn watch_crossing(&mut self, now: Time, robot: &Pose2) {
        let cells = &self.occupied[self.occupied.len() - self.occupied_cells..];
        let moves = |place: &Point2<f64>| self.grid.moves(robot.transform_point(*place));
        let moving = cells.iter().map(|place| place.cast()).filter(moves);
        self.crossing.see(now.as_secs_f64(), &self.path, moving);
    }

    /// Chooses the lane of a robot at `robot` (odometry frame), and returns what the drive goes by.
    fn plan(&mut self, now: Time, robot: &Pose2, on_map: Option<&Pose2>, is_blind: bool) -> Situation {
        let now_s = now.as_secs_f64();
        let walls = &self.near_walls;
        let wall_m = |place: Point2<f64>| {
            on_map.map_or(f64::INFINITY, |on_map| {
                walls.clearance(on_map.transform_point(robot.transform_point(place)))
            })
        };
        let is_floor = |place: Point2<f64>| {
            !self.config.uses_look || self.grid.is_taken_for_floor(robot.transform_point(place))
        };
        let unseen = UnseenGround::of(&self.path, is_floor);
        let scene = Scene {
            path: &self.path,
            obstacles: &self.occupied,
            unseen: &unseen,
            walkway: self.crossing.walkway(now_s),
            wall_m: &wall_m,
            clearance_m: self.clearance_m,
            wall_clearance_m: self.wall_clearance_m,
            touch_m: self.touch_m,
            wall_touch_m: self.wall_touch_m,
        };
        self.plan = scene.plan(self.drive.lane_m());
        let narrow = Scene { clearance_m: self.clearance_m - NARROW_M, ..scene };
        let is_narrow = self.plan.best.free_m < NARROW_FREE_M.0 && {
            let best = narrow.plan(self.drive.lane_m()).best;
            let is_longer = best.free_m > self.plan.best.free_m + NARROW_FREE_M.1;
            if is_longer {
                self.plan.best = best;
            }
            is_longer
        };
        let aim = self.path.stations[AIM_STATION].beside(self.plan.best.offset_m);
        let blind_mps = if is_blind { self.config.blind_speed_mps } else { f64::INFINITY };
        let narrow_mps = if is_narrow { NARROW_MPS } else { f64::INFINITY };
        Situation {
            now_s,
            plan: self.plan,
            aim,
            odometry: *robot,
            path_heading: self.path.heading(),
            echo_ahead_m: self.sonar.nearest_m(-AHEAD_RAD..AHEAD_RAD),
            echo_left_m: self.sonar.nearest_m(AHEAD_RAD..ASIDE_RAD),
            echo_right_m: self.sonar.nearest_m(-ASIDE_RAD..-AHEAD_RAD),
            straight_m: scene.straight_m(),
            arc_m: scene.arc_m(drive::curvature_to(aim)),
            is_sonar_silent: self.sonar.is_silent(),
            gate_m: self.config.gate_m,
            clearance_m: self.clearance_m,
            speed_mps: self.config.speed_mps.min(blind_mps).min(narrow_mps),
            max_turn_radps: self.config.max_turn_radps,
            is_crossed: self.crossing.is_there(now_s),
            is_arrived: self.is_arrived(),
            room: [1.0, -1.0].map(|side| scene.room(side)),
            way_out: if self.drive.looks_for_way_out(now_s) { self.way_finder.find(&narrow) } else { None },
        }
    }

    /// Returns why the place on the map is not known; `None` if it is, or without a map.
    fn lost_reason(&self, now: Time) -> Option<Reason> {
        let is_known = self.guidance.is_in_corridor() || self.guidance.is_localized(&self.odometry, now);
        (!is_known).then(|| self.guidance.lost_reason())
    }

    /// Returns why vision gives no result; `None` if it does.
    fn blindness(&self, now: Time) -> Option<Reason> {
        let is_stale = self.last_picture.is_none_or(|stamp| now.seconds_after(stamp) > PICTURE_STALE_S);
        let failure = self.pose_failure.or(self.picture_failure);
        failure.or(is_stale.then_some(Reason::StaleInput))
    }

    /// True if the path ends here.
    fn is_arrived(&self) -> bool {
        let corners = self.guidance.path().windows(2);
        let length_m: f64 =
            corners.map(|pair| (pair[1].x - pair[0].x).hypotenuse(pair[1].y - pair[0].y)).sum();
        length_m > 0.0 && length_m - self.guidance.path_header().progress_m < ARRIVED_M
    }

    /// Gathers the occupied places around the robot that are not walls.
    fn gather_occupied(&mut self, robot: &Pose2, on_map: Option<&Pose2>) {
        let to_robot = robot.inverse();
        let (walls, (behind_m, ahead_m, aside_m)) = (&self.near_walls, AROUND_M);
        let to_path = Rotation2::new(-self.path.heading());
        let matters = |cell: Point2<f64>| {
            let place = to_robot.transform_point(cell);
            let on_path = to_path * place;
            let is_around = (behind_m..ahead_m).contains(&on_path.x) && on_path.y.abs() < aside_m;
            let is_open =
                || on_map.is_none_or(|on_map| walls.clearance(on_map.transform_point(cell)) > WALL_M);
            (is_around && is_open()).then(|| place.cast())
        };
        self.occupied.clear();
        self.occupied.extend(self.covered.places().filter_map(matters));
        let covered = self.occupied.len();
        self.occupied.extend(self.grid.occupied().filter_map(matters).take(MAX_CELLS));
        self.occupied_cells = self.occupied.len() - covered;
    }
}
