//! The plugins of a live run that get processes of their own.

use std::time::Duration;

use yamabico_host::bus::{Bus, BusError};
use yamabico_host::config::{Clock, Isolation};
use yamabico_host::process::{Begin, BehaviorCharge, Charge, DeviceCharge, OnDeath, PROTOCOL, Part};
use yamabico_host::{BehaviorPlan, DevicePlan, Hosting};

use super::plan::Plan;
use crate::supervisor::WardPlan;

/// Plugins that get processes of their own.
#[derive(Debug, Default)]
pub(super) struct Apart {
    pub devices: Vec<DevicePlan>,
    pub behaviors: Vec<BehaviorPlan>,
    clock: Clock,
    step: Duration,
}

impl Plan {
    /// Takes the plugins out of the plan that are to have processes of their own.
    pub(super) fn take_apart(&mut self) -> Apart {
        let is_apart = |hosting: &Hosting| hosting.isolation == Isolation::Process;
        Apart {
            devices: self.devices.extract_if(.., |device| is_apart(&device.hosting)).collect(),
            behaviors: self.behaviors.extract_if(.., |behavior| is_apart(&behavior.hosting)).collect(),
            clock: self.clock,
            step: self.step,
        }
    }
}

impl Apart {
    /// What the supervisor is to start: devices first, which take longer to open.
    pub fn wards(&self, bus: &Bus) -> Result<Vec<WardPlan>, BusError> {
        let devices = self.devices.iter().map(|device| {
            let part = Part::Device(DeviceCharge::of(device, self.step));
            let ward = self.ward(bus, &device.spec.name, &device.hosting, part, OnDeath::Brake)?;
            Ok(WardPlan { exec: device.exec.clone(), ..ward })
        });
        let behaviors = self.behaviors.iter().map(|behavior| {
            let part = Part::Behavior(BehaviorCharge::of(behavior));
            let ward = self.ward(bus, &behavior.setup.name, &behavior.hosting, part, OnDeath::Die)?;
            Ok(WardPlan { exec: behavior.exec.clone(), ..ward })
        });
        devices.chain(behaviors).collect()
    }

    fn ward(
        &self,
        bus: &Bus,
        name: &str,
        hosting: &Hosting,
        part: Part,
        on_death: OnDeath,
    ) -> Result<WardPlan, BusError> {
        let (bus_root, bus_prefix) = bus.files()?;
        let charge = Charge {
            protocol: PROTOCOL,
            name: name.to_owned(),
            robot: bus.name().to_owned(),
            bus_root,
            bus_prefix,
            restarts: 0,
            beat_ms: hosting.patience.as_secs_f64() * 1e3 / 4.0,
            begin: Begin::WithTheFirstCommand,
            memory: String::new(),
            clock: self.clock,
            part,
        };
        let Hosting { patience, scheduling, .. } = *hosting;
        Ok(WardPlan { charge, on_death, patience, scheduling, exec: Vec::new() })
    }
}
