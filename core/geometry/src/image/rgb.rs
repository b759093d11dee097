//! Borrowed color images.

use super::{ImageError, check_layout};

/// A borrowed RGB image of at least one pixel, three bytes per pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RgbView<'a> {
    data: &'a [u8],
    width: usize,
    height: usize,
    stride: usize,
}

impl<'a> RgbView<'a> {
    /// Creates a view of `width` x `height` pixels whose rows begin `stride` bytes apart in `data`.
    ///
    /// # Errors
    /// [`ImageError`] if a size is zero or does not match the buffer.
    pub fn new(data: &'a [u8], width: usize, height: usize, stride: usize) -> Result<Self, ImageError> {
        check_layout(data.len(), width, height, stride, 3)?;
        Ok(Self { data, width, height, stride })
    }

    /// Image width, pixels, at least 1.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Image height, pixels, at least 1.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// Returns row `v`; a row below the image is the last one (replicated border).
    #[inline]
    #[must_use]
    pub fn row(&self, v: usize) -> &'a [[u8; 3]] {
        let start = v.min(self.height - 1) * self.stride;
        self.data[start..start + 3 * self.width].as_chunks::<3>().0
    }

    /// Returns the pixel in column `u` and row `v`; outside of the image, the nearest one (replicated border).
    #[must_use]
    pub fn pixel(&self, u: usize, v: usize) -> [u8; 3] {
        self.row(v)[u.min(self.width - 1)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_skip_the_gap() {
        let data: Vec<u8> = (0..14).collect();
        let view = RgbView::new(&data, 2, 2, 8).unwrap();
        assert_eq!((view.row(1), view.pixel(9, 9)), (&[[8, 9, 10], [11, 12, 13]][..], [11, 12, 13]));
        assert!(RgbView::new(&data, 2, 2, 5).is_err() && RgbView::new(&data[1..], 2, 2, 8).is_err());
    }
}
