//! Gray levels of a picture file.

use std::path::Path;

use image::DynamicImage;

use crate::files::{SequenceError, is_complete};

/// A decoded picture, gray or in color, as it came from the file.
pub(crate) enum Picture {
    Gray(image::GrayImage),
    Color(image::RgbImage),
}

impl Picture {
    /// Reads the whole file.
    ///
    /// # Errors
    /// Unreadable, not an image, cut short, broken.
    pub fn read(path: &Path) -> Result<Picture, SequenceError> {
        let unreadable = |source| SequenceError::Unreadable { path: path.to_owned(), source };
        let bytes = std::fs::read(path).map_err(unreadable)?;
        let format = image::guess_format(&bytes).map_err(|_| SequenceError::NotAnImage(path.to_owned()))?;
        if !is_complete(format, &bytes) {
            return Err(SequenceError::Truncated(path.to_owned()));
        }
        let picture = image::load_from_memory_with_format(&bytes, format);
        Ok(match picture.map_err(|error| SequenceError::decoding(path, error))? {
            DynamicImage::ImageLuma8(gray) => Picture::Gray(gray),
            DynamicImage::ImageRgb8(color) => Picture::Color(color),
            gray @ (DynamicImage::ImageLumaA8(_)
            | DynamicImage::ImageLuma16(_)
            | DynamicImage::ImageLumaA16(_)) => Picture::Gray(gray.into_luma8()),
            other => Picture::Color(other.into_rgb8()),
        })
    }

    /// Width and height, pixels.
    pub fn size(&self) -> (u32, u32) {
        match self {
            Picture::Gray(gray) => gray.dimensions(),
            Picture::Color(color) => color.dimensions(),
        }
    }

    /// Writes a gray level a pixel, row by row; `out` holds as many bytes as there are pixels.
    pub fn write_luma(&self, out: &mut [u8]) {
        match self {
            Picture::Gray(gray) => {
                for (out, &level) in out.iter_mut().zip(gray.as_raw()) {
                    *out = level;
                }
            }
            Picture::Color(color) => {
                for (out, pixel) in out.iter_mut().zip(color.as_raw().chunks_exact(3)) {
                    *out = luma(pixel[0], pixel[1], pixel[2]);
                }
            }
        }
    }
}

/// The luma of ITU-R BT.601, which is that of JPEG: 0.299 R + 0.587 G + 0.114 B in 1/65536 parts, rounded.
fn luma(red: u8, green: u8, blue: u8) -> u8 {
    let sum = 19_595 * u32::from(red) + 38_470 * u32::from(green) + 7_471 * u32::from(blue);
    ((sum + 32_768) >> 16) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn luma_keeps_gray_and_weighs_colors() {
        assert!((0..=255).all(|level| luma(level, level, level) == level));
        assert_eq!((luma(255, 0, 0), luma(0, 255, 0), luma(0, 0, 255)), (76, 150, 29));
    }
}
