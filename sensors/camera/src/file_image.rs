//! Decoded image file, and its conversion to gray levels.

use std::path::Path;

use image::DynamicImage;
use yamabico_core::image::jpeg_luma;

use crate::files::{SequenceError, is_complete};

/// Decoded image, gray or color.
pub(crate) enum FileImage {
    Gray(image::GrayImage),
    Color(image::RgbImage),
}

impl FileImage {
    /// Reads and decodes a file.
    ///
    /// # Errors
    /// A file that is unreadable, not an image, truncated or corrupt.
    pub fn read(path: &Path) -> Result<FileImage, SequenceError> {
        let unreadable = |source| SequenceError::Unreadable { path: path.to_owned(), source };
        let bytes = std::fs::read(path).map_err(unreadable)?;
        let format = image::guess_format(&bytes).map_err(|_| SequenceError::NotAnImage(path.to_owned()))?;
        if !is_complete(format, &bytes) {
            return Err(SequenceError::Truncated(path.to_owned()));
        }
        let decoded = image::load_from_memory_with_format(&bytes, format);
        Ok(match decoded.map_err(|error| SequenceError::decoding(path, error))? {
            DynamicImage::ImageLuma8(gray) => FileImage::Gray(gray),
            DynamicImage::ImageRgb8(color) => FileImage::Color(color),
            gray @ (DynamicImage::ImageLumaA8(_)
            | DynamicImage::ImageLuma16(_)
            | DynamicImage::ImageLumaA16(_)) => FileImage::Gray(gray.into_luma8()),
            other => FileImage::Color(other.into_rgb8()),
        })
    }

    /// Returns width and height, pixels.
    pub fn size(&self) -> (u32, u32) {
        match self {
            FileImage::Gray(gray) => gray.dimensions(),
            FileImage::Color(color) => color.dimensions(),
        }
    }

    /// Writes one gray level per pixel, row by row; `out` has one byte per pixel.
    pub fn write_luma(&self, out: &mut [u8]) {
        match self {
            FileImage::Gray(gray) => {
                for (out, &level) in out.iter_mut().zip(gray.as_raw()) {
                    *out = level;
                }
            }
            FileImage::Color(color) => {
                for (out, pixel) in out.iter_mut().zip(color.as_raw().chunks_exact(3)) {
                    *out = jpeg_luma(pixel[0], pixel[1], pixel[2]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn luma_preserves_gray_and_weights_colors() {
        assert!((0..=255).all(|level| jpeg_luma(level, level, level) == level));
        assert_eq!((jpeg_luma(255, 0, 0), jpeg_luma(0, 255, 0), jpeg_luma(0, 0, 255)), (76, 150, 29));
    }
}
