//! Newest pictures of the cameras, compressed.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use super::Overlays;
use serde::Serialize;
use yamabico_core::message::FrameHeader;
use yamabico_core::time::Time;
use yamabico_runtime::record::{ImageFormat, compress};

/// Number of newest pictures of one camera that are kept, for clients that are a little late.
const KEPT: usize = 8;
/// Maximum number of cameras.
const MAX_CAMERAS: usize = 16;
/// Minimum time between two pictures of one camera that are compressed, s.
const MIN_INTERVAL_S: f64 = 0.06;
/// Quality of the pictures.
const JPEG_QUALITY: u8 = 85;

/// A compressed picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Header of its frame.
    pub header: FrameHeader,
    /// Media type: `image/jpeg` or `image/png`.
    pub media_type: &'static str,
    /// Compressed pixels.
    pub data: Arc<[u8]>,
}

/// Newest picture of a camera.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PictureView {
    /// Topic of the camera.
    pub topic: String,
    /// Stamp, ns, as text: JavaScript's numbers are too short for it.
    pub stamp: String,
    /// Stamp of the newest picture that a behavior has drawn over, if there is one.
    pub overlaid: Option<String>,
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Age, s.
    pub age_s: f64,
}

/// Newest pictures by topic.
#[derive(Clone, Debug, Default)]
pub struct Pictures {
    cameras: BTreeMap<String, VecDeque<Picture>>,
}

impl Pictures {
    /// Compresses a frame; `None` if the last picture of its camera is too new, or if the frame is malformed.
    pub(crate) fn compress(&self, topic: &str, header: &FrameHeader, pixels: &[u8]) -> Option<Picture> {
        let last = self.cameras.get(topic).and_then(VecDeque::back);
        let since_s = last.map(|last| Time(header.stamp_ns).seconds_after(Time(last.header.stamp_ns)));
        if since_s.is_some_and(|since_s| (0.0..MIN_INTERVAL_S).contains(&since_s)) {
            return None;
        }
        let data = compress(header, pixels, ImageFormat::Jpeg(JPEG_QUALITY))?;
        Some(Picture { header: *header, media_type: "image/jpeg", data: data.into() })
    }

    /// Takes in the newest picture of a camera.
    pub fn add(&mut self, topic: &str, picture: Picture) {
        if !self.cameras.contains_key(topic) {
            if self.cameras.len() == MAX_CAMERAS {
                return;
            }
            self.cameras.insert(topic.to_owned(), VecDeque::new());
        }
        let Some(kept) = self.cameras.get_mut(topic) else { return };
        if kept.len() == KEPT {
            kept.pop_front();
        }
        kept.push_back(picture);
    }

    /// Picture of the camera `topic` with this stamp, or else its newest one.
    pub fn get(&self, topic: &str, stamp_ns: Option<u64>) -> Option<&Picture> {
        let kept = self.cameras.get(topic)?;
        kept.iter().find(|picture| Some(picture.header.stamp_ns) == stamp_ns).or_else(|| kept.back())
    }

    /// Newest picture of each camera.
    pub(super) fn views(&self, now: Time, overlays: &Overlays) -> Vec<PictureView> {
        let newest = self.cameras.iter().filter_map(|(topic, kept)| Some((topic, kept, kept.back()?)));
        let stamps = |topic: &str, kept: &VecDeque<Picture>| {
            let mut stamps = kept.iter().rev().map(|picture| picture.header.stamp_ns);
            stamps.find(|stamp_ns| overlays.has(topic, *stamp_ns))
        };
        let view = |(topic, kept, picture): (&String, &VecDeque<Picture>, &Picture)| PictureView {
            overlaid: stamps(topic, kept).map(|stamp_ns| stamp_ns.to_string()),
            topic: topic.clone(),
            stamp: picture.header.stamp_ns.to_string(),
            width: picture.header.width,
            height: picture.header.height,
            age_s: now.seconds_after(Time(picture.header.stamp_ns)),
        };
        newest.map(view).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_compressed_thinned_and_found_by_their_stamp() {
        let mut pictures = Pictures::default();
        let frame = |millis: u64| FrameHeader::gray(8, 4, millis * 1_000_000);
        for millis in [0, 20, 100, 200, 300, 400] {
            if let Some(picture) = pictures.compress("front", &frame(millis), &[90; 32]) {
                pictures.add("front", picture);
            }
        }
        assert!(pictures.compress("front", &frame(900), &[90; 3]).is_none());
        let stamp = |wanted| pictures.get("front", wanted).map(|picture| picture.header.stamp_ns / 1_000_000);
        assert_eq!(stamp(Some(200_000_000)), Some(200));
        assert_eq!((stamp(Some(20_000_000)), stamp(None)), (Some(400), Some(400)));
        assert_eq!(pictures.get("rear", None), None);
        assert_eq!(pictures.views(Time(500_000_000), &Overlays::default())[0].age_s, 0.1);
    }
}
