//! New parameters for behaviors of a running robot.

use std::time::{Duration, Instant};

use yamabico_core::message::{ControlKind, RetuneOutcome, RetunedHeader};
use yamabico_core::time::Time;
use yamabico_host::MAX_PARAMETER_BYTES;

use super::{ClientError, PAUSE, RobotClient, control};
use crate::execution::topics;

/// Time within which the robot answers: longer than it waits for its behaviors.
pub(super) const TIMEOUT: Duration = Duration::from_secs(10);

impl RobotClient {
    /// Changes parameters of behaviors: `changes` holds a table of keys for each behavior. Either all of them are changed or
    /// none. Returns the time that it took.
    ///
    /// # Errors
    /// The robot refused the parameters, or did not answer.
    pub fn set_parameters(&mut self, changes: &toml::Table) -> Result<Duration, ClientError> {
        let text = toml::to_string(changes).map_err(|_| ClientError::ParametersTooLong)?;
        if text.len() > MAX_PARAMETER_BYTES {
            return Err(ClientError::ParametersTooLong);
        }
        let answers = self.bus.subscriber::<RetunedHeader>(topics::RETUNED)?;
        let sent = Time::monotonic_now();
        self.send(control(ControlKind::Retune), sent, text.as_bytes())?;
        let began = Instant::now();
        while began.elapsed() < TIMEOUT {
            while let Some(answer) = answers.receive()? {
                let header = answer.header();
                if header.request != sent.0 || !header.behavior.is_empty() {
                    continue;
                }
                return match header.outcome() {
                    Some(RetuneOutcome::Applied) => Ok(began.elapsed()),
                    _ => Err(ClientError::ParametersRefused {
                        key: header.key.as_str().to_owned(),
                        problem: String::from_utf8_lossy(answer.items()).into_owned(),
                    }),
                };
            }
            std::thread::sleep(PAUSE);
        }
        Err(ClientError::NoAnswer)
    }
}
