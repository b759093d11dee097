//! Somebody outside who changes parameters of behaviors that run.

use std::time::{Duration, Instant};

use yamabico_core::message::{Control, ControlKind, RetunedHeader, Retuning};
use yamabico_core::time::Time;
use yamabico_host::MAX_PARAMETERS;
use yamabico_host::bus::{Bus, BusError};

use crate::execution::topics;

/// How long the robot may take to answer: longer than it waits for its behaviors.
const PATIENCE: Duration = Duration::from_secs(10);
const PAUSE: Duration = Duration::from_millis(5);

/// Why parameters were not changed.
#[derive(Debug, thiserror::Error)]
pub enum RetuneError {
    /// No such robot runs, or the bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// What is asked cannot be written down.
    #[error("too much at once: at most {MAX_PARAMETERS} bytes")]
    TooLong,
    /// The robot refused all of it.
    #[error("nothing was changed: {}{words}", if key.is_empty() { String::new() } else { format!("`{key}`: ") })]
    Refused {
        /// The key to change; empty where none is to blame.
        key: String,
        /// Why.
        words: String,
    },
    /// It does not answer.
    #[error("the robot did not answer within {} s: it is coming up, or it hangs", PATIENCE.as_secs())]
    Silent,
}

/// Asks the running robot of this name to change parameters: a table of keys for each behavior. All of it or nothing is
/// done; returns when it is, with the time that it took.
///
/// # Errors
/// The robot refused, or did not answer.
pub fn retune(robot: &str, changes: &toml::Table) -> Result<Duration, RetuneError> {
    let text = toml::to_string(changes).map_err(|_| RetuneError::TooLong)?;
    if text.len() > MAX_PARAMETERS {
        return Err(RetuneError::TooLong);
    }
    let bus = Bus::join(robot)?;
    let answers = bus.subscriber::<RetunedHeader>(topics::RETUNED)?;
    let controls = bus.publisher::<Control>(topics::CONTROL)?;
    let asked = Time::monotonic_now();
    let kind = ControlKind::Retune.code();
    let request = Control { stamp_ns: asked.0, sequence: 1, kind, ..Control::default() };
    controls.publish(&request, text.as_bytes())?;
    let began = Instant::now();
    while began.elapsed() < PATIENCE {
        while let Some(answer) = answers.receive()? {
            let header = answer.header();
            if header.request != asked.0 || !header.behavior.is_empty() {
                continue;
            }
            return match header.outcome() {
                Some(Retuning::Applied) => Ok(began.elapsed()),
                _ => Err(RetuneError::Refused {
                    key: header.key.as_str().to_owned(),
                    words: String::from_utf8_lossy(answer.items()).into_owned(),
                }),
            };
        }
        std::thread::sleep(PAUSE);
    }
    Err(RetuneError::Silent)
}
