//! Change of a running behavior's parameters between two calls.
//!
//! A change has two steps, so that several behaviors change together or not at all: every behavior prepares, and when
//! all are ready, every behavior applies.

use crate::behavior_host::BehaviorHost;
use crate::bus::{Bus, BusError, Publisher, Subscriber};
use crate::candidate::Candidate;
use crate::topics;
use yamabico_core::behavior::ParameterError;
use yamabico_core::message::{Name, Note, RetuneHeader, RetuneOutcome, RetuneStep, RetunedHeader};
use yamabico_core::time::Time;

/// Maximum length of a behavior's parameters, bytes of TOML.
pub const MAX_PARAMETER_BYTES: usize = 16 * 1024;

/// Receives requests to change the parameters of one behavior, and replies.
pub(super) struct Tuner {
    requests: Subscriber<RetuneHeader>,
    replies: Option<Publisher<RetunedHeader>>,
    candidate: Option<(u64, Candidate)>,
    sequence: u64,
    bus: Bus,
}

impl Tuner {
    /// Opens the tuner of the behavior of `host`. Returns none and logs a warning if its topic cannot be opened.
    pub fn open(host: &BehaviorHost, bus: &Bus) -> Option<Tuner> {
        match bus.subscriber(topics::RETUNE) {
            Ok(requests) => {
                Some(Tuner { requests, replies: None, candidate: None, sequence: 0, bus: bus.clone() })
            }
            Err(error) => {
                tracing::warn!("parameters of `{}` cannot be changed during the run: {error}", host.name());
                None
            }
        }
    }

    /// Handles the requests that arrived since the last call. Logs a failure of the bus.
    pub fn step(&mut self, host: &mut BehaviorHost) {
        if let Err(error) = self.handle_requests(host) {
            tracing::error!("changing parameters of `{}` failed: {error}", host.name());
        }
    }

    fn handle_requests(&mut self, host: &mut BehaviorHost) -> Result<(), BusError> {
        loop {
            let Some(request) = self.requests.receive()? else { return Ok(()) };
            let header = *request.header();
            let text = String::from_utf8_lossy(request.items()).into_owned();
            drop(request);
            if header.behavior.as_str() != host.name() {
                continue;
            }
            let result = match header.step() {
                Some(RetuneStep::Prepare) => self.prepare(host, header.request, &text),
                Some(RetuneStep::Apply) => self.apply(host, header.request, &text),
                Some(RetuneStep::Drop) | None => {
                    self.candidate = None;
                    continue;
                }
            };
            self.reply(header.behavior, header.request, result)?;
        }
    }

    fn prepare(
        &mut self,
        host: &BehaviorHost,
        request: u64,
        text: &str,
    ) -> Result<RetuneOutcome, ParameterError> {
        self.candidate = None;
        self.candidate = Some((request, host.build(parse(text)?)?));
        Ok(RetuneOutcome::Ready)
    }

    fn apply(
        &mut self,
        host: &mut BehaviorHost,
        request: u64,
        text: &str,
    ) -> Result<RetuneOutcome, ParameterError> {
        let prepared = self.candidate.take().filter(|(of, _)| *of == request);
        let candidate = match prepared {
            Some((_, candidate)) => candidate,
            // The behavior was restarted after it prepared, perhaps with the new parameters.
            None => {
                let table = parse(text)?;
                if host.has_parameters(&table) {
                    return Ok(RetuneOutcome::Applied);
                }
                host.build(table)?
            }
        };
        if let Err(error) = host.replace(candidate, &self.bus) {
            tracing::error!("could not reopen the inputs of behavior `{}`: {error}", host.name());
        }
        if let Some(calls) = host.call_log() {
            calls.retuned(request);
        }
        Ok(RetuneOutcome::Applied)
    }

    fn reply(
        &mut self,
        behavior: Name,
        request: u64,
        result: Result<RetuneOutcome, ParameterError>,
    ) -> Result<(), BusError> {
        let (outcome, key, text) = match result {
            Ok(outcome) => (outcome, Note::default(), String::new()),
            Err(error) => (RetuneOutcome::Refused, Note::new(&error.key), error.problem),
        };
        self.sequence += 1;
        let header = RetunedHeader {
            stamp_ns: Time::monotonic_now().0,
            sequence: self.sequence,
            request,
            behavior,
            key,
            outcome: outcome.code(),
            reserved: 0,
        };
        let replies = match &self.replies {
            Some(replies) => replies,
            None => self.replies.insert(self.bus.publisher(topics::RETUNED)?),
        };
        let len = text.len().min(super::MAX_FAILURE_TEXT_BYTES);
        replies.publish(&header, &text.as_bytes()[..len])
    }
}

fn parse(text: &str) -> Result<toml::Table, ParameterError> {
    toml::from_str(text).map_err(|error| ParameterError::new("", error.message()))
}
