//! Typed access to the pixels of a camera frame.

use super::{Encoding, FrameHeader, View};
use crate::image::{GrayImage, ImageView, RgbView};

impl<'a> View<'a, FrameHeader> {
    /// Returns the frame as a gray image: its own pixels if it is gray, else its luma, computed into `buffer`. Returns
    /// `None` if the encoding is unknown, or if the size (columns, rows) differs from `size` or does not match the
    /// number of bytes.
    #[must_use]
    pub fn gray(&self, size: [u32; 2], buffer: &'a mut GrayImage) -> Option<ImageView<'a>> {
        let (width, height, stride) = self.layout(size)?;
        match self.header.encoding()? {
            Encoding::Gray8 => ImageView::new(self.items, width, height, stride).ok(),
            Encoding::Rgb8 => {
                buffer.copy_from_rgb8(self.items, width, height, stride).ok()?;
                buffer.view().ok()
            }
        }
    }

    /// Returns the frame as a color image. Returns `None` if it is not a color frame, or if the size (columns, rows)
    /// differs from `size` or does not match the number of bytes.
    #[must_use]
    pub fn rgb(&self, size: [u32; 2]) -> Option<RgbView<'a>> {
        let (width, height, stride) = self.layout(size)?;
        match self.header.encoding()? {
            Encoding::Gray8 => None,
            Encoding::Rgb8 => RgbView::new(self.items, width, height, stride).ok(),
        }
    }

    /// Returns columns, rows and stride if the frame has this size.
    fn layout(&self, size: [u32; 2]) -> Option<(usize, usize, usize)> {
        let header = self.header;
        let fits = [header.width, header.height] == size;
        fits.then_some((header.width as usize, header.height as usize, header.stride as usize))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_must_have_the_size_and_the_encoding_that_are_expected() {
        let data: Vec<u8> = (0..14).collect();
        let rgb = FrameHeader {
            width: 2,
            height: 2,
            stride: 8,
            encoding: Encoding::Rgb8.code(),
            ..Default::default()
        };
        let mut buffer = GrayImage::default();
        let mut readable = |header: FrameHeader| {
            let frame = View::<FrameHeader> { header: &header, items: &data };
            (frame.rgb([2, 2]).is_some(), frame.gray([2, 2], &mut buffer).is_some())
        };
        assert_eq!(readable(rgb), (true, true));
        assert_eq!(
            readable(FrameHeader { encoding: Encoding::Gray8.code(), stride: 4, ..rgb }),
            (false, true)
        );
        assert_eq!(readable(FrameHeader { encoding: 99, ..rgb }), (false, false));
        assert_eq!(readable(FrameHeader { height: 3, ..rgb }), (false, false));
        assert_eq!(readable(FrameHeader { stride: 9, ..rgb }), (false, false));
    }
}
