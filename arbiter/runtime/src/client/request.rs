//! Requests that the arbiter carries out: enable, disable, emergency stop, reset.

use std::time::{Duration, Instant};

use yamabico_arbiter::decide::DecisionMessage;
use yamabico_core::message::{Control, ControlKind, Mode, Name, Outcome, Twist};
use yamabico_core::time::Time;
use yamabico_host::bus::BusError;
use yamabico_parameters::instead;

use super::{ClientError, RobotClient, control};

/// Time within which the robot decides and carries out a request.
pub(super) const TIMEOUT: Duration = Duration::from_secs(5);
/// Time within which the robot stops after an emergency stop.
pub(super) const STOPPING_TIMEOUT: Duration = Duration::from_secs(10);
/// Period after which a request without effect is repeated: a robot that is starting has topics before it receives.
const RETRY_PERIOD: Duration = Duration::from_millis(100);
/// Time until the consequences of a request show, such as a stop because a critical behavior was disabled.
const SETTLING: Duration = Duration::from_millis(500);
/// Pause between two attempts to receive a decision.
const PAUSE: Duration = Duration::from_millis(2);

/// A request to the arbiter of a running robot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Request {
    /// Enable this behavior.
    Enable(String),
    /// Disable this behavior.
    Disable(String),
    /// Latch the emergency stop.
    EmergencyStop,
    /// Release the emergency stop.
    Reset,
}

/// Decisions before and after a request.
#[derive(Clone, Debug, PartialEq)]
pub struct RequestResult {
    /// Decision before the request took effect; after an emergency stop, the first one received.
    pub before: DecisionMessage,
    /// Decision half a second after the request took effect; after an emergency stop, the first one without motion.
    pub after: DecisionMessage,
    /// Set if the request changed anything.
    pub changed: bool,
    /// Time from the request to `after`.
    pub took: Duration,
}

impl RobotClient {
    /// Sends a request and waits until a decision shows its effect; after an emergency stop, until no motion is commanded.
    ///
    /// # Errors
    /// The robot has no such behavior, does not decide, or did not carry out the request in time.
    pub fn request(&mut self, request: &Request) -> Result<RequestResult, ClientError> {
        if *request == Request::EmergencyStop {
            // Stop first, find out later.
            self.send_request(request)?;
        }
        let before = self.next_decision(TIMEOUT)?.ok_or(ClientError::NoDecision)?;
        request.check(&before)?;
        let began = Instant::now();
        let mut sent_at: Option<Instant> = None;
        let mut decision = before.clone();
        while !request.is_in_effect(&decision) {
            if began.elapsed() > TIMEOUT {
                return Err(ClientError::NotCarriedOut);
            }
            if sent_at.is_none_or(|at| at.elapsed() > RETRY_PERIOD) {
                self.send_request(request)?;
                sent_at = Some(Instant::now());
            }
            decision = self.next_decision(RETRY_PERIOD)?.unwrap_or(decision);
        }
        decision = match request {
            Request::EmergencyStop => self.stopped(decision)?,
            _ => self.settled(decision)?,
        };
        let took = began.elapsed();
        Ok(RequestResult { changed: !request.is_in_effect(&before), took, before, after: decision })
    }

    fn send_request(&mut self, request: &Request) -> Result<(), BusError> {
        self.send(request.control(), Time::monotonic_now(), &[])
    }

    /// First decision made [`SETTLING`] after `decision`, or the last one before the timeout.
    fn settled(&self, mut decision: DecisionMessage) -> Result<DecisionMessage, BusError> {
        let (began, settled_ns) = (Instant::now(), (Time(decision.header.stamp_ns) + SETTLING).0);
        while decision.header.stamp_ns < settled_ns
            && let Some(left) = TIMEOUT.checked_sub(began.elapsed())
        {
            decision = self.next_decision(left)?.unwrap_or(decision);
        }
        Ok(decision)
    }

    /// First decision from `decision` on that commands no motion.
    fn stopped(&self, mut decision: DecisionMessage) -> Result<DecisionMessage, ClientError> {
        let began = Instant::now();
        while decision.header.commanded != Twist::ZERO {
            if began.elapsed() > STOPPING_TIMEOUT {
                return Err(ClientError::StillMoving);
            }
            decision = self.next_decision(RETRY_PERIOD)?.unwrap_or(decision);
        }
        Ok(decision)
    }

    /// Oldest decision that was not returned yet, waited for up to `timeout`.
    fn next_decision(&self, timeout: Duration) -> Result<Option<DecisionMessage>, BusError> {
        let began = Instant::now();
        loop {
            if let Some(decision) = self.decisions.receive()? {
                let (header, verdicts) = (*decision.header(), decision.items().to_vec());
                return Ok(Some(DecisionMessage { header, verdicts }));
            }
            if began.elapsed() > timeout {
                return Ok(None);
            }
            std::thread::sleep(PAUSE);
        }
    }
}

impl Request {
    fn control(&self) -> Control {
        let (kind, target) = match self {
            Request::Enable(name) => (ControlKind::Enable, name.as_str()),
            Request::Disable(name) => (ControlKind::Disable, name.as_str()),
            Request::EmergencyStop => (ControlKind::EmergencyStop, ""),
            Request::Reset => (ControlKind::Reset, ""),
        };
        Control { target: Name::new(target), ..control(kind) }
    }

    /// Refuses a behavior that the robot does not have.
    fn check(&self, decision: &DecisionMessage) -> Result<(), ClientError> {
        let (Request::Enable(name) | Request::Disable(name)) = self else { return Ok(()) };
        if decision.verdict(name).is_some() {
            return Ok(());
        }
        let names = decision.verdicts.iter().map(|verdict| verdict.behavior.as_str());
        Err(ClientError::NoSuchBehavior { name: name.clone(), instead: instead(name, names, "behavior") })
    }

    fn is_in_effect(&self, decision: &DecisionMessage) -> bool {
        // The outcome of a disabled behavior may be that its last halt is held; the fault shows that it is disabled.
        let is_disabled = |name: &str| {
            decision.verdict(name).is_some_and(|verdict| verdict.fault == Outcome::Disabled.code())
        };
        match self {
            Request::Enable(name) => !is_disabled(name),
            Request::Disable(name) => is_disabled(name),
            Request::EmergencyStop => decision.header.mode() == Some(Mode::EmergencyStop),
            Request::Reset => decision.header.mode() != Some(Mode::EmergencyStop),
        }
    }
}
