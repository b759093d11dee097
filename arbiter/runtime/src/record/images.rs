//! Conversion of frames to compressed images.

use foxglove::bytes::Bytes;
use foxglove::messages::CompressedImage;
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use yamabico_core::message::{Encoding, FrameHeader};

use super::frames::timestamp;

/// Compression of the images of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageFormat {
    /// Lossless, so that a playback gives the same bytes.
    Png,
    /// Lossy and smaller; quality from 1 to 100.
    Jpeg(u8),
    /// None: instead of its pixels, a frame has its picture as a JPEG.
    IsJpeg,
}

impl ImageFormat {
    /// Name in a `foxglove.CompressedImage`.
    fn name(self) -> &'static str {
        match self {
            ImageFormat::Png => "png",
            ImageFormat::Jpeg(_) | ImageFormat::IsJpeg => "jpeg",
        }
    }
}

/// Compresses a frame for a recording; `None` if its header and its bytes contradict each other.
pub(super) fn compressed(
    header: &FrameHeader,
    pixels: &[u8],
    format: ImageFormat,
    frame_id: &str,
) -> Option<CompressedImage> {
    Some(CompressedImage {
        timestamp: Some(timestamp(header.stamp_ns)),
        frame_id: frame_id.to_owned(),
        data: Bytes::from(compress(header, pixels, format)?),
        format: format.name().to_owned(),
    })
}

/// Compresses the pixels of a frame; `None` if its header and its bytes contradict each other.
pub fn compress(header: &FrameHeader, pixels: &[u8], format: ImageFormat) -> Option<Vec<u8>> {
    let quality = match format {
        ImageFormat::IsJpeg => return (!pixels.is_empty()).then(|| pixels.to_vec()),
        ImageFormat::Png => None,
        ImageFormat::Jpeg(quality) => Some(quality),
    };
    let row = (header.width as usize).checked_mul(header.encoding()?.bytes_per_pixel() as usize)?;
    let (stride, height) = (header.stride as usize, header.height as usize);
    if row == 0 || height == 0 || stride < row || pixels.len() < stride * (height - 1) + row {
        return None;
    }
    let packed: Vec<u8>;
    let pixels = if stride == row {
        &pixels[..row * height]
    } else {
        packed = pixels.chunks(stride).take(height).flat_map(|line| &line[..row]).copied().collect();
        &packed
    };
    let color = match header.encoding()? {
        Encoding::Gray8 => ExtendedColorType::L8,
        Encoding::Rgb8 => ExtendedColorType::Rgb8,
    };
    let mut data = Vec::with_capacity(pixels.len());
    let written =
        match quality {
            None => PngEncoder::new_with_quality(&mut data, CompressionType::Fast, FilterType::Sub)
                .write_image(pixels, header.width, header.height, color),
            Some(quality) => JpegEncoder::new_with_quality(&mut data, quality.clamp(1, 100)).write_image(
                pixels,
                header.width,
                header.height,
                color,
            ),
        };
    written.ok()?;
    Some(data)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(width: u32, height: u32, stride: u32) -> FrameHeader {
        FrameHeader { width, height, stride, encoding: Encoding::Gray8.code(), ..FrameHeader::default() }
    }

    #[test]
    fn png_keeps_every_pixel_and_drops_the_padding() {
        let pixels: Vec<u8> = (0..5 * 10).collect();
        let image = compressed(&frame(7, 5, 10), &pixels, ImageFormat::Png, "front").unwrap();
        let back = image::load_from_memory(&image.data).unwrap().into_luma8();
        assert_eq!(back.dimensions(), (7, 5));
        for (x, y, pixel) in back.enumerate_pixels() {
            assert_eq!(u32::from(pixel.0[0]), y * 10 + x);
        }
        assert_eq!(image.format, "png");
    }

    #[test]
    fn jpeg_is_similar() {
        let header = FrameHeader { encoding: Encoding::Rgb8.code(), ..frame(16, 16, 48) };
        let image = compressed(&header, &[100; 768], ImageFormat::Jpeg(85), "front").unwrap();
        let back = image::load_from_memory(&image.data).unwrap().into_rgb8();
        assert!(back.as_raw().iter().all(|&value| value.abs_diff(100) < 4));
    }

    #[test]
    fn contradictory_frames_are_no_image() {
        let broken =
            [frame(7, 5, 6), frame(0, 5, 7), frame(7, 0, 7), frame(8, 8, 8), frame(u32::MAX, 1, u32::MAX)];
        for header in broken {
            assert!(compressed(&header, &[0; 50], ImageFormat::Png, "front").is_none(), "{header:?}");
        }
        let unknown = FrameHeader { encoding: 77, ..frame(7, 5, 10) };
        assert!(compressed(&unknown, &[0; 50], ImageFormat::Png, "front").is_none());
    }
}
