//! A behavior built again from other parameters while the robot runs.

use std::panic::{AssertUnwindSafe, catch_unwind};

use super::behavior::BehaviorSeat;
use super::feed::Feed;
use crate::bus::{Bus, BusError};
use yamabico_core::behavior::{Behavior, BuildError};

/// What other parameters make of a behavior, beside the one that works.
pub(super) struct Candidate {
    table: toml::Table,
    behavior: Box<dyn Behavior>,
}

impl BehaviorSeat {
    /// Builds what `table` makes of the behavior; the one that works goes on.
    ///
    /// # Errors
    /// The constructor refuses the parameters, or panics over them.
    pub(super) fn build(&self, table: toml::Table) -> Result<Candidate, BuildError> {
        let plan = &self.plan;
        let built = catch_unwind(AssertUnwindSafe(|| plan.factory.build(&table, &plan.setup)));
        let behavior =
            built.unwrap_or_else(|_| Err(BuildError::new("", "its constructor panics over them")))?;
        Ok(Candidate { table, behavior })
    }

    /// Lets the candidate work from now on. It goes on where its predecessor stops, as after a death, and is told again what is
    /// kept on the bus.
    ///
    /// # Errors
    /// Its inputs cannot be opened anew; it works with those of its predecessor.
    pub(super) fn replace(&mut self, candidate: Candidate, bus: &Bus) -> Result<(), BusError> {
        let Candidate { table, mut behavior } = candidate;
        self.plan.table = table;
        let (old, memory) = (self.behavior.take(), &mut self.memory);
        let handed_over = catch_unwind(AssertUnwindSafe(|| {
            memory.clear();
            if let Some(old) = &old {
                old.remember(memory);
            }
            drop(old);
            if !memory.is_empty() {
                behavior.recall(memory);
            }
            behavior
        }));
        match handed_over {
            Ok(behavior) => self.behavior = Some(behavior),
            Err(_) => self.start_anew(),
        }
        self.feed = Feed::open(bus, &self.plan.inputs)?;
        Ok(())
    }

    /// Whether it works with exactly these parameters.
    pub(super) fn has(&self, table: &toml::Table) -> bool {
        self.behavior.is_some() && self.plan.table == *table
    }
}
