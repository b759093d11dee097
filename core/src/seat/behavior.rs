//! A behaviour at work: fed from the bus, asked when something is new, its proposal signed and sent.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use crate::behavior::{Behavior, BehaviorPlugin, BuildError, Inputs, Outputs, Setup};
use crate::bus::{Bus, BusError, Publisher, Subscriber, Waiter};
use crate::config::Isolation;
use crate::message::{DecisionHeader, Kind, MessageType, Name, Outcome, Proposal, Verdict};
use crate::time::{Time, TimeSource};

use super::durations::Durations;
use super::feed::Feed;
use super::ports::Ports;
use super::scheduling::Scheduling;
use super::topics;

/// After so many panics a behaviour stays out.
const MOST_PANICS: u32 = 5;

/// Everything needed to seat a behaviour.
#[derive(Clone, Debug)]
pub struct BehaviorPlan {
    /// What it is.
    pub plugin: BehaviorPlugin,
    /// Its parameters.
    pub table: toml::Table,
    /// What it is told about itself and the robot.
    pub setup: Setup,
    /// Higher wins.
    pub priority: i32,
    /// Slot, topic and type of each input.
    pub inputs: Vec<(String, String, MessageType)>,
    /// Asked at least this often, new input or not.
    pub period: Option<Duration>,
    /// Longer calls count as overruns.
    pub budget: Option<Duration>,
    /// Whether it is not asked while it is inhibited.
    pub sleeps: bool,
    /// Live: where it runs, and how long it may show no sign of life.
    pub hosting: Hosting,
    /// The program that it is, and its arguments; empty where it is a part of this one.
    pub exec: Vec<String>,
}

impl BehaviorPlan {
    /// Waits for what arrives in the behaviour's slots, and where it may sleep, for what wakes it.
    ///
    /// # Errors
    /// Topics that do not ring.
    pub fn waiter(&self, bus: &Bus) -> Result<Waiter, BusError> {
        let inputs = self.inputs.iter().map(|(_, topic, _)| topic.as_str());
        bus.waiter(&inputs.chain(self.sleeps.then_some(topics::DECISION)).collect::<Vec<_>>())
    }
}

/// Where a plugin runs while the robot runs live, and when it hangs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hosting {
    /// In a process of its own or on a thread.
    pub isolation: Isolation,
    /// A process that shows no sign of life for longer hangs.
    pub patience: Duration,
    /// What is asked of the system's scheduler for it.
    pub scheduling: Scheduling,
}

/// How a behaviour fared. Wall-clock figures: they never enter a decision.
#[derive(Clone, Debug, Default)]
pub struct BehaviorRecord {
    /// Of all calls.
    pub calls: Durations,
    /// Calls longer than the budget.
    pub overruns: u64,
    /// Calls that proposed nothing.
    pub abstentions: u64,
    /// Calls that panicked.
    pub panics: u32,
}

/// A behaviour between its feed and its ports.
pub struct BehaviorSeat {
    plan: BehaviorPlan,
    behavior: Option<Box<dyn Behavior>>,
    feed: Feed,
    /// Where it may sleep, what tells it whether to.
    decisions: Option<Subscriber<DecisionHeader>>,
    sleeps: bool,
    ports: Ports,
    proposals: Publisher<Proposal>,
    name: Name,
    sequence: u64,
    fresh: bool,
    last_call: Option<Time>,
    time: TimeSource,
    record: BehaviorRecord,
}

impl BehaviorSeat {
    /// Builds the behaviour and opens its channels.
    ///
    /// # Errors
    /// Parameters that do not fit, or channels that do not open.
    pub fn open(plan: BehaviorPlan, bus: &Bus) -> Result<BehaviorSeat, SeatError> {
        let instance = &plan.setup.name;
        let outputs: Vec<_> = plan
            .plugin
            .outputs
            .iter()
            .map(|slot| (slot.name.to_owned(), topics::output(instance, slot.name), slot.message))
            .collect();
        Ok(BehaviorSeat {
            behavior: Some((plan.plugin.build)(&plan.table, &plan.setup)?),
            feed: Feed::open(bus, &plan.inputs)?,
            decisions: plan.sleeps.then(|| bus.subscriber(topics::DECISION)).transpose()?,
            sleeps: false,
            ports: Ports::open(bus, &outputs)?,
            proposals: bus.publisher(&topics::proposal(instance))?,
            name: Name::new(instance),
            sequence: 0,
            fresh: false,
            last_call: None,
            time: TimeSource::Step,
            record: BehaviorRecord::default(),
            plan,
        })
    }

    /// Its name in the task file.
    pub fn name(&self) -> &str {
        &self.plan.setup.name
    }

    /// Stamps the stages of its proposals by `time`; without it, they stand still within a step.
    pub fn keep_time_by(&mut self, time: TimeSource) {
        self.time = time;
    }

    /// How it fared so far.
    pub fn record(&self) -> &BehaviorRecord {
        &self.record
    }

    /// Takes in what has arrived.
    ///
    /// # Errors
    /// The bus failed.
    pub fn collect(&mut self) -> Result<(), BusError> {
        self.fresh |= self.feed.collect()?;
        let Some(decisions) = &self.decisions else { return Ok(()) };
        if let Some(decision) = decisions.newest()? {
            let mut verdicts = decision.items().iter();
            let own = verdicts.find(|verdict| verdict.behaviour == self.name);
            self.sleeps = own.and_then(Verdict::outcome) == Some(Outcome::Inhibited);
        }
        Ok(())
    }

    /// Whether it is inhibited and therefore not asked.
    pub fn sleeps(&self) -> bool {
        self.sleeps
    }

    /// When it wants to be asked though nothing is new; `None` where never, while it sleeps, or where it stays out.
    pub fn next_call(&self) -> Option<Time> {
        let period = self.plan.period.filter(|_| self.behavior.is_some() && !self.sleeps)?;
        Some(self.last_call.map_or(Time::ZERO, |last| last + period))
    }

    /// Asks the behaviour where something is new or its period is over, and publishes its proposal. A panic is caught:
    /// the behaviour falls silent for this call, as if it had died, and is built anew.
    ///
    /// # Errors
    /// The bus refused the proposal.
    pub fn propose(&mut self, now: Time) -> Result<(), BusError> {
        let due = !self.sleeps && (self.fresh || self.next_call().is_some_and(|at| at <= now));
        let Some(behavior) = self.behavior.as_mut().filter(|_| due) else { return Ok(()) };
        let started = Instant::now();
        let (feed, ports) = (&self.feed, &mut self.ports);
        let outcome = catch_unwind(AssertUnwindSafe(|| {
            behavior.propose(&Inputs::new(now, feed), &mut Outputs::new(ports))
        }));
        let took = started.elapsed();
        self.record.calls.add(took);
        self.record.overruns += u64::from(self.plan.budget.is_some_and(|budget| took > budget));
        self.fresh = false;
        self.last_call = Some(now);
        let evidence_ns = self.feed.evidence_ns().unwrap_or(now.0);
        match outcome {
            Ok(proposal) => self.publish(proposal, now, evidence_ns),
            Err(_) => {
                self.start_anew();
                Ok(())
            }
        }
    }

    fn publish(&mut self, mut proposal: Proposal, now: Time, evidence_ns: u64) -> Result<(), BusError> {
        self.record.abstentions += u64::from(proposal.kind() == Some(Kind::Abstain));
        self.sequence += 1;
        proposal.behaviour = self.name;
        proposal.sequence = self.sequence;
        proposal.priority = self.plan.priority;
        if proposal.stamp_ns == 0 {
            proposal.stamp_ns = now.0;
        }
        if proposal.evidence_ns == 0 {
            proposal.evidence_ns = evidence_ns;
        }
        proposal.received_ns = now.0;
        proposal.proposed_ns = self.time.now(now).0;
        self.proposals.publish(&proposal, &[])
    }

    /// Whatever goes wrong in taking down the old one or building the new one, the seat stays empty.
    fn start_anew(&mut self) {
        self.record.panics += 1;
        let (plan, panics) = (&self.plan, self.record.panics);
        let old = self.behavior.take();
        let rebuilt = catch_unwind(AssertUnwindSafe(|| {
            drop(old);
            (panics < MOST_PANICS).then(|| (plan.plugin.build)(&plan.table, &plan.setup)).transpose()
        }));
        let name = &plan.setup.name;
        self.behavior = match rebuilt {
            Ok(Ok(Some(anew))) => {
                tracing::error!("behaviour `{name}` panicked and is built anew");
                Some(anew)
            }
            Ok(Ok(None)) => {
                tracing::error!("behaviour `{name}` panicked {panics} times and stays out");
                None
            }
            Ok(Err(error)) => {
                tracing::error!("behaviour `{name}` panicked, cannot be built anew and stays out: {error}");
                None
            }
            Err(_) => {
                tracing::error!("behaviour `{name}` panicked, again while it was built anew, and stays out");
                None
            }
        };
    }
}

/// A behaviour or a device that could not be set up.
#[derive(Debug, thiserror::Error)]
pub enum SeatError {
    /// The parameters of a behaviour do not fit.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// A device does not open.
    #[error("device `{device}` does not open: {reason}")]
    Device {
        /// Its name in the robot file.
        device: String,
        /// Why.
        reason: BuildError,
    },
    /// The channels do not open.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// Its process cannot be started, or did not come up.
    #[error("the process of `{name}` does not come up: {reason}")]
    Process {
        /// Whose.
        name: String,
        /// What happened and what to do.
        reason: String,
    },
    /// A thread does not start.
    #[error("cannot start the thread of `{name}`: {source}; end other programs or raise `ulimit -u`")]
    Thread {
        /// Whose.
        name: String,
        /// What the system said.
        source: std::io::Error,
    },
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::Spec;
    use crate::message::{Axes, Odometry, Reason};
    use std::sync::atomic::{AtomicU32, Ordering};

    struct Broken;

    impl Behavior for Broken {
        fn propose(&mut self, _: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
            panic!("as every time")
        }
    }

    fn plan(build: crate::behavior::Build) -> BehaviorPlan {
        let plugin = BehaviorPlugin {
            name: "broken",
            summary: "Panics.",
            inputs: &[],
            outputs: &[],
            files: &[],
            claims: Axes::NONE,
            schema: schemars::Schema::default,
            told: None,
            build,
        };
        BehaviorPlan {
            plugin,
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

    fn seat(build: crate::behavior::Build) -> BehaviorSeat {
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
        assert_eq!(panics_of(seat(|_, _| Ok(Box::new(Broken)))), MOST_PANICS);
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
        assert_eq!(
            (turn(&mut seat, 26), seat.next_call()),
            (3, Some(at(46))),
            "new input begins a period anew"
        );
    }

    #[test]
    fn calls_beyond_the_budget_are_counted() {
        for (budget_ms, overruns) in [(1, 2), (5000, 0)] {
            let (mut seat, wheels, _said, _bus) =
                fed(|plan| plan.budget = Some(Duration::from_millis(budget_ms)));
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
            let other = Verdict { behaviour: Name::new("other"), ..Default::default() };
            let own =
                Verdict { behaviour: Name::new("broken"), outcome: outcome.code(), ..Default::default() };
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
}
