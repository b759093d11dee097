//! Notifications to systemd, for a run that it started as a service of `Type=notify`.

use std::time::{Duration, Instant};

use sd_notify::NotifyState;
use yamabico_core::message::{Command, Message, MessageType};
use yamabico_core::time::Time;

use crate::record::Tap;

/// Service manager of a run; without one, nothing is sent.
///
/// The run is ready from the arbiter's first command. It is alive while the arbiter commands and the supervisor passes these
/// commands on: if either hangs, the watchdog is not fed, and systemd restarts the service.
#[derive(Debug, Default)]
pub(super) struct ServiceManager {
    /// Period of feeding the watchdog, a third of its timeout; `None` without a watchdog.
    period: Option<Duration>,
    fed: Option<Instant>,
    /// Set by a command since the watchdog was fed.
    commands: bool,
    is_ready: bool,
    is_stopping: bool,
}

impl ServiceManager {
    /// The service manager that the environment names.
    pub fn from_environment() -> ServiceManager {
        let period = sd_notify::watchdog_enabled().map(|timeout| timeout / 3);
        ServiceManager { period, ..ServiceManager::default() }
    }

    /// Reports the run as ready once, and feeds the watchdog when it is due.
    pub fn step(&mut self, now: Instant) {
        if !self.commands {
            return;
        }
        if !std::mem::replace(&mut self.is_ready, true) {
            send(NotifyState::Ready);
        }
        let is_due = |period| self.fed.is_none_or(|fed| now.duration_since(fed) >= period);
        if self.period.is_some_and(is_due) {
            (self.fed, self.commands) = (Some(now), false);
            send(NotifyState::Watchdog);
        }
    }

    /// Reports once that the run ends: the robot is brought to a standstill.
    pub fn stopping(&mut self) {
        if !std::mem::replace(&mut self.is_stopping, true) {
            send(NotifyState::Stopping);
        }
    }
}

impl Tap for ServiceManager {
    fn message(&mut self, _: &str, message: &MessageType, _: Time, _: &[u8], _: &[u8]) {
        self.commands |= message.name == Command::NAME;
    }
}

fn send(state: NotifyState<'_>) {
    if let Err(error) = sd_notify::notify(std::slice::from_ref(&state)) {
        tracing::warn!("systemd was not notified of `{state}`: {error}");
    }
}
