//! Messages of a file whose chunks a thread of its own unpacks ahead.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::mpsc::{Receiver, Sender, channel, sync_channel};
use std::thread::JoinHandle;

use crate::blocks::{Block, next_block};
use crate::definitions::Channel;
use crate::error::ReadError;
use crate::messages::{Message, Unpacked};
use crate::records::Records;

/// Blocks by which the thread is ahead.
const AHEAD: usize = 2;

/// Messages of the wanted channels of a file, in the order in which they were written. A thread of its own reads and unpacks the
/// chunks. Memory is bounded by a few of the longest chunks.
pub struct MessagesAhead<F> {
    is_wanted: F,
    /// Answers of `is_wanted` by the numbers of the channels.
    wanted: BTreeMap<u16, bool>,
    blocks: Option<Receiver<Result<Block, ReadError>>>,
    /// Blocks that have been read, whose memory is reused.
    read: Sender<Block>,
    unpacked: Unpacked,
    thread: Option<JoinHandle<()>>,
}

impl<F: Fn(&Channel) -> bool> MessagesAhead<F> {
    /// Opens the file, and begins to read it.
    ///
    /// # Errors
    /// It cannot be read, or is no MCAP file.
    pub fn open(path: &Path, is_wanted: F) -> Result<MessagesAhead<F>, ReadError> {
        let mut records = Records::open(path)?;
        let (sender, blocks) = sync_channel(AHEAD);
        let (read, reused) = channel::<Block>();
        let thread = std::thread::Builder::new().name("mcap".into()).spawn(move || {
            loop {
                let mut block = reused.try_recv().unwrap_or_default();
                let next = match next_block(&mut records, &mut block) {
                    Ok(true) => Ok(block),
                    Ok(false) => return,
                    Err(error) => Err(error),
                };
                let is_last = next.is_err();
                if sender.send(next).is_err() || is_last {
                    return;
                }
            }
        })?;
        Ok(MessagesAhead {
            is_wanted,
            wanted: BTreeMap::new(),
            blocks: Some(blocks),
            read,
            unpacked: Unpacked::default(),
            thread: Some(thread),
        })
    }

    /// Returns the next message of a wanted channel; `None` at the end of the file, and after an error.
    ///
    /// # Errors
    /// The file cannot be read, is damaged, or ends early: the messages so far are whole.
    #[allow(clippy::should_implement_trait, reason = "a message lives until the next one only")]
    pub fn next(&mut self) -> Result<Option<Message<'_>>, ReadError> {
        // An error ends it.
        let Some(blocks) = self.blocks.take() else { return Ok(None) };
        let body = loop {
            if let Some(body) = self.unpacked.next()? {
                let channel = self.unpacked.message(body.clone())?.channel;
                if *self.wanted.entry(channel.id).or_insert_with(|| (self.is_wanted)(channel)) {
                    break body;
                }
                continue;
            }
            match blocks.recv() {
                Ok(block) => {
                    let read = std::mem::replace(self.unpacked.renew(), block?);
                    // The thread may have ended.
                    drop(self.read.send(read));
                }
                Err(_) => {
                    if let Some(Err(panic)) = self.thread.take().map(JoinHandle::join) {
                        std::panic::resume_unwind(panic);
                    }
                    return Ok(None);
                }
            }
        };
        self.blocks = Some(blocks);
        self.unpacked.message(body).map(Some)
    }
}
