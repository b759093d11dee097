//! Explanations of `yamabico why` in typical situations.

use std::time::Duration;

use yamabico_arbiter::decide::{ArbiterState, Decision, DecisionMessage, ExplainContext, decide, explain};
use yamabico_arbiter::kinematics::Kinematics;
use yamabico_arbiter::policy::{BehaviorPolicy, Policy, Wire};
use yamabico_core::message::{Axes, Name, Note, Process, ProcessState, Proposal, Reason, Sector, Twist};
use yamabico_core::sensor::MotionLimits;
use yamabico_core::time::Time;

const LIMITS: MotionLimits = MotionLimits {
    speed: [0.5, 0.0, 1.0],
    acceleration: [0.5, 0.5, 2.0],
    deceleration: [1.0, 1.0, 3.0],
    emergency: [2.0, 2.0, 6.0],
    jerk: [50.0, 50.0, 200.0],
};
const TICK: Duration = Duration::from_millis(20);
const SONAR_HALT: usize = 0;
const AVOIDER: usize = 1;
const LOCALIZER: usize = 2;
const WALL_FOLLOWER: usize = 3;

/// Arbiter of a hallway task whose proposals are set by hand.
struct Hallway {
    policy: Policy,
    state: ArbiterState,
    proposals: Vec<Option<Proposal>>,
    processes: Vec<Process>,
    now: Time,
    sequence: u64,
    decision: Decision,
}

impl Hallway {
    fn new(change: impl FnOnce(&mut Policy)) -> Hallway {
        let behaviors = vec![
            BehaviorPolicy { critical: true, ..BehaviorPolicy::new("sonar-halt", 100) },
            BehaviorPolicy::new("obstacle-avoider", 50),
            BehaviorPolicy { dwell: Duration::from_millis(300), ..BehaviorPolicy::new("map-localizer", 20) },
            BehaviorPolicy::new("wall-follower", 10),
        ];
        let mut policy = Policy::new(LIMITS, Kinematics::Body { axes: Axes::PLANAR }, behaviors);
        change(&mut policy);
        Hallway {
            state: ArbiterState::new(&policy),
            proposals: vec![None; policy.behaviors.len()],
            processes: Vec::new(),
            now: Time(10_000_000_000),
            sequence: 0,
            decision: Decision::new(&policy),
            policy,
        }
    }

    /// Robot that has followed its path for two seconds.
    fn under_way() -> Hallway {
        Hallway::changed(|_| {})
    }

    fn changed(change: impl FnOnce(&mut Policy)) -> Hallway {
        let mut hallway = Hallway::new(change);
        hallway.propose(SONAR_HALT, Proposal::abstain(Reason::Clear));
        hallway.propose(
            AVOIDER,
            Proposal::abstain(Reason::Clear).with_note(format_args!("nothing new within 3.2 m")),
        );
        hallway.propose(
            LOCALIZER,
            drive(0.4, 0.03).with_note(format_args!("7.9 m to go, 0.02 m beside the path")),
        );
        hallway.propose(WALL_FOLLOWER, drive(0.4, -0.02));
        hallway.repeat_for(Duration::from_secs(2), &[]);
        hallway
    }

    fn propose(&mut self, who: usize, proposal: Proposal) {
        self.proposals[who] = Some(proposal);
    }

    /// Repeats every proposal for `duration`, except those of `silent` behaviors.
    fn repeat_for(&mut self, duration: Duration, silent: &[usize]) {
        let end = self.now + duration;
        while self.now < end {
            self.now = self.now + TICK;
            self.sequence += 1;
            let proposing = self.proposals.iter_mut().enumerate().filter(|(who, _)| !silent.contains(who));
            for proposal in proposing.filter_map(|(_, proposal)| proposal.as_mut()) {
                let lag_ns = proposal.stamp_ns.saturating_sub(proposal.evidence_ns);
                proposal.sequence = self.sequence;
                (proposal.stamp_ns, proposal.evidence_ns) = (self.now.0, self.now.0 - lag_ns);
            }
            decide(&self.policy, &mut self.state, &self.proposals, self.now, &mut self.decision);
        }
    }

    fn why(&self) -> String {
        let context = ExplainContext {
            processes: self.processes.clone(),
            ..ExplainContext::of(&self.policy, &self.proposals)
        };
        explain(&DecisionMessage::new(&self.policy, &self.decision), &context).to_string()
    }
}

fn drive(speed: f64, turn: f64) -> Proposal {
    Proposal::drive(Axes::PLANAR, Twist::planar(speed, turn))
}

const MOMENT: Duration = Duration::from_millis(60);

#[test]
fn the_path_is_driven_freely() {
    insta::assert_snapshot!(Hallway::under_way().why());
}

#[test]
fn a_halting_behavior_is_disabled() {
    let mut hallway = Hallway::under_way();
    hallway.propose(SONAR_HALT, Proposal::halt(Axes::LINEAR.union(Axes::LATERAL), Reason::Echo));
    hallway.repeat_for(MOMENT, &[]);
    hallway.state.disable(SONAR_HALT);
    hallway.repeat_for(Duration::from_secs(1), &[]);
    insta::assert_snapshot!(hallway.why());
}

#[test]
fn the_sonar_halts_the_robot() {
    let mut hallway = Hallway::under_way();
    let halt = Proposal::halt(Axes::LINEAR.union(Axes::LATERAL), Reason::Echo);
    hallway.propose(SONAR_HALT, halt.with_note(format_args!("echo at 0.42 m; 2 clean scans to release")));
    hallway.repeat_for(MOMENT, &[]);
    insta::assert_snapshot!(hallway.why());
}

#[test]
fn a_limit_slows_the_robot() {
    let mut hallway = Hallway::under_way();
    let limit = Proposal::limit(Axes::LINEAR, Twist::planar(0.15, 0.0), Reason::WallNear);
    let ahead = Sector { center_rad: 0.0, half_width_rad: 0.5 };
    hallway.propose(
        AVOIDER,
        limit.in_sector(ahead).with_note(format_args!("box at 0.9 m, 0.12 m beside the path")),
    );
    hallway.repeat_for(MOMENT, &[]);
    insta::assert_snapshot!(hallway.why());
}

#[test]
fn a_critical_behavior_is_dead_and_restarts() {
    let mut hallway = Hallway::under_way();
    let died = hallway.now + MOMENT;
    hallway.repeat_for(Duration::from_millis(400), &[SONAR_HALT]);
    hallway.processes.push(Process {
        plugin: Name::new("sonar-halt"),
        ended: Note::new("was killed by signal 9"),
        ended_ns: died.0,
        state: ProcessState::Starting.code(),
        restarts: 2,
        ..Process::default()
    });
    insta::assert_snapshot!(hallway.why());
}

#[test]
fn the_emergency_stop_is_latched_and_a_behavior_is_disabled() {
    let mut hallway = Hallway::under_way();
    hallway.state.disable(WALL_FOLLOWER);
    hallway.state.emergency_stop();
    hallway.repeat_for(MOMENT, &[]);
    insta::assert_snapshot!(hallway.why());
}

#[test]
fn sensor_data_is_too_old_and_another_behavior_waits_to_take_over() {
    let mut hallway = Hallway::under_way();
    let mut blind = drive(0.4, 0.03).with_reason(Reason::Coasting);
    (blind.stamp_ns, blind.evidence_ns) = (2_000_000_000, 800_000_000);
    hallway.propose(LOCALIZER, blind);
    hallway.repeat_for(MOMENT, &[]);
    insta::assert_snapshot!(hallway.why());
}

#[test]
fn a_behavior_inhibits_another_and_the_wire_holds() {
    let mut hallway = Hallway::changed(|policy| {
        policy.wires.push(Wire::inhibit(AVOIDER, LOCALIZER, Duration::from_secs(1)));
        policy.behaviors[LOCALIZER].dwell = Duration::ZERO;
    });
    hallway.propose(AVOIDER, drive(0.0, 0.9).with_note(format_args!("turns to the passage on the left")));
    hallway.repeat_for(MOMENT, &[]);
    insta::assert_snapshot!("inhibits", hallway.why());
    hallway.propose(AVOIDER, Proposal::abstain(Reason::Clear));
    hallway.repeat_for(Duration::from_millis(300), &[]);
    insta::assert_snapshot!("still_inhibited", hallway.why());
}

#[test]
fn the_halt_of_a_dead_author_outlives_it() {
    let mut hallway = Hallway::under_way();
    hallway.propose(AVOIDER, Proposal::halt(Axes::PLANAR, Reason::PassageBlocked));
    hallway.repeat_for(Duration::from_secs(1), &[]);
    hallway.repeat_for(Duration::from_millis(320), &[AVOIDER]);
    insta::assert_snapshot!(hallway.why());
}

#[test]
fn a_drive_above_the_limits_is_cut_and_another_is_malformed() {
    let mut hallway = Hallway::under_way();
    hallway.propose(AVOIDER, drive(0.8, 0.0));
    hallway.propose(LOCALIZER, drive(f64::NAN, 0.0));
    hallway.propose(WALL_FOLLOWER, Proposal::drive(Axes::LATERAL, Twist::ZERO));
    hallway.repeat_for(MOMENT, &[]);
    insta::assert_snapshot!(hallway.why());
}
