//! The newest pictures, kept until it is known where they were taken.

use yamabico_core::image::{GrayImage, ImageView};
use yamabico_core::time::Time;

/// How many.
const COUNT: usize = 3;

/// Copies of the newest pictures.
#[derive(Clone, Debug, Default)]
pub struct KeptPictures {
    slots: [Kept; COUNT],
    next: usize,
}

/// A picture with when and how it was taken.
#[derive(Clone, Debug, Default)]
pub struct Kept {
    stamp: Option<Time>,
    /// Exposure relative to the camera's nominal one.
    pub exposure: f64,
    /// The gray levels.
    pub image: GrayImage,
}

impl KeptPictures {
    /// Keeps a copy instead of the oldest one.
    pub fn keep(&mut self, stamp: Time, exposure: f64, image: ImageView) {
        let slot = &mut self.slots[self.next];
        self.next = (self.next + 1) % COUNT;
        slot.stamp = Some(stamp);
        slot.exposure = exposure;
        slot.image.copy_from(image);
    }

    /// The picture taken at `stamp`; `None` where it is not kept (any more).
    #[must_use]
    pub fn of(&self, stamp: Time) -> Option<&Kept> {
        self.slots.iter().find(|slot| slot.stamp == Some(stamp))
    }

    /// When the newest one was taken.
    #[must_use]
    pub fn newest(&self) -> Option<Time> {
        self.slots.iter().filter_map(|slot| slot.stamp).max()
    }
}
