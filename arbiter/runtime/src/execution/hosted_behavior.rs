//! A behavior of a run in lockstep or of a replay: in this process, or in a program of its own.

use yamabico_core::behavior::ParameterError;
use yamabico_core::sensor::DeviceError;
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, BusError};
use yamabico_host::{BehaviorHost, BehaviorPlan, CallStats, HostError};

use super::external_program::ExternalProgram;
use super::plan::Plan;
use crate::supervisor::Program;

/// A behavior that is called from here.
pub(crate) enum HostedBehavior {
    /// Built into this program.
    Here(Box<BehaviorHost>),
    /// In a program of its own.
    Program(Box<ExternalProgram>),
}

/// Surroundings of the behaviors of a run.
pub(crate) struct Hosting<'a> {
    /// Plan of the run, with the topics.
    pub plan: &'a Plan,
    /// Bus with these topics.
    pub bus: &'a Bus,
    /// Program that starts external programs; without it they are refused.
    pub program: Option<&'a Program>,
    /// Set if saved states are published on their topic.
    pub publishes_states: bool,
}

impl HostedBehavior {
    /// Opens `behavior`, which continues from the saved state `state` unless that is empty.
    ///
    /// # Errors
    /// Parameters that the behavior rejects, topics that cannot be opened, or a program that does not start.
    pub fn open(
        behavior: BehaviorPlan,
        hosting: &Hosting<'_>,
        state: &[u8],
    ) -> Result<HostedBehavior, HostError> {
        if behavior.settings.host.exec.is_empty() {
            let mut host = BehaviorHost::open(behavior, hosting.bus)?;
            if hosting.publishes_states {
                host.publish_states(hosting.bus)?;
            }
            if !state.is_empty() {
                host.restore_state(state);
            }
            return Ok(HostedBehavior::Here(Box::new(host)));
        }
        let Some(program) = hosting.program else {
            let problem =
                "an external program is started by `yamabico run`, or by `yamabico replay --programs`";
            return Err(ParameterError::new("exec", problem).into());
        };
        Ok(HostedBehavior::Program(Box::new(ExternalProgram::open(behavior, hosting, program, state)?)))
    }

    /// Name in the task file.
    pub fn name(&self) -> &str {
        match self {
            HostedBehavior::Here(host) => host.name(),
            HostedBehavior::Program(program) => program.name(),
        }
    }

    /// Statistics of its calls.
    pub fn stats(&self) -> &CallStats {
        match self {
            HostedBehavior::Here(host) => host.stats(),
            HostedBehavior::Program(program) => program.stats(),
        }
    }

    /// Continues the count of an earlier instance, whose last proposal had this number.
    pub fn resume(&mut self, sequence: u64) {
        match self {
            HostedBehavior::Here(host) => host.resume(sequence),
            HostedBehavior::Program(program) => program.resume(sequence),
        }
    }

    /// Receives every waiting input.
    ///
    /// # Errors
    /// The bus or the program failed.
    pub fn collect(&mut self) -> Result<(), DeviceError> {
        match self {
            HostedBehavior::Here(host) => host.collect().map_err(bus_failed),
            HostedBehavior::Program(program) => program.collect(),
        }
    }

    /// Begins the call of an external program, so that several of them compute at the same time.
    ///
    /// # Errors
    /// The program failed.
    pub fn prepare(&mut self, now: Time) -> Result<(), DeviceError> {
        match self {
            HostedBehavior::Here(_) => Ok(()),
            HostedBehavior::Program(program) => program.ask(now),
        }
    }

    /// Lets the behavior propose if it is due, after [`HostedBehavior::prepare`].
    ///
    /// # Errors
    /// The bus or the program failed.
    pub fn propose(&mut self, now: Time) -> Result<(), DeviceError> {
        match self {
            HostedBehavior::Here(host) => host.propose(now).map_err(bus_failed),
            HostedBehavior::Program(program) => program.answer(now),
        }
    }

    /// Lets the behavior propose, due or not; a program must have been opened with a period of zero.
    ///
    /// # Errors
    /// The bus or the program failed.
    pub fn call(&mut self, now: Time) -> Result<(), DeviceError> {
        match self {
            HostedBehavior::Here(host) => host.call(now).map_err(bus_failed),
            HostedBehavior::Program(program) => program.ask(now).and_then(|()| program.answer(now)),
        }
    }

    /// Changes its parameters as during a live run.
    ///
    /// # Errors
    /// The parameters are refused, or the bus or the program failed.
    pub fn retune(&mut self, table: toml::Table, bus: &Bus) -> Result<(), HostError> {
        match self {
            HostedBehavior::Here(host) => host.retune(table, bus),
            HostedBehavior::Program(program) => program.retune(&table).map_err(|error| HostError::Process {
                name: program.name().to_owned(),
                reason: error.to_string(),
            }),
        }
    }
}

fn bus_failed(error: BusError) -> DeviceError {
    DeviceError::failed("bus", error)
}
