//! Tests of a hosted behavior.

use super::*;
use crate::bus::TopicSpec;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;
use yamabico_core::behavior::BehaviorInfo;
use yamabico_core::message::{Axes, Odometry, OverlayHeader, Reason};

struct Broken;

impl Behavior for Broken {
    fn propose(&mut self, _: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        panic!("always")
    }
}

type Build = fn(&toml::Table, &Setup) -> Result<Box<dyn Behavior>, ParameterError>;

struct Fake {
    info: BehaviorInfo,
    build: Build,
}

impl BehaviorFactory for Fake {
    fn info(&self) -> &BehaviorInfo {
        &self.info
    }

    fn build(&self, parameters: &toml::Table, setup: &Setup) -> Result<Box<dyn Behavior>, ParameterError> {
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
        inputs: Vec::new(),
        settings: BehaviorSettings { period: Some(Duration::from_millis(20)), ..BehaviorSettings::default() },
    }
}

fn bus() -> Bus {
    let bus = Bus::local("host").unwrap();
    bus.create::<Proposal>(&topics::proposal("broken"), &TopicSpec::default()).unwrap();
    bus.create::<OverlayHeader>(&topics::overlay("broken"), &TopicSpec::default()).unwrap();
    bus
}

fn host(build: Build) -> BehaviorHost {
    BehaviorHost::open(plan(build), &bus()).unwrap()
}

fn panics_of(mut host: BehaviorHost) -> u32 {
    for step in 0..10 {
        host.propose(Time::from_secs_f64(0.02 * f64::from(step))).unwrap();
    }
    assert_eq!(host.next_call(), None, "a disabled behavior is not called");
    assert_eq!(u64::from(host.stats().panics), host.stats().calls.count());
    host.stats().panics
}

#[test]
fn a_behavior_that_panics_too_often_is_disabled() {
    assert_eq!(panics_of(host(|_, _| Ok(Box::new(Broken)))), MAX_PANICS);
}

#[test]
fn a_behavior_that_cannot_be_rebuilt_is_disabled() {
    static REFUSED: AtomicU32 = AtomicU32::new(0);
    let refuses = host(|_, _| match REFUSED.fetch_add(1, Ordering::Relaxed) {
        0 => Ok(Box::new(Broken)),
        _ => Err(ParameterError::new("", "not again")),
    });
    assert_eq!(panics_of(refuses), 1);
    static PANICKED: AtomicU32 = AtomicU32::new(0);
    let panics = host(|_, _| match PANICKED.fetch_add(1, Ordering::Relaxed) {
        0 => Ok(Box::new(Broken)),
        _ => panic!("not again"),
    });
    assert_eq!(panics_of(panics), 1);
}

/// Abstains after this number of milliseconds.
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

/// Hosts a behavior that takes odometry. Returns also its odometry, its proposals and the bus.
fn hosted(
    change: impl FnOnce(&mut BehaviorPlan),
) -> (BehaviorHost, Publisher<Odometry>, Subscriber<Proposal>, Bus) {
    let bus = bus();
    bus.create::<Odometry>("wheels", &TopicSpec::default()).unwrap();
    let list_bytes = 4 * size_of::<Verdict>();
    bus.create::<DecisionHeader>(topics::DECISION, &TopicSpec { list_bytes, ..TopicSpec::default() })
        .unwrap();
    let mut plan = plan(|_, _| Ok(Box::new(Slow(5))));
    plan.settings.period = None;
    plan.inputs = vec![("wheels".into(), "wheels".into(), MessageType::of::<Odometry>())];
    change(&mut plan);
    let host = BehaviorHost::open(plan, &bus).unwrap();
    let wheels = bus.publisher("wheels").unwrap();
    let proposals = bus.subscriber(&topics::proposal("broken")).unwrap();
    (host, wheels, proposals, bus)
}

fn measure(wheels: &Publisher<Odometry>, millis: u64) {
    wheels
        .publish(&Odometry { stamp_ns: at(millis).0, sequence: millis, ..Default::default() }, &[])
        .unwrap();
}

fn step(host: &mut BehaviorHost, millis: u64) -> u64 {
    host.collect().unwrap();
    host.propose(at(millis)).unwrap();
    host.stats().calls.count()
}

#[test]
fn it_is_called_once_for_several_messages_with_the_evidence_of_the_newest() {
    let (mut host, wheels, proposals, _bus) = hosted(|_| ());
    assert_eq!(step(&mut host, 5), 0, "nothing is new");
    [10, 11, 12].iter().for_each(|&millis| measure(&wheels, millis));
    assert_eq!(step(&mut host, 13), 1);
    assert_eq!(proposals.newest().unwrap().unwrap().header().evidence_ns, at(12).0);
    assert_eq!(step(&mut host, 14), 1, "nothing is new");
}

#[test]
fn it_is_called_when_its_period_is_over_without_new_input() {
    let (mut host, wheels, _proposals, _bus) =
        hosted(|plan| plan.settings.period = Some(Duration::from_millis(20)));
    assert_eq!((step(&mut host, 0), step(&mut host, 19)), (1, 1));
    assert_eq!((step(&mut host, 20), host.next_call()), (2, Some(at(40))));
    measure(&wheels, 25);
    assert_eq!(
        (step(&mut host, 26), host.next_call()),
        (3, Some(at(46))),
        "a call on new input restarts the period"
    );
}

#[test]
fn calls_over_the_budget_are_counted() {
    for (budget, overruns) in [(Duration::from_millis(1), 2), (Duration::MAX, 0)] {
        let (mut host, wheels, _proposals, _bus) = hosted(|plan| plan.settings.budget = Some(budget));
        [1, 2].iter().for_each(|&millis| {
            measure(&wheels, millis);
            step(&mut host, millis);
        });
        assert_eq!((host.stats().calls.count(), host.stats().overruns), (2, overruns));
    }
}

#[test]
fn it_sleeps_while_inhibited_and_continues_with_the_newest_input() {
    let (mut host, wheels, proposals, bus) = hosted(|plan| plan.settings.sleeps_while_inhibited = true);
    let decisions = bus.publisher::<DecisionHeader>(topics::DECISION).unwrap();
    let decide = |outcome: Outcome| {
        let other = Verdict { behavior: Name::new("other"), ..Default::default() };
        let own = Verdict { behavior: Name::new("broken"), outcome: outcome.code(), ..Default::default() };
        decisions.publish(&DecisionHeader::default(), &[other, own]).unwrap();
    };
    measure(&wheels, 1);
    assert_eq!((step(&mut host, 1), host.sleeps()), (1, false));
    decide(Outcome::Inhibited);
    for millis in 2..9 {
        measure(&wheels, millis);
        assert_eq!((step(&mut host, millis), host.sleeps(), host.next_call()), (1, true, None));
    }
    decide(Outcome::Stale);
    assert_eq!((step(&mut host, 9), host.sleeps()), (2, false), "input that arrived during the sleep is new");
    assert_eq!(proposals.newest().unwrap().unwrap().header().evidence_ns, at(8).0);
}
