//! Transitions between the modes of the drive.

use yamabico_core::geometry::{angle_difference, wrap_angle};

use super::super::mode::Mode;
use super::super::situation::Situation;
use super::super::way_out::Leg;
use super::{Drive, OUT_RADPS, out_radps};

/// Smallest share of the speed that is worth driving.
const MIN_SHARE: f64 = 0.08;
/// Time that the robot stands at least, s; times after which it takes a route around, backs off the way it came, and tries another
/// way, s.
const MIN_WAIT_S: f64 = 0.3;
pub(super) const ROUTE_S: f64 = 1.5;
const BACK_OFF_S: f64 = 2.0;
const WAIT_S: f64 = 4.0;
/// Time after which what crosses the way is passed, however it moves, s.
const YIELD_S: f64 = 12.0;
/// Angles to the path at which the turn ends, rad: with a free view, and at last. Range of a free view, m.
const TURN_RAD: (f64, f64) = (0.44, 1.05);
const VIEW_M: f64 = 0.9;
/// Angle to the path from which a leg of a route leads away from what is in view, rad.
const MAX_LEG_RAD: f64 = 1.4;
/// Difference to its heading at which a leg of a route is faced, rad.
const FACED_RAD: f64 = 0.08;
/// Length of a way out, m.
pub(super) const OUT_M: f64 = 0.35;
/// Free distance ahead at which a way out ends, m.
const OUT_STOP_M: f64 = 0.05;
/// Length from which backing off is worth it, m.
const MIN_BACK_M: f64 = 0.15;
/// Number of legs of a route, and ways back, after which the robot turns instead: from where one ends, another often leads back.
pub(super) const MAX_TRIES: u32 = 3;
/// Time after which a turn or a way out is given up, s.
const MANEUVER_S: f64 = 5.0;

impl Drive {
    /// Mode after `at`.
    pub(super) fn next(&self, at: &Situation) -> Mode {
        let wait = Mode::Wait { since_s: at.now_s };
        match self.mode {
            _ if at.is_arrived => Mode::Free,
            Mode::Yield { since_s } if at.is_crossed && at.now_s - since_s < YIELD_S => self.mode,
            Mode::Free | Mode::Lane | Mode::Wait { .. } if at.is_crossed && !self.has_yielded => {
                Mode::Yield { since_s: at.now_s }
            }
            Mode::Free | Mode::Lane | Mode::Yield { .. } if at.must_stand() => wait,
            Mode::Free | Mode::Lane | Mode::Yield { .. } if at.is_path_open() => Mode::Free,
            Mode::Free | Mode::Lane | Mode::Yield { .. } if at.share() < MIN_SHARE || at.is_aim_blocked() => {
                wait
            }
            Mode::Free | Mode::Lane | Mode::Yield { .. } => Mode::Lane,
            Mode::Wait { since_s } => self.after_waiting(at, since_s),
            Mode::Back { .. } | Mode::Turn { .. } | Mode::Face { .. } if at.is_sonar_silent => wait,
            Mode::Back { since_s } => {
                let is_over = self.way_back.length_m() <= 0.0 || at.now_s - since_s > MANEUVER_S;
                if !is_over {
                    self.mode
                } else if at.is_released() {
                    Mode::Lane
                } else {
                    wait
                }
            }
            Mode::Turn { since_s, side } => {
                let turned = side * -at.path_heading;
                let sees_way =
                    turned > TURN_RAD.0 && at.echo_ahead_m > VIEW_M && at.straight_m > OUT_M + OUT_STOP_M;
                let is_over = turned > TURN_RAD.1 || at.now_s - since_s > turn_s(at);
                if sees_way || is_over {
                    Mode::Out { since_s: at.now_s, from: at.odometry, length_m: OUT_M }
                } else {
                    self.mode
                }
            }
            Mode::Face { since_s, heading, length_m } => {
                let is_faced = angle_difference(heading, at.odometry.theta).abs() < FACED_RAD;
                if is_faced {
                    Mode::Out { since_s: at.now_s, from: at.odometry, length_m }
                } else if at.now_s - since_s > turn_s(at) {
                    wait
                } else {
                    self.mode
                }
            }
            Mode::Out { .. } if at.must_stand() || at.straight_m < OUT_STOP_M => wait,
            Mode::Out { since_s, from, length_m } => {
                let is_over = from.distance(&at.odometry) > length_m || at.now_s - since_s > MANEUVER_S;
                if is_over { Mode::Lane } else { self.mode }
            }
        }
    }

    /// Mode of a robot that has waited since `since_s`.
    fn after_waiting(&self, at: &Situation, since_s: f64) -> Mode {
        let waited_s = at.now_s - since_s;
        let may_try = self.tries.number(&at.odometry) < MAX_TRIES;
        if at.is_released() && waited_s > MIN_WAIT_S {
            Mode::Lane
        } else if at.is_sonar_silent {
            self.mode
        } else if let Some(leg) =
            at.way_out.filter(|leg| may_try && waited_s > ROUTE_S && self.is_worth(leg, at))
        {
            let heading = wrap_angle(at.odometry.theta + leg.bearing);
            Mode::Face { since_s: at.now_s, heading, length_m: leg.length_m }
        } else if may_try && waited_s > BACK_OFF_S && self.way_back.length_m() >= MIN_BACK_M {
            Mode::Back { since_s: at.now_s }
        } else if waited_s > WAIT_S {
            let [left, right] = at.room;
            let roomier = if left >= right { 1.0 } else { -1.0 };
            // The side that led to no way is not tried twice in a row.
            let side = if self.tried == roomier { -roomier } else { roomier };
            Mode::Turn { since_s: at.now_s, side }
        } else {
            self.mode
        }
    }

    /// True if the robot keeps the path in view on this leg, and it is new.
    fn is_worth(&self, leg: &Leg, at: &Situation) -> bool {
        let off = angle_difference(leg.bearing, at.path_heading).abs();
        off < MAX_LEG_RAD && self.taken.is_new(leg, &at.odometry)
    }
}

/// Time after which a turn in place is given up, s.
fn turn_s(at: &Situation) -> f64 {
    MANEUVER_S * OUT_RADPS / out_radps(at)
}
