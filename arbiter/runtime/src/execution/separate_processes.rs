//! Plugins of a live run with processes of their own.

use std::time::Duration;

use yamabico_host::bus::{Bus, BusError};
use yamabico_host::config::{Clock, Isolation};
use yamabico_host::process::{
    BehaviorLaunch, DeviceLaunch, LaunchConfig, OnParentDeath, PROTOCOL, Role, Start,
};
use yamabico_host::{BehaviorPlan, DevicePlan, HostSettings};

use super::plan::Plan;
use crate::supervisor::ProcessPlan;

/// Plugins with processes of their own.
#[derive(Debug, Default)]
pub(super) struct SeparateProcesses {
    pub devices: Vec<DevicePlan>,
    pub behaviors: Vec<BehaviorPlan>,
    clock: Clock,
    step: Duration,
}

impl Plan {
    /// Removes the plugins with processes of their own from the plan and returns them.
    pub(super) fn split_off_processes(&mut self) -> SeparateProcesses {
        let is_separate = |host: &HostSettings| host.isolation == Isolation::Process;
        SeparateProcesses {
            devices: self.devices.extract_if(.., |device| is_separate(&device.settings)).collect(),
            behaviors: self
                .behaviors
                .extract_if(.., |behavior| is_separate(&behavior.settings.host))
                .collect(),
            clock: self.clock,
            step: self.step,
        }
    }
}

impl SeparateProcesses {
    /// Processes that the supervisor starts: devices first, which take longer to open.
    pub fn plans(&self, bus: &Bus) -> Result<Vec<ProcessPlan>, BusError> {
        let devices = self.devices.iter().map(|device| {
            let role = Role::Device(DeviceLaunch::of(device, self.step));
            self.plan(bus, &device.spec.name, &device.settings, role, OnParentDeath::Brake)
        });
        let behaviors = self.behaviors.iter().map(|behavior| {
            let role = Role::Behavior(BehaviorLaunch::of(behavior));
            self.plan(bus, &behavior.setup.name, &behavior.settings.host, role, OnParentDeath::Die)
        });
        devices.chain(behaviors).collect()
    }

    fn plan(
        &self,
        bus: &Bus,
        name: &str,
        host: &HostSettings,
        role: Role,
        on_parent_death: OnParentDeath,
    ) -> Result<ProcessPlan, BusError> {
        let (bus_root, bus_prefix) = bus.files()?;
        let launch = LaunchConfig {
            protocol: PROTOCOL,
            name: name.to_owned(),
            robot: bus.name().to_owned(),
            bus_root,
            bus_prefix,
            restarts: 0,
            heartbeat_ms: host.deadline.heartbeat_period().as_secs_f64() * 1e3,
            start: Start::OnFirstCommand,
            saved_state: String::new(),
            request: 0,
            clock: self.clock,
            role,
        };
        Ok(ProcessPlan {
            launch,
            on_parent_death,
            deadline: host.deadline,
            scheduling: host.scheduling,
            exec: host.exec.clone(),
        })
    }
}
