//! The pixels of a camera frame.

use super::{Encoding, FrameHeader, View};
use crate::image::{GrayImage, ImageView, RgbView};

impl<'a> View<'a, FrameHeader> {
    /// The gray levels of the frame: its own bytes where it is gray, else its luma, computed into `buffer`. `None` where
    /// the encoding is unknown, or where the size (columns, rows) differs from `size` or from the number of bytes.
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

    /// The colors of the frame. `None` where it is not a color frame, or where the size (columns, rows) differs from `size`
    /// or from the number of bytes.
    #[must_use]
    pub fn rgb(&self, size: [u32; 2]) -> Option<RgbView<'a>> {
        let (width, height, stride) = self.layout(size)?;
        match self.header.encoding()? {
            Encoding::Gray8 => None,
            Encoding::Rgb8 => RgbView::new(self.items, width, height, stride).ok(),
        }
    }

    /// Columns, rows and stride, where the frame is of this size.
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
        let mut seen = |header: FrameHeader| {
            let frame = View::<FrameHeader> { header: &header, items: &data };
            (frame.rgb([2, 2]).is_some(), frame.gray([2, 2], &mut buffer).is_some())
        };
        assert_eq!(seen(rgb), (true, true));
        assert_eq!(seen(FrameHeader { encoding: Encoding::Gray8.code(), stride: 4, ..rgb }), (false, true));
        assert_eq!(seen(FrameHeader { encoding: 99, ..rgb }), (false, false));
        assert_eq!(seen(FrameHeader { height: 3, ..rgb }), (false, false));
        assert_eq!(seen(FrameHeader { stride: 9, ..rgb }), (false, false));
    }
}
