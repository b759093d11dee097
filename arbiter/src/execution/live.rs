//! Real time: behaviours, devices and the arbiter each on a thread of its own, woken by the messages that they wait for.
//!
//! Stamps are the machine's monotonic clock. The arrival of a proposal triggers a decision and a command at once; the tick
//! is the keep-alive.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

use rustix::time::{ClockId, clock_gettime};
use yamabico_core::bus::{Bell, Bus, BusError, RawSubscriber};
use yamabico_core::config::Run;
use yamabico_core::message::MessageType;
use yamabico_core::sensor::{DeviceError, Due};
use yamabico_core::time::Time;

use super::arbiter_seat::ArbiterSeat;
use super::behavior_seat::{BehaviorRecord, BehaviorSeat, SeatError};
use super::course::{End, Progress, REST, ended};
use super::device_seat::DeviceSeat;
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

/// Now, on the machine's monotonic clock.
pub fn monotonic_now() -> Time {
    let now = clock_gettime(ClockId::Monotonic);
    Time(now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64)
}

/// A live run.
pub struct Live {
    taps: Vec<(String, MessageType, RawSubscriber)>,
    orders: Arc<Orders>,
    reports: Receiver<Report>,
    working: usize,
    records: Vec<(String, BehaviorRecord)>,
    walls: Vec<Vec<[f64; 2]>>,
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
}

/// What the threads tell.
enum Report {
    Behavior(String, BehaviorRecord),
    DeviceEnded,
    DeviceDone(Result<(), DeviceError>),
    ArbiterDone(Result<(), BusError>),
}

impl Live {
    /// Opens everything in shared memory under the robot's name and starts every thread; the arbiter first.
    ///
    /// # Errors
    /// A robot of this name runs already; devices or behaviours that do not open.
    pub fn start(mut plan: Plan, robot: &str) -> Result<Live, SeatError> {
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
        let orders = Arc::new(Orders::default());
        let (report, reports) = channel();
        let mut live = Live {
            taps,
            orders,
            reports,
            working: 0,
            records: Vec::new(),
            walls: Vec::new(),
            began: monotonic_now(),
            _bus: bus.clone(),
        };
        let started = live.seat(plan, &bus, &report);
        if started.is_err() {
            live.dismiss();
        }
        started.map(|()| live)
    }

    /// Everything is opened before anything moves; then the threads start, the arbiter's first.
    fn seat(&mut self, plan: Plan, bus: &Bus, report: &Sender<Report>) -> Result<(), SeatError> {
        let arbiter = ArbiterSeat::open(&plan, bus)?;
        let period = Duration::from_secs_f64(1.0 / plan.policy.rate_hz);
        let mut heard: Vec<String> =
            plan.behaviors.iter().map(|behavior| topics::proposal(&behavior.setup.name)).collect();
        heard.push(topics::CONTROL.to_owned());
        let behaviors = plan.behaviors.into_iter().map(|behavior| {
            let inputs: Vec<String> = behavior.inputs.iter().map(|(_, topic, _)| topic.clone()).collect();
            Ok((BehaviorSeat::open(behavior, bus)?, inputs))
        });
        let behaviors = behaviors.collect::<Result<Vec<_>, SeatError>>()?;
        let devices = plan.devices.into_iter().map(|device| DeviceSeat::open(device, bus));
        let devices = devices.collect::<Result<Vec<_>, _>>()?;
        self.walls = devices.iter().flat_map(|device| device.walls().to_vec()).collect();

        self.start_thread("arbiter", bus, report, move |bus, orders, report| {
            let outcome = arbitrate(arbiter, bus, &heard, period, orders);
            report(Report::ArbiterDone(outcome));
        });
        for (seat, inputs) in behaviors {
            let name = seat.name().to_owned();
            self.start_thread(&name, bus, report, move |bus, orders, report| {
                let record = behave(seat, bus, &inputs, orders);
                report(Report::Behavior(record.0, record.1));
            });
        }
        for device in devices {
            self.start_thread("device", bus, report, move |bus, orders, report| {
                let outcome = operate(device, bus, orders, report);
                report(Report::DeviceDone(outcome));
            });
        }
        Ok(())
    }

    fn start_thread(
        &mut self,
        name: &str,
        bus: &Bus,
        report: &Sender<Report>,
        work: impl FnOnce(&Bus, &Orders, &dyn Fn(Report)) + Send + 'static,
    ) {
        let (bus, orders, report) = (bus.clone(), Arc::clone(&self.orders), report.clone());
        let body = move || {
            // Nobody listens any more only when the run has ended.
            work(&bus, &orders, &|told| drop(report.send(told)));
        };
        match std::thread::Builder::new().name(name.to_owned()).spawn(body) {
            Ok(_) => self.working += 1,
            Err(error) => tracing::error!("cannot start the thread of `{name}`: {error}"),
        }
    }

    /// Walls that the devices know, for plots.
    pub fn walls(&self) -> Vec<Vec<[f64; 2]>> {
        self.walls.clone()
    }

    /// Goes on until the goal is reached, the time is over, the sensors have ended or `interrupt` is set; then until the robot
    /// stands. How each behaviour fared comes with it.
    ///
    /// # Errors
    /// A device failed.
    pub fn run(
        &mut self,
        run: &Run,
        interrupt: &AtomicBool,
        tap: &mut dyn Tap,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<(End, Vec<(String, BehaviorRecord)>), DeviceError> {
        let mut referee = Referee::new(run.goal);
        let mut supply = Supply::Lasting;
        let mut told: Option<(End, Time)> = None;
        let mut failure = None;
        loop {
            let now = monotonic_now();
            self.show(&mut Tee(vec![&mut referee, tap]), now);
            let elapsed = now.since(self.began);
            progress(Progress { elapsed, to_go_m: referee.to_go_m() });
            while let Ok(report) = self.reports.try_recv() {
                match report {
                    Report::DeviceEnded => supply = Supply::Ended,
                    other => failure = failure.or(self.note(other)),
                }
            }
            if failure.is_some() && told.is_none() {
                told = Some((End::Interrupted, now));
            }
            told = told.or_else(|| Some((ended(run, &referee, elapsed, supply, interrupt)?, now)));
            if let Some((end, since)) = told {
                self.orders.rest.store(true, Ordering::Relaxed);
                let waited = now.since(since);
                if (referee.stands() && waited > NAP) || waited > REST {
                    self.dismiss();
                    self.show(tap, monotonic_now());
                    return failure.map_or(Ok((end, std::mem::take(&mut self.records))), Err);
                }
            }
            std::thread::sleep(RECORDER_NAP);
        }
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

    /// Takes down what a thread tells; a failure, where it is one.
    fn note(&mut self, report: Report) -> Option<DeviceError> {
        match report {
            Report::DeviceEnded => return None,
            Report::Behavior(name, record) => self.records.push((name, record)),
            Report::DeviceDone(Ok(())) | Report::ArbiterDone(Ok(())) => {}
            Report::DeviceDone(Err(error)) => {
                self.working -= 1;
                return Some(error);
            }
            Report::ArbiterDone(Err(error)) => {
                self.working -= 1;
                return Some(DeviceError::failed("arbiter", error));
            }
        }
        self.working -= 1;
        None
    }

    /// Ends every thread; one that hangs is left behind.
    fn dismiss(&mut self) {
        self.orders.rest.store(true, Ordering::Relaxed);
        self.orders.end.store(true, Ordering::Relaxed);
        let deadline = Instant::now() + FAREWELL;
        while self.working > 0 {
            let left = deadline.saturating_duration_since(Instant::now());
            match self.reports.recv_timeout(left) {
                Ok(report) => drop(self.note(report)),
                Err(_) => {
                    tracing::warn!("{} threads hang and are left behind", self.working);
                    return;
                }
            }
        }
    }
}

impl Orders {
    fn is_over(&self) -> bool {
        self.end.load(Ordering::Relaxed)
    }
}

/// Decides when a proposal arrives and at every tick, until the end; the last decisions bring the robot to rest.
fn arbitrate(
    mut seat: ArbiterSeat,
    bus: &Bus,
    heard: &[String],
    period: Duration,
    orders: &Orders,
) -> Result<(), BusError> {
    let mut waiter = bus.waiter(&heard.iter().map(String::as_str).collect::<Vec<_>>())?;
    let mut tick = monotonic_now();
    while !orders.is_over() {
        if orders.rest.load(Ordering::Relaxed) {
            seat.shut_down();
        }
        let now = monotonic_now();
        seat.step(now)?;
        while tick <= now {
            tick = tick + period;
        }
        waiter.wait(tick.since(monotonic_now()))?;
    }
    Ok(())
}

/// Asks one behaviour whenever something arrives for it, until the end.
fn behave(mut seat: BehaviorSeat, bus: &Bus, inputs: &[String], orders: &Orders) -> (String, BehaviorRecord) {
    let mut waiter = bus.waiter(&inputs.iter().map(String::as_str).collect::<Vec<_>>());
    while !orders.is_over() {
        let asked = seat.collect().and_then(|()| seat.propose(monotonic_now()));
        let sleep = seat.next_call().map_or(NAP, |at| at.since(monotonic_now()).min(NAP));
        let slept = waiter
            .as_mut()
            .map_err(|error| error.to_string())
            .and_then(|waiter| waiter.wait(sleep).map_err(|error| error.to_string()));
        if let Err(problem) = asked.map_err(|error| error.to_string()).and(slept.map(drop)) {
            // Its silence is the arbiter's to deal with; it tries again.
            tracing::error!("behaviour `{}`: {problem}", seat.name());
            std::thread::sleep(NAP);
        }
    }
    (seat.name().to_owned(), seat.record().clone())
}

/// Polls one device's sensors when they are due and hands its drive every command, until the end.
fn operate(
    mut seat: DeviceSeat,
    bus: &Bus,
    orders: &Orders,
    report: &dyn Fn(Report),
) -> Result<(), DeviceError> {
    let failed = |error: BusError| DeviceError::failed("bus", error);
    let mut waiter = bus.waiter(&[topics::COMMAND]).map_err(failed)?;
    let mut told = false;
    while !orders.is_over() {
        let now = monotonic_now();
        let due = seat.poll(now)?;
        seat.drive(monotonic_now())?;
        let sleep = match due {
            Due::At(at) => at.since(monotonic_now()).min(DEVICE_NAP),
            Due::Ended => DEVICE_NAP,
        };
        if due == Due::Ended && !told {
            told = true;
            report(Report::DeviceEnded);
        }
        waiter.wait(sleep).map_err(failed)?;
    }
    Ok(())
}
