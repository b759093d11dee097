//! A run whose clock is a driver's: time advances by its steps, and each step waits for everybody.
//!
//! In a step the driver publishes what its sensors measured and then the instant. The arbiter calls two turns: everybody
//! takes in what has arrived; then everybody who has something new proposes. It decides, and calls the step done; the driver
//! obeys and goes on. So the run is the same however fast the driver and the machine are.

use std::time::Duration;

use super::behavior::BehaviorSeat;
use super::device::DeviceSeat;
use super::pulse::Pulse;
use super::topics;
use super::tuner::Tuner;
use crate::bus::{Bus, BusError, Publisher, Subscriber, Waiter};
use yamabico_core::message::{Clock, Name, PluginState, Turn, TurnPhase};
use yamabico_core::sensor::{DeviceError, Due};
use yamabico_core::time::Time;

/// Longest sleep: how late the end of the run is noticed.
const NAP: Duration = Duration::from_millis(50);

/// A behavior's end of the turns.
pub struct TurnSeat {
    turns: Subscriber<Turn>,
    taken: Publisher<Turn>,
    waiter: Waiter,
    name: Name,
    sequence: u64,
}

/// A driver's end of the turns.
pub struct ClockSeat {
    clock: Publisher<Clock>,
    turns: Subscriber<Turn>,
    waiter: Waiter,
    step: Duration,
}

impl TurnSeat {
    /// That of the behavior `name`.
    ///
    /// # Errors
    /// Channels that do not open.
    pub fn open(bus: &Bus, name: &str) -> Result<TurnSeat, BusError> {
        Ok(TurnSeat {
            turns: bus.subscriber(topics::TURNS)?,
            taken: bus.publisher(topics::TAKEN)?,
            waiter: bus.waiter(&[topics::TURNS])?,
            name: Name::new(name),
            sequence: 0,
        })
    }

    fn take(&mut self, turn: Turn) -> Result<(), BusError> {
        self.sequence += 1;
        self.taken.publish(&Turn { plugin: self.name, sequence: self.sequence, ..turn }, &[])
    }
}

impl ClockSeat {
    /// That of a driver whose steps are this long.
    ///
    /// # Errors
    /// Channels that do not open.
    pub fn open(bus: &Bus, step: Duration) -> Result<ClockSeat, BusError> {
        Ok(ClockSeat {
            clock: bus.publisher(topics::CLOCK)?,
            turns: bus.subscriber(topics::TURNS)?,
            waiter: bus.waiter(&[topics::TURNS])?,
            step,
        })
    }

    /// Whether the step has been called done.
    fn is_done(&self, step: u64) -> Result<bool, BusError> {
        while let Some(turn) = self.turns.receive()? {
            if turn.header().step == step && turn.header().phase() == Some(TurnPhase::Done) {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

/// Asks one behavior when it is its turn, until `is_over`.
pub fn behave_in_turn(
    seat: &mut BehaviorSeat,
    turns: &mut TurnSeat,
    pulse: &mut Pulse,
    is_over: &dyn Fn() -> bool,
) {
    let longest = NAP.min(pulse.every());
    let mut tuner = Tuner::open(seat, pulse.bus());
    while !is_over() {
        if let Some(tuner) = &mut tuner {
            tuner.step(seat);
        }
        pulse.beat(PluginState::Running, Time::monotonic_now());
        let asked = take_turns(seat, turns);
        pulse.tell_memory(seat.memory(), Time::monotonic_now());
        pulse.tell_calls(seat.record(), Time::monotonic_now());
        let waited = asked.and_then(|()| turns.waiter.wait(longest));
        if let Err(error) = waited {
            // Its silence is the arbiter's to deal with; it tries again.
            tracing::error!("behavior `{}`: {error}", seat.name());
            std::thread::sleep(longest);
        }
    }
    pulse.tell_last_calls(seat.record(), Time::monotonic_now());
}

fn take_turns(seat: &mut BehaviorSeat, turns: &mut TurnSeat) -> Result<(), BusError> {
    loop {
        let Some(turn) = turns.turns.receive()?.map(|turn| *turn.header()) else { return Ok(()) };
        match turn.phase() {
            Some(TurnPhase::Collect) => seat.collect()?,
            Some(TurnPhase::Propose) => seat.propose(Time(turn.stamp_ns))?,
            Some(TurnPhase::Done) | None => continue,
        }
        turns.take(turn)?;
    }
}

/// Steps one device as fast as the others follow, until `is_over`.
///
/// # Errors
/// A sensor or the drive failed, or the bus did.
pub fn keep_the_clock(
    seat: &mut DeviceSeat,
    clock: &mut ClockSeat,
    pulse: &mut Pulse,
    is_over: &dyn Fn() -> bool,
) -> Result<(), DeviceError> {
    let failed = |error: BusError| DeviceError::failed("clock", error);
    pulse.show_walls(seat.walls(), Time::monotonic_now());
    let (mut now, mut step, mut state) = (Time::ZERO, 0, PluginState::Running);
    while !is_over() {
        if seat.poll(now)? == Due::Ended && seat.measures() {
            state = PluginState::Ended;
        }
        clock.clock.publish(&Clock { stamp_ns: now.0, step }, &[]).map_err(failed)?;
        loop {
            pulse.beat(state, Time::monotonic_now());
            if clock.is_done(step).map_err(failed)? || is_over() {
                break;
            }
            clock.waiter.wait(NAP.min(pulse.every())).map_err(failed)?;
        }
        seat.drive(now)?;
        (now, step) = (now + clock.step, step + 1);
    }
    Ok(())
}
