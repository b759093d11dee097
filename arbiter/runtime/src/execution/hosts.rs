//! Hosts of a live run: everything that is opened for its threads.

use std::time::Duration;

use yamabico_host::bus::{Bus, MAX_WAIT_TOPICS, WaitSet};
use yamabico_host::{
    BehaviorHost, DeviceHost, HostError, HostSettings, PluginReporter, Scheduling, StepFollower, topics,
};

use super::arbiter_host::ArbiterHost;
use super::driver_clock::StepCoordinator;
use super::plan::Plan;

/// Hosts that have been opened for their threads.
pub(super) struct Hosts {
    pub arbiter: ArbiterThread,
    /// Coordinator of the steps, if a driver owns the clock.
    pub coordinator: Option<StepCoordinator>,
    pub behaviors: Vec<BehaviorThread>,
    pub devices: Vec<DeviceThread>,
}

/// The arbiter and its notifications.
pub(super) struct ArbiterThread {
    pub host: ArbiterHost,
    /// Notifications of requests and proposals.
    pub wait_set: WaitSet,
    /// Period of the tick.
    pub period: Duration,
    pub scheduling: Scheduling,
}

/// A behavior and its notifications.
pub(super) struct BehaviorThread {
    pub host: BehaviorHost,
    pub wait_set: WaitSet,
    pub reporter: PluginReporter,
    pub scheduling: Scheduling,
    /// Follower of the steps, if a driver owns the clock.
    pub follower: Option<StepFollower>,
}

/// A device and its notifications.
pub(super) struct DeviceThread {
    pub name: String,
    pub host: DeviceHost,
    pub wait_set: WaitSet,
    pub reporter: PluginReporter,
    pub scheduling: Scheduling,
}

impl ArbiterThread {
    /// Opens the arbiter. It comes before every other part, so that no other can publish commands.
    pub fn open(plan: &Plan, bus: &Bus) -> Result<ArbiterThread, HostError> {
        let host = ArbiterHost::open(plan, bus)?;
        let period = Duration::from_secs_f64(1.0 / plan.policy.rate_hz);
        let proposals = plan.policy.behaviors.iter().map(|behavior| topics::proposal(behavior.name.as_str()));
        // Proposals beyond this number, those of the lowest priority, are received at the tick.
        let waited_for: Vec<String> =
            std::iter::once(topics::CONTROL.to_owned()).chain(proposals).take(MAX_WAIT_TOPICS).collect();
        let wait_set = bus.wait_set(&waited_for.iter().map(String::as_str).collect::<Vec<_>>())?;
        Ok(ArbiterThread { host, wait_set, period, scheduling: plan.scheduling })
    }
}

impl Hosts {
    /// Opens everything of `plan` that gets a thread.
    pub fn open(
        arbiter: ArbiterThread,
        coordinator: Option<StepCoordinator>,
        plan: Plan,
        bus: &Bus,
    ) -> Result<Hosts, HostError> {
        let reporter = |name: &str, host: &HostSettings| {
            PluginReporter::open(bus, name, 0, host.deadline.heartbeat_period())
        };
        let follows_steps = coordinator.is_some();
        let behaviors = plan.behaviors.into_iter().map(|behavior| {
            let name = &behavior.setup.name;
            Ok(BehaviorThread {
                wait_set: behavior.wait_set(bus)?,
                reporter: reporter(name, &behavior.settings.host)?,
                scheduling: behavior.settings.host.scheduling,
                follower: follows_steps.then(|| StepFollower::open(bus, name)).transpose()?,
                host: BehaviorHost::open(behavior, bus)?,
            })
        });
        let behaviors = behaviors.collect::<Result<_, HostError>>()?;
        let devices = plan.devices.into_iter().map(|device| {
            Ok(DeviceThread {
                name: device.spec.name.clone(),
                wait_set: bus.wait_set(&[topics::COMMAND])?,
                reporter: reporter(&device.spec.name, &device.settings)?,
                scheduling: device.settings.scheduling,
                host: DeviceHost::open(device, bus)?,
            })
        });
        let devices = devices.collect::<Result<_, HostError>>()?;
        Ok(Hosts { arbiter, coordinator, behaviors, devices })
    }
}
