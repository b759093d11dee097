//! What is opened for the threads of a live run.

use std::time::Duration;

use yamabico_host::bus::{Bus, Waiter};
use yamabico_host::{BehaviorSeat, DeviceSeat, Hosting, Pulse, Scheduling, SeatError, TurnSeat, topics};

use super::arbiter_seat::ArbiterSeat;
use super::paced::Pacer;
use super::plan::Plan;

/// Topics that one thread can wait for. The arbiter hears behaviors beyond that, those of the lowest priority, at its tick.
const MAX_BELLS: usize = 64;

/// Everything that has been opened and waits for its thread.
pub(super) struct Seats {
    /// The arbiter, what wakes it, its period, and what is asked of the scheduler for it.
    pub arbiter: ArbitersSeat,
    /// Where the clock is a driver's.
    pub pacer: Option<Pacer>,
    /// The behaviors.
    pub behaviors: Vec<(BehaviorSeat, Waiter, Pulse, Scheduling, Option<TurnSeat>)>,
    /// The devices, by name.
    pub devices: Vec<(String, DeviceSeat, Waiter, Pulse, Scheduling)>,
}

/// The arbiter, what wakes it, its period, and what is asked of the scheduler for it.
pub(super) type ArbitersSeat = (ArbiterSeat, Waiter, Duration, Scheduling);

impl Seats {
    /// The arbiter's seat, which is opened before any other.
    pub fn arbiter(plan: &Plan, bus: &Bus) -> Result<ArbitersSeat, SeatError> {
        let arbiter = ArbiterSeat::open(plan, bus)?;
        let period = Duration::from_secs_f64(1.0 / plan.policy.rate_hz);
        let proposals = plan.policy.behaviors.iter().map(|behavior| topics::proposal(behavior.name.as_str()));
        let heard: Vec<String> =
            std::iter::once(topics::CONTROL.to_owned()).chain(proposals).take(MAX_BELLS).collect();
        let waiter = bus.waiter(&heard.iter().map(String::as_str).collect::<Vec<_>>())?;
        Ok((arbiter, waiter, period, plan.scheduling))
    }

    /// Opens everything of `plan` that gets a thread.
    pub fn open(
        arbiter: ArbitersSeat,
        pacer: Option<Pacer>,
        plan: Plan,
        bus: &Bus,
    ) -> Result<Seats, SeatError> {
        let pulse = |name: &str, hosting: &Hosting| Pulse::open(bus, name, 0, hosting.patience / 4);
        let behaviors = plan.behaviors.into_iter().map(|behavior| {
            let waiter = behavior.waiter(bus)?;
            let pulse = pulse(&behavior.setup.name, &behavior.hosting)?;
            let scheduling = behavior.hosting.scheduling;
            let turns = match &pacer {
                None => None,
                Some(_) => Some(TurnSeat::open(bus, &behavior.setup.name)?),
            };
            Ok((BehaviorSeat::open(behavior, bus)?, waiter, pulse, scheduling, turns))
        });
        let behaviors = behaviors.collect::<Result<_, SeatError>>()?;
        let devices = plan.devices.into_iter().map(|device| {
            let name = device.spec.name.clone();
            let (waiter, pulse) = (bus.waiter(&[topics::COMMAND])?, pulse(&name, &device.hosting)?);
            let scheduling = device.hosting.scheduling;
            Ok((name, DeviceSeat::open(device, bus)?, waiter, pulse, scheduling))
        });
        Ok(Seats { arbiter, behaviors, devices: devices.collect::<Result<_, SeatError>>()?, pacer })
    }
}
