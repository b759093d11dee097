//! Copies of the newest camera frames, kept until the pose at which they were captured is available.

use yamabico_core::image::{GrayImage, ImageView};
use yamabico_core::time::Time;

/// Number of frames kept.
const FRAME_COUNT: usize = 3;

/// Ring buffer of the newest frames.
#[derive(Clone, Debug, Default)]
pub struct RecentFrames {
    slots: [RecentFrame; FRAME_COUNT],
    next: usize,
}

/// Copy of a frame, with its capture stamp and exposure.
#[derive(Clone, Debug, Default)]
pub struct RecentFrame {
    stamp: Option<Time>,
    /// Exposure relative to the nominal exposure of the camera.
    pub exposure: f64,
    /// Image, gray levels.
    pub image: GrayImage,
}

impl RecentFrames {
    /// Copies a frame into the buffer, in place of the oldest one.
    pub fn push(&mut self, stamp: Time, exposure: f64, image: ImageView) {
        let slot = &mut self.slots[self.next];
        self.next = (self.next + 1) % FRAME_COUNT;
        slot.stamp = Some(stamp);
        slot.exposure = exposure;
        slot.image.copy_from(image);
    }

    /// Returns the frame captured at `stamp`; `None` if it is not in the buffer.
    #[must_use]
    pub fn taken_at(&self, stamp: Time) -> Option<&RecentFrame> {
        self.slots.iter().find(|slot| slot.stamp == Some(stamp))
    }

    /// Returns the capture stamp of the newest frame.
    #[must_use]
    pub fn newest(&self) -> Option<Time> {
        self.slots.iter().filter_map(|slot| slot.stamp).max()
    }
}
