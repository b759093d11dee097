//! Live runs: the arbiter on a thread of its own, each behavior and device in a process or on a thread, woken by the messages
//! that it waits for.
//!
//! Stamps are the machine's monotonic clock. The arrival of a proposal triggers a decision and a command at once; the tick
//! is the keep-alive.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

use yamabico_core::behavior::ParameterError;
use yamabico_core::message::MessageType;
use yamabico_core::sensor::DeviceError;
use yamabico_core::time::{Time, TimeSource};
use yamabico_host::bus::{Bus, RawSubscriber, WaitSet};
use yamabico_host::config::{Clock, Run};
use yamabico_host::{
    DurationHistogram, HostError, Scheduling, follow_steps, panic_text, run_behavior, run_device,
};

use super::arbiter_host::ArbiterHost;
use super::driver_clock::StepCoordinator;
use super::goal_monitor::GoalMonitor;
use super::hosts::{ArbiterThread, BehaviorThread, DeviceThread, Hosts};
use super::lockstep::SensorSupply;
use super::parameter_server::ParameterServer;
use super::plan::Plan;
use super::plugin_stats::{PluginFailure, PluginStats};
use super::robot_manifest::{ManifestPublisher, ProcessPolicy, RobotManifest};
use super::run_end::{Progress, RunEnd, STOPPING_TIMEOUT, ended};
use super::run_flags::RunFlags;
use super::run_stats::RunStats;
use super::separate_processes::SeparateProcesses;
use super::service_manager::ServiceManager;
use crate::record::{Tap, Tee};
use crate::supervisor::{Program, Supervisor};

/// Time for which a robot must be at a standstill after it was commanded to stop.
const SETTLING: Duration = Duration::from_millis(50);
/// Period of the recorder.
const RECORDER_PERIOD: Duration = Duration::from_millis(2);
/// Time within which every process opens its parts, without the time for which it waits for a processor.
const OPENING_TIMEOUT: Duration = Duration::from_secs(20);
/// Time within which every thread ends; a thread that does not is hung and abandoned.
const ENDING_TIMEOUT: Duration = Duration::from_secs(1);
/// Decisions that the arbiter makes without a pause between two ticks.
const BURST: u32 = 64;
/// Pause after each decision once the burst is used up, so that a flood of proposals cannot occupy a processor.
const FLOOD_PAUSE: Duration = Duration::from_millis(1);

/// A live run.
pub struct Live {
    hosts: Option<Hosts>,
    supervisor: Option<Supervisor>,
    clock: Clock,
    taps: Vec<(String, MessageType, RawSubscriber)>,
    manifest: ManifestPublisher,
    parameter_server: ParameterServer,
    plugins: PluginStats,
    flags: Arc<RunFlags>,
    report: Sender<Report>,
    reports: Receiver<Report>,
    running_threads: usize,
    measuring: usize,
    devices: Vec<String>,
    failure: Option<DeviceError>,
    arbiter_stats: RunStats,
    // Dropped only after everything that the threads published has been received.
    left: Vec<Box<dyn Any + Send>>,
    began: Time,
    // Dropped last: ports must go before their bus.
    _bus: Bus,
}

/// Reports of the threads.
enum Report {
    /// A failure; the thread continues as well as it can.
    Failed(DeviceError),
    /// Statistics of the arbiter.
    ArbiterStats(Box<RunStats>),
    /// The thread has ended and leaves this behind.
    Done(Box<dyn Any + Send>),
}

impl Live {
    /// Opens everything in shared memory under the robot's name. Plugins with processes of their own become processes of
    /// `program`; without it, every plugin gets a thread. No plugin is called before [`Live::run`].
    ///
    /// # Errors
    /// A robot of this name is running already, or a device or behavior does not open.
    pub fn open(plan: Plan, robot: &str, program: Option<Program>) -> Result<Live, HostError> {
        let mut plan = plan.live();
        let bus = Bus::ipc(robot)?;
        plan.create_topics(&bus)?;
        let taps = plan.taps(&bus)?;
        let devices: Vec<String> = plan.devices.iter().map(|device| device.spec.name.clone()).collect();
        let policy = if program.is_some() { ProcessPolicy::Separate } else { ProcessPolicy::Threads };
        let manifest = ManifestPublisher::start(&bus, &RobotManifest::new(&plan, robot, policy))?;
        let parameter_server = ParameterServer::open(&plan, &bus)?;
        let arbiter = ArbiterThread::open(&plan, &bus)?;
        let clock = plan.clock;
        let coordinator = match clock {
            Clock::Machine => None,
            Clock::Driver => Some(StepCoordinator::open(&plan, &bus)?),
        };
        let separate =
            if program.is_some() { plan.split_off_processes() } else { SeparateProcesses::default() };
        let measuring = separate.devices.iter().filter(|device| !device.sensors.is_empty()).count();
        let processes = separate.plans(&bus)?;
        let hosts = Hosts::open(arbiter, coordinator, plan, &bus)?;
        let here = hosts.devices.iter().filter(|device| device.host.has_sensors()).count();
        let names: Vec<String> = processes.iter().map(|process| process.launch.name.clone()).collect();
        let supervisor = program.filter(|_| !processes.is_empty());
        let supervisor = supervisor.map(|program| Supervisor::start(&bus, processes, program)).transpose()?;
        let (report, reports) = channel();
        let mut live = Live {
            taps,
            manifest,
            parameter_server,
            plugins: PluginStats::default(),
            flags: Arc::default(),
            report,
            reports,
            running_threads: 0,
            measuring: measuring + here,
            devices,
            failure: None,
            arbiter_stats: RunStats::default(),
            left: Vec::new(),
            hosts: Some(hosts),
            clock,
            supervisor,
            began: Time::monotonic_now(),
            _bus: bus,
        };
        live.wait_for(&names)?;
        Ok(live)
    }

    /// Waits until each of these processes has opened its parts.
    fn wait_for(&mut self, names: &[String]) -> Result<(), HostError> {
        let begun = Instant::now();
        loop {
            self.show(&mut Tee::default(), Time::monotonic_now());
            if let Some(failure) = self.plugins.failures().first() {
                return Err(self.refusal(failure));
            }
            let Some(missing) = names.iter().find(|name| !self.plugins.is_up(name)) else { return Ok(()) };
            let delay = self.supervisor.as_ref().map_or(Duration::ZERO, Supervisor::start_delay);
            if begun.elapsed() > OPENING_TIMEOUT + delay {
                let reason = format!("it sent no heartbeat within {} s", OPENING_TIMEOUT.as_secs());
                return Err(HostError::Process { name: missing.clone(), reason });
            }
            std::thread::sleep(RECORDER_PERIOD);
        }
    }

    fn refusal(&self, failure: &PluginFailure) -> HostError {
        let reason = ParameterError::new(&failure.key, &failure.problem);
        match self.devices.contains(&failure.plugin) {
            true => HostError::Device { device: failure.plugin.clone(), reason },
            false => HostError::Process { name: failure.plugin.clone(), reason: reason.to_string() },
        }
    }

    /// Starts every thread, the arbiter's first.
    fn start(&mut self) -> Result<(), DeviceError> {
        let Some(Hosts { arbiter, coordinator, behaviors, devices }) = self.hosts.take() else {
            return Err(DeviceError::failed("live run", "it can be run only once; open another one"));
        };
        self.began = self.now();
        let ArbiterThread { host, wait_set, period, scheduling } = arbiter;
        self.start_thread("arbiter", scheduling, move |flags, report| {
            match coordinator {
                None => arbitrate(host, wait_set, period, flags, report),
                Some(coordinator) => arbitrate_steps(host, coordinator, period, flags, report),
            }
            Box::new(())
        })?;
        if let Some(supervisor) = &self.supervisor {
            supervisor.begin();
        }
        for behavior in behaviors {
            let BehaviorThread { mut host, mut wait_set, mut reporter, scheduling, mut follower } = behavior;
            let name = host.name().to_owned();
            self.start_thread(&name, scheduling, move |flags, _| {
                let is_over = || flags.is_over();
                match &mut follower {
                    None => run_behavior(&mut host, &mut wait_set, &mut reporter, &is_over),
                    Some(follower) => follow_steps(&mut host, follower, &mut reporter, &is_over),
                }
                Box::new((host, reporter))
            })?;
        }
        for device in devices {
            let DeviceThread { name, mut host, mut wait_set, mut reporter, scheduling } = device;
            self.start_thread(&name, scheduling, move |flags, _| {
                run_device(&mut host, &mut wait_set, &mut reporter, &|| flags.is_over());
                Box::new((host, reporter))
            })?;
        }
        Ok(())
    }

    fn start_thread(
        &mut self,
        name: &str,
        scheduling: Scheduling,
        work: impl FnOnce(&RunFlags, &dyn Fn(Report)) -> Box<dyn Any + Send> + Send + 'static,
    ) -> Result<(), DeviceError> {
        let (flags, report, who) = (Arc::clone(&self.flags), self.report.clone(), name.to_owned());
        let body = move || {
            for refused in scheduling.apply() {
                tracing::warn!("`{who}` runs although {refused}");
            }
            // Sending fails only after the end of the run.
            let send = |message| drop(report.send(message));
            match catch_unwind(AssertUnwindSafe(|| work(&flags, &send))) {
                Ok(left) => send(Report::Done(left)),
                Err(panic) => {
                    send(Report::Failed(DeviceError::failed(who, panic_text(&*panic))));
                    send(Report::Done(Box::new(())));
                }
            }
        };
        let started = std::thread::Builder::new().name(name.to_owned()).spawn(body);
        started.map_err(|error| DeviceError::failed(name, format!("could not start its thread: {error}")))?;
        self.running_threads += 1;
        Ok(())
    }

    /// Walls reported by the devices, for plots.
    pub fn walls(&self) -> Vec<Vec<[f64; 2]>> {
        self.plugins.walls()
    }

    /// Starts the run and continues until the goal is reached, the time is over, the sensors have ended, a device fails or
    /// `interrupt` is set; then until the robot stands. `tap` receives every message, `progress` is called every 2 ms.
    ///
    /// # Errors
    /// A device failed, or a thread did not start or panicked.
    pub fn run(
        &mut self,
        run: &Run,
        interrupt: &AtomicBool,
        tap: &mut dyn Tap,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<RunEnd, DeviceError> {
        self.failure = self.start().err();
        let mut monitor = GoalMonitor::new(run.goal);
        let mut service_manager = ServiceManager::from_environment();
        let mut decided: Option<(RunEnd, Time)> = None;
        loop {
            let now = self.now();
            self.show(&mut Tee(vec![&mut monitor, &mut service_manager, tap]), now);
            service_manager.step(Instant::now());
            if let Err(error) = self.parameter_server.step(self.supervisor.as_ref(), now) {
                tracing::error!("updating parameters failed: {error}");
            }
            let elapsed = now.since(self.began);
            progress(Progress { elapsed, to_go_m: monitor.to_go_m() });
            while let Ok(report) = self.reports.try_recv() {
                self.note(report);
            }
            let supply = SensorSupply::of(self.measuring, self.plugins.ended());
            let failed = self.has_failed().then_some(RunEnd::Interrupted);
            decided = decided.or_else(|| {
                Some((failed.or_else(|| ended(run, &monitor, elapsed, supply, interrupt))?, now))
            });
            if let Some((end, since)) = decided {
                service_manager.stopping();
                self.flags.stop.store(true, Ordering::Relaxed);
                let waited = now.since(since);
                if (monitor.stands() && waited > SETTLING)
                    || waited > STOPPING_TIMEOUT
                    || self.running_threads == 0
                {
                    self.end_everything(tap);
                    return self.failure.take().map_or(Ok(end), Err);
                }
            }
            std::thread::sleep(RECORDER_PERIOD);
        }
    }

    /// Number of messages that the taps lost to buffer overflow.
    pub fn lost(&self) -> u64 {
        self.taps.iter().map(|(.., subscriber)| subscriber.lost()).sum()
    }

    /// Statistics of the run, as far as they were reported.
    pub fn finish(mut self) -> RunStats {
        let arbiter_stats = std::mem::take(&mut self.arbiter_stats);
        RunStats { behaviors: self.plugins.records(), restarts: self.plugins.restarts(), ..arbiter_stats }
    }

    /// Passes `tap` what has been published since the last call, sorted by topic.
    fn show(&mut self, tap: &mut dyn Tap, now: Time) {
        self.manifest.serve_new_subscribers();
        let mut taps = Tee(vec![&mut self.plugins, tap]);
        for (topic, message, subscriber) in &self.taps {
            while let Ok(Some(sample)) = subscriber.receive() {
                let at = (message.stamps)(sample.header()).0.max(self.began).min(now);
                taps.message(topic, message, at, sample.header(), sample.items());
            }
        }
    }

    /// Returns true if a thread or a device has failed; stores the first failure.
    fn has_failed(&mut self) -> bool {
        if self.failure.is_none() {
            // A behavior that fails to restart is silent, which the arbiter handles; without a device there is no robot.
            let mut of_devices =
                self.plugins.failures().iter().filter(|failure| self.devices.contains(&failure.plugin));
            self.failure = of_devices.next().map(|failure| DeviceError::Reported(failure.problem.clone()));
        }
        self.failure.is_some()
    }

    /// Takes in the report of a thread; of several failures the first is kept.
    fn note(&mut self, report: Report) {
        match report {
            Report::Failed(error) => drop(self.failure.get_or_insert(error)),
            Report::ArbiterStats(fared) => self.arbiter_stats = *fared,
            Report::Done(left) => {
                self.running_threads -= 1;
                self.left.push(left);
            }
        }
    }

    /// Ends every process and every thread, and passes `tap` their last messages. A hung thread is abandoned.
    fn end_everything(&mut self, tap: &mut dyn Tap) {
        self.flags.end.store(true, Ordering::Relaxed);
        if let Some(supervisor) = &self.supervisor {
            supervisor.end();
        }
        // Counted in periods: a machine that stands still in between does not make a thread hung.
        let mut time_left = ENDING_TIMEOUT;
        while self.running_threads > 0
            || self.supervisor.as_ref().is_some_and(|supervisor| !supervisor.is_done())
        {
            let now = self.now();
            self.show(tap, now);
            match self.reports.recv_timeout(RECORDER_PERIOD) {
                Ok(report) => self.note(report),
                Err(_) if self.running_threads > 0 && time_left.is_zero() => {
                    tracing::warn!("{} threads did not end in time and are abandoned", self.running_threads);
                    self.running_threads = 0;
                }
                Err(_) => time_left = time_left.saturating_sub(RECORDER_PERIOD),
            }
        }
        let now = self.now();
        self.show(tap, now);
    }

    /// Time of the run: the newest step of a driver's clock, or the machine's clock.
    fn now(&mut self) -> Time {
        match self.clock {
            Clock::Machine => Time::monotonic_now(),
            Clock::Driver => {
                let (first, now) = self.flags.time.read();
                self.began = first;
                now
            }
        }
    }
}

impl Drop for Live {
    /// Ends every process and every thread, however the run ends.
    fn drop(&mut self) {
        self.end_everything(&mut Tee::default());
    }
}

/// Decides at every step of the driver's clock, until the end of the run.
fn arbitrate_steps(
    mut host: ArbiterHost,
    coordinator: StepCoordinator,
    period: Duration,
    flags: &RunFlags,
    report: &dyn Fn(Report),
) {
    let stops = || flags.stop.load(Ordering::Relaxed);
    let fail = |error| report(Report::Failed(error));
    coordinator.arbitrate(&mut host, period, &flags.time, &|| flags.is_over(), &stops, &fail);
    report(Report::ArbiterStats(Box::new(RunStats { latencies: host.latencies(), ..RunStats::default() })));
}

/// Decides when a proposal arrives and at every tick, until the end of the run; the last decisions bring the robot to a
/// standstill. Neither failures nor a flood of proposals end it.
fn arbitrate(
    mut host: ArbiterHost,
    mut wait_set: WaitSet,
    period: Duration,
    flags: &RunFlags,
    report: &dyn Fn(Report),
) {
    let mut tick = Time::monotonic_now();
    let mut lateness = DurationHistogram::default();
    let mut decided = 0;
    host.keep_time_by(TimeSource::Machine);
    while !flags.is_over() {
        if flags.stop.load(Ordering::Relaxed) {
            host.shut_down();
        }
        let now = Time::monotonic_now();
        if tick <= now {
            lateness.add(now.since(tick));
            decided = 0;
        }
        if let Err(error) = host.step(now) {
            report(Report::Failed(DeviceError::failed("arbiter", error)));
        }
        while tick <= now {
            tick = tick + period;
        }
        decided += 1;
        if decided > BURST {
            std::thread::sleep(FLOOD_PAUSE.min(tick.since(Time::monotonic_now())));
        }
        let left = tick.since(Time::monotonic_now());
        if let Err(error) = wait_set.wait(left) {
            tracing::error!("waiting for proposals failed: {error}");
            std::thread::sleep(left);
        }
    }
    let latencies = host.latencies();
    report(Report::ArbiterStats(Box::new(RunStats { latencies, lateness, ..RunStats::default() })));
}
