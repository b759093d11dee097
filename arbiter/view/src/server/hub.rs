//! The newest state of the robot, shared by all clients.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde::Serialize;
use serde_json::{Value, json};
use tokio::sync::watch;

use crate::model::{Event, MAX_EVENTS, Model, Overlays, Picture, Pictures, Sample, Setup, Snapshot};

/// Maximum number of samples that are kept: two minutes at 20 Hz, and some more.
const MAX_SAMPLES: usize = 2500;

/// State of the source: the robot, or the playback of a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "source")]
pub(crate) enum SourceState {
    /// A robot.
    Robot {
        /// Set while it runs.
        is_running: bool,
    },
    /// A recording.
    Recording {
        /// Position, s.
        position_s: f64,
        /// Pace, times real time.
        pace: f64,
        /// Set while it plays.
        is_playing: bool,
    },
}

/// State of the robot at one instant, as JSON.
#[derive(Clone, Debug, Default)]
pub(crate) struct Update {
    pub state: String,
}

/// The newest state, the strips and the log.
pub(crate) struct Hub {
    title: Title,
    updates: watch::Sender<Arc<Update>>,
    shared: Mutex<Shared>,
}

#[derive(Default)]
struct Shared {
    pictures: Pictures,
    overlays: Overlays,
    setup: Arc<str>,
    setup_version: u64,
    epoch: u64,
    names: Vec<String>,
    samples: VecDeque<(f64, Sample)>,
    samples_before: u64,
    events: VecDeque<Value>,
    events_before: u64,
}

/// Title of the page: a robot, or a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Title {
    /// Name of the robot, or of the file.
    pub title: String,
    /// Duration of a recording, s.
    pub duration_s: Option<f64>,
}

/// Position of one client: everything before it was sent.
#[derive(Default)]
pub(crate) struct Cursor {
    setup_version: u64,
    epoch: u64,
    samples: u64,
    events: u64,
}

impl Hub {
    pub fn new(title: Title) -> Hub {
        Hub { title, updates: watch::Sender::new(Arc::default()), shared: Mutex::default() }
    }

    /// Follows the updates.
    pub fn subscribe(&self) -> watch::Receiver<Arc<Update>> {
        self.updates.subscribe()
    }

    /// Returns true if a client follows the updates.
    pub fn is_watched(&self) -> bool {
        self.updates.receiver_count() > 0
    }

    /// Picture of the camera `topic` with this stamp, or its newest one.
    pub fn picture(&self, topic: &str, stamp_ns: Option<u64>) -> Option<Picture> {
        self.lock().pictures.get(topic, stamp_ns).cloned()
    }

    /// Overlays over the picture of the camera `topic` with this stamp.
    pub fn overlays(&self, topic: &str, stamp_ns: u64) -> Vec<Value> {
        self.lock().overlays.over(topic, stamp_ns)
    }

    /// Publishes the state of `model`. Strips and log begin anew when `epoch` changes; `events` are those of a recording, which
    /// are known from the start.
    pub fn publish(&self, model: &Model, epoch: u64, source: &SourceState, events: Option<&[Event]>) {
        let mut shared = self.lock();
        if shared.epoch != epoch {
            *shared = Shared { epoch, ..Shared::default() };
            let all = events.unwrap_or_default().iter().map(|event| event_json(model, event));
            shared.events.extend(all);
        }
        shared.pictures = model.pictures().clone();
        shared.overlays = model.overlays().clone();
        let version = model.setup_version() + 1;
        if shared.setup_version != version {
            shared.setup = setup_json(&model.setup().0, &self.title).into();
            shared.setup_version = version;
        }
        let strips = model.strips();
        if shared.names.len() != strips.names().len() {
            shared.names = strips.names().map(str::to_owned).collect();
        }
        let missing = strips.count().saturating_sub(shared.samples_before + shared.samples.len() as u64);
        let kept = strips.samples().rev().take(missing as usize).count();
        let skipped = missing - kept as u64;
        if skipped > 0 {
            shared.samples_before += skipped + shared.samples.len() as u64;
            shared.samples.clear();
        }
        let new: Vec<_> = strips.samples().rev().take(kept).collect();
        for sample in new.into_iter().rev() {
            if shared.samples.len() == MAX_SAMPLES {
                shared.samples.pop_front();
                shared.samples_before += 1;
            }
            shared.samples.push_back((model.seconds(sample.at), *sample));
        }
        if events.is_none() {
            shared.add_events(model);
        }
        drop(shared);
        if self.is_watched() {
            let state = state_json(&model.snapshot(), source);
            self.updates.send_replace(Arc::new(Update { state }));
        }
    }

    /// Message for a client: the state, and everything that it has not received yet.
    pub fn message(&self, update: &Update, cursor: &mut Cursor) -> String {
        let shared = self.lock();
        let is_new = cursor.epoch != shared.epoch;
        if is_new {
            *cursor = Cursor { epoch: shared.epoch, ..Cursor::default() };
        }
        let skip = |sent: u64, before: u64| sent.saturating_sub(before) as usize;
        let samples = shared.samples.iter().skip(skip(cursor.samples, shared.samples_before));
        let samples: Vec<Value> = samples.map(|(at_s, sample)| sample_json(*at_s, sample)).collect();
        let events: Vec<&Value> =
            shared.events.iter().skip(skip(cursor.events, shared.events_before)).collect();
        let mut message = json!({ "samples": samples, "events": events, "names": shared.names });
        message["is_new"] = is_new.into();
        cursor.samples = shared.samples_before + shared.samples.len() as u64;
        cursor.events = shared.events_before + shared.events.len() as u64;
        let setup = (cursor.setup_version != shared.setup_version).then(|| Arc::clone(&shared.setup));
        cursor.setup_version = shared.setup_version;
        drop(shared);
        let mut text = message.to_string();
        text.pop();
        if let Some(setup) = setup {
            text += ",\"setup\":";
            text += &setup;
        }
        text + ",\"state\":" + &update.state + "}"
    }

    fn lock(&self) -> MutexGuard<'_, Shared> {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Shared {
    fn add_events(&mut self, model: &Model) {
        let log = model.events();
        let missing = log.count().saturating_sub(self.events_before + self.events.len() as u64);
        let missing = missing.min(MAX_EVENTS as u64) as usize;
        let new: Vec<_> = log.events().rev().take(missing).collect();
        for event in new.into_iter().rev() {
            if self.events.len() == MAX_EVENTS {
                self.events.pop_front();
                self.events_before += 1;
            }
            self.events.push_back(event_json(model, event));
        }
    }
}

fn setup_json(setup: &Setup, title: &Title) -> String {
    let mut setup = serde_json::to_value(setup).unwrap_or_default();
    setup["title"] = title.title.as_str().into();
    setup["duration_s"] = title.duration_s.into();
    setup.to_string()
}

fn state_json(snapshot: &Snapshot, source: &SourceState) -> String {
    let mut state = serde_json::to_value(snapshot).unwrap_or_default();
    state["source"] = serde_json::to_value(source).unwrap_or_default();
    state.to_string()
}

fn event_json(model: &Model, event: &Event) -> Value {
    json!({ "at_s": model.seconds(event.at), "kind": event.kind, "who": event.who, "text": event.text })
}

/// A sample as a short list: time, owners, stopped axes as a bit mask, speeds, estimated and true position.
fn sample_json(at_s: f64, sample: &Sample) -> Value {
    let stopped = sample.halted.iter().rev().fold(0, |bits, halted| 2 * bits + u32::from(*halted));
    let rounded = |number: &f32| (f64::from(*number) * 1e3).round() / 1e3;
    let list = |numbers: &[f32]| numbers.iter().map(rounded).collect::<Vec<_>>();
    json!([
        (at_s * 1e3).round() / 1e3,
        sample.owner,
        stopped,
        list(&sample.linear),
        list(&sample.angular),
        sample.pose.map(|pose| list(&pose)),
        sample.truth.map(|truth| list(&truth)),
    ])
}
