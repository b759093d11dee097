//! Playback of a recording at any pace, from any time.

use std::collections::VecDeque;
use std::time::Duration;

use yamabico_core::time::Time;

use super::chunks::Entry;
use super::{Recording, RecordingError, show};
use crate::model::{Event, Model};

/// Maximum pace, times real time.
pub const MAX_PACE: f64 = 32.0;
/// Time of the recording that one step plays at most; what a slow machine cannot show in time is skipped.
const MAX_STEP_S: f64 = 4.0;

/// Plays a recording.
pub struct Player {
    recording: Recording,
    model: Model,
    position: Time,
    waiting: VecDeque<Entry<'static>>,
    next_chunk: usize,
    pace: f64,
    is_playing: bool,
    seeks: u64,
}

impl Player {
    /// Begins at the first decision, paused.
    ///
    /// # Errors
    /// The file cannot be read any more.
    pub fn new(recording: Recording) -> Result<Player, RecordingError> {
        let begin = recording.first_decision.min(recording.end);
        let mut player = Player {
            recording,
            model: Model::default(),
            position: begin,
            waiting: VecDeque::new(),
            next_chunk: 0,
            pace: 1.0,
            is_playing: false,
            seeks: 0,
        };
        player.seek_to(begin)?;
        Ok(player)
    }

    /// The recording.
    pub fn recording(&self) -> &Recording {
        &self.recording
    }

    /// State at the position.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Position, s after the first message.
    pub fn position_s(&self) -> f64 {
        self.position.seconds_after(self.recording.begin)
    }

    /// Pace, times real time.
    pub fn pace(&self) -> f64 {
        self.pace
    }

    /// Returns true while it plays.
    pub fn is_playing(&self) -> bool {
        self.is_playing
    }

    /// Number of jumps so far: after each, the strips begin anew.
    pub fn seeks(&self) -> u64 {
        self.seeks
    }

    /// Plays at `pace` times real time, 0.05 to 32; from the start if it is at the end.
    ///
    /// # Errors
    /// The file cannot be read any more.
    pub fn play(&mut self, pace: f64) -> Result<(), RecordingError> {
        self.pace = if pace.is_finite() { pace.clamp(0.05, MAX_PACE) } else { 1.0 };
        self.is_playing = true;
        if self.position >= self.recording.end {
            self.seek_to(self.recording.first_decision)?;
        }
        Ok(())
    }

    /// Pauses.
    pub fn pause(&mut self) {
        self.is_playing = false;
    }

    /// Jumps to `at_s` seconds after the first message.
    ///
    /// # Errors
    /// The file cannot be read any more.
    pub fn seek(&mut self, at_s: f64) -> Result<(), RecordingError> {
        self.seek_to(self.recording.time(at_s))
    }

    /// Jumps to the next event of which `is_wanted` returns true, or the last one before the position; returns it, or `None` if
    /// there is none.
    ///
    /// # Errors
    /// The file cannot be read any more.
    pub fn jump(
        &mut self,
        forward: bool,
        is_wanted: &dyn Fn(&Event) -> bool,
    ) -> Result<Option<Event>, RecordingError> {
        let position = self.position;
        let mut events = self.recording.events().filter(|event| is_wanted(event));
        let found = match forward {
            true => events.find(|event| event.at > position),
            false => events.rfind(|event| event.at < position),
        };
        let found = found.cloned();
        drop(events);
        let Some(event) = found else { return Ok(None) };
        self.seek_to(event.at)?;
        Ok(Some(event))
    }

    /// Advances by `elapsed` of real time.
    ///
    /// # Errors
    /// The file cannot be read any more.
    pub fn step(&mut self, elapsed: Duration) -> Result<(), RecordingError> {
        if !self.is_playing {
            return Ok(());
        }
        let step_s = (elapsed.as_secs_f64() * self.pace).min(MAX_STEP_S);
        self.position = (self.position + Duration::from_secs_f64(step_s)).min(self.recording.end);
        loop {
            while let Some(entry) = self.waiting.front()
                && entry.time <= self.position
            {
                show(&mut self.model, entry);
                self.waiting.pop_front();
            }
            if !self.waiting.is_empty() || self.next_chunk >= self.recording.chunks.chunks.len() {
                break;
            }
            self.read_chunk(Time::ZERO)?;
        }
        self.model.set_time(self.position);
        self.is_playing = self.position < self.recording.end;
        Ok(())
    }

    fn seek_to(&mut self, at: Time) -> Result<(), RecordingError> {
        self.model = self.recording.state(at)?;
        self.position = at;
        self.seeks += 1;
        self.waiting.clear();
        self.next_chunk = self.recording.chunks.chunks.partition_point(|chunk| chunk.end < at);
        self.read_chunk(at)
    }

    /// Reads the next chunk; entries up to `after` are left out.
    fn read_chunk(&mut self, after: Time) -> Result<(), RecordingError> {
        let waiting = &mut self.waiting;
        self.recording.chunks.read(self.next_chunk, &mut |entry| {
            if entry.time > after {
                waiting.push_back(entry.into_owned());
            }
        })?;
        self.next_chunk += 1;
        Ok(())
    }
}
