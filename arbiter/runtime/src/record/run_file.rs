//! File of a recording as its writer sees it: the facts of the run first, and nothing unsaved for longer than a second.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant, SystemTime};

use foxglove::McapWriterHandle;
use yamabico_core::time::Time;

use super::contents::RUN;
use super::file::OutputFile;
use super::identity::digest_of_program;
use super::utc::utc;

/// Longest time for which messages are only in memory: what a killed run loses.
const MAX_UNSAVED: Duration = Duration::from_millis(500);

/// Handle to the file of a recording.
pub(super) type Handle = Arc<McapWriterHandle<OutputFile>>;

/// File of a recording, on the thread of its writer.
pub(super) struct RunFile {
    handle: Handle,
    facts: BTreeMap<String, String>,
    started: Arc<OnceLock<SystemTime>>,
    saved: Instant,
}

impl RunFile {
    /// File of a run with these facts; `started` is set at the run's first message.
    pub fn new(
        handle: Handle,
        facts: BTreeMap<String, String>,
        started: Arc<OnceLock<SystemTime>>,
    ) -> RunFile {
        RunFile { handle, facts, started, saved: Instant::now() }
    }

    /// Writes the facts of the run. `origin` is the stamp at time zero of the recording.
    pub fn begin(&mut self, origin: Time) {
        let mut facts = std::mem::take(&mut self.facts);
        let started = self.started.get().copied().unwrap_or_else(SystemTime::now);
        let more = [
            ("program_sha256", digest_of_program().to_owned()),
            ("started", utc(started)),
            ("origin_ns", origin.0.to_string()),
        ];
        for (key, value) in more {
            // A copy of a recording keeps the facts of its run.
            facts.entry(key.to_owned()).or_insert(value);
        }
        if let Err(error) = self.handle.write_metadata(RUN, facts) {
            tracing::error!("the recording has no facts of its run: {error}");
        }
    }

    /// Passes what has been written to the operating system if it has been in memory for too long.
    pub fn save_if_due(&mut self) {
        if self.saved.elapsed() >= MAX_UNSAVED {
            // A failure is that of the output file, which reports it.
            let _ = self.handle.flush();
            self.saved = Instant::now();
        }
    }
}
