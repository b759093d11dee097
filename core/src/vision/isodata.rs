//! Iterative mean threshold ("isodata") of an 8-bit image: the level half-way between the means of what it separates.
//!
//! Ridler & Calvard (1978), as Abdelfatah et al. use it: start at the mean, split, take the middle of both means, repeat
//! until nothing changes.

use std::ops::RangeInclusive;

use super::vectorise::{self, Kernel};

/// An image whose grey levels span less than this has no two classes.
pub const LEAST_RANGE: u8 = 10;

/// More rounds than any histogram of 256 levels can take.
const MOST_ROUNDS: u32 = 256;

/// A level and the two classes that it separates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Threshold {
    /// Pixels below are dark, the others bright; 0 to 255, between two grey levels as a rule.
    pub level: f64,
    /// Rounds until the level stayed, at least 1.
    pub rounds: u32,
    /// What is below the level.
    pub dark: Class,
    /// What is not.
    pub bright: Class,
}

impl Threshold {
    /// The lowest grey level that is bright: a pixel is dark if it is smaller. 1 to 255.
    #[must_use]
    pub fn first_bright(&self) -> u8 {
        // A class on either side: the level lies above the lowest and not above the highest grey level.
        self.level.ceil() as u8
    }

    /// Bright mean less dark mean, grey levels.
    #[must_use]
    pub fn contrast(&self) -> f64 {
        self.bright.mean() - self.dark.mean()
    }
}

/// Pixels of one class.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Class {
    /// How many.
    pub count: u64,
    /// Sum of their grey levels.
    pub sum: u64,
}

impl Class {
    /// Mean grey level; NaN of an empty class.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.sum as f64 / self.count as f64
    }

    fn without(self, other: Class) -> Class {
        Class { count: self.count - other.count, sum: self.sum - other.sum }
    }
}

/// Why there is no threshold.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum IsodataError {
    /// No pixel at all.
    #[error("there are no pixels")]
    Empty,
    /// Darkest and brightest pixel are nearer than [`LEAST_RANGE`].
    #[error("low contrast: all grey levels are near {mean:.1}")]
    LowContrast {
        /// Mean of all pixels.
        mean: f64,
    },
}

/// The threshold of some pixels, in no order: a few vectorised passes over them, no histogram.
///
/// # Errors
/// [`IsodataError`].
pub fn threshold_of_pixels(pixels: &[u8]) -> Result<Threshold, IsodataError> {
    let (all, range) = vectorise::run(Survey(pixels));
    iterate(all, range, |first_bright| vectorise::run(DarkPixels { pixels, first_bright }))
}

/// The threshold of those pixels alone whose grey level is in `levels`.
///
/// # Errors
/// [`IsodataError`]; `LowContrast` where they all have one level.
pub fn threshold_within(pixels: &[u8], levels: RangeInclusive<u8>) -> Result<Threshold, IsodataError> {
    let dark_below = |first_bright| vectorise::run(DarkPixels { pixels, first_bright });
    let darker = dark_below(*levels.start());
    let up_to_end = match levels.end().checked_add(1) {
        Some(above) => dark_below(above),
        None => vectorise::run(Survey(pixels)).0,
    };
    if levels.is_empty() {
        return Err(IsodataError::Empty);
    }
    let range = [*levels.start(), *levels.end()];
    iterate(up_to_end.without(darker), range, |first_bright| dark_below(first_bright).without(darker))
}

/// The threshold of the pixels that a histogram counts.
///
/// # Errors
/// [`IsodataError`].
pub fn threshold_of_histogram(histogram: &[u64; 256]) -> Result<Threshold, IsodataError> {
    let class = |levels: &[u64]| Class {
        count: levels.iter().sum(),
        sum: (0..).zip(levels).map(|(level, count)| level * count).sum(),
    };
    let lowest = histogram.iter().position(|&count| count > 0).unwrap_or(0) as u8;
    let highest = histogram.iter().rposition(|&count| count > 0).unwrap_or(0) as u8;
    iterate(class(histogram), [lowest, highest], |first_bright| class(&histogram[..first_bright as usize]))
}

/// The rule, on whatever tells the pixels below a level.
fn iterate(
    all: Class,
    [lowest, highest]: [u8; 2],
    dark_below: impl Fn(u8) -> Class,
) -> Result<Threshold, IsodataError> {
    if all.count == 0 {
        return Err(IsodataError::Empty);
    }
    let mean = all.mean();
    if highest - lowest < LEAST_RANGE {
        return Err(IsodataError::LowContrast { mean });
    }
    // With two levels or more, the mean lies above the lowest and below the highest, and so does every middle of two means.
    let mut threshold =
        Threshold { level: mean, rounds: 0, dark: Class::default(), bright: Class::default() };
    while threshold.rounds < MOST_ROUNDS {
        threshold.rounds += 1;
        threshold.dark = dark_below(threshold.first_bright());
        threshold.bright = all.without(threshold.dark);
        if threshold.dark.count == 0 || threshold.bright.count == 0 {
            return Err(IsodataError::LowContrast { mean });
        }
        let middle = (threshold.dark.mean() + threshold.bright.mean()) / 2.0;
        if middle == threshold.level {
            break;
        }
        threshold.level = middle;
    }
    Ok(threshold)
}

/// Pixels summed up in vector lanes at a time: 128 of 255 still fit 16 bits.
const LANES: usize = 32;
const BLOCK: usize = 128 * LANES;

/// All pixels as one class, the lowest and the highest level.
struct Survey<'a>(&'a [u8]);

impl Kernel for Survey<'_> {
    type Output = (Class, [u8; 2]);

    #[inline(always)]
    fn run(self) -> Self::Output {
        let (mut sum, mut lows, mut highs) = (0, [255; LANES], [0; LANES]);
        for block in self.0.chunks(BLOCK) {
            let mut sums = [0_u16; LANES];
            let (lanes, rest) = block.as_chunks::<LANES>();
            for pixels in lanes {
                for i in 0..LANES {
                    sums[i] += u16::from(pixels[i]);
                    lows[i] = pixels[i].min(lows[i]);
                    highs[i] = pixels[i].max(highs[i]);
                }
            }
            for &pixel in rest {
                lows[0] = pixel.min(lows[0]);
                highs[0] = pixel.max(highs[0]);
                sum += u64::from(pixel);
            }
            sum += sums.iter().map(|&sum| u64::from(sum)).sum::<u64>();
        }
        let lowest = lows.iter().fold(255, |low, &next| next.min(low));
        let highest = highs.iter().fold(0, |high, &next| next.max(high));
        (Class { count: self.0.len() as u64, sum }, [lowest, highest])
    }
}

/// The pixels below a level.
struct DarkPixels<'a> {
    pixels: &'a [u8],
    first_bright: u8,
}

impl Kernel for DarkPixels<'_> {
    type Output = Class;

    #[inline(always)]
    fn run(self) -> Class {
        let mut dark = Class::default();
        for block in self.pixels.chunks(BLOCK) {
            let (mut counts, mut sums) = ([0_u8; LANES], [0_u16; LANES]);
            let (lanes, rest) = block.as_chunks::<LANES>();
            for pixels in lanes {
                for i in 0..LANES {
                    let is_dark = u8::from(pixels[i] < self.first_bright);
                    counts[i] += is_dark;
                    sums[i] += u16::from(pixels[i] & is_dark.wrapping_neg());
                }
            }
            for &pixel in rest.iter().filter(|&&pixel| pixel < self.first_bright) {
                dark.count += 1;
                dark.sum += u64::from(pixel);
            }
            dark.count += counts.iter().map(|&count| u64::from(count)).sum::<u64>();
            dark.sum += sums.iter().map(|&sum| u64::from(sum)).sum::<u64>();
        }
        dark
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    fn histogram(pixels: &[u8]) -> [u64; 256] {
        let mut histogram = [0; 256];
        pixels.iter().for_each(|&pixel| histogram[pixel as usize] += 1);
        histogram
    }

    #[test]
    fn pixels_and_their_histogram_give_the_same_to_the_bit() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(4);
        for length in [1, 2, 31, 33, 4096, 4097, 61_200] {
            for (low, high) in [(0, 255), (100, 140), (0, 12), (243, 255), (7, 8)] {
                let pixels: Vec<u8> = (0..length).map(|_| random.random_range(low..=high)).collect();
                let from_pixels = threshold_of_pixels(&pixels);
                assert_eq!(from_pixels, threshold_of_histogram(&histogram(&pixels)));
                let base = DarkPixels { pixels: &pixels, first_bright: 128 }.run();
                assert_eq!(base, vectorise::run(DarkPixels { pixels: &pixels, first_bright: 128 }));
                assert_eq!(Survey(&pixels).run(), vectorise::run(Survey(&pixels)), "{length}");
            }
        }
    }

    #[test]
    fn a_part_of_the_levels_is_thresholded_as_if_alone() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(6);
        let pixels: Vec<u8> = (0..5000).map(|_| random.random()).collect();
        for levels in [0..=255, 100..=255, 0..=99, 40..=200] {
            let alone: Vec<u8> = pixels.iter().copied().filter(|pixel| levels.contains(pixel)).collect();
            assert_eq!(threshold_within(&pixels, levels), threshold_of_pixels(&alone));
        }
        let low_contrast = Err(IsodataError::LowContrast { mean: 77.0 });
        assert_eq!(threshold_within(&[5, 77, 77, 200], 50..=100), low_contrast);
        assert_eq!(threshold_within(&[5, 77], 100..=255), Err(IsodataError::Empty));
    }

    #[test]
    fn the_brightest_image_does_not_overflow() {
        let mut pixels = vec![255; 100_000];
        pixels[77] = 0;
        let threshold = threshold_of_pixels(&pixels).unwrap();
        assert_eq!((threshold.level, threshold.dark.count), (127.5, 1));
        assert_eq!(threshold.bright.sum, 255 * 99_999);
    }

    #[test]
    fn nothing_and_one_tone_have_no_threshold() {
        assert_eq!(threshold_of_pixels(&[]), Err(IsodataError::Empty));
        assert_eq!(threshold_of_histogram(&[0; 256]), Err(IsodataError::Empty));
        for tone in [0, 255] {
            let mean = f64::from(tone);
            assert_eq!(threshold_of_pixels(&[tone; 400]), Err(IsodataError::LowContrast { mean }));
        }
    }
}
