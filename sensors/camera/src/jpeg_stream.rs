//! Images out of a stream of bytes.

use std::collections::VecDeque;
use std::io::{self, Read};

use yamabico_core::time::Time;

use crate::grabber::{Image, Stream};
use crate::jpeg_cutter::{Cut, JpegCutter};
use crate::pixels::Pixels;

/// Number of bytes read at once.
const READ_SIZE: usize = 64 * 1024;
/// Maximum size of an image, bytes.
const MAX_IMAGE: usize = 8 << 20;

/// JPEG images, one after the other, out of a stream of bytes.
pub(crate) struct JpegStream<R> {
    bytes: Vec<u8>,
    reader: R,
    cutter: JpegCutter,
    /// Arrival of the first byte of the image that is being read.
    arrival: Time,
    count: u64,
    waiting: VecDeque<Image>,
}

impl<R: Read> JpegStream<R> {
    pub fn new(reader: R) -> JpegStream<R> {
        JpegStream {
            bytes: vec![0; READ_SIZE],
            reader,
            cutter: JpegCutter::new(MAX_IMAGE),
            arrival: Time::ZERO,
            count: 0,
            waiting: VecDeque::new(),
        }
    }
}

impl<R: Read> Stream for JpegStream<R> {
    fn next(&mut self) -> io::Result<Image> {
        loop {
            if let Some(image) = self.waiting.pop_front() {
                return Ok(image);
            }
            let read = match self.reader.read(&mut self.bytes) {
                Ok(0) => return Err(io::Error::new(io::ErrorKind::UnexpectedEof, "the stream has ended")),
                Ok(read) => read,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                    return Err(io::Error::new(io::ErrorKind::TimedOut, "no image in time"));
                }
                Err(error) => return Err(error),
            };
            let now = Time::monotonic_now();
            let JpegStream { bytes, cutter, arrival, count, waiting, .. } = self;
            cutter.push(&bytes[..read], |cut| match cut {
                Cut::Begin => *arrival = now,
                Cut::Image(jpeg) => {
                    let (stamp, number) = (*arrival, *count);
                    *count += 1;
                    waiting.push_back(Image { stamp, number, pixels: Pixels::Jpeg, data: jpeg.to_vec() });
                }
            });
        }
    }
}
