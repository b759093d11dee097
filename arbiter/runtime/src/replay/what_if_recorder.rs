//! Recording of a what-if: the recorded messages, and beside them the replayed ones.

use std::collections::BTreeSet;
use std::path::Path;

use yamabico_core::message::MessageType;
use yamabico_core::time::Time;

use super::recorded_task::{RecordedTask, ReplayError};
use super::steps::RecordedMessage;
use crate::execution::topics;
use crate::record::{McapRecorder, Pace, Recording, Tap, WHAT_IF};

/// Writes both sides of a what-if to one file, so that one plot shows both.
pub(super) struct WhatIfRecorder {
    recorder: McapRecorder,
    /// Topics that the replay computes.
    computed: BTreeSet<String>,
}

impl WhatIfRecorder {
    /// Begins the recording `file` of a what-if on the recording `of`.
    ///
    /// # Errors
    /// The file exists or cannot be written.
    pub fn create(
        file: &Path,
        of: &Path,
        recorded: &RecordedTask,
        computed: BTreeSet<String>,
    ) -> Result<WhatIfRecorder, ReplayError> {
        let sensors = recorded.task.robot.sensors.iter();
        let sensors = sensors.map(|sensor| (topics::sensor(&sensor.part.name), sensor.info.clone()));
        let mut facts = recorded.facts.clone();
        let note = format!(
            "{WHAT_IF} holds what {} would have led to with the changes {:?}; open loop: the world did not react",
            of.display(),
            recorded.overrides.set
        );
        facts.insert("what_if".to_owned(), note);
        let recording = Recording {
            robot: recorded.task.robot.robot.clone(),
            sensors: sensors.collect(),
            files: recorded.files.clone(),
            facts,
            ..Recording::new(file, Pace::Lockstep)
        };
        Ok(WhatIfRecorder { recorder: McapRecorder::create(recording)?, computed })
    }

    /// Writes a recorded message.
    pub fn recorded(&mut self, time: Time, message: &RecordedMessage) {
        self.recorder.message(&message.topic, &message.message, time, &message.header, &message.items);
    }

    /// Closes the file; returns the cause why it is incomplete, if it is.
    pub fn finish(self) -> Option<String> {
        self.recorder
            .finish([("end".to_owned(), "what-if".to_owned())].into())
            .error
            .map(|error| error.to_string())
    }
}

impl Tap for WhatIfRecorder {
    fn message(&mut self, topic: &str, message: &MessageType, time: Time, header: &[u8], items: &[u8]) {
        if self.computed.contains(topic) {
            self.recorder.message(&format!("{WHAT_IF}{topic}"), message, time, header, items);
        }
    }
}
