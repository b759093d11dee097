//! Real time: the arbiter on a thread of its own, behaviors and devices each in a process or on a thread, woken by the
//! messages that they wait for.
//!
//! Stamps are the machine's monotonic clock. The arrival of a proposal triggers a decision and a command at once; the tick
//! is the keep-alive.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

use yamabico_core::behavior::BuildError;
use yamabico_core::message::MessageType;
use yamabico_core::sensor::DeviceError;
use yamabico_core::time::{Time, TimeSource};
use yamabico_host::bus::{Bus, BusError, RawSubscriber, Waiter};
use yamabico_host::config::{Clock, Run};
use yamabico_host::{Durations, Scheduling, SeatError, behave, behave_in_turn, operate, panicked};

use super::apart::Apart;
use super::arbiter_seat::ArbiterSeat;
use super::course::{End, Progress, REST, ended};
use super::fared::Fared;
use super::lockstep::Supply;
use super::paced::{DriversTime, Pacer};
use super::plan::Plan;
use super::referee::Referee;
use super::retuning::RetuningDesk;
use super::roll::{Failure, Roll};
use super::roster::{Herald, MayPart, Roster};
use super::seats::Seats;
use crate::record::{Tap, Tee};
use crate::supervisor::{Program, Supervisor};

/// A robot that is told to rest is believed to stand from then on.
const SETTLING: Duration = Duration::from_millis(50);
/// How often the recorder looks.
const RECORDER_NAP: Duration = Duration::from_millis(2);
/// Processes that have not opened everything by then never will.
const OPENING: Duration = Duration::from_secs(20);
/// A thread that has not ended by then hangs, and is left behind.
const FAREWELL: Duration = Duration::from_secs(1);
/// Decisions that the arbiter makes at once from one tick to the next; whoever rings more often makes it wait between them.
const BURST: u32 = 64;
/// From one decision to the next once the burst is used up: somebody floods.
const CALM: Duration = Duration::from_millis(1);

/// A live run.
pub struct Live {
    seats: Option<Seats>,
    supervisor: Option<Supervisor>,
    clock: Clock,
    taps: Vec<(String, MessageType, RawSubscriber)>,
    herald: Herald,
    retuning: RetuningDesk,
    roll: Roll,
    orders: Arc<Orders>,
    report: Sender<Report>,
    reports: Receiver<Report>,
    working: usize,
    measuring: usize,
    devices: Vec<String>,
    failure: Option<DeviceError>,
    arbitrated: Fared,
    // What threads have left behind: it goes when all that they said has been heard.
    left: Vec<Box<dyn Any + Send>>,
    began: Time,
    // Ports go before the bus that they are on.
    _bus: Bus,
}

/// What the threads are told.
#[derive(Default)]
struct Orders {
    /// Bring the robot to rest.
    rest: AtomicBool,
    /// End.
    end: AtomicBool,
    /// The time, where the clock is a driver's.
    time: DriversTime,
}

/// What the threads tell.
enum Report {
    /// Something failed; its thread goes on as well as it can.
    Failed(DeviceError),
    /// How the arbiter fared.
    Arbitrated(Box<Fared>),
    /// The thread has ended and leaves this.
    Done(Box<dyn Any + Send>),
}

impl Live {
    /// Opens everything in shared memory under the robot's name. Plugins that are to run in processes of their own become
    /// processes of `program`; without one, every plugin gets a thread. Nothing is asked, measured or moved before
    /// [`Live::run`].
    ///
    /// # Errors
    /// A robot of this name runs already; devices or behaviors that do not open.
    pub fn open(plan: Plan, robot: &str, program: Option<Program>) -> Result<Live, SeatError> {
        let mut plan = plan.live();
        let bus = Bus::ipc(robot)?;
        plan.create_topics(&bus)?;
        let taps = plan
            .topics
            .iter()
            .map(|topic| Ok((topic.name.clone(), topic.message, bus.tap(&topic.name, &topic.message)?)));
        let taps = taps.collect::<Result<Vec<_>, BusError>>()?;
        let devices: Vec<String> = plan.devices.iter().map(|device| device.spec.name.clone()).collect();
        let may_part = if program.is_some() { MayPart::Yes } else { MayPart::No };
        let herald = Herald::start(&bus, &Roster::of(&plan, robot, may_part))?;
        let retuning = RetuningDesk::open(&plan, &bus)?;
        let arbiter = Seats::arbiter(&plan, &bus)?;
        let clock = plan.clock;
        let pacer = match clock {
            Clock::Machine => None,
            Clock::Driver => Some(Pacer::open(&plan, &bus)?),
        };
        let apart = if program.is_some() { plan.take_apart() } else { Apart::default() };
        let measuring = apart.devices.iter().filter(|device| !device.sensors.is_empty()).count();
        let wards = apart.wards(&bus)?;
        let seats = Seats::open(arbiter, pacer, plan, &bus)?;
        let here = seats.devices.iter().filter(|(_, device, ..)| device.measures()).count();
        let names: Vec<String> = wards.iter().map(|ward| ward.charge.name.clone()).collect();
        let supervisor = program.filter(|_| !wards.is_empty());
        let supervisor = supervisor.map(|program| Supervisor::start(&bus, wards, program)).transpose()?;
        let (report, reports) = channel();
        let mut live = Live {
            taps,
            herald,
            retuning,
            roll: Roll::default(),
            orders: Arc::default(),
            report,
            reports,
            working: 0,
            measuring: measuring + here,
            devices,
            failure: None,
            arbitrated: Fared::default(),
            left: Vec::new(),
            seats: Some(seats),
            clock,
            supervisor,
            began: Time::monotonic_now(),
            _bus: bus,
        };
        live.wait_for(&names)?;
        Ok(live)
    }

    /// Waits until each of these processes has opened everything.
    fn wait_for(&mut self, names: &[String]) -> Result<(), SeatError> {
        let begun = Instant::now();
        loop {
            self.show(&mut Tee::default(), Time::monotonic_now());
            if let Some(failure) = self.roll.failures().first() {
                return Err(self.refusal(failure));
            }
            let Some(missing) = names.iter().find(|name| !self.roll.is_up(name)) else { return Ok(()) };
            if begun.elapsed() > OPENING {
                let reason = format!("it gave no sign of life for {} s", OPENING.as_secs());
                return Err(SeatError::Process { name: missing.clone(), reason });
            }
            std::thread::sleep(RECORDER_NAP);
        }
    }

    fn refusal(&self, failure: &Failure) -> SeatError {
        let reason = BuildError::new(&failure.key, &failure.words);
        match self.devices.contains(&failure.plugin) {
            true => SeatError::Device { device: failure.plugin.clone(), reason },
            false => SeatError::Process { name: failure.plugin.clone(), reason: reason.to_string() },
        }
    }

    /// Starts every thread, the arbiter's first.
    fn start(&mut self) -> Result<(), DeviceError> {
        let Some(Seats { arbiter, pacer, behaviors, devices }) = self.seats.take() else {
            return Err(DeviceError::failed("live run", "it has been run before; open another one"));
        };
        self.began = self.now();
        let (arbiter, waiter, period, scheduling) = arbiter;
        self.start_thread("arbiter", scheduling, move |orders, report| {
            match pacer {
                None => arbitrate(arbiter, waiter, period, orders, report),
                Some(pacer) => arbitrate_by_steps(arbiter, pacer, period, orders, report),
            }
            Box::new(())
        })?;
        if let Some(supervisor) = &self.supervisor {
            supervisor.begin();
        }
        for (mut seat, mut waiter, mut pulse, scheduling, mut turns) in behaviors {
            let name = seat.name().to_owned();
            self.start_thread(&name, scheduling, move |orders, _| {
                let is_over = || orders.is_over();
                match &mut turns {
                    None => behave(&mut seat, &mut waiter, &mut pulse, &is_over),
                    Some(turns) => behave_in_turn(&mut seat, turns, &mut pulse, &is_over),
                }
                Box::new((seat, pulse))
            })?;
        }
        for (name, mut seat, mut waiter, mut pulse, scheduling) in devices {
            self.start_thread(&name, scheduling, move |orders, _| {
                operate(&mut seat, &mut waiter, &mut pulse, &|| orders.is_over());
                Box::new((seat, pulse))
            })?;
        }
        Ok(())
    }

    fn start_thread(
        &mut self,
        name: &str,
        scheduling: Scheduling,
        work: impl FnOnce(&Orders, &dyn Fn(Report)) -> Box<dyn Any + Send> + Send + 'static,
    ) -> Result<(), DeviceError> {
        let (orders, report, who) = (Arc::clone(&self.orders), self.report.clone(), name.to_owned());
        let body = move || {
            for refused in scheduling.apply() {
                tracing::warn!("`{who}` runs on although {refused}");
            }
            // Nobody listens any more only when the run has ended.
            let tell = |told| drop(report.send(told));
            match catch_unwind(AssertUnwindSafe(|| work(&orders, &tell))) {
                Ok(left) => tell(Report::Done(left)),
                Err(panic) => {
                    tell(Report::Failed(DeviceError::failed(who, panicked(&*panic))));
                    tell(Report::Done(Box::new(())));
                }
            }
        };
        let started = std::thread::Builder::new().name(name.to_owned()).spawn(body);
        started.map_err(|error| DeviceError::failed(name, format!("its thread does not start: {error}")))?;
        self.working += 1;
        Ok(())
    }

    /// Walls that the devices have told of, for plots.
    pub fn walls(&self) -> Vec<Vec<[f64; 2]>> {
        self.roll.walls()
    }

    /// Starts, and goes on until the goal is reached, the time is over, the sensors have ended, something fails or `interrupt`
    /// is set; then until the robot stands.
    ///
    /// # Errors
    /// A device failed, a thread did not start, or one panicked.
    pub fn run(
        &mut self,
        run: &Run,
        interrupt: &AtomicBool,
        tap: &mut dyn Tap,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<End, DeviceError> {
        self.failure = self.start().err();
        let mut referee = Referee::new(run.goal);
        let mut told: Option<(End, Time)> = None;
        loop {
            let now = self.now();
            self.show(&mut Tee(vec![&mut referee, tap]), now);
            if let Err(error) = self.retuning.step(self.supervisor.as_ref(), now) {
                tracing::error!("parameters cannot be changed: {error}");
            }
            let elapsed = now.since(self.began);
            progress(Progress { elapsed, to_go_m: referee.to_go_m() });
            while let Ok(report) = self.reports.try_recv() {
                self.note(report);
            }
            let supply = Supply::of(self.measuring, self.roll.ended());
            let failed = self.has_failed().then_some(End::Interrupted);
            told = told.or_else(|| {
                Some((failed.or_else(|| ended(run, &referee, elapsed, supply, interrupt))?, now))
            });
            if let Some((end, since)) = told {
                self.orders.rest.store(true, Ordering::Relaxed);
                let waited = now.since(since);
                if (referee.stands() && waited > SETTLING) || waited > REST || self.working == 0 {
                    self.dismiss(tap);
                    return self.failure.take().map_or(Ok(end), Err);
                }
            }
            std::thread::sleep(RECORDER_NAP);
        }
    }

    /// Messages that the taps have lost.
    pub fn lost(&self) -> u64 {
        self.taps.iter().map(|(.., subscriber)| subscriber.lost()).sum()
    }

    /// How the parts of the run fared, as far as they told.
    pub fn finish(mut self) -> Fared {
        let arbitrated = std::mem::take(&mut self.arbitrated);
        Fared { behaviors: self.roll.records(), restarts: self.roll.restarts(), ..arbitrated }
    }

    /// Shows `tap` what has been published since the last call, in the order of publication as far as stamps tell it.
    fn show(&mut self, tap: &mut dyn Tap, now: Time) {
        self.herald.welcome();
        let mut taps = Tee(vec![&mut self.roll, tap]);
        for (topic, message, subscriber) in &self.taps {
            while let Ok(Some(sample)) = subscriber.receive() {
                let at = (message.stamps)(sample.header()).0.max(self.began).min(now);
                taps.message(topic, message, at, sample.header(), sample.items());
            }
        }
    }

    /// Whether a thread or a device has failed; of several failures the first is kept.
    fn has_failed(&mut self) -> bool {
        if self.failure.is_none() {
            // Of a behavior that cannot begin again its silence tells; without a device there is no robot.
            let mut of_devices =
                self.roll.failures().iter().filter(|failure| self.devices.contains(&failure.plugin));
            self.failure = of_devices.next().map(|failure| DeviceError::Told(failure.words.clone()));
        }
        self.failure.is_some()
    }

    /// Takes down what a thread tells; of several failures the first.
    fn note(&mut self, report: Report) {
        match report {
            Report::Failed(error) => drop(self.failure.get_or_insert(error)),
            Report::Arbitrated(fared) => self.arbitrated = *fared,
            Report::Done(left) => {
                self.working -= 1;
                self.left.push(left);
            }
        }
    }

    /// Ends every process and every thread, and shows `tap` what they said last. A thread that hangs is left behind.
    fn dismiss(&mut self, tap: &mut dyn Tap) {
        self.orders.end.store(true, Ordering::Relaxed);
        if let Some(supervisor) = &self.supervisor {
            supervisor.dismiss();
        }
        // By naps, for a machine that stands still in between is no thread that hangs.
        let mut patience = FAREWELL;
        while self.working > 0 || self.supervisor.as_ref().is_some_and(|supervisor| !supervisor.is_done()) {
            let now = self.now();
            self.show(tap, now);
            match self.reports.recv_timeout(RECORDER_NAP) {
                Ok(report) => self.note(report),
                Err(_) if self.working > 0 && patience.is_zero() => {
                    tracing::warn!("{} threads hang and are left behind", self.working);
                    self.working = 0;
                }
                Err(_) => patience = patience.saturating_sub(RECORDER_NAP),
            }
        }
        let now = self.now();
        self.show(tap, now);
    }

    /// The time of the run; where the clock is a driver's, that of its newest step.
    fn now(&mut self) -> Time {
        match self.clock {
            Clock::Machine => Time::monotonic_now(),
            Clock::Driver => {
                let (first, now) = self.orders.time.read();
                self.began = first;
                now
            }
        }
    }
}

impl Drop for Live {
    /// No process and no thread outlives the run, however it ends.
    fn drop(&mut self) {
        self.dismiss(&mut Tee::default());
    }
}

impl Orders {
    fn is_over(&self) -> bool {
        self.end.load(Ordering::Relaxed)
    }
}

/// Decides at every step of the driver's clock, until the end.
fn arbitrate_by_steps(
    mut seat: ArbiterSeat,
    pacer: Pacer,
    period: Duration,
    orders: &Orders,
    report: &dyn Fn(Report),
) {
    let rests = || orders.rest.load(Ordering::Relaxed);
    let tell = |error| report(Report::Failed(error));
    pacer.arbitrate(&mut seat, period, &orders.time, &|| orders.is_over(), &rests, &tell);
    report(Report::Arbitrated(Box::new(Fared { latencies: seat.latencies(), ..Fared::default() })));
}

/// Decides when a proposal arrives and at every tick, until the end, whatever fails and whoever floods; the last decisions
/// bring the robot to rest.
fn arbitrate(
    mut seat: ArbiterSeat,
    mut waiter: Waiter,
    period: Duration,
    orders: &Orders,
    report: &dyn Fn(Report),
) {
    let mut tick = Time::monotonic_now();
    let mut lateness = Durations::default();
    let mut decided = 0;
    seat.keep_time_by(TimeSource::Machine);
    while !orders.is_over() {
        if orders.rest.load(Ordering::Relaxed) {
            seat.shut_down();
        }
        let now = Time::monotonic_now();
        if tick <= now {
            lateness.add(now.since(tick));
            decided = 0;
        }
        if let Err(error) = seat.step(now) {
            report(Report::Failed(DeviceError::failed("arbiter", error)));
        }
        while tick <= now {
            tick = tick + period;
        }
        decided += 1;
        if decided > BURST {
            std::thread::sleep(CALM.min(tick.since(Time::monotonic_now())));
        }
        let left = tick.since(Time::monotonic_now());
        if let Err(error) = waiter.wait(left) {
            tracing::error!("proposals wake nobody: {error}");
            std::thread::sleep(left);
        }
    }
    let latencies = seat.latencies();
    report(Report::Arbitrated(Box::new(Fared { latencies, lateness, ..Fared::default() })));
}
