//! JPEG images in a stream of bytes, such as motion JPEG in a pipe or in an HTTP response.

/// Markers of JPEG: start and end of an image, start of a scan, and the first and last restart within a scan.
const START: u8 = 0xd8;
const END: u8 = 0xd9;
const SCAN: u8 = 0xda;
const FIRST_RESTART: u8 = 0xd0;
const LAST_RESTART: u8 = 0xd7;

/// Cuts images out of a stream. Bytes between them, such as the headers of HTTP parts, are skipped; the end of a thumbnail is
/// not the end of its image.
#[derive(Clone, Debug)]
pub struct JpegCutter {
    max_len: usize,
    image: Vec<u8>,
    place: Place,
    broken: u64,
}

/// Place in the stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    /// Between images; true after a byte of 0xff.
    Outside(bool),
    /// Before a marker; true after its 0xff.
    Marker(bool),
    /// In the length of a segment: its first byte, if there.
    Length(u8, Option<u8>),
    /// In a segment with this marker: number of bytes that are left.
    Segment(u8, usize),
    /// In the data of a scan; true after a byte of 0xff.
    Data(bool),
}

/// Event in a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut<'a> {
    /// An image begins.
    Begin,
    /// An image is complete.
    Image(&'a [u8]),
}

impl JpegCutter {
    /// Returns a cutter for images up to `max_len` bytes; longer ones are dropped.
    #[must_use]
    pub fn new(max_len: usize) -> JpegCutter {
        JpegCutter { max_len, image: Vec::new(), place: Place::Outside(false), broken: 0 }
    }

    /// Number of images that were cut off, damaged or too long.
    #[must_use]
    pub fn broken(&self) -> u64 {
        self.broken
    }

    /// Takes in bytes, and tells what begins and ends in them.
    pub fn push(&mut self, bytes: &[u8], mut each: impl FnMut(Cut<'_>)) {
        for &byte in bytes {
            if !matches!(self.place, Place::Outside(_)) {
                self.image.push(byte);
                if self.image.len() > self.max_len {
                    self.drop_image();
                    continue;
                }
            }
            self.place = match (self.place, byte) {
                (Place::Outside(true), START) => self.begin(&mut each),
                (Place::Outside(_), _) => Place::Outside(byte == 0xff),
                (Place::Marker(false), 0xff) | (Place::Marker(true), 0xff) => Place::Marker(true),
                (Place::Marker(true) | Place::Data(true), START) => {
                    // The image before was cut off.
                    self.broken += 1;
                    self.begin(&mut each)
                }
                (Place::Marker(true) | Place::Data(true), END) => {
                    each(Cut::Image(&self.image));
                    Place::Outside(false)
                }
                (Place::Marker(true), marker) => Place::Length(marker, None),
                (Place::Marker(false), _) => {
                    self.drop_image();
                    Place::Outside(false)
                }
                (Place::Length(marker, None), high) => Place::Length(marker, Some(high)),
                (Place::Length(marker, Some(high)), low) => {
                    let left = usize::from(u16::from_be_bytes([high, low])).saturating_sub(2);
                    after_segment(marker, left)
                }
                (Place::Segment(marker, left), _) => after_segment(marker, left - 1),
                (Place::Data(_), 0xff) => Place::Data(true),
                (Place::Data(false), _) => Place::Data(false),
                (Place::Data(true), 0 | FIRST_RESTART..=LAST_RESTART) => Place::Data(false),
                // Tables between the scans of a progressive image.
                (Place::Data(true), marker) => Place::Length(marker, None),
            };
        }
    }

    fn begin(&mut self, each: &mut impl FnMut(Cut<'_>)) -> Place {
        self.image.clear();
        self.image.extend([0xff, START]);
        each(Cut::Begin);
        Place::Marker(false)
    }

    fn drop_image(&mut self) {
        self.broken += 1;
        self.image.clear();
        self.place = Place::Outside(false);
    }
}

fn after_segment(marker: u8, left: usize) -> Place {
    match (left, marker) {
        (0, SCAN) => Place::Data(false),
        (0, _) => Place::Marker(false),
        _ => Place::Segment(marker, left),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An image with a thumbnail whose end is no end.
    fn image(content: &[u8]) -> Vec<u8> {
        let thumbnail = [0xff, 0xe1, 0, 8, 0xff, 0xd8, 1, 0xff, 0xd9, 2];
        let scan = [0xff, 0xda, 0, 4, 1, 2];
        [&[0xff, 0xd8][..], &thumbnail, &scan, content, &[0xff, 0, 0xff, 0xd3, 7, 0xff, 0xd9]].concat()
    }

    fn cut(cutter: &mut JpegCutter, bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut images = Vec::new();
        for byte in bytes {
            cutter.push(&[*byte], |cut| {
                if let Cut::Image(image) = cut {
                    images.push(image.to_vec());
                }
            });
        }
        images
    }

    #[test]
    fn images_are_cut_out_of_parts() {
        let (a, b) = (image(&[1, 2, 3]), image(&[9; 50]));
        let stream =
            [b"--part\r\nContent-Type: image/jpeg\r\n\r\n", &a[..], b"\r\n--part\r\n\r\n", &b, b"\r\n"]
                .concat();
        let mut cutter = JpegCutter::new(1000);
        assert_eq!(cut(&mut cutter, &stream), [a, b]);
        assert_eq!(cutter.broken(), 0);
    }

    #[test]
    fn a_cut_off_image_does_not_hide_the_next_one() {
        let (a, b) = (image(&[5; 30]), image(&[6; 30]));
        for at in 0..a.len() {
            let mut cutter = JpegCutter::new(1000);
            // Cut off in a segment, what follows is taken for its rest: up to 64 kB.
            let stream = [&a[..at], &b.repeat(66_000 / b.len())].concat();
            let images = cut(&mut cutter, &stream);
            assert!(images.last() == Some(&b), "cut at {at}: {}", images.len());
        }
    }

    #[test]
    fn the_length_is_bounded() {
        let mut cutter = JpegCutter::new(100);
        assert!(cut(&mut cutter, &image(&[1; 200])).is_empty());
        assert_eq!(cutter.broken(), 1);
        assert_eq!(cut(&mut cutter, &image(&[1; 20])).len(), 1);
    }

    #[test]
    fn ten_million_random_bytes_are_no_problem() {
        let mut cutter = JpegCutter::new(100_000);
        let mut state = 1_u64;
        let mut images = 0;
        let mut bytes = vec![0; 10_000];
        for _ in 0..1000 {
            for byte in &mut bytes {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                // Many markers.
                *byte = if state >> 60 == 0 { 0xff } else { (state >> 33) as u8 | 0xc0 };
            }
            cutter.push(&bytes, |cut| images += u64::from(matches!(cut, Cut::Image(_))));
        }
        assert!(images > 0 && cutter.image.len() <= 100_001);
        let whole = image(&[3; 40]);
        cutter.push(&[0; 100_000], |_| {});
        assert_eq!(cut(&mut cutter, &whole), std::slice::from_ref(&whole));
    }
}
