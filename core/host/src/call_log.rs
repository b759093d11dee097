//! Log of the calls of one behavior in a live run, from which the run can be replayed.

use crate::bus::{Bus, Publisher};
use crate::input_ports::InputPorts;
use crate::topics;
use yamabico_core::behavior::SlotSource;
use yamabico_core::message::{CallEvent, CallHeader, CallInput, Name};
use yamabico_core::time::Time;

/// Maximum number of inputs in one record; a call with more cannot be replayed.
pub const MAX_CALL_INPUTS: usize = 256;

/// Publishes what each call was handed, after the call.
pub(crate) struct CallLog {
    publisher: Publisher<CallHeader>,
    name: Name,
    sequence: u64,
    /// Sequence number and stamp of the newest message of each slot that has been logged.
    newest: Vec<Option<(u64, u64)>>,
    inputs: Vec<CallInput>,
    /// Events since the last call.
    pending: Vec<CallHeader>,
    has_failed: bool,
}

impl CallLog {
    /// Opens the log of the behavior `name`, which begins with the state of this hash and the parameters of this request.
    /// Returns none if the run is not logged.
    pub fn open(bus: &Bus, name: &str, (state, request): (u64, u64)) -> Option<CallLog> {
        let event = CallEvent::Start.code();
        let start = CallHeader { event, state, request, ..CallHeader::default() };
        Some(CallLog {
            publisher: bus.publisher(&topics::calls_of(name)).ok()?,
            name: Name::new(name),
            sequence: 0,
            newest: Vec::new(),
            inputs: Vec::with_capacity(MAX_CALL_INPUTS),
            pending: vec![start],
            has_failed: false,
        })
    }

    /// Notes that the behavior was replaced by one with the parameters of `request`; its slots are open anew.
    pub fn retuned(&mut self, request: u64) {
        self.newest.clear();
        self.pending.push(CallHeader { event: CallEvent::Retune.code(), request, ..CallHeader::default() });
    }

    /// Logs a call at `now` that led to the proposal with this sequence number.
    pub fn called(&mut self, ports: &InputPorts, now: Time, proposal: u64) {
        for i in 0..self.pending.len() {
            let event = self.pending[i];
            self.publish(event, now, false);
        }
        self.pending.clear();
        let left_out = self.collect(ports);
        let call = CallHeader { proposal, left_out, event: CallEvent::Call.code(), ..CallHeader::default() };
        self.publish(call, now, true);
    }

    /// Collects the messages that the call was handed for the first time; returns the number of those without room.
    fn collect(&mut self, ports: &InputPorts) -> u32 {
        self.inputs.clear();
        let mut left_out = 0;
        for (slot, inbox) in ports.slots().iter().enumerate() {
            if self.newest.len() <= slot {
                self.newest.push(None);
            }
            let message = inbox.subscriber().message();
            let key = |index: usize| {
                let raw = inbox.get(index)?;
                Some(((message.sequence)(raw.header), (message.stamps)(raw.header).0.0))
            };
            let newest = inbox.len().checked_sub(1).and_then(key);
            // Without a fresh message, the newest may still have arrived since the last call.
            let first = match inbox.fresh() {
                0 if newest == self.newest[slot] => inbox.len(),
                0 => inbox.len().saturating_sub(1),
                fresh => inbox.len().saturating_sub(fresh),
            };
            for (sequence, stamp_ns) in (first..inbox.len()).filter_map(key) {
                let fresh = u32::from(inbox.fresh() > 0);
                if self.inputs.len() == MAX_CALL_INPUTS {
                    left_out += 1;
                    continue;
                }
                self.inputs.push(CallInput { slot: slot as u32, fresh, sequence, stamp_ns });
            }
            self.newest[slot] = newest;
        }
        left_out
    }

    fn publish(&mut self, header: CallHeader, now: Time, with_inputs: bool) {
        self.sequence += 1;
        let header = CallHeader { stamp_ns: now.0, sequence: self.sequence, behavior: self.name, ..header };
        let inputs: &[CallInput] = if with_inputs { &self.inputs } else { &[] };
        if let Err(error) = self.publisher.publish(&header, inputs)
            && !std::mem::replace(&mut self.has_failed, true)
        {
            tracing::error!("the calls of `{}` cannot be logged, and not be replayed: {error}", self.name);
        }
    }
}
