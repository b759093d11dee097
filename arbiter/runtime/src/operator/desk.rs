//! Requests that the arbiter obeys with its next decision, and what it then decides.

use std::time::{Duration, Instant};

use yamabico_core::message::{Control, ControlKind, Mode, Name, Outcome, Twist};
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, BusError, Publisher, Subscriber};
use yamabico_parameters::instead;

use crate::execution::topics;
use yamabico_arbiter::decide::Told;

/// How long the robot may take to decide, and to obey.
const PATIENCE: Duration = Duration::from_secs(5);
/// How long it may take to brake.
const BRAKING: Duration = Duration::from_secs(10);
/// A request that has not been obeyed for so long is made again.
const AGAIN: Duration = Duration::from_millis(100);
/// What a request brings about, such as a stop for want of a critical behavior, has come about after so long.
const SETTLING: Duration = Duration::from_millis(500);
/// From one look at what was decided to the next.
const PAUSE: Duration = Duration::from_millis(2);

/// A connection to a running robot for requests.
pub struct Desk {
    controls: Publisher<Control>,
    decisions: Subscriber<yamabico_core::message::DecisionHeader>,
    sequence: u64,
}

/// What is asked of a robot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Request {
    /// Let this behavior be heard.
    Enable(String),
    /// Let this behavior not be heard.
    Disable(String),
    /// Stop, latched until a reset.
    EmergencyStop,
    /// Release the latched stop.
    Reset,
}

/// What became of a request.
#[derive(Clone, Debug, PartialEq)]
pub struct Obeyed {
    /// A decision before it was obeyed; of an emergency stop perhaps the first one after.
    pub before: Told,
    /// Half a second after it was obeyed; of an emergency stop, the first decision with no motion.
    pub after: Told,
    /// Whether it was otherwise before.
    pub changed: bool,
    /// From the request until `after`.
    pub took: Duration,
}

/// Why a request was not obeyed.
#[derive(Debug, thiserror::Error)]
pub enum RequestError {
    /// No such robot runs, or the bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The robot has no such behavior.
    #[error("the robot has no behavior `{name}`: {instead}")]
    NoSuchBehavior {
        /// What was asked for.
        name: String,
        /// What it has.
        instead: String,
    },
    /// It decides nothing.
    #[error("the robot decided nothing for {} s: it is coming up, or it hangs and its drive has braked", PATIENCE.as_secs())]
    Silent,
    /// It goes on as before.
    #[error("the robot did not obey within {} s, though it decides: is somebody else asking for the opposite?", PATIENCE.as_secs())]
    NotObeyed,
    /// It brakes and brakes.
    #[error("the emergency stop is latched, but after {} s the robot is still commanded to move", BRAKING.as_secs())]
    StillMoving,
}

impl Desk {
    /// Joins the running robot of this name.
    ///
    /// # Errors
    /// No such robot runs.
    pub fn join(robot: &str) -> Result<Desk, BusError> {
        let bus = Bus::join(robot)?;
        Ok(Desk {
            controls: bus.publisher(topics::CONTROL)?,
            decisions: bus.subscriber(topics::DECISION)?,
            sequence: 0,
        })
    }

    /// Asks, and waits until a decision shows that the robot obeyed; of an emergency stop, until no motion is commanded.
    ///
    /// # Errors
    /// It has no such behavior, or did not obey.
    pub fn ask(&mut self, request: &Request) -> Result<Obeyed, RequestError> {
        if *request == Request::EmergencyStop {
            // Whatever is to be found out comes after.
            self.publish(request)?;
        }
        let before = self.next(PATIENCE)?.ok_or(RequestError::Silent)?;
        request.check(&before)?;
        let began = Instant::now();
        let mut asked_at: Option<Instant> = None;
        let mut decision = before.clone();
        while !request.is_obeyed(&decision) {
            if began.elapsed() > PATIENCE {
                return Err(RequestError::NotObeyed);
            }
            // A robot that is just coming up has topics before it has ears.
            if asked_at.is_none_or(|at| at.elapsed() > AGAIN) {
                self.publish(request)?;
                asked_at = Some(Instant::now());
            }
            decision = self.next(AGAIN)?.unwrap_or(decision);
        }
        decision = match request {
            Request::EmergencyStop => self.standing(decision)?,
            _ => self.settled(decision)?,
        };
        let took = began.elapsed();
        Ok(Obeyed { changed: !request.is_obeyed(&before), took, before, after: decision })
    }

    fn publish(&mut self, request: &Request) -> Result<(), BusError> {
        self.sequence += 1;
        self.controls.publish(&request.control(Time::monotonic_now(), self.sequence), &[])
    }

    /// The first decision that was made so long after `decision`, or the last one where there is none.
    fn settled(&self, mut decision: Told) -> Result<Told, BusError> {
        let (began, settled_ns) = (Instant::now(), (Time(decision.header.stamp_ns) + SETTLING).0);
        while decision.header.stamp_ns < settled_ns
            && let Some(left) = PATIENCE.checked_sub(began.elapsed())
        {
            decision = self.next(left)?.unwrap_or(decision);
        }
        Ok(decision)
    }

    /// The first decision from `decision` on that commands no motion.
    fn standing(&self, mut decision: Told) -> Result<Told, RequestError> {
        let began = Instant::now();
        while decision.header.commanded != Twist::ZERO {
            if began.elapsed() > BRAKING {
                return Err(RequestError::StillMoving);
            }
            decision = self.next(AGAIN)?.unwrap_or(decision);
        }
        Ok(decision)
    }

    /// The oldest decision that was not looked at yet, or the next one within `longest`.
    fn next(&self, longest: Duration) -> Result<Option<Told>, BusError> {
        let began = Instant::now();
        loop {
            if let Some(decision) = self.decisions.receive()? {
                return Ok(Some(Told { header: *decision.header(), verdicts: decision.items().to_vec() }));
            }
            if began.elapsed() > longest {
                return Ok(None);
            }
            std::thread::sleep(PAUSE);
        }
    }
}

impl Request {
    fn control(&self, asked: Time, sequence: u64) -> Control {
        let (kind, target) = match self {
            Request::Enable(name) => (ControlKind::Enable, name.as_str()),
            Request::Disable(name) => (ControlKind::Disable, name.as_str()),
            Request::EmergencyStop => (ControlKind::EmergencyStop, ""),
            Request::Reset => (ControlKind::Reset, ""),
        };
        let target = Name::new(target);
        Control { stamp_ns: asked.0, sequence, kind: kind.code(), target, ..Control::default() }
    }

    /// Refuses a behavior that the robot does not have.
    fn check(&self, told: &Told) -> Result<(), RequestError> {
        let (Request::Enable(name) | Request::Disable(name)) = self else { return Ok(()) };
        if told.verdict(name).is_some() {
            return Ok(());
        }
        let names = told.verdicts.iter().map(|verdict| verdict.behavior.as_str());
        Err(RequestError::NoSuchBehavior { name: name.clone(), instead: instead(name, names, "behavior") })
    }

    fn is_obeyed(&self, told: &Told) -> bool {
        // The outcome may be that its last halt is held.
        let is_disabled =
            |name: &str| told.verdict(name).is_some_and(|verdict| verdict.fault == Outcome::Disabled.code());
        match self {
            Request::Enable(name) => !is_disabled(name),
            Request::Disable(name) => is_disabled(name),
            Request::EmergencyStop => told.header.mode() == Some(Mode::EmergencyStop),
            Request::Reset => told.header.mode() != Some(Mode::EmergencyStop),
        }
    }
}
