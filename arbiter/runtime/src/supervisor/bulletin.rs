//! What the supervisor tells of its processes.

use std::time::Duration;

use yamabico_core::message::{Process, ProcessesHeader};
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, BusError, Publisher};
use yamabico_host::topics;

/// How soon somebody who joins is told.
const WELCOME: Duration = Duration::from_millis(50);

/// Tells of processes whenever something changed, and to everybody who joins.
pub(super) struct Bulletin {
    publisher: Publisher<ProcessesHeader>,
    told: Vec<Process>,
    sequence: u64,
    welcomed: Time,
}

impl Bulletin {
    pub fn open(bus: &Bus) -> Result<Bulletin, BusError> {
        let publisher = bus.publisher(topics::PROCESSES)?;
        Ok(Bulletin { publisher, told: Vec::new(), sequence: 0, welcomed: Time::ZERO })
    }

    /// Tells how `processes` are, where it is time to.
    pub fn tell(
        &mut self,
        processes: impl Iterator<Item = Process> + Clone,
        now: Time,
    ) -> Result<(), BusError> {
        if self.told.iter().copied().eq(processes.clone()) {
            if now.since(self.welcomed) >= WELCOME {
                self.welcomed = now;
                self.publisher.welcome()?;
            }
            return Ok(());
        }
        self.told.clear();
        self.told.extend(processes);
        self.sequence += 1;
        self.publisher.publish(&ProcessesHeader { stamp_ns: now.0, sequence: self.sequence }, &self.told)
    }
}
