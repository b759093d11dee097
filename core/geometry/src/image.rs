//! 8-bit gray images: a borrowed view with checked dimensions and an owned buffer that is filled again without
//! allocating; and a borrowed view of color images.
//!
//! Pixel centers stand on integer coordinates; u counts columns to the right, v rows downwards.

mod rgb;

pub use rgb::RgbView;

use thiserror::Error;

/// Why some bytes are not an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum ImageError {
    /// An image needs at least one column and one row.
    #[error("an image of {width} x {height} pixels is empty")]
    Empty {
        /// Columns asked for.
        width: usize,
        /// Rows asked for.
        height: usize,
    },
    /// The distance between two rows is shorter than a row.
    #[error("rows are {stride} bytes apart, but one row needs {needed} bytes")]
    StrideTooSmall {
        /// Bytes from one row to the next.
        stride: usize,
        /// Bytes that one row holds.
        needed: usize,
    },
    /// The data end before the last row does.
    #[error("the image needs {needed} bytes, but {available} are there")]
    TooShort {
        /// Bytes from the first pixel to the last, inclusive.
        needed: usize,
        /// Bytes handed over.
        available: usize,
    },
    /// Width, height and stride together exceed the address space.
    #[error("an image of {height} rows, {stride} bytes apart, exceeds the address space")]
    TooLarge {
        /// Rows asked for.
        height: usize,
        /// Bytes from one row to the next.
        stride: usize,
    },
}

/// A borrowed 8-bit gray image of at least one pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageView<'a> {
    data: &'a [u8],
    width: usize,
    height: usize,
    stride: usize,
}

impl<'a> ImageView<'a> {
    /// The image of `width` x `height` pixels whose rows start `stride` bytes apart in `data`.
    ///
    /// # Errors
    /// [`ImageError`] names which of the numbers does not fit.
    pub fn new(data: &'a [u8], width: usize, height: usize, stride: usize) -> Result<Self, ImageError> {
        check_layout(data.len(), width, height, stride, 1)?;
        Ok(Self { data, width, height, stride })
    }

    /// Columns, at least 1.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows, at least 1.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Bytes from the start of one row to the start of the next, at least the width.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// Row `v`, exactly `width` pixels; a row beyond the image is the nearest one (replicated border).
    #[inline]
    pub fn row(&self, v: usize) -> &'a [u8] {
        let start = v.min(self.height - 1) * self.stride;
        &self.data[start..start + self.width]
    }

    /// The pixel in column `u` and row `v`; outside, the nearest one (replicated border).
    pub fn pixel(&self, u: usize, v: usize) -> u8 {
        self.row(v)[u.min(self.width - 1)]
    }
}

/// An owned 8-bit gray image without gaps between its rows. Filling it again allocates only when it must grow.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct GrayImage {
    data: Vec<u8>,
    width: usize,
    height: usize,
}

impl GrayImage {
    /// A black image; 0 x 0 is allowed and waits for [`GrayImage::resize`].
    pub fn new(width: usize, height: usize) -> Self {
        Self { data: vec![0; width * height], width, height }
    }

    /// Gives the buffer this size. The pixels are unspecified until they are written.
    pub fn resize(&mut self, width: usize, height: usize) {
        self.data.resize(width * height, 0);
        self.width = width;
        self.height = height;
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The image as a view.
    ///
    /// # Errors
    /// [`ImageError::Empty`] when it has no pixels.
    pub fn view(&self) -> Result<ImageView<'_>, ImageError> {
        ImageView::new(&self.data, self.width, self.height, self.width)
    }

    /// All pixels, row by row.
    pub fn pixels(&self) -> &[u8] {
        &self.data
    }

    /// All pixels, row by row, to be written.
    pub fn pixels_mut(&mut self) -> &mut [u8] {
        &mut self.data
    }

    /// Takes the size and the pixels of `view`.
    pub fn copy_from(&mut self, view: ImageView) {
        self.resize(view.width(), view.height());
        for (v, row) in self.data.chunks_exact_mut(view.width()).enumerate() {
            row.copy_from_slice(view.row(v));
        }
    }

    /// Takes the size and the luma (0.299 R + 0.587 G + 0.114 B, rounded) of an image with three bytes a pixel, whose
    /// rows start `stride` bytes apart.
    ///
    /// # Errors
    /// [`ImageError`] names which of the numbers does not fit; the buffer then keeps what it held.
    pub fn copy_from_rgb8(
        &mut self,
        rgb: &[u8],
        width: usize,
        height: usize,
        stride: usize,
    ) -> Result<(), ImageError> {
        check_layout(rgb.len(), width, height, stride, 3)?;
        self.resize(width, height);
        for (v, row) in self.data.chunks_exact_mut(width).enumerate() {
            let colors = rgb[v * stride..][..3 * width].as_chunks::<3>().0;
            for (gray, &[r, g, b]) in row.iter_mut().zip(colors) {
                *gray = luma(r, g, b);
            }
        }
        Ok(())
    }
}

/// Luma of ITU-R BT.601 in 1/256, rounded; 255 of each channel gives 255.
fn luma(r: u8, g: u8, b: u8) -> u8 {
    ((77 * u16::from(r) + 150 * u16::from(g) + 29 * u16::from(b) + 127) >> 8) as u8
}

fn check_layout(
    available: usize,
    width: usize,
    height: usize,
    stride: usize,
    bytes_per_pixel: usize,
) -> Result<(), ImageError> {
    if width == 0 || height == 0 {
        return Err(ImageError::Empty { width, height });
    }
    let too_large = ImageError::TooLarge { height, stride };
    let row = width.checked_mul(bytes_per_pixel).ok_or(too_large)?;
    if stride < row {
        return Err(ImageError::StrideTooSmall { stride, needed: row });
    }
    let needed = (height - 1).checked_mul(stride).and_then(|n| n.checked_add(row)).ok_or(too_large)?;
    if available < needed {
        return Err(ImageError::TooShort { needed, available });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_view_names_what_is_wrong() {
        let data = [0; 20];
        assert_eq!(ImageView::new(&data, 0, 5, 4), Err(ImageError::Empty { width: 0, height: 5 }));
        assert_eq!(ImageView::new(&data, 5, 2, 4), Err(ImageError::StrideTooSmall { stride: 4, needed: 5 }));
        assert_eq!(ImageView::new(&data, 5, 5, 5), Err(ImageError::TooShort { needed: 25, available: 20 }));
        let huge = usize::MAX / 2;
        assert_eq!(ImageView::new(&data, 5, 9, huge), Err(ImageError::TooLarge { height: 9, stride: huge }));
        assert!(ImageView::new(&data, 4, 4, 5).is_ok(), "the last row needs no gap behind it");
    }

    #[test]
    fn rows_skip_the_gap_and_replicate_the_border() {
        let data: Vec<u8> = (0..15).collect();
        let view = ImageView::new(&data, 4, 3, 5).unwrap();
        assert_eq!(view.row(1), &[5, 6, 7, 8]);
        assert_eq!(view.row(9), view.row(2));
        assert_eq!(view.pixel(9, 0), 3);
    }

    #[test]
    fn luma_keeps_gray_and_orders_colors() {
        for g in 0..=255 {
            assert_eq!(luma(g, g, g), g);
        }
        assert!(luma(0, 255, 0) > luma(255, 0, 0) && luma(255, 0, 0) > luma(0, 0, 255));
    }

    #[test]
    fn a_refused_rgb_image_leaves_the_buffer_alone() {
        let mut gray = GrayImage::new(2, 1);
        gray.pixels_mut().copy_from_slice(&[7, 9]);
        assert!(gray.copy_from_rgb8(&[0; 11], 2, 2, 6).is_err());
        assert_eq!(gray.pixels(), &[7, 9]);
        gray.copy_from_rgb8(&[255; 12], 2, 2, 6).unwrap();
        assert_eq!(gray.pixels(), &[255; 4]);
    }
}
