//! Reports on the supervised processes.

use std::time::Duration;

use yamabico_core::message::{Process, ProcessesHeader};
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, BusError, Publisher};
use yamabico_host::topics;

/// Period in which new subscribers are served.
const SERVING_PERIOD: Duration = Duration::from_millis(50);

/// Publishes the state of every process whenever it changes, and to new subscribers.
pub(super) struct ProcessReporter {
    publisher: Publisher<ProcessesHeader>,
    published: Vec<Process>,
    sequence: u64,
    served_at: Time,
}

impl ProcessReporter {
    pub fn open(bus: &Bus) -> Result<ProcessReporter, BusError> {
        let publisher = bus.publisher(topics::PROCESSES)?;
        Ok(ProcessReporter { publisher, published: Vec::new(), sequence: 0, served_at: Time::ZERO })
    }

    /// Publishes `processes` if they have changed; serves new subscribers if it is time to.
    pub fn report(
        &mut self,
        processes: impl Iterator<Item = Process> + Clone,
        now: Time,
    ) -> Result<(), BusError> {
        if self.published.iter().copied().eq(processes.clone()) {
            if now.since(self.served_at) >= SERVING_PERIOD {
                self.served_at = now;
                self.publisher.resend_to_new_subscribers()?;
            }
            return Ok(());
        }
        self.published.clear();
        self.published.extend(processes);
        self.sequence += 1;
        let header = ProcessesHeader { stamp_ns: now.0, sequence: self.sequence };
        self.publisher.publish(&header, &self.published)
    }
}
