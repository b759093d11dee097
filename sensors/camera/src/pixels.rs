//! Arrangements of the bytes of a camera's image, and their conversion to frames.

use yamabico_core::message::Encoding;

use crate::jpeg::{self, JpegError};

/// Arrangement of the bytes of an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Pixels {
    /// JPEG.
    #[default]
    Jpeg,
    #[cfg_attr(not(feature = "v4l2"), allow(dead_code, reason = "of kernel cameras"))]
    /// Luma and chroma by turns (YUYV, 4:2:2), with this distance between the beginnings of two rows, bytes.
    Yuyv(usize),
    #[cfg_attr(not(feature = "v4l2"), allow(dead_code, reason = "of kernel cameras"))]
    /// Luma alone, with this distance between the beginnings of two rows, bytes.
    Luma(usize),
}

impl Pixels {
    /// Converts an image of the size (width, height) into `out`, row by row without padding.
    ///
    /// # Errors
    /// A damaged image, or one of another size; `out` then holds anything.
    pub fn convert(
        self,
        data: &[u8],
        size: [u32; 2],
        encoding: Encoding,
        out: &mut [u8],
    ) -> Result<(), JpegError> {
        let [width, height] = size.map(|side| side as usize);
        let row_bytes = width * encoding.bytes_per_pixel() as usize;
        let (stride, pixel_bytes) = match self {
            Pixels::Jpeg => return jpeg::decode(data, size, encoding, out),
            Pixels::Yuyv(stride) => (stride, 2),
            Pixels::Luma(stride) => (stride, 1),
        };
        if stride < pixel_bytes * width || data.len() < stride * (height - 1) + pixel_bytes * width {
            return Err(JpegError::Damaged(format!("it has {} bytes, too few for its size", data.len())));
        }
        for (out, row) in out.chunks_exact_mut(row_bytes).zip(data.chunks(stride)) {
            match (encoding, pixel_bytes) {
                (Encoding::Gray8, 1) => out.copy_from_slice(&row[..width]),
                (Encoding::Gray8, _) => {
                    out.iter_mut().zip(row.iter().step_by(2)).for_each(|(out, luma)| *out = *luma);
                }
                (Encoding::Rgb8, 1) => {
                    out.chunks_exact_mut(3).zip(row).for_each(|(out, luma)| out.fill(*luma));
                }
                (Encoding::Rgb8, _) => {
                    for (out, pair) in out.chunks_mut(6).zip(row.chunks_exact(4)) {
                        for (out, luma) in out.chunks_exact_mut(3).zip([pair[0], pair[2]]) {
                            out.copy_from_slice(&rgb(luma, pair[1], pair[3]));
                        }
                    }
                }
            }
        }
        Ok(())
    }
}

/// Converts full-range BT.601 luma and chroma, as in JPEG and in the raw formats of USB cameras.
fn rgb(luma: u8, blue: u8, red: u8) -> [u8; 3] {
    let (y, u, v) = (f32::from(luma), f32::from(blue) - 128.0, f32::from(red) - 128.0);
    [y + 1.402 * v, y - 0.344_136 * u - 0.714_136 * v, y + 1.772 * u]
        .map(|level| level.round().clamp(0.0, 255.0) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn raw_images_lose_their_padding() {
        // 2 x 2 pixels, rows of 6 bytes.
        let yuyv = [10, 128, 20, 128, 0, 0, 30, 128, 40, 255, 0, 0];
        let mut gray = [0; 4];
        Pixels::Yuyv(6).convert(&yuyv, [2, 2], Encoding::Gray8, &mut gray).unwrap();
        assert_eq!(gray, [10, 20, 30, 40]);
        let mut colors = [0; 12];
        Pixels::Yuyv(6).convert(&yuyv, [2, 2], Encoding::Rgb8, &mut colors).unwrap();
        assert_eq!(colors[..6], [10, 10, 10, 20, 20, 20]);
        assert!(colors[6] > 200 && colors[7] < 10, "red: {colors:?}");
        Pixels::Luma(3).convert(&[1, 2, 0, 3, 4], [2, 2], Encoding::Gray8, &mut gray).unwrap();
        assert_eq!(gray, [1, 2, 3, 4]);
        assert!(Pixels::Luma(3).convert(&[1, 2, 0, 3], [2, 2], Encoding::Gray8, &mut gray).is_err());
        assert!(Pixels::Yuyv(3).convert(&yuyv, [2, 2], Encoding::Gray8, &mut gray).is_err());
    }
}
