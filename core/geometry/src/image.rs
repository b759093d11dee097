//! 8-bit gray images, borrowed ([`ImageView`]) or owned ([`GrayImage`]), and borrowed color images ([`RgbView`]).
//!
//! Pixel centers lie on integer coordinates; u counts columns to the right, v rows downward.

mod rgb;

pub use rgb::RgbView;

use thiserror::Error;

/// Reason why a buffer is not a valid image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum ImageError {
    /// The image has no pixels.
    #[error("an image of {width} x {height} pixels is empty")]
    Empty {
        /// Image width, pixels.
        width: usize,
        /// Image height, pixels.
        height: usize,
    },
    /// Rows overlap.
    #[error("the stride is {stride} bytes, but a row has {needed} bytes")]
    StrideTooSmall {
        /// Distance between the beginnings of two rows, bytes.
        stride: usize,
        /// Size of one row, bytes.
        needed: usize,
    },
    /// The buffer is shorter than the image.
    #[error("the image needs {needed} bytes, but the buffer has {available}")]
    TooShort {
        /// Size from the first pixel to the last, bytes.
        needed: usize,
        /// Size of the buffer, bytes.
        available: usize,
    },
    /// The image exceeds the address space.
    #[error("an image of {height} rows of {stride} bytes exceeds the address space")]
    TooLarge {
        /// Image height, pixels.
        height: usize,
        /// Distance between the beginnings of two rows, bytes.
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
    /// Creates a view of `width` x `height` pixels whose rows begin `stride` bytes apart in `data`.
    ///
    /// # Errors
    /// [`ImageError`] if a size is zero or does not match the buffer.
    pub fn new(data: &'a [u8], width: usize, height: usize, stride: usize) -> Result<Self, ImageError> {
        check_layout(data.len(), width, height, stride, 1)?;
        Ok(Self { data, width, height, stride })
    }

    /// Image width, pixels, at least 1.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Image height, pixels, at least 1.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Distance between the beginnings of two rows, bytes, at least the width.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// Returns row `v`; a row below the image is the last one (replicated border).
    #[inline]
    pub fn row(&self, v: usize) -> &'a [u8] {
        let start = v.min(self.height - 1) * self.stride;
        &self.data[start..start + self.width]
    }

    /// Returns the pixel in column `u` and row `v`; outside of the image, the nearest one (replicated border).
    pub fn pixel(&self, u: usize, v: usize) -> u8 {
        self.row(v)[u.min(self.width - 1)]
    }
}

/// An owned 8-bit gray image without padding between its rows. Refilling it allocates only if it must grow.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct GrayImage {
    data: Vec<u8>,
    width: usize,
    height: usize,
}

impl GrayImage {
    /// Creates a black image; 0 x 0 is allowed.
    pub fn new(width: usize, height: usize) -> Self {
        Self { data: vec![0; width * height], width, height }
    }

    /// Resizes the image. Its pixels are unspecified until they are written.
    pub fn resize(&mut self, width: usize, height: usize) {
        self.data.resize(width * height, 0);
        self.width = width;
        self.height = height;
    }

    /// Image width, pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Image height, pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Returns a view of the image.
    ///
    /// # Errors
    /// [`ImageError::Empty`] if it has no pixels.
    pub fn view(&self) -> Result<ImageView<'_>, ImageError> {
        ImageView::new(&self.data, self.width, self.height, self.width)
    }

    /// Pixels, row by row.
    pub fn pixels(&self) -> &[u8] {
        &self.data
    }

    /// Mutable pixels, row by row.
    pub fn pixels_mut(&mut self) -> &mut [u8] {
        &mut self.data
    }

    /// Copies size and pixels of `view`.
    pub fn copy_from(&mut self, view: ImageView) {
        self.resize(view.width(), view.height());
        for (v, row) in self.data.chunks_exact_mut(view.width()).enumerate() {
            row.copy_from_slice(view.row(v));
        }
    }

    /// Converts an RGB image, whose rows begin `stride` bytes apart, to luma (ITU-R BT.601: 0.299 R + 0.587 G + 0.114
    /// B, rounded).
    ///
    /// # Errors
    /// [`ImageError`] if a size is zero or does not match the buffer; the image is then unchanged.
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

/// Returns the luma of ITU-R BT.601, as in JPEG: 0.299 R + 0.587 G + 0.114 B in units of 1/65536, rounded.
#[must_use]
pub fn jpeg_luma(red: u8, green: u8, blue: u8) -> u8 {
    let sum = 19_595 * u32::from(red) + 38_470 * u32::from(green) + 7_471 * u32::from(blue);
    ((sum + 32_768) >> 16) as u8
}

/// Returns the luma of ITU-R BT.601, in integer arithmetic of 1/256; white gives 255.
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
