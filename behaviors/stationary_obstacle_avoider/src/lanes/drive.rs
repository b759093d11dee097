//! The drive along the chosen lane: when to take over, when to wait, and how to get out where no lane is free.

mod transition;

use nalgebra::Point2;
use serde::{Deserialize, Serialize};
use yamabico_core::geometry::{Twist, angle_difference};
use yamabico_core::message::{Axes, Proposal, Reason};

use super::mode::Mode;
use super::situation::{Situation, turn_by};
use super::taken_leg::TakenLeg;
use super::tries_here::TriesHere;
use super::way_back::WayBack;
use transition::ROUTE_S;

/// Station that the robot steers for: 0.61 m ahead.
pub(super) const AIM_STATION: usize = 7;
/// Curvature at which the robot veers away from an echo aside, 1/m, and the speed then, m/s.
const VEER_PER_M: f64 = 1.5;
const VEER_MPS: f64 = 0.15;
/// Bearing of the aim above which a driving robot turns in place, rad.
const TURN_IN_PLACE_RAD: f64 = 0.9;
/// Turn rate of a way out, rad/s, and its speed, m/s.
const OUT_RADPS: f64 = 0.6;
const OUT_MPS: f64 = 0.15;
/// Speed of backing off, m/s.
const BACK_MPS: f64 = 0.12;
/// Number of turns in which what is remembered comes into doubt, one to each side, and that after which it does again: what has been
/// seen since is used first.
const DOUBTFUL: u32 = 2;
const DOUBTFUL_AGAIN: u32 = 4;
/// State of the drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Drive {
    mode: Mode,
    lane_m: f64,
    /// Side of the last turn in place since the path was free, 1 left, -1 right; 0 without one.
    tried: f64,
    turns: TriesHere,
    /// Legs of a route, and ways back, since the last turn.
    tries: TriesHere,
    /// True in the step of the turn with which what is remembered comes into doubt.
    #[serde(skip)]
    doubts: bool,
    taken: TakenLeg,
    /// True if what crosses the way is passed: it has been waited for.
    has_yielded: bool,
    way_back: WayBack,
}

impl Drive {
    /// Offset of the lane that was driven last, m.
    pub fn lane_m(&self) -> f64 {
        self.lane_m
    }

    /// True if what is remembered around the robot is in doubt: it has turned to both sides, and is still here.
    pub fn doubts(&self) -> bool {
        self.doubts
    }

    /// True if the robot has waited long enough to look for a way out.
    pub fn looks_for_way_out(&self, now_s: f64) -> bool {
        matches!(self.mode, Mode::Wait { since_s } if now_s - since_s > ROUTE_S)
    }

    /// Ends what the robot was doing: others drive, and it decides anew afterward.
    pub fn interrupt(&mut self) {
        self.mode = Mode::Free;
    }

    /// Takes a step, and returns the proposal; `None` where the path is free.
    pub fn step(&mut self, at: &Situation) -> Option<Proposal> {
        self.lane_m = at.plan.best.offset_m;
        self.way_back.update(&at.odometry);
        let mode = self.next(at);
        self.has_yielded = at.is_crossed
            && (self.has_yielded || (matches!(self.mode, Mode::Yield { .. }) && mode != self.mode));
        self.doubts = false;
        match (self.mode, mode) {
            (Mode::Wait { .. }, Mode::Face { heading, .. }) => {
                self.taken = TakenLeg::new(&at.odometry, heading);
                self.tries.count(&at.odometry);
            }
            (Mode::Wait { .. }, Mode::Back { .. }) => self.tries.count(&at.odometry),
            (Mode::Wait { .. }, Mode::Turn { .. }) => {
                self.tries = TriesHere::default();
                self.turns.count(&at.odometry);
                self.doubts = self.turns.number(&at.odometry) % DOUBTFUL_AGAIN == DOUBTFUL;
            }
            _ => {}
        }
        self.mode = mode;
        Some(match self.mode {
            Mode::Free => {
                (self.lane_m, self.tried) = (0.0, 0.0);
                (self.taken, self.turns, self.tries) = Default::default();
                return None;
            }
            Mode::Lane => self.drive_lane(at),
            Mode::Yield { .. } => Proposal::drive(Axes::PLANAR, Twist::ZERO)
                .with_reason(Reason::PassageBlocked)
                .with_note(format_args!("waits for what crosses the way")),
            // The beam of a sonar is wider than the robot.
            Mode::Wait { .. } if at.is_beside_lane() => Proposal::drive(Axes::PLANAR, at.turn_to_aim())
                .uncoupled()
                .with_reason(Reason::Echo)
                .with_note(format_args!("turns to the lane {:+.2} m beside the path", self.lane_m)),
            Mode::Wait { .. } => {
                let reason = if at.must_stand() { Reason::Echo } else { Reason::PassageBlocked };
                Proposal::drive(Axes::PLANAR, Twist::ZERO)
                    .with_reason(reason)
                    .with_note(format_args!("waits: {:.1} m free ahead", at.plan.best.free_m))
            }
            Mode::Back { .. } => {
                Proposal::drive(Axes::PLANAR, Twist::planar(-BACK_MPS.min(at.speed_mps), 0.0))
                    .with_reason(Reason::Searching)
                    .with_note(format_args!("backs off the way it came"))
            }
            Mode::Turn { side, .. } => {
                self.tried = side;
                Proposal::drive(Axes::PLANAR, Twist::planar(0.0, side * out_radps(at)))
                    .uncoupled()
                    .with_reason(Reason::Searching)
                    .with_note(format_args!("turns to the side with more room"))
            }
            Mode::Face { heading, .. } => {
                let off = angle_difference(heading, at.odometry.theta);
                Proposal::drive(Axes::PLANAR, turn_by(off, out_radps(at)))
                    .uncoupled()
                    .with_reason(Reason::Searching)
                    .with_note(format_args!("turns to the way around"))
            }
            Mode::Out { .. } => match at.near_side() {
                // What is so near aside halts a robot that drives on, and may be below the view of the camera.
                Some(side) => Proposal::drive(Axes::PLANAR, Twist::planar(0.0, -side * out_radps(at)))
                    .uncoupled()
                    .with_reason(Reason::Searching)
                    .with_note(format_args!("turns away from what is near aside")),
                None => Proposal::drive(Axes::PLANAR, Twist::planar(OUT_MPS.min(at.speed_mps), 0.0))
                    .with_reason(Reason::Searching)
                    .with_note(format_args!("leaves a place without a free lane")),
            },
        })
    }

    fn drive_lane(&self, at: &Situation) -> Proposal {
        let note =
            format_args!("lane {:+.2} m beside the path, {:.1} m free", self.lane_m, at.plan.best.free_m);
        if at.bearing().abs() > TURN_IN_PLACE_RAD || at.is_arc_short() {
            return Proposal::drive(Axes::PLANAR, at.turn_to_aim()).uncoupled().with_note(note);
        }
        let mut speed = at.lane_mps();
        let mut curvature = curvature_to(at.aim);
        if let Some(side) = at.near_side() {
            curvature -= side * VEER_PER_M;
            speed = speed.min(VEER_MPS);
        }
        let rate = (speed * curvature).clamp(-at.max_turn_radps, at.max_turn_radps);
        Proposal::drive(Axes::PLANAR, Twist::planar(speed, rate)).with_note(note)
    }
}

/// Turn rate of a way out, rad/s.
fn out_radps(at: &Situation) -> f64 {
    OUT_RADPS.min(at.max_turn_radps)
}

/// Curvature of the arc from straight ahead through a point (robot frame, m), 1/m.
pub(super) fn curvature_to(aim: Point2<f64>) -> f64 {
    2.0 * aim.y / aim.coords.norm_squared()
}

#[cfg(test)]
mod tests {
    use yamabico_core::geometry::Pose2;

    use super::super::lane::Lane;
    use super::super::planner::{ARC_M, Plan};
    use super::super::way_out::Leg;
    use super::transition::{MAX_TRIES, OUT_M};
    use super::*;

    /// A robot on its path before something that it hears 0.3 m ahead, with a lane that is `free_m` long and `offset_m` aside.
    fn blocked(now_s: f64, free_m: f64, offset_m: f64, path_heading: f64) -> Situation {
        let lane = |offset_m: f64| Lane { offset_m, free_m, gap_m: 0.4, near_gap_m: 0.4, squeeze_m: 0.0 };
        Situation {
            now_s,
            plan: Plan { best: lane(offset_m), nominal: Lane { free_m: 0.2, ..lane(0.0) } },
            aim: Point2::new(0.6, offset_m),
            odometry: Pose2::IDENTITY,
            path_heading,
            echo_ahead_m: 0.3,
            echo_left_m: f64::INFINITY,
            echo_right_m: f64::INFINITY,
            is_sonar_silent: false,
            gate_m: 0.5,
            clearance_m: 0.3,
            straight_m: f64::INFINITY,
            arc_m: ARC_M,
            speed_mps: 0.25,
            max_turn_radps: 0.7,
            is_crossed: false,
            is_arrived: false,
            room: [1.0, 0.0],
            way_out: None,
        }
    }

    #[test]
    fn a_robot_that_waits_turns_to_a_free_lane() {
        let mut drive = Drive::default();
        let proposal = drive.step(&blocked(0.0, 2.4, 0.4, 0.0)).expect("a proposal");
        assert!(proposal.twist.linear == 0.0 && proposal.twist.angular > 0.3, "{:?}", proposal.twist);
        let proposal = drive.step(&blocked(0.1, 0.3, 0.4, 0.0)).expect("a proposal");
        assert_eq!(proposal.twist, Twist::ZERO, "the lane is not free");
    }

    #[test]
    fn what_crosses_the_way_is_waited_for_but_not_forever() {
        let open = |now_s: f64, is_crossed: bool| Situation {
            echo_ahead_m: f64::INFINITY,
            is_crossed,
            ..blocked(now_s, 2.4, 0.4, 0.0)
        };
        let mut drive = Drive::default();
        let speed = |drive: &mut Drive, at: &Situation| drive.step(at).expect("a proposal").twist.linear;
        assert!(speed(&mut drive, &open(0.0, false)) > 0.1);
        assert_eq!(speed(&mut drive, &open(0.1, true)), 0.0);
        assert!(speed(&mut drive, &open(0.2, false)) > 0.1, "it has gone");
        let stood = (3..400).filter(|&i| speed(&mut drive, &open(0.1 * f64::from(i), true)) == 0.0);
        assert!((119..=121).contains(&stood.count()), "it is passed after 12 s");
        assert!(speed(&mut drive, &open(40.0, false)) > 0.1);
        assert_eq!(speed(&mut drive, &open(40.1, true)), 0.0, "another one");
    }

    #[test]
    fn an_arc_that_would_touch_something_is_a_turn_in_place() {
        let short = Situation { echo_ahead_m: f64::INFINITY, arc_m: 0.05, ..blocked(0.0, 2.4, 0.4, 0.0) };
        let twist = Drive::default().step(&short).expect("a proposal").twist;
        assert!(twist.linear == 0.0 && twist.angular > 0.3, "{twist:?}");
        let twist = Drive::default()
            .step(&Situation { aim: Point2::new(0.6, 0.0), ..short })
            .expect("a proposal")
            .twist;
        assert_eq!(twist, Twist::ZERO, "the aim is straight ahead");
    }

    #[test]
    fn a_side_that_leads_nowhere_is_not_tried_twice_in_a_row() {
        let mut drive = Drive::default();
        let (mut sides, mut heading) = (Vec::new(), 0.0);
        for step in 0..400 {
            let at = blocked(0.1 * f64::from(step), 0.2, 0.0, -heading);
            let rate = drive.step(&at).expect("a proposal").twist.angular;
            heading += 0.1 * rate;
            if rate != 0.0 && sides.last() != Some(&rate.signum()) {
                sides.push(rate.signum());
            }
        }
        assert!(sides.len() >= 3, "{sides:?}");
        assert!(sides.windows(2).all(|pair| pair[0] == -pair[1]) && sides[0] == 1.0, "{sides:?}");
    }

    #[test]
    fn each_turn_in_place_counts_once() {
        let (mut drive, mut heading, mut doubts) = (Drive::default(), 0.0, 0);
        for step in 0..400 {
            let at = blocked(0.1 * f64::from(step), 0.2, 0.0, -heading);
            heading += 0.1 * drive.step(&at).expect("a proposal").twist.angular;
            doubts += u32::from(drive.doubts());
        }
        assert_eq!(doubts, 1, "three turns and more");
    }

    #[test]
    fn a_way_around_is_faced_driven_and_not_tried_twice_from_one_place() {
        let mut drive = Drive::default();
        let mut odometry = Pose2::IDENTITY;
        let mut step = |drive: &mut Drive, now_s: f64, echo_ahead_m: f64| {
            let way_out = Some(Leg { bearing: 0.8 - odometry.theta, length_m: 0.6 });
            let at =
                Situation { odometry, way_out, echo_ahead_m, ..blocked(now_s, 0.2, 0.0, -odometry.theta) };
            let twist = drive.step(&at).expect("a proposal").twist;
            odometry.theta += 0.1 * twist.angular;
            (twist.linear, odometry.theta)
        };
        let times = || (0..100).map(|i| 0.1 * f64::from(i));
        let starts = |drive: &mut Drive, step: &mut dyn FnMut(&mut Drive, f64, f64) -> (f64, f64)| {
            times().find(|&now_s| step(drive, now_s, f64::INFINITY).0 > 0.0)
        };
        let drives_s = starts(&mut drive, &mut step).expect("it drives");
        assert!((2.5..4.5).contains(&drives_s), "it waits, and turns: {drives_s} s");
        let (_, heading) = step(&mut drive, drives_s + 0.1, 0.3);
        assert!((heading - 0.8).abs() < 0.1, "{heading}");
        let last = times().take(35).map(|later_s| step(&mut drive, drives_s + 0.1 + later_s, 0.3)).last();
        assert_eq!(last.expect("steps").1, heading, "what stopped it there would again");
    }

    #[test]
    fn a_way_out_turns_away_from_what_is_near_aside() {
        let mut drive = Drive {
            mode: Mode::Out { since_s: 0.0, from: Pose2::IDENTITY, length_m: OUT_M },
            ..Drive::default()
        };
        let open = Situation { echo_ahead_m: f64::INFINITY, ..blocked(0.1, 0.2, 0.0, 0.0) };
        let mut twist = |echo_left_m: f64, echo_right_m: f64| {
            drive.step(&Situation { echo_left_m, echo_right_m, ..open }).expect("a proposal").twist
        };
        assert_eq!(twist(0.2, f64::INFINITY), Twist::planar(0.0, -OUT_RADPS));
        assert_eq!(twist(0.4, 0.2), Twist::planar(0.0, OUT_RADPS));
        assert!(twist(0.4, 0.3).linear > 0.0, "what is near no longer is");
    }

    #[test]
    fn a_robot_that_only_goes_to_and_fro_turns() {
        let (mut drive, mut odometry) = (Drive::default(), Pose2::IDENTITY);
        let (mut legs, mut turns_after) = (0, None);
        for step in 0..600 {
            let way_out = Some(Leg { bearing: 0.4 - odometry.theta, length_m: 0.6 });
            let echo_ahead_m = if odometry.x > 0.3 { 0.3 } else { f64::INFINITY };
            let at = Situation {
                odometry,
                way_out,
                echo_ahead_m,
                ..blocked(0.1 * f64::from(step), 0.2, 0.0, -odometry.theta)
            };
            let before = drive.mode;
            let twist = drive.step(&at).expect("a proposal").twist;
            legs += u32::from(matches!(
                (before, drive.mode),
                (Mode::Wait { .. }, Mode::Face { .. } | Mode::Back { .. })
            ));
            if matches!(drive.mode, Mode::Turn { .. }) {
                turns_after = turns_after.or(Some(legs));
            }
            odometry.x += 0.1 * twist.linear;
            odometry.theta += 0.1 * twist.angular;
        }
        assert!(turns_after == Some(MAX_TRIES), "{turns_after:?} of {legs}");
    }

    #[test]
    fn a_way_out_ends_before_a_known_obstacle() {
        let way = || Drive {
            mode: Mode::Out { since_s: 0.0, from: Pose2::IDENTITY, length_m: OUT_M },
            ..Drive::default()
        };
        let open = Situation { echo_ahead_m: f64::INFINITY, ..blocked(0.1, 0.2, 0.0, 0.0) };
        assert!(way().step(&open).expect("a proposal").twist.linear > 0.0);
        let near = Situation { straight_m: 0.02, ..open };
        assert_eq!(way().step(&near).expect("a proposal").twist, Twist::ZERO);
    }

    #[test]
    fn turns_keep_to_the_maximum_rate_and_take_longer() {
        let mut drive = Drive { mode: Mode::Turn { since_s: 0.0, side: 1.0 }, ..Drive::default() };
        let slow = |now_s: f64| Situation { max_turn_radps: 0.2, ..blocked(now_s, 0.2, 0.0, 0.0) };
        assert_eq!(drive.step(&slow(0.1)).expect("a proposal").twist, Twist::planar(0.0, 0.2));
        drive.step(&slow(14.0));
        assert!(matches!(drive.mode, Mode::Turn { .. }), "{:?}", drive.mode);
        drive.step(&slow(15.1));
        assert!(!matches!(drive.mode, Mode::Turn { .. }), "{:?}", drive.mode);
    }

    #[test]
    fn without_scans_every_maneuver_ends() {
        let since_s = 0.0;
        for mode in [
            Mode::Turn { since_s, side: 1.0 },
            Mode::Face { since_s, heading: 1.0, length_m: 0.5 },
            Mode::Out { since_s, from: Pose2::IDENTITY, length_m: OUT_M },
            Mode::Back { since_s },
            Mode::Lane,
        ] {
            let mut drive = Drive { mode, ..Drive::default() };
            let open = Situation { echo_ahead_m: f64::INFINITY, ..blocked(0.1, 2.4, 0.4, 0.0) };
            // Backing off ends at once anyway: the robot has not come from anywhere.
            let silent = Situation { is_sonar_silent: true, ..open };
            assert_eq!(drive.step(&silent).expect("a proposal").twist, Twist::ZERO, "{mode:?}");
        }
    }
}
