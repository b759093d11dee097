//! Frames in a stream of bytes that may be cut anywhere, damaged, or no frames at all.

use std::marker::PhantomData;

/// Frame of a protocol.
pub trait Frame: Sized {
    /// Maximum length of a frame, bytes. A parser buffers no more than that.
    const MAX_LEN: usize;

    /// Looks for a frame at the beginning of `bytes`, which are not empty.
    fn at_start(bytes: &[u8]) -> Found<Self>;
}

/// Result of a look for a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Found<F> {
    /// A valid frame, and its length in bytes.
    Frame(F, usize),
    /// The beginning of a frame whose rest is missing.
    Incomplete,
    /// No frame begins here.
    Nothing,
}

/// Parser of a stream of frames.
///
/// After damage it skips one byte at a time, so that the first whole frame behind is found. A damaged beginning can hold it
/// back until [`Frame::MAX_LEN`] bytes arrived, not longer.
#[derive(Clone, Debug)]
pub struct Framer<F> {
    buffer: Vec<u8>,
    frames: u64,
    skipped: u64,
    kind: PhantomData<fn() -> F>,
}

impl<F: Frame> Default for Framer<F> {
    fn default() -> Self {
        let buffer = Vec::with_capacity(F::MAX_LEN);
        Framer { buffer, frames: 0, skipped: 0, kind: PhantomData }
    }
}

impl<F: Frame> Framer<F> {
    /// Takes in bytes, and calls `each` with every frame that they complete.
    pub fn push(&mut self, bytes: &[u8], mut each: impl FnMut(F)) {
        // In pieces, so that the buffer is bounded.
        for piece in bytes.chunks(F::MAX_LEN) {
            self.buffer.extend_from_slice(piece);
            let taken = self.take(&mut each);
            self.buffer.drain(..taken);
        }
    }

    /// Forgets an incomplete frame.
    pub fn clear(&mut self) {
        self.buffer.clear();
    }

    /// Number of frames so far.
    #[must_use]
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Number of bytes so far that belong to no frame.
    #[must_use]
    pub fn skipped(&self) -> u64 {
        self.skipped
    }

    /// Returns the number of bytes that are done with.
    fn take(&mut self, each: &mut impl FnMut(F)) -> usize {
        let mut at = 0;
        while at < self.buffer.len() {
            match F::at_start(&self.buffer[at..]) {
                Found::Frame(frame, len) => {
                    self.frames += 1;
                    at += len;
                    each(frame);
                }
                Found::Incomplete if self.buffer.len() - at < F::MAX_LEN => break,
                Found::Incomplete | Found::Nothing => {
                    self.skipped += 1;
                    at += 1;
                }
            }
        }
        at.min(self.buffer.len())
    }
}
