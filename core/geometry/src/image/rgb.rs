//! A borrowed color picture.

use super::{ImageError, check_layout};

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
    fn rows_skip_the_gap() {
        let data: Vec<u8> = (0..14).collect();
        let view = RgbView::new(&data, 2, 2, 8).unwrap();
        assert_eq!((view.row(1), view.pixel(9, 9)), (&[[8, 9, 10], [11, 12, 13]][..], [11, 12, 13]));
        assert!(RgbView::new(&data, 2, 2, 5).is_err() && RgbView::new(&data[1..], 2, 2, 8).is_err());
    }
}
