//! Changes a behavior's parameters between two of its calls, in two steps, so that several behaviors change together or
//! not at all.

use super::behavior::BehaviorSeat;
use super::rebuild::Candidate;
use super::topics;
use crate::bus::{Bus, BusError, Publisher, Subscriber};
use yamabico_core::behavior::BuildError;
use yamabico_core::message::{Name, Note, RetuneHeader, RetuneStep, RetunedHeader, Retuning};
use yamabico_core::time::Time;

/// Longest table of parameters, bytes of TOML.
pub const MAX_PARAMETERS: usize = 16 * 1024;

/// Hears what parameters a behavior is to get, and answers.
pub(super) struct Tuner {
    requests: Subscriber<RetuneHeader>,
    answers: Option<Publisher<RetunedHeader>>,
    candidate: Option<(u64, Candidate)>,
    answered: u64,
    bus: Bus,
}

impl Tuner {
    /// That of the behavior on `seat`; `None` where its channels do not open, which is told.
    pub fn open(seat: &BehaviorSeat, bus: &Bus) -> Option<Tuner> {
        match bus.subscriber(topics::RETUNE) {
            Ok(requests) => {
                Some(Tuner { requests, answers: None, candidate: None, answered: 0, bus: bus.clone() })
            }
            Err(error) => {
                tracing::warn!("parameters of `{}` cannot be changed while it runs: {error}", seat.name());
                None
            }
        }
    }

    /// Does what was asked of the behavior on `seat` since the last call; a bus that fails is told of.
    pub fn step(&mut self, seat: &mut BehaviorSeat) {
        if let Err(error) = self.try_to_step(seat) {
            tracing::error!("parameters of `{}`: {error}", seat.name());
        }
    }

    fn try_to_step(&mut self, seat: &mut BehaviorSeat) -> Result<(), BusError> {
        loop {
            let Some(request) = self.requests.receive()? else { return Ok(()) };
            let header = *request.header();
            let text = String::from_utf8_lossy(request.items()).into_owned();
            drop(request);
            if header.behavior.as_str() != seat.name() {
                continue;
            }
            let answer = match header.step() {
                Some(RetuneStep::Prepare) => self.prepare(seat, header.request, &text),
                Some(RetuneStep::Apply) => self.apply(seat, header.request, &text),
                Some(RetuneStep::Drop) | None => {
                    self.candidate = None;
                    continue;
                }
            };
            self.tell(header.behavior, header.request, answer)?;
        }
    }

    fn prepare(&mut self, seat: &BehaviorSeat, request: u64, text: &str) -> Result<Retuning, BuildError> {
        self.candidate = None;
        self.candidate = Some((request, seat.build(read(text)?)?));
        Ok(Retuning::Ready)
    }

    fn apply(&mut self, seat: &mut BehaviorSeat, request: u64, text: &str) -> Result<Retuning, BuildError> {
        let prepared = self.candidate.take().filter(|(of, _)| *of == request);
        let candidate = match prepared {
            Some((_, candidate)) => candidate,
            None => {
                let table = read(text)?;
                if seat.has(&table) {
                    return Ok(Retuning::Applied);
                }
                seat.build(table)?
            }
        };
        if let Err(error) = seat.replace(candidate, &self.bus) {
            tracing::error!("behavior `{}` is not told again what is kept: {error}", seat.name());
        }
        Ok(Retuning::Applied)
    }

    fn tell(
        &mut self,
        behavior: Name,
        request: u64,
        answer: Result<Retuning, BuildError>,
    ) -> Result<(), BusError> {
        let (outcome, key, words) = match answer {
            Ok(outcome) => (outcome, Note::default(), String::new()),
            Err(refusal) => (Retuning::Refused, Note::new(&refusal.key), refusal.problem),
        };
        self.answered += 1;
        let header = RetunedHeader {
            stamp_ns: Time::monotonic_now().0,
            sequence: self.answered,
            request,
            behavior,
            key,
            outcome: outcome.code(),
            reserved: 0,
        };
        let answers = match &self.answers {
            Some(answers) => answers,
            None => self.answers.insert(self.bus.publisher(topics::RETUNED)?),
        };
        let most = words.len().min(super::MAX_WORDS);
        answers.publish(&header, &words.as_bytes()[..most])
    }
}

fn read(text: &str) -> Result<toml::Table, BuildError> {
    toml::from_str(text).map_err(|error| BuildError::new("", error.message()))
}
