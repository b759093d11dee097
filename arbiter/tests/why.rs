//! What `why` tells in situations that somebody wonders about, as a person reads it.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::time::Duration;

use yamabico_arbiter::decide::{Decision, Scene, State, Told, decide, explain};
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

/// The behaviors of a hallway, whose words are put into their mouths.
struct Hallway {
    policy: Policy,
    state: State,
    proposals: Vec<Option<Proposal>>,
    processes: Vec<Process>,
    now: Time,
    sequence: u64,
    decision: Decision,
}

impl Hallway {
    fn new(change: impl FnOnce(&mut Policy)) -> Hallway {
        let behaviors = vec![
            BehaviorPolicy::new("sonar-halt", 100).critical(),
            BehaviorPolicy::new("obstacle-avoider", 50),
            BehaviorPolicy::new("map-localizer", 20).with_dwell(Duration::from_millis(300)),
            BehaviorPolicy::new("wall-follower", 10),
        ];
        let mut policy = Policy::new(LIMITS, Kinematics::Body { axes: Axes::PLANAR }, behaviors);
        change(&mut policy);
        Hallway {
            state: State::new(&policy),
            proposals: vec![None; policy.behaviors.len()],
            processes: Vec::new(),
            now: Time(10_000_000_000),
            sequence: 0,
            decision: Decision::new(&policy),
            policy,
        }
    }

    /// A robot that has followed its path for two seconds.
    fn under_way() -> Hallway {
        Hallway::changed(|_| {})
    }

    fn changed(change: impl FnOnce(&mut Policy)) -> Hallway {
        let mut hallway = Hallway::new(change);
        hallway.say(SONAR_HALT, Proposal::abstain(Reason::Clear));
        hallway.say(
            AVOIDER,
            Proposal::abstain(Reason::Clear).with_note(format_args!("nothing new within 3.2 m")),
        );
        hallway
            .say(LOCALIZER, drive(0.4, 0.03).with_note(format_args!("7.9 m to go, 0.02 m beside the path")));
        hallway.say(WALL_FOLLOWER, drive(0.4, -0.02));
        hallway.go_on(Duration::from_secs(2), &[]);
        hallway
    }

    fn say(&mut self, who: usize, proposal: Proposal) {
        self.proposals[who] = Some(proposal);
    }

    /// Everybody but the `silent` says the same again for so long.
    fn go_on(&mut self, duration: Duration, silent: &[usize]) {
        let end = self.now + duration;
        while self.now < end {
            self.now = self.now + TICK;
            self.sequence += 1;
            let speaking = self.proposals.iter_mut().enumerate().filter(|(who, _)| !silent.contains(who));
            for proposal in speaking.filter_map(|(_, proposal)| proposal.as_mut()) {
                let lag_ns = proposal.stamp_ns.saturating_sub(proposal.evidence_ns);
                proposal.sequence = self.sequence;
                (proposal.stamp_ns, proposal.evidence_ns) = (self.now.0, self.now.0 - lag_ns);
            }
            decide(&self.policy, &mut self.state, &self.proposals, self.now, &mut self.decision);
        }
    }

    fn why(&self) -> String {
        let scene = Scene { processes: self.processes.clone(), ..Scene::of(&self.policy, &self.proposals) };
        explain(&Told::of(&self.policy, &self.decision), &scene).to_string()
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
fn somebody_who_halts_is_disabled() {
    let mut hallway = Hallway::under_way();
    hallway.say(SONAR_HALT, Proposal::halt(Axes::LINEAR.union(Axes::LATERAL), Reason::Echo));
    hallway.go_on(MOMENT, &[]);
    hallway.state.disable(SONAR_HALT);
    hallway.go_on(Duration::from_secs(1), &[]);
    insta::assert_snapshot!(hallway.why());
}

#[test]
fn the_sonar_halts_before_somebody() {
    let mut hallway = Hallway::under_way();
    let halt = Proposal::halt(Axes::LINEAR.union(Axes::LATERAL), Reason::Echo);
    hallway.say(SONAR_HALT, halt.with_note(format_args!("echo at 0.42 m; 2 clean readings to go")));
    hallway.go_on(MOMENT, &[]);
    insta::assert_snapshot!(hallway.why());
}

#[test]
fn a_limit_slows_what_is_ahead() {
    let mut hallway = Hallway::under_way();
    let limit = Proposal::limit(Axes::LINEAR, Twist::planar(0.15, 0.0), Reason::WallNear);
    let ahead = Sector { center_rad: 0.0, half_width_rad: 0.5 };
    hallway
        .say(AVOIDER, limit.in_sector(ahead).with_note(format_args!("box at 0.9 m, 0.12 m beside the path")));
    hallway.go_on(MOMENT, &[]);
    insta::assert_snapshot!(hallway.why());
}

#[test]
fn a_critical_behavior_is_dead_and_comes_back() {
    let mut hallway = Hallway::under_way();
    let died = hallway.now + MOMENT;
    hallway.go_on(Duration::from_millis(400), &[SONAR_HALT]);
    hallway.processes.push(Process {
        plugin: Name::new("sonar-halt"),
        ended: Note::new("was killed by signal 9"),
        ended_ns: died.0,
        state: ProcessState::ComingUp.code(),
        restarts: 2,
        ..Process::default()
    });
    insta::assert_snapshot!(hallway.why());
}

#[test]
fn the_emergency_stop_is_latched_and_somebody_is_switched_off() {
    let mut hallway = Hallway::under_way();
    hallway.state.disable(WALL_FOLLOWER);
    hallway.state.emergency_stop();
    hallway.go_on(MOMENT, &[]);
    insta::assert_snapshot!(hallway.why());
}

#[test]
fn what_one_goes_by_is_too_old_and_the_other_waits_to_take_over() {
    let mut hallway = Hallway::under_way();
    let mut blind = drive(0.4, 0.03).because(Reason::Coasting);
    (blind.stamp_ns, blind.evidence_ns) = (2_000_000_000, 800_000_000);
    hallway.say(LOCALIZER, blind);
    hallway.go_on(MOMENT, &[]);
    insta::assert_snapshot!(hallway.why());
}

#[test]
fn one_inhibits_another_and_goes_on_doing_so_for_a_while() {
    let mut hallway = Hallway::changed(|policy| {
        policy.wires.push(Wire::inhibit(AVOIDER, LOCALIZER, Duration::from_secs(1)));
        policy.behaviors[LOCALIZER].dwell = Duration::ZERO;
    });
    hallway.say(AVOIDER, drive(0.0, 0.9).with_note(format_args!("turns to the passage on the left")));
    hallway.go_on(MOMENT, &[]);
    insta::assert_snapshot!("inhibits", hallway.why());
    hallway.say(AVOIDER, Proposal::abstain(Reason::Clear));
    hallway.go_on(Duration::from_millis(300), &[]);
    insta::assert_snapshot!("inhibited_still", hallway.why());
}

#[test]
fn the_halt_of_a_dead_author_outlives_it() {
    let mut hallway = Hallway::under_way();
    hallway.say(AVOIDER, Proposal::halt(Axes::PLANAR, Reason::PassageBlocked));
    hallway.go_on(Duration::from_secs(1), &[]);
    hallway.go_on(Duration::from_millis(320), &[AVOIDER]);
    insta::assert_snapshot!(hallway.why());
}

#[test]
fn a_command_beyond_the_robot_is_cut_and_another_is_nonsense() {
    let mut hallway = Hallway::under_way();
    hallway.say(AVOIDER, drive(0.8, 0.0));
    hallway.say(LOCALIZER, drive(f64::NAN, 0.0));
    hallway.say(WALL_FOLLOWER, Proposal::drive(Axes::LATERAL, Twist::ZERO));
    hallway.go_on(MOMENT, &[]);
    insta::assert_snapshot!(hallway.why());
}
