//! Grey levels of a picture file.

use std::path::Path;

use image::{DynamicImage, ImageFormat};

use crate::files::SequenceError;

/// A decoded picture, grey or in colour, as it came from the file.
pub(crate) enum Picture {
    Grey(image::GrayImage),
    Colour(image::RgbImage),
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
        if format == ImageFormat::Jpeg && !jpeg_is_complete(&bytes) {
            return Err(SequenceError::Truncated(path.to_owned()));
        }
        let picture = image::load_from_memory_with_format(&bytes, format);
        Ok(match picture.map_err(|error| SequenceError::decoding(path, error))? {
            DynamicImage::ImageLuma8(grey) => Picture::Grey(grey),
            DynamicImage::ImageRgb8(colour) => Picture::Colour(colour),
            grey @ (DynamicImage::ImageLumaA8(_)
            | DynamicImage::ImageLuma16(_)
            | DynamicImage::ImageLumaA16(_)) => Picture::Grey(grey.into_luma8()),
            other => Picture::Colour(other.into_rgb8()),
        })
    }

    /// Width and height, pixels.
    pub fn size(&self) -> (u32, u32) {
        match self {
            Picture::Grey(grey) => grey.dimensions(),
            Picture::Colour(colour) => colour.dimensions(),
        }
    }

    /// Writes a grey level a pixel, row by row; `out` holds as many bytes as there are pixels.
    pub fn write_luma(&self, out: &mut [u8]) {
        match self {
            Picture::Grey(grey) => {
                for (out, &level) in out.iter_mut().zip(grey.as_raw()) {
                    *out = level;
                }
            }
            Picture::Colour(colour) => {
                for (out, pixel) in out.iter_mut().zip(colour.as_raw().chunks_exact(3)) {
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

/// Whether the picture's data come to their end marker: the decoder fills what is missing with grey and says nothing.
fn jpeg_is_complete(bytes: &[u8]) -> bool {
    const START_OF_SCAN: u8 = 0xda;
    const END_OF_IMAGE: [u8; 2] = [0xff, 0xd9];
    let mut at = 2;
    while let Some(&[0xff, marker, high, low]) = bytes.get(at..at + 4) {
        if marker == START_OF_SCAN {
            // Within a scan 0xff is followed by zero or a restart marker: the end marker cannot occur by chance.
            return bytes[at..].windows(2).any(|pair| pair == END_OF_IMAGE);
        }
        // Padding before a marker is one byte of 0xff; a segment tells its length.
        at += if marker == 0xff { 1 } else { 2 + usize::from(u16::from_be_bytes([high, low])) };
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn luma_keeps_grey_and_weighs_colours() {
        assert!((0..=255).all(|level| luma(level, level, level) == level));
        assert_eq!((luma(255, 0, 0), luma(0, 255, 0), luma(0, 0, 255)), (76, 150, 29));
    }

    #[test]
    fn an_end_marker_in_a_thumbnail_is_not_the_end() {
        let thumbnail = [0xff, 0xe1, 0, 6, 0xff, 0xd9, 1, 2];
        let scan = [0xff, 0xda, 0, 2, 1, 2, 3, 0xff, 0, 4];
        let cut = [&[0xff, 0xd8][..], &thumbnail, &scan].concat();
        assert!(!jpeg_is_complete(&cut));
        assert!(jpeg_is_complete(&[&cut[..], &[0xff, 0xd9]].concat()));
        assert!(!jpeg_is_complete(&[0xff, 0xd8]) && !jpeg_is_complete(&[]));
    }
}
