//! Decoding of the JPEG images of cameras.

use yamabico_core::message::Encoding;
use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;

/// An image that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum JpegError {
    /// The data are damaged.
    #[error("a damaged image: {0}")]
    Damaged(String),
    /// The image has another size than the camera's intrinsics.
    #[error(
        "the camera sends {}x{} pixels, but `intrinsics` has {}x{}: correct one of them",
        actual[0], actual[1], expected[0], expected[1]
    )]
    WrongSize {
        /// Width and height of the image, pixels.
        actual: [u32; 2],
        /// Width and height in the intrinsics, pixels.
        expected: [u32; 2],
    },
}

/// Decodes an image of the size (width, height) into `out`, row by row without padding: luma, or red, green and blue.
/// A camera's image may lack its Huffman tables: then those of the standard are meant.
///
/// # Errors
/// [`JpegError`]; `out` then holds anything.
pub fn decode(jpeg: &[u8], size: [u32; 2], encoding: Encoding, out: &mut [u8]) -> Result<(), JpegError> {
    let damaged = |error: &dyn std::fmt::Display| JpegError::Damaged(error.to_string());
    let completed;
    let jpeg = match huffman::missing_at(jpeg) {
        None => jpeg,
        Some(at) => {
            completed = [&jpeg[..at], &huffman::TABLES, &jpeg[at..]].concat();
            &completed[..]
        }
    };
    let colors = match encoding {
        Encoding::Gray8 => ColorSpace::Luma,
        Encoding::Rgb8 => ColorSpace::RGB,
    };
    let options = DecoderOptions::new_fast().jpeg_set_out_colorspace(colors);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(jpeg), options);
    decoder.decode_headers().map_err(|error| damaged(&error))?;
    let actual = decoder.info().map(|info| [u32::from(info.width), u32::from(info.height)]);
    let actual = actual.ok_or_else(|| damaged(&"it has no size"))?;
    if actual != size {
        return Err(JpegError::WrongSize { actual, expected: size });
    }
    if decoder.output_buffer_size() != Some(out.len()) {
        return Err(damaged(&"its colors are unknown"));
    }
    decoder.decode_into(out).map_err(|error| damaged(&error))
}

/// Huffman tables of the standard (ITU-T T.81, annex K.3), which cameras leave out of motion JPEG.
mod huffman {
    /// Marker of a segment of Huffman tables, of the start of a scan, and of an image.
    const TABLE: u8 = 0xc4;
    const SCAN: u8 = 0xda;

    /// Returns the place of the start of the scan if no table comes before it.
    pub fn missing_at(jpeg: &[u8]) -> Option<usize> {
        let mut at = 2;
        loop {
            match jpeg.get(at..at + 4)? {
                [0xff, 0xff, ..] => at += 1,
                [0xff, TABLE, ..] => return None,
                [0xff, SCAN, ..] => return Some(at),
                [0xff, _, high, low] => at += 2 + usize::from(u16::from_be_bytes([*high, *low])),
                _ => return None,
            }
        }
    }

    /// Segment with the four tables: luma and chroma, DC and AC.
    pub const TABLES: [u8; 420] = concatenated();

    const DC_LUMA: [u8; 16] = [0, 1, 5, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0];
    const DC_CHROMA: [u8; 16] = [0, 3, 1, 1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0];
    const AC_LUMA: [u8; 16] = [0, 2, 1, 3, 3, 2, 4, 3, 5, 5, 4, 4, 0, 0, 1, 0x7d];
    const AC_CHROMA: [u8; 16] = [0, 2, 1, 2, 4, 4, 3, 4, 7, 5, 4, 4, 0, 1, 2, 0x77];
    const DC_VALUES: [u8; 12] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11];
    const AC_LUMA_VALUES: [u8; 162] = [
        0x01, 0x02, 0x03, 0x00, 0x04, 0x11, 0x05, 0x12, 0x21, 0x31, 0x41, 0x06, 0x13, 0x51, 0x61, 0x07, 0x22,
        0x71, 0x14, 0x32, 0x81, 0x91, 0xa1, 0x08, 0x23, 0x42, 0xb1, 0xc1, 0x15, 0x52, 0xd1, 0xf0, 0x24, 0x33,
        0x62, 0x72, 0x82, 0x09, 0x0a, 0x16, 0x17, 0x18, 0x19, 0x1a, 0x25, 0x26, 0x27, 0x28, 0x29, 0x2a, 0x34,
        0x35, 0x36, 0x37, 0x38, 0x39, 0x3a, 0x43, 0x44, 0x45, 0x46, 0x47, 0x48, 0x49, 0x4a, 0x53, 0x54, 0x55,
        0x56, 0x57, 0x58, 0x59, 0x5a, 0x63, 0x64, 0x65, 0x66, 0x67, 0x68, 0x69, 0x6a, 0x73, 0x74, 0x75, 0x76,
        0x77, 0x78, 0x79, 0x7a, 0x83, 0x84, 0x85, 0x86, 0x87, 0x88, 0x89, 0x8a, 0x92, 0x93, 0x94, 0x95, 0x96,
        0x97, 0x98, 0x99, 0x9a, 0xa2, 0xa3, 0xa4, 0xa5, 0xa6, 0xa7, 0xa8, 0xa9, 0xaa, 0xb2, 0xb3, 0xb4, 0xb5,
        0xb6, 0xb7, 0xb8, 0xb9, 0xba, 0xc2, 0xc3, 0xc4, 0xc5, 0xc6, 0xc7, 0xc8, 0xc9, 0xca, 0xd2, 0xd3, 0xd4,
        0xd5, 0xd6, 0xd7, 0xd8, 0xd9, 0xda, 0xe1, 0xe2, 0xe3, 0xe4, 0xe5, 0xe6, 0xe7, 0xe8, 0xe9, 0xea, 0xf1,
        0xf2, 0xf3, 0xf4, 0xf5, 0xf6, 0xf7, 0xf8, 0xf9, 0xfa,
    ];
    const AC_CHROMA_VALUES: [u8; 162] = [
        0x00, 0x01, 0x02, 0x03, 0x11, 0x04, 0x05, 0x21, 0x31, 0x06, 0x12, 0x41, 0x51, 0x07, 0x61, 0x71, 0x13,
        0x22, 0x32, 0x81, 0x08, 0x14, 0x42, 0x91, 0xa1, 0xb1, 0xc1, 0x09, 0x23, 0x33, 0x52, 0xf0, 0x15, 0x62,
        0x72, 0xd1, 0x0a, 0x16, 0x24, 0x34, 0xe1, 0x25, 0xf1, 0x17, 0x18, 0x19, 0x1a, 0x26, 0x27, 0x28, 0x29,
        0x2a, 0x35, 0x36, 0x37, 0x38, 0x39, 0x3a, 0x43, 0x44, 0x45, 0x46, 0x47, 0x48, 0x49, 0x4a, 0x53, 0x54,
        0x55, 0x56, 0x57, 0x58, 0x59, 0x5a, 0x63, 0x64, 0x65, 0x66, 0x67, 0x68, 0x69, 0x6a, 0x73, 0x74, 0x75,
        0x76, 0x77, 0x78, 0x79, 0x7a, 0x82, 0x83, 0x84, 0x85, 0x86, 0x87, 0x88, 0x89, 0x8a, 0x92, 0x93, 0x94,
        0x95, 0x96, 0x97, 0x98, 0x99, 0x9a, 0xa2, 0xa3, 0xa4, 0xa5, 0xa6, 0xa7, 0xa8, 0xa9, 0xaa, 0xb2, 0xb3,
        0xb4, 0xb5, 0xb6, 0xb7, 0xb8, 0xb9, 0xba, 0xc2, 0xc3, 0xc4, 0xc5, 0xc6, 0xc7, 0xc8, 0xc9, 0xca, 0xd2,
        0xd3, 0xd4, 0xd5, 0xd6, 0xd7, 0xd8, 0xd9, 0xda, 0xe2, 0xe3, 0xe4, 0xe5, 0xe6, 0xe7, 0xe8, 0xe9, 0xea,
        0xf2, 0xf3, 0xf4, 0xf5, 0xf6, 0xf7, 0xf8, 0xf9, 0xfa,
    ];

    const fn concatenated() -> [u8; 420] {
        let mut out = [0; 420];
        [out[0], out[1], out[2], out[3]] = [0xff, TABLE, 0x01, 0xa2];
        let at = put(&mut out, 4, &[0x00]);
        let at = put(&mut out, at, &DC_LUMA);
        let at = put(&mut out, at, &DC_VALUES);
        let at = put(&mut out, at, &[0x10]);
        let at = put(&mut out, at, &AC_LUMA);
        let at = put(&mut out, at, &AC_LUMA_VALUES);
        let at = put(&mut out, at, &[0x01]);
        let at = put(&mut out, at, &DC_CHROMA);
        let at = put(&mut out, at, &DC_VALUES);
        let at = put(&mut out, at, &[0x11]);
        let at = put(&mut out, at, &AC_CHROMA);
        put(&mut out, at, &AC_CHROMA_VALUES);
        out
    }

    const fn put(out: &mut [u8; 420], mut at: usize, bytes: &[u8]) -> usize {
        let mut i = 0;
        while i < bytes.len() {
            out[at] = bytes[i];
            (at, i) = (at + 1, i + 1);
        }
        at
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture with structure, and its JPEG.
    fn picture() -> (image::RgbImage, Vec<u8>) {
        let level = |x: u32, y: u32| ((x * 3 + y * 5) % 200) as u8;
        let picture = image::RgbImage::from_fn(64, 48, |x, y| image::Rgb([level(x, y), level(y, x), 90]));
        let mut jpeg = Vec::new();
        let mut encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut jpeg, 90);
        encoder.encode_image(&picture).unwrap();
        (picture, jpeg)
    }

    /// Returns the image without its Huffman tables.
    fn without_tables(jpeg: &[u8]) -> Vec<u8> {
        let (mut out, mut at) = (jpeg[..2].to_vec(), 2);
        while jpeg[at + 1] != 0xda {
            let len = 2 + usize::from(u16::from_be_bytes([jpeg[at + 2], jpeg[at + 3]]));
            if jpeg[at + 1] != 0xc4 {
                out.extend(&jpeg[at..at + len]);
            }
            at += len;
        }
        out.extend(&jpeg[at..]);
        out
    }

    #[test]
    fn an_image_without_tables_decodes_as_with_them() {
        let (picture, jpeg) = picture();
        let short = without_tables(&jpeg);
        assert!(short.len() + 400 < jpeg.len());
        for (encoding, bytes) in [(Encoding::Gray8, 64 * 48), (Encoding::Rgb8, 64 * 48 * 3)] {
            let mut decoded = [vec![0; bytes], vec![0; bytes]];
            decode(&jpeg, [64, 48], encoding, &mut decoded[0]).unwrap();
            decode(&short, [64, 48], encoding, &mut decoded[1]).unwrap();
            assert_eq!(decoded[0], decoded[1]);
            if encoding == Encoding::Rgb8 {
                let off = decoded[0].iter().zip(picture.as_raw()).map(|(a, b)| f64::from(a.abs_diff(*b)));
                assert!(off.sum::<f64>() / (bytes as f64) < 12.0);
            }
        }
    }

    #[test]
    fn nothing_panics_on_damage() {
        let (_, jpeg) = picture();
        let mut out = vec![0; 64 * 48];
        let wrong = decode(&jpeg, [64, 40], Encoding::Gray8, &mut out[..64 * 40]).unwrap_err();
        assert!(wrong.to_string().contains("64x48") && wrong.to_string().contains("64x40"), "{wrong}");
        for at in 0..jpeg.len() {
            let mut damaged = jpeg.clone();
            damaged[at] ^= 0x55;
            let _ = decode(&damaged, [64, 48], Encoding::Gray8, &mut out);
            let _ = decode(&jpeg[..at], [64, 48], Encoding::Gray8, &mut out);
        }
    }
}
