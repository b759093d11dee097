//! Real time: behaviours, devices and the arbiter each on a thread of its own, woken by the messages that they wait for.
//!
//! Stamps are the machine's monotonic clock. The arrival of a proposal triggers a decision and a command at once; the tick
//! is the keep-alive.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

use rustix::time::{ClockId, clock_gettime};
use yamabico_core::bus::{Bell, Bus, BusError, RawSubscriber, Waiter};
use yamabico_core::config::Run;
use yamabico_core::message::MessageType;
use yamabico_core::sensor::{DeviceError, Due};
use yamabico_core::time::Time;

use super::arbiter_seat::ArbiterSeat;
use super::behavior_seat::{BehaviorRecord, BehaviorSeat, SeatError};
use super::course::{End, Progress, REST, ended};
use super::device_seat::{DeviceSeat, panicked};
use super::lockstep::Supply;
use super::plan::Plan;
use super::referee::Referee;
use super::topics;
use crate::record::{Tap, Tee};

/// Longest sleep of a thread that nothing wakes: how late it notices the end of the run.
const NAP: Duration = Duration::from_millis(50);
/// Longest sleep of a device: its drive notices missing commands at least this often.
const DEVICE_NAP: Duration = Duration::from_millis(10);
/// How often the recorder looks.
const RECORDER_NAP: Duration = Duration::from_millis(2);
/// A thread that has not ended by then hangs, and is left behind.
const FAREWELL: Duration = Duration::from_secs(1);
/// Topics that one thread can wait for. The arbiter hears behaviours beyond that, those of the lowest priority, at its tick.
const MOST_BELLS: usize = 64;

/// Now, on the machine's monotonic clock.
pub fn monotonic_now() -> Time {
    let now = clock_gettime(ClockId::Monotonic);
    Time(now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64)
}

/// A live run.
pub struct Live {
    seats: Option<Seats>,
    taps: Vec<(String, MessageType, RawSubscriber)>,
    orders: Arc<Orders>,
    report: Sender<Report>,
    reports: Receiver<Report>,
    working: usize,
    measuring: usize,
    ended: usize,
    failure: Option<DeviceError>,
    records: Vec<(String, BehaviorRecord)>,
    walls: Vec<Vec<[f64; 2]>>,
    began: Time,
    // Ports go before the bus that they are on.
    _bus: Bus,
}

/// Everything that has been opened and waits for its thread.
struct Seats {
    arbiter: (ArbiterSeat, Waiter, Duration),
    behaviors: Vec<(BehaviorSeat, Waiter)>,
    devices: Vec<(DeviceSeat, Waiter)>,
}

/// What the threads are told.
#[derive(Default)]
struct Orders {
    /// Bring the robot to rest.
    rest: AtomicBool,
    /// End.
    end: AtomicBool,
}

/// What the threads tell.
enum Report {
    /// A device has nothing more to measure.
    Ended,
    /// Something failed; its thread goes on as well as it can.
    Failed(DeviceError),
    /// How a behaviour fared.
    Fared(String, BehaviorRecord),
    /// The thread has ended.
    Done,
}

impl Live {
    /// Opens everything in shared memory under the robot's name. Nothing is asked, measured or moved before
    /// [`Live::run`].
    ///
    /// # Errors
    /// A robot of this name runs already; devices or behaviours that do not open.
    pub fn open(mut plan: Plan, robot: &str) -> Result<Live, SeatError> {
        for topic in &mut plan.topics {
            topic.spec.bell = Bell::Rings;
        }
        let bus = Bus::ipc(robot)?;
        plan.create_topics(&bus)?;
        let taps = plan
            .topics
            .iter()
            .map(|topic| Ok((topic.name.clone(), topic.message, bus.tap(&topic.name, &topic.message)?)));
        let taps = taps.collect::<Result<Vec<_>, BusError>>()?;
        let seats = Seats::open(plan, &bus)?;
        let devices = || seats.devices.iter().map(|(device, _)| device);
        let (report, reports) = channel();
        Ok(Live {
            taps,
            orders: Arc::default(),
            report,
            reports,
            working: 0,
            measuring: devices().filter(|device| device.measures()).count(),
            ended: 0,
            failure: None,
            records: Vec::new(),
            walls: devices().flat_map(|device| device.walls().to_vec()).collect(),
            seats: Some(seats),
            began: monotonic_now(),
            _bus: bus,
        })
    }

    /// Starts every thread, the arbiter's first.
    fn start(&mut self) -> Result<(), DeviceError> {
        let Some(Seats { arbiter: (arbiter, waiter, period), behaviors, devices }) = self.seats.take() else {
            return Err(DeviceError::failed("live run", "it has been run before; open another one"));
        };
        self.began = monotonic_now();
        self.start_thread("arbiter", move |orders, report| {
            arbitrate(arbiter, waiter, period, orders, report);
        })?;
        for (seat, waiter) in behaviors {
            let name = seat.name().to_owned();
            self.start_thread(&name, move |orders, report| behave(seat, waiter, orders, report))?;
        }
        for (seat, waiter) in devices {
            self.start_thread("device", move |orders, report| operate(seat, waiter, orders, report))?;
        }
        Ok(())
    }

    fn start_thread(
        &mut self,
        name: &str,
        work: impl FnOnce(&Orders, &dyn Fn(Report)) + Send + 'static,
    ) -> Result<(), DeviceError> {
        let (orders, report, who) = (Arc::clone(&self.orders), self.report.clone(), name.to_owned());
        let body = move || {
            // Nobody listens any more only when the run has ended.
            let tell = |told| drop(report.send(told));
            if let Err(panic) = catch_unwind(AssertUnwindSafe(|| work(&orders, &tell))) {
                tell(Report::Failed(DeviceError::failed(who, panicked(&*panic))));
            }
            tell(Report::Done);
        };
        let started = std::thread::Builder::new().name(name.to_owned()).spawn(body);
        started.map_err(|error| DeviceError::failed(name, format!("its thread does not start: {error}")))?;
        self.working += 1;
        Ok(())
    }

    /// Walls that the devices know, for plots.
    pub fn walls(&self) -> Vec<Vec<[f64; 2]>> {
        self.walls.clone()
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
            let now = monotonic_now();
            self.show(&mut Tee(vec![&mut referee, tap]), now);
            let elapsed = now.since(self.began);
            progress(Progress { elapsed, to_go_m: referee.to_go_m() });
            while let Ok(report) = self.reports.try_recv() {
                self.note(report);
            }
            let supply = Supply::of(self.measuring, self.ended);
            let failed = self.failure.is_some().then_some(End::Interrupted);
            told = told.or_else(|| {
                Some((failed.or_else(|| ended(run, &referee, elapsed, supply, interrupt))?, now))
            });
            if let Some((end, since)) = told {
                self.orders.rest.store(true, Ordering::Relaxed);
                let waited = now.since(since);
                if (referee.stands() && waited > NAP) || waited > REST || self.working == 0 {
                    self.dismiss();
                    self.show(tap, monotonic_now());
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

    /// How each behaviour fared in the run; without those that hang.
    pub fn finish(mut self) -> Vec<(String, BehaviorRecord)> {
        std::mem::take(&mut self.records)
    }

    /// Shows `tap` what has been published since the last call, in the order of publication as far as stamps tell it.
    fn show(&mut self, tap: &mut dyn Tap, now: Time) {
        for (topic, message, subscriber) in &self.taps {
            while let Ok(Some(sample)) = subscriber.receive() {
                let at = (message.stamps)(sample.header()).0.max(self.began).min(now);
                tap.message(topic, message, at, sample.header(), sample.items());
            }
        }
    }

    /// Takes down what a thread tells; of several failures the first.
    fn note(&mut self, report: Report) {
        match report {
            Report::Ended => self.ended += 1,
            Report::Failed(error) => drop(self.failure.get_or_insert(error)),
            Report::Fared(name, record) => self.records.push((name, record)),
            Report::Done => self.working -= 1,
        }
    }

    /// Ends every thread; one that hangs is left behind.
    fn dismiss(&mut self) {
        self.orders.end.store(true, Ordering::Relaxed);
        let deadline = Instant::now() + FAREWELL;
        while self.working > 0 {
            let left = deadline.saturating_duration_since(Instant::now());
            match self.reports.recv_timeout(left) {
                Ok(report) => self.note(report),
                Err(_) => {
                    tracing::warn!("{} threads hang and are left behind", self.working);
                    self.working = 0;
                }
            }
        }
    }
}

impl Seats {
    fn open(plan: Plan, bus: &Bus) -> Result<Seats, SeatError> {
        let arbiter = ArbiterSeat::open(&plan, bus)?;
        let period = Duration::from_secs_f64(1.0 / plan.policy.rate_hz);
        let proposals = plan.behaviors.iter().map(|behavior| topics::proposal(&behavior.setup.name));
        let heard: Vec<String> =
            std::iter::once(topics::CONTROL.to_owned()).chain(proposals).take(MOST_BELLS).collect();
        let waiter = bus.waiter(&heard.iter().map(String::as_str).collect::<Vec<_>>())?;
        let behaviors = plan.behaviors.into_iter().map(|behavior| {
            let inputs: Vec<String> = behavior.inputs.iter().map(|(_, topic, _)| topic.clone()).collect();
            let waiter = bus.waiter(&inputs.iter().map(String::as_str).collect::<Vec<_>>())?;
            Ok((BehaviorSeat::open(behavior, bus)?, waiter))
        });
        let behaviors = behaviors.collect::<Result<_, SeatError>>()?;
        let devices = plan.devices.into_iter();
        let devices =
            devices.map(|device| Ok((DeviceSeat::open(device, bus)?, bus.waiter(&[topics::COMMAND])?)));
        Ok(Seats {
            arbiter: (arbiter, waiter, period),
            behaviors,
            devices: devices.collect::<Result<_, SeatError>>()?,
        })
    }
}

impl Drop for Live {
    /// No thread outlives the run, however it ends.
    fn drop(&mut self) {
        self.dismiss();
    }
}

impl Orders {
    fn is_over(&self) -> bool {
        self.end.load(Ordering::Relaxed)
    }
}

/// Decides when a proposal arrives and at every tick, until the end, whatever fails; the last decisions bring the robot to
/// rest.
fn arbitrate(
    mut seat: ArbiterSeat,
    mut waiter: Waiter,
    period: Duration,
    orders: &Orders,
    report: &dyn Fn(Report),
) {
    let mut tick = monotonic_now();
    while !orders.is_over() {
        if orders.rest.load(Ordering::Relaxed) {
            seat.shut_down();
        }
        let now = monotonic_now();
        if let Err(error) = seat.step(now) {
            report(Report::Failed(DeviceError::failed("arbiter", error)));
        }
        while tick <= now {
            tick = tick + period;
        }
        nap(&mut waiter, tick.since(monotonic_now()));
    }
}

/// Asks one behaviour whenever something arrives for it, until the end.
fn behave(mut seat: BehaviorSeat, mut waiter: Waiter, orders: &Orders, report: &dyn Fn(Report)) {
    while !orders.is_over() {
        let asked = seat.collect().and_then(|()| seat.propose(monotonic_now()));
        let sleep = seat.next_call().map_or(NAP, |at| at.since(monotonic_now()).min(NAP));
        match asked {
            Ok(()) => nap(&mut waiter, sleep),
            Err(error) => {
                // Its silence is the arbiter's to deal with; it tries again.
                tracing::error!("behaviour `{}`: {error}", seat.name());
                std::thread::sleep(NAP);
            }
        }
    }
    report(Report::Fared(seat.name().to_owned(), seat.record().clone()));
}

/// Polls one device's sensors when they are due and hands its drive every command, until the end, whatever fails.
fn operate(mut seat: DeviceSeat, mut waiter: Waiter, orders: &Orders, report: &dyn Fn(Report)) {
    let mut lasts = seat.measures();
    while !orders.is_over() {
        let polled = seat.poll(monotonic_now());
        let driven = seat.drive(monotonic_now());
        let sleep = match polled {
            Ok(Due::At(at)) => at.since(monotonic_now()).min(DEVICE_NAP),
            _ => DEVICE_NAP,
        };
        if polled == Ok(Due::Ended) && lasts {
            lasts = false;
            report(Report::Ended);
        }
        for error in [polled.err(), driven.err()].into_iter().flatten() {
            report(Report::Failed(error));
        }
        nap(&mut waiter, sleep);
    }
    // What was commanded before the end is obeyed before the end.
    if let Err(error) = seat.drive(monotonic_now()) {
        report(Report::Failed(error));
    }
}

/// Sleeps until something arrives, or for so long; where the waiter fails, for so long.
fn nap(waiter: &mut Waiter, longest: Duration) {
    if let Err(error) = waiter.wait(longest) {
        tracing::error!("what arrives wakes nobody: {error}");
        std::thread::sleep(longest);
    }
}
