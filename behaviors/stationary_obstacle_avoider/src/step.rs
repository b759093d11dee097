//! Steps of the avoider: state transitions, echoes, and publication of obstacles.

use nalgebra::Point2;
use yamabico_core::behavior::Outputs;
use yamabico_core::message::{Obstacle, ObstaclesHeader, Reason};
use yamabico_core::time::Time;

use crate::OBSTACLES;
use crate::halt_state_machine::{State, Tick};
use crate::passage_avoider::PassageAvoider;
use crate::search::Search;

/// Distance from a wall of the map within which an echo is assigned to the wall, m.
const WALL_ECHO_M: f64 = 0.15;

impl PassageAvoider {
    /// Advances the state machine by the newest scan, and applies the limits of the search.
    pub(crate) fn step(&mut self, now: Time) {
        self.add_echoes(now);
        self.report_blindness(now);
        let robot = self.robot();
        self.known_obstacles.expire(now, robot.map(|robot| robot.position()));
        let speed_mps = self.odometry.newest().map_or(0.0, |newest| newest.twist.speed());
        let path = *self.guidance.path_header();
        let tick = Tick {
            now_s: now.as_secs_f64(),
            echo: self.sonar.has_echo(self.config.gate_m, self.clearances.half_width_m),
            beside: robot.is_some_and(|robot| self.is_beside_obstacle(&robot)),
            speed_mps,
            heading: robot.map_or(f64::NAN, |robot| robot.theta),
            lateral_m: path.lateral_error_m,
            path_heading_error: path.heading_error_rad,
            progress_m: path.progress_m,
            pose_ok: self.guidance.is_localized(&self.odometry, now) && robot.is_some(),
            vision: self.pending.take(),
        };
        let before = self.order.state;
        (self.machine, self.order) = self.machine.step(&tick, &self.rules);
        let along = robot.map(|robot| robot.theta - path.heading_error_rad);
        if self.order.state == State::Relook && self.search.is_due() {
            (self.machine, self.order) = self.machine.start_search();
        }
        if self.order.state != before {
            self.entered = now;
            if self.order.state == State::Halt {
                self.halt_reason = if tick.echo { Reason::Echo } else { Reason::PassageBlocked };
            }
            self.search = self.search.after(self.order.state, robot, along);
            if matches!(self.order.state, State::Follow | State::Rejoin | State::Search) {
                self.lean_m = 0.0;
            }
        }
        if self.search.is_exhausted() {
            (self.machine, self.order) = self.machine.block_path();
            (self.entered, self.search) = (now, Search::default());
        }
        if self.order.state == State::Blocked && now.seconds_after(self.entered) > self.config.retry_s {
            self.known_obstacles.forget_ahead(robot);
            (self.machine, self.search) = (self.machine.start_search().0, Search::default());
        }
    }

    /// Adds echoes to the obstacle memory, except those from walls of the map.
    fn add_echoes(&mut self, now: Time) {
        let Some(robot) = self.robot() else { return };
        for beam in self.sonar.beams() {
            let Some(range_m) = beam.echo_m().filter(|range| (0.0..self.config.gate_m).contains(range))
            else {
                continue;
            };
            let (sin, cos) = beam.azimuth_rad.sin_cos();
            let at = Point2::new(beam.x_m + range_m * cos, beam.y_m + range_m * sin);
            let on_map = robot.transform_point(at);
            let is_sound = on_map.x.is_finite() && on_map.y.is_finite();
            if is_sound && self.detector.map().clearance(on_map) > WALL_ECHO_M {
                self.known_obstacles.add_echo(on_map, 0.1, now);
            }
        }
    }

    /// Publishes the confirmed obstacles in the robot frame.
    pub(crate) fn publish(&mut self, now: Time, outputs: &mut Outputs<'_>) {
        let (Some(robot), Some(newest), Some(evaluated)) =
            (self.robot(), self.odometry.newest(), self.evaluated)
        else {
            return;
        };
        self.obstacles.clear();
        for obstacle in self.known_obstacles.confirmed() {
            let at = robot.inverse().transform_point(obstacle.at);
            let variance = (0.1 * at.coords.norm()).powi(2);
            let age = now.seconds_after(obstacle.seen) / obstacle.lifetime_s(Some(robot.position()));
            self.obstacles.push(Obstacle {
                x: at.x,
                y: at.y,
                radius_m: obstacle.radius_m,
                covariance: [variance, 0.0, 0.0, variance],
                confidence: (1.0 - age).clamp(0.0, 1.0),
            });
        }
        self.sequence += 1;
        let header =
            ObstaclesHeader { stamp_ns: newest.stamp.0, evidence_ns: evaluated.0, sequence: self.sequence };
        // A missing subscriber or a full queue does not affect the proposal.
        let _ = outputs.publish(OBSTACLES.name, &header, &self.obstacles);
    }
}
