//! The arbiter of a run whose clock is a driver's: each step of it waits for everybody.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use yamabico_core::message::{Clock, Name, Turn, TurnPhase};
use yamabico_core::sensor::DeviceError;
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, BusError, Publisher, Subscriber, Waiter};
use yamabico_host::topics;

use super::arbiter_seat::ArbiterSeat;
use super::plan::Plan;

/// Longest sleep: how late the end of the run is noticed.
const NAP: Duration = Duration::from_millis(20);
/// The first step may take so long: a world is built.
const FIRST_STEP: Duration = Duration::from_secs(10);

/// The clock of the driver, for those who only want to know the time.
#[derive(Debug, Default)]
pub(super) struct DriversTime {
    first: AtomicU64,
    now: AtomicU64,
}

/// Calls the turns of each step, and waits for those who take them.
pub(super) struct Pacer {
    clock: Subscriber<Clock>,
    turns: Publisher<Turn>,
    taken: Subscriber<Turn>,
    waiter: Waiter,
    members: Vec<Member>,
    device: String,
    patience: Duration,
    sequence: u64,
    last: Option<Clock>,
}

/// A behavior that takes turns.
struct Member {
    name: Name,
    patience: Duration,
    /// Its turn is waited for: it took the last one that was called, or took one since.
    is_awaited: bool,
    has_taken: bool,
}

impl DriversTime {
    /// The instant of the first step, and of the newest one.
    pub fn read(&self) -> (Time, Time) {
        (Time(self.first.load(Ordering::Relaxed)), Time(self.now.load(Ordering::Relaxed)))
    }

    fn advance(&self, now: Time, is_first: impl FnOnce() -> bool) {
        if is_first() {
            self.first.store(now.0, Ordering::Relaxed);
        }
        self.now.store(now.0, Ordering::Relaxed);
    }
}

impl Pacer {
    /// Of a robot with one device, which owns the clock.
    pub fn open(plan: &Plan, bus: &Bus) -> Result<Pacer, BusError> {
        let device = plan.devices.first();
        let member = |behavior: &yamabico_host::BehaviorPlan| Member {
            name: Name::new(&behavior.setup.name),
            patience: behavior.hosting.patience,
            is_awaited: true,
            has_taken: false,
        };
        Ok(Pacer {
            clock: bus.subscriber(topics::CLOCK)?,
            turns: bus.publisher(topics::TURNS)?,
            taken: bus.subscriber(topics::TAKEN)?,
            waiter: bus.waiter(&[topics::CLOCK, topics::TAKEN])?,
            members: plan.behaviors.iter().map(member).collect(),
            device: device.map(|device| device.spec.name.clone()).unwrap_or_default(),
            patience: device.map_or(FIRST_STEP, |device| device.hosting.patience),
            sequence: 0,
            last: None,
        })
    }

    /// Decides at each step of the driver, until `is_over`. Where its clock stands still for longer than the driver may be
    /// silent, or jumps, that is told, and the robot is brought to rest by the machine's clock.
    pub fn arbitrate(
        mut self,
        seat: &mut ArbiterSeat,
        period: Duration,
        time: &DriversTime,
        is_over: &dyn Fn() -> bool,
        rests: &dyn Fn() -> bool,
        tell: &dyn Fn(DeviceError),
    ) {
        // Everybody begins with the first command.
        if let Err(error) = seat.step(Time::ZERO) {
            tell(DeviceError::failed("arbiter", error));
        }
        while !is_over() {
            if rests() {
                seat.shut_down();
            }
            match self.step(seat, time, is_over) {
                Ok(()) => {}
                Err(problem) => {
                    tell(DeviceError::failed(&self.device, problem));
                    self.rest(seat, period, time, is_over);
                }
            }
        }
    }

    /// One step, where one comes; what is wrong with the clock, in words.
    fn step(
        &mut self,
        seat: &mut ArbiterSeat,
        time: &DriversTime,
        is_over: &dyn Fn() -> bool,
    ) -> Result<(), String> {
        let in_words = |error: BusError| error.to_string();
        let Some(clock) = self.next(is_over)? else { return Ok(()) };
        let now = Time(clock.stamp_ns);
        time.advance(now, || self.last.is_none());
        self.last = Some(clock);
        for phase in [TurnPhase::Collect, TurnPhase::Propose] {
            self.call(&clock, phase).map_err(in_words)?;
            self.wait_for_all(&clock, phase, is_over).map_err(in_words)?;
        }
        seat.step(now).map_err(in_words)?;
        self.call(&clock, TurnPhase::Done).map_err(in_words)
    }

    /// The next instant; none where the run is over before.
    fn next(&mut self, is_over: &dyn Fn() -> bool) -> Result<Option<Clock>, String> {
        let begun = Instant::now();
        let patience = if self.last.is_some() { self.patience } else { FIRST_STEP };
        while !is_over() {
            if let Some(clock) = self.clock.receive().map_err(|error| error.to_string())? {
                let clock = *clock.header();
                let follows = |last: &Clock| clock.step == last.step + 1 && clock.stamp_ns > last.stamp_ns;
                return match &self.last {
                    Some(last) if !follows(last) => Err(format!(
                        "its clock went from step {} at {} ns to step {} at {} ns; it must go on by one step",
                        last.step, last.stamp_ns, clock.step, clock.stamp_ns
                    )),
                    _ => Ok(Some(clock)),
                };
            }
            if begun.elapsed() > patience {
                return Err(format!(
                    "its clock has stood still for {patience:?}; let it be slower with `deadline_ms` in its table"
                ));
            }
            self.waiter.wait(NAP).map_err(|error| error.to_string())?;
        }
        Ok(None)
    }

    fn call(&mut self, clock: &Clock, phase: TurnPhase) -> Result<(), BusError> {
        self.members.iter_mut().for_each(|member| member.has_taken = false);
        self.sequence += 1;
        let turn = Turn {
            stamp_ns: clock.stamp_ns,
            sequence: self.sequence,
            step: clock.step,
            phase: phase.code(),
            ..Turn::default()
        };
        self.turns.publish(&turn, &[])
    }

    /// Waits until every behavior has taken the turn. One that is silent for longer than it may be is waited for again when
    /// it takes a turn.
    fn wait_for_all(
        &mut self,
        clock: &Clock,
        phase: TurnPhase,
        is_over: &dyn Fn() -> bool,
    ) -> Result<(), BusError> {
        let begun = Instant::now();
        while !is_over() {
            while let Some(turn) = self.taken.receive()? {
                let turn = turn.header();
                let fits = turn.step == clock.step && turn.phase() == Some(phase);
                let member = self.members.iter_mut().find(|member| member.name == turn.plugin);
                if let Some(member) = member.filter(|_| fits) {
                    (member.has_taken, member.is_awaited) = (true, true);
                }
            }
            let waited = begun.elapsed();
            let missing = self.members.iter_mut().filter(|member| member.is_awaited && !member.has_taken);
            for member in missing.filter(|member| waited > member.patience) {
                tracing::warn!("step {} goes on without `{}`", clock.step, member.name);
                member.is_awaited = false;
            }
            if self.members.iter().all(|member| member.has_taken || !member.is_awaited) {
                break;
            }
            self.waiter.wait(NAP)?;
        }
        Ok(())
    }

    /// Brings the robot to rest without the driver: from its last instant on time goes by the machine's clock.
    fn rest(&self, seat: &mut ArbiterSeat, period: Duration, time: &DriversTime, is_over: &dyn Fn() -> bool) {
        let (begun, (_, last)) = (Instant::now(), time.read());
        seat.shut_down();
        while !is_over() {
            let now = last + self.patience + begun.elapsed();
            time.advance(now, || false);
            if let Err(error) = seat.step(now) {
                tracing::error!("the robot is not told to stop: {error}");
            }
            std::thread::sleep(period);
        }
    }
}
