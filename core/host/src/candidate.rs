//! Replacement of a running behavior by one with other parameters.

use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::behavior_host::BehaviorHost;
use crate::bus::{Bus, BusError};
use crate::input_ports::InputPorts;
use yamabico_core::behavior::{Behavior, ParameterError};

/// Behavior with new parameters, built beside the running one.
pub(super) struct Candidate {
    table: toml::Table,
    behavior: Box<dyn Behavior>,
}

impl BehaviorHost {
    /// Builds the behavior with the parameters `table`; the running one continues.
    ///
    /// # Errors
    /// The constructor rejects the parameters or panics.
    pub(super) fn build(&self, table: toml::Table) -> Result<Candidate, ParameterError> {
        let plan = &self.plan;
        let built = catch_unwind(AssertUnwindSafe(|| plan.factory.build(&table, &plan.setup)));
        let behavior = built.unwrap_or_else(|_| Err(ParameterError::new("", "the constructor panicked")))?;
        Ok(Candidate { table, behavior })
    }

    /// Replaces the running behavior by the candidate. The candidate restores the state of the running behavior, as
    /// after a restart, and receives the newest message of each latest input again.
    ///
    /// # Errors
    /// Its inputs cannot be reopened; it then keeps those of the old behavior.
    pub(super) fn replace(&mut self, candidate: Candidate, bus: &Bus) -> Result<(), BusError> {
        let Candidate { table, mut behavior } = candidate;
        self.plan.table = table;
        let (old, state) = (self.behavior.take(), &mut self.saved_state);
        let handed_over = catch_unwind(AssertUnwindSafe(|| {
            state.clear();
            if let Some(old) = &old {
                old.save_state(state);
            }
            drop(old);
            if !state.is_empty() {
                behavior.restore_state(state);
            }
            behavior
        }));
        match handed_over {
            Ok(behavior) => self.behavior = Some(behavior),
            Err(_) => self.rebuild(),
        }
        self.inputs = InputPorts::open(bus, &self.plan.inputs)?;
        Ok(())
    }

    /// Returns true if the behavior runs with exactly these parameters.
    pub(super) fn has_parameters(&self, table: &toml::Table) -> bool {
        self.behavior.is_some() && self.plan.table == *table
    }
}
