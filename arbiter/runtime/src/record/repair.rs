//! Repair of recordings whose process was killed: everything readable again, with an index and an end.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Seek, Write};
use std::path::{Path, PathBuf};

use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, Compression, McapError, WriteOptions};
use serde::Serialize;

use yamabico_mcap::Channel;

use super::contents::{BROKE_OFF, RUN};
use super::playback::each_message;
use super::{Contents, PlaybackError, RecordError};

/// Result of a repair.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Repaired {
    /// Number of messages in the recording.
    pub messages: u64,
    /// Time from the first message to the last, s.
    pub seconds: f64,
    /// Cause why the recording ended early; `None` if it was whole and nothing was changed.
    pub broken_off: Option<String>,
    /// File as it was before.
    pub kept: Option<PathBuf>,
}

/// Failure of a repair.
#[derive(Debug, thiserror::Error)]
pub enum RepairError {
    /// The file cannot be read, or is no recording.
    #[error(transparent)]
    Read(#[from] PlaybackError),
    /// The repaired file cannot be written.
    #[error(transparent)]
    Write(#[from] RecordError),
    /// The repaired file cannot be written, for a reason of its format.
    #[error("the repaired recording {} cannot be written: {reason}", path.display())]
    Format {
        /// File.
        path: PathBuf,
        /// Cause.
        reason: String,
    },
}

/// Gives a recording that breaks off an index and an end. The file as it was is kept beside it, with the extension `broken`. A
/// whole recording stays as it is.
///
/// # Errors
/// The file cannot be read, is no recording, or the folder is not writable.
pub fn repair(path: &Path) -> Result<Repaired, RepairError> {
    let mut repaired = Repaired { messages: 0, seconds: 0.0, broken_off: None, kept: None };
    let mut span: Option<(u64, u64)> = None;
    repaired.broken_off = each_message(
        path,
        |_| true,
        |message| {
            repaired.messages += 1;
            let (first, last) = span.unwrap_or((message.log_time, message.log_time));
            span = Some((first.min(message.log_time), last.max(message.log_time)));
            Ok::<(), RepairError>(())
        },
    )?;
    repaired.seconds = span.map_or(0.0, |(first, last)| (last - first) as f64 * 1e-9);
    let Some(cause) = &repaired.broken_off else { return Ok(repaired) };
    let (new, kept) = (beside(path, "repairing"), beside(path, "broken"));
    let opening = |error| RecordError::opening(&new, error);
    write(path, cause, &new).inspect_err(|_| drop(std::fs::remove_file(&new)))?;
    std::fs::rename(path, &kept).map_err(opening)?;
    std::fs::rename(&new, path).map_err(opening)?;
    repaired.kept = Some(kept);
    Ok(repaired)
}

/// Writes everything readable in `path`, which broke off for this `cause`, to `new`.
fn write(path: &Path, cause: &str, new: &Path) -> Result<(), RepairError> {
    let format = |error: McapError| RepairError::Format { path: new.to_owned(), reason: error.to_string() };
    let contents = Contents::read(path)?;
    let file = File::create(new).map_err(|error| RecordError::opening(new, error))?;
    let options = WriteOptions::new().compression(Some(Compression::Lz4)).profile("");
    let mut writer = options.create(BufWriter::new(file)).map_err(format)?;
    for (name, text) in &contents.files {
        let attachment = Attachment {
            log_time: 0,
            create_time: 0,
            name: name.clone(),
            media_type: "application/toml".to_owned(),
            data: text.as_bytes().into(),
        };
        writer.attach(&attachment).map_err(format)?;
    }
    let mut facts = contents.facts;
    facts.insert(BROKE_OFF.to_owned(), cause.to_owned());
    let metadata = Metadata { name: RUN.to_owned(), metadata: facts };
    writer.write_metadata(&metadata).map_err(format)?;
    let mut channels = BTreeMap::new();
    each_message(
        path,
        |_| true,
        |message| {
            let channel_id = match channels.get(&message.channel.id) {
                Some(id) => *id,
                None => {
                    let id = add(message.channel, &mut writer).map_err(format)?;
                    channels.insert(message.channel.id, id);
                    id
                }
            };
            let yamabico_mcap::Message { sequence, log_time, publish_time, data, .. } = *message;
            let header = MessageHeader { channel_id, sequence, log_time, publish_time };
            writer.write_to_known_channel(&header, data).map_err(format)
        },
    )?;
    writer.finish().map_err(format)?;
    Ok(())
}

/// Adds a channel to a file, and returns its number there.
fn add<W: Write + Seek>(channel: &Channel, writer: &mut mcap::Writer<W>) -> Result<u16, McapError> {
    let Channel { topic, encoding, schema, metadata, .. } = channel;
    let schema = match schema.as_deref() {
        Some(schema) => writer.add_schema(&schema.name, &schema.encoding, &schema.data)?,
        None => 0,
    };
    writer.add_channel(schema, topic, encoding, metadata)
}

/// File beside `path` with one more extension.
fn beside(path: &Path, extension: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".");
    name.push(extension);
    name.into()
}
