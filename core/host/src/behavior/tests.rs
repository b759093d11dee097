//! A behavior on its seat.

use super::*;
use crate::bus::Spec;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use yamabico_core::behavior::BehaviorInfo;
use yamabico_core::message::{Axes, Odometry, Reason};

struct Broken;

impl Behavior for Broken {
    fn propose(&mut self, _: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        panic!("as every time")
    }
}

type Build = fn(&toml::Table, &Setup) -> Result<Box<dyn Behavior>, BuildError>;

struct Fake {
    info: BehaviorInfo,
    build: Build,
}

impl BehaviorFactory for Fake {
    fn info(&self) -> &BehaviorInfo {
        &self.info
    }

    fn build(&self, parameters: &toml::Table, setup: &Setup) -> Result<Box<dyn Behavior>, BuildError> {
        (self.build)(parameters, setup)
    }
}

fn plan(build: Build) -> BehaviorPlan {
    let info = BehaviorInfo {
        name: "broken".into(),
        summary: "Panics.".into(),
        inputs: Vec::new(),
        outputs: Vec::new(),
        files: Vec::new(),
        claims: Axes::NONE,
        parameters: serde_json::Value::Null,
    };
    BehaviorPlan {
        factory: Arc::new(Fake { info, build }),
        table: toml::Table::new(),
        setup: Setup { name: "broken".into(), ..Setup::default() },
        priority: 1,
        inputs: Vec::new(),
        period: Some(Duration::from_millis(20)),
        budget: None,
        sleeps: false,
        hosting: Hosting {
            isolation: Isolation::Thread,
            patience: Duration::from_secs(1),
            scheduling: Scheduling::default(),
        },
        exec: Vec::new(),
    }
}

fn bus() -> Bus {
    let bus = Bus::local("seat").unwrap();
    bus.create::<Proposal>(&topics::proposal("broken"), &Spec::default()).unwrap();
    bus
}

fn seat(build: Build) -> BehaviorSeat {
    BehaviorSeat::open(plan(build), &bus()).unwrap()
}

fn panics_of(mut seat: BehaviorSeat) -> u32 {
    for step in 0..10 {
        seat.propose(Time::from_secs_f64(0.02 * f64::from(step))).unwrap();
    }
    assert_eq!(seat.next_call(), None, "who stays out wants nothing");
    assert_eq!(u64::from(seat.record().panics), seat.record().calls.count());
    seat.record().panics
}

#[test]
fn who_panics_too_often_stays_out() {
    assert_eq!(panics_of(seat(|_, _| Ok(Box::new(Broken)))), MAX_PANICS);
}

#[test]
fn who_cannot_be_built_anew_stays_out() {
    static REFUSED: AtomicU32 = AtomicU32::new(0);
    let refuses = seat(|_, _| match REFUSED.fetch_add(1, Ordering::Relaxed) {
        0 => Ok(Box::new(Broken)),
        _ => Err(BuildError::new("", "not again")),
    });
    assert_eq!(panics_of(refuses), 1);
    static PANICKED: AtomicU32 = AtomicU32::new(0);
    let panics = seat(|_, _| match PANICKED.fetch_add(1, Ordering::Relaxed) {
        0 => Ok(Box::new(Broken)),
        _ => panic!("not again"),
    });
    assert_eq!(panics_of(panics), 1);
}

/// Proposes what it was handed, after so many milliseconds.
struct Slow(u64);

impl Behavior for Slow {
    fn propose(&mut self, _: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        std::thread::sleep(Duration::from_millis(self.0));
        Proposal::abstain(Reason::Clear)
    }
}

fn at(millis: u64) -> Time {
    Time(millis * 1_000_000)
}

/// A seat that is fed with odometry, and what it says.
fn fed(
    change: impl FnOnce(&mut BehaviorPlan),
) -> (BehaviorSeat, Publisher<Odometry>, Subscriber<Proposal>, Bus) {
    let bus = bus();
    bus.create::<Odometry>("wheels", &Spec::default()).unwrap();
    let list_bytes = 4 * size_of::<Verdict>();
    bus.create::<DecisionHeader>(topics::DECISION, &Spec { list_bytes, ..Spec::default() }).unwrap();
    let mut plan = plan(|_, _| Ok(Box::new(Slow(5))));
    plan.period = None;
    plan.inputs = vec![("wheels".into(), "wheels".into(), MessageType::of::<Odometry>())];
    change(&mut plan);
    let seat = BehaviorSeat::open(plan, &bus).unwrap();
    let wheels = bus.publisher("wheels").unwrap();
    let said = bus.subscriber(&topics::proposal("broken")).unwrap();
    (seat, wheels, said, bus)
}

fn measure(wheels: &Publisher<Odometry>, millis: u64) {
    wheels
        .publish(&Odometry { stamp_ns: at(millis).0, sequence: millis, ..Default::default() }, &[])
        .unwrap();
}

fn turn(seat: &mut BehaviorSeat, millis: u64) -> u64 {
    seat.collect().unwrap();
    seat.propose(at(millis)).unwrap();
    seat.record().calls.count()
}

#[test]
fn it_is_asked_once_for_all_that_arrived_and_rests_on_the_newest() {
    let (mut seat, wheels, said, _bus) = fed(|_| ());
    assert_eq!(turn(&mut seat, 5), 0, "nothing is new");
    [10, 11, 12].iter().for_each(|&millis| measure(&wheels, millis));
    assert_eq!(turn(&mut seat, 13), 1);
    assert_eq!(said.newest().unwrap().unwrap().header().evidence_ns, at(12).0);
    assert_eq!(turn(&mut seat, 14), 1, "nothing is new any more");
}

#[test]
fn it_is_asked_when_its_period_is_over_though_nothing_is_new() {
    let (mut seat, wheels, _said, _bus) = fed(|plan| plan.period = Some(Duration::from_millis(20)));
    assert_eq!((turn(&mut seat, 0), turn(&mut seat, 19)), (1, 1));
    assert_eq!((turn(&mut seat, 20), seat.next_call()), (2, Some(at(40))));
    measure(&wheels, 25);
    assert_eq!((turn(&mut seat, 26), seat.next_call()), (3, Some(at(46))), "new input begins a period anew");
}

#[test]
fn calls_beyond_the_budget_are_counted() {
    for (budget, overruns) in [(Duration::from_millis(1), 2), (Duration::MAX, 0)] {
        let (mut seat, wheels, _said, _bus) = fed(|plan| plan.budget = Some(budget));
        [1, 2].iter().for_each(|&millis| {
            measure(&wheels, millis);
            turn(&mut seat, millis);
        });
        assert_eq!((seat.record().calls.count(), seat.record().overruns), (2, overruns));
    }
}

#[test]
fn it_sleeps_while_it_is_inhibited_and_wakes_to_the_newest() {
    let (mut seat, wheels, said, bus) = fed(|plan| plan.sleeps = true);
    let decisions = bus.publisher::<DecisionHeader>(topics::DECISION).unwrap();
    let decide = |outcome: Outcome| {
        let other = Verdict { behavior: Name::new("other"), ..Default::default() };
        let own = Verdict { behavior: Name::new("broken"), outcome: outcome.code(), ..Default::default() };
        decisions.publish(&DecisionHeader::default(), &[other, own]).unwrap();
    };
    measure(&wheels, 1);
    assert_eq!((turn(&mut seat, 1), seat.sleeps()), (1, false));
    decide(Outcome::Inhibited);
    for millis in 2..9 {
        measure(&wheels, millis);
        assert_eq!((turn(&mut seat, millis), seat.sleeps(), seat.next_call()), (1, true, None));
    }
    decide(Outcome::Stale);
    assert_eq!((turn(&mut seat, 9), seat.sleeps()), (2, false), "what came while it slept wakes it");
    assert_eq!(said.newest().unwrap().unwrap().header().evidence_ns, at(8).0);
}
