//! Images of ROS 2. All become gray.

use image::DynamicImage;
use serde::Deserialize;
use yamabico_core::image::jpeg_luma;
use yamabico_core::message::{Encoding, FrameHeader};

use super::Header;
use crate::measurement::{Measurement, Refusal, decode};

#[derive(Deserialize)]
pub(super) struct CompressedImage<'a> {
    header: Header,
    _format: String,
    #[serde(borrow)]
    data: &'a [u8],
}

pub(super) fn compressed(message: &CompressedImage<'_>) -> Result<Measurement, Refusal> {
    let image = decode(message.data)?;
    let (width, height) = (image.width(), image.height());
    let pixels = match image {
        DynamicImage::ImageLuma8(gray) => gray.into_raw(),
        other => {
            let colors = other.into_rgb8().into_raw();
            colors.chunks_exact(3).map(|pixel| jpeg_luma(pixel[0], pixel[1], pixel[2])).collect()
        }
    };
    Ok(gray(&message.header, width, height, pixels))
}

#[derive(Deserialize)]
pub(super) struct Image<'a> {
    header: Header,
    height: u32,
    width: u32,
    encoding: String,
    _is_bigendian: u8,
    step: u32,
    #[serde(borrow)]
    data: &'a [u8],
}

/// Bytes of a pixel, and its gray level.
#[derive(Clone, Copy)]
enum Pixel {
    Mono,
    Rgb,
    Bgr,
    /// One luma per pixel at this byte, and every other pixel a chroma.
    Luma(usize),
}

impl Pixel {
    fn of(encoding: &str) -> Option<Pixel> {
        Some(match encoding {
            "mono8" | "8UC1" => Pixel::Mono,
            "rgb8" => Pixel::Rgb,
            "bgr8" | "8UC3" => Pixel::Bgr,
            "yuv422" | "uyvy" => Pixel::Luma(1),
            "yuv422_yuy2" | "yuyv" => Pixel::Luma(0),
            _ => return None,
        })
    }

    const fn bytes(self) -> usize {
        match self {
            Pixel::Mono => 1,
            Pixel::Rgb | Pixel::Bgr => 3,
            Pixel::Luma(_) => 2,
        }
    }

    fn gray(self, pixel: &[u8]) -> u8 {
        match self {
            Pixel::Mono => pixel[0],
            Pixel::Luma(byte) => pixel[byte],
            Pixel::Rgb => jpeg_luma(pixel[0], pixel[1], pixel[2]),
            Pixel::Bgr => jpeg_luma(pixel[2], pixel[1], pixel[0]),
        }
    }
}

pub(super) fn raw(message: &Image<'_>) -> Result<Measurement, Refusal> {
    let pixel = Pixel::of(&message.encoding).ok_or_else(|| Refusal::Encoding(message.encoding.clone()))?;
    let malformed = || Refusal::Malformed(format!("an image of {}x{} pixels", message.width, message.height));
    let (width, step) = (message.width as usize, message.step as usize);
    let row =
        width.checked_mul(pixel.bytes()).filter(|row| *row > 0 && *row <= step).ok_or_else(malformed)?;
    let size = step.checked_mul(message.height as usize).filter(|size| *size <= message.data.len());
    let data = &message.data[..size.ok_or_else(malformed)?];
    let lines = data.chunks_exact(step);
    let pixels =
        lines.flat_map(|line| line[..row].chunks_exact(pixel.bytes()).map(|bytes| pixel.gray(bytes)));
    Ok(gray(&message.header, message.width, message.height, pixels.collect()))
}

fn gray(header: &Header, width: u32, height: u32, pixels: Vec<u8>) -> Measurement {
    let encoding = Encoding::Gray8.code();
    let stamp_ns = header.stamp_ns();
    let frame = FrameHeader { stamp_ns, width, height, stride: width, encoding, exposure: 1.0, sequence: 0 };
    Measurement::Frame(frame, pixels)
}
