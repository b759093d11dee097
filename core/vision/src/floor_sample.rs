//! Color statistics of a patch of floor.

use super::floor_color::{Color, ColorBox};

/// Histograms of the three color channels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FloorSample {
    channels: [[u32; 256]; 3],
    count: u32,
}

impl Default for FloorSample {
    fn default() -> Self {
        Self { channels: [[0; 256]; 3], count: 0 }
    }
}

impl FloorSample {
    /// Removes all pixels.
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    /// Adds a pixel.
    pub fn add(&mut self, color: Color) {
        for (channel, level) in self.channels.iter_mut().zip(color) {
            channel[usize::from(level)] += 1;
        }
        self.count += 1;
    }

    /// Adds the pixels of another sample.
    pub fn merge(&mut self, sample: &FloorSample) {
        for (mine, theirs) in self.channels.iter_mut().flatten().zip(sample.channels.iter().flatten()) {
            *mine += theirs;
        }
        self.count += sample.count;
    }

    /// Number of pixels.
    #[must_use]
    pub fn count(&self) -> u32 {
        self.count
    }

    /// Quantile range per channel: the levels that exclude this share (0 to 0.5) of the pixels at either end. `None`
    /// for an empty sample.
    #[must_use]
    pub fn quantile_range(&self, share: f64) -> Option<ColorBox> {
        let skipped = (share.clamp(0.0, 0.5) * f64::from(self.count)) as u32;
        let mut colors = ColorBox { min: [0; 3], max: [0; 3] };
        for (i, channel) in self.channels.iter().enumerate() {
            colors.min[i] = first_level(channel.iter().enumerate(), skipped)?;
            colors.max[i] = first_level(channel.iter().enumerate().rev(), skipped)?;
        }
        Some(colors)
    }
}

/// First level after `skipped` pixels.
fn first_level<'a>(mut levels: impl Iterator<Item = (usize, &'a u32)>, skipped: u32) -> Option<u8> {
    let mut sum = 0;
    let found = levels.find(|(_, count)| {
        sum += **count;
        sum > skipped
    });
    found.map(|(level, _)| level as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outliers_are_left_out() {
        let mut sample = FloorSample::default();
        assert_eq!(sample.quantile_range(0.1), None);
        (0..100).for_each(|i| sample.add([i, 40, 255 - i]));
        assert_eq!(sample.quantile_range(0.0), Some(ColorBox { min: [0, 40, 156], max: [99, 40, 255] }));
        assert_eq!(sample.quantile_range(0.1), Some(ColorBox { min: [10, 40, 166], max: [89, 40, 245] }));
        sample.clear();
        assert_eq!(sample.count(), 0);
    }
}
