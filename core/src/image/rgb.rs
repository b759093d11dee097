//! A borrowed colour picture.

use super::{ImageError, check_layout};
use crate::behavior::View;
use crate::message::{Encoding, FrameHeader};

/// A borrowed picture of at least one pixel, three bytes a pixel: red, green, blue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RgbView<'a> {
    data: &'a [u8],
    width: usize,
    height: usize,
    stride: usize,
}

impl<'a> RgbView<'a> {
    /// The picture of `width` x `height` pixels whose rows start `stride` bytes apart in `data`.
    ///
    /// # Errors
    /// [`ImageError`] names which of the numbers does not fit.
    pub fn new(data: &'a [u8], width: usize, height: usize, stride: usize) -> Result<Self, ImageError> {
        check_layout(data.len(), width, height, stride, 3)?;
        Ok(Self { data, width, height, stride })
    }

    /// The colours of a frame; `None` where it is no colour frame of this size, or its bytes do not fit.
    #[must_use]
    pub fn of_frame(frame: &View<'a, FrameHeader>, width: u32, height: u32) -> Option<Self> {
        let header = frame.header;
        if (header.width, header.height) != (width, height) || header.encoding()? != Encoding::Rgb8 {
            return None;
        }
        Self::new(frame.items, width as usize, height as usize, header.stride as usize).ok()
    }

    /// Columns, at least 1.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows, at least 1.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// Row `v`, exactly `width` pixels; a row beyond the picture is the nearest one (replicated border).
    #[inline]
    #[must_use]
    pub fn row(&self, v: usize) -> &'a [[u8; 3]] {
        let start = v.min(self.height - 1) * self.stride;
        self.data[start..start + 3 * self.width].as_chunks::<3>().0
    }

    /// The pixel in column `u` and row `v`; outside, the nearest one (replicated border).
    #[must_use]
    pub fn pixel(&self, u: usize, v: usize) -> [u8; 3] {
        self.row(v)[u.min(self.width - 1)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_skip_the_gap_and_frames_must_be_in_colour() {
        let data: Vec<u8> = (0..14).collect();
        let view = RgbView::new(&data, 2, 2, 8).unwrap();
        assert_eq!((view.row(1), view.pixel(9, 9)), (&[[8, 9, 10], [11, 12, 13]][..], [11, 12, 13]));
        assert!(RgbView::new(&data, 2, 2, 5).is_err() && RgbView::new(&data[1..], 2, 2, 8).is_err());
        let good = FrameHeader {
            width: 2,
            height: 2,
            stride: 8,
            encoding: Encoding::Rgb8.code(),
            ..Default::default()
        };
        let frame = |header: &FrameHeader| {
            RgbView::of_frame(&View::<FrameHeader> { header, items: &data[..] }, 2, 2).is_some()
        };
        assert!(frame(&good));
        assert!(!frame(&FrameHeader { encoding: Encoding::Gray8.code(), ..good }));
        assert!(!frame(&FrameHeader { height: 3, ..good }) && !frame(&FrameHeader { stride: 9, ..good }));
    }
}
