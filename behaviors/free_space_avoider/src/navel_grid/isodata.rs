//! Iterative mean threshold (ISODATA) of an 8-bit image: the level midway between the means of the two classes that it
//! separates.
//!
//! Ridler & Calvard (1978), as used by Abdelfatah et al.: start at the mean, split, move to the midpoint of both class
//! means, repeat until convergence.

use yamabico_vision::vectorize::{self, Kernel};

/// Minimum range of gray levels. An image with a smaller range has a single class.
pub const MIN_RANGE: u8 = 10;

/// Iteration limit, above the maximum number of iterations for 256 levels.
const MAX_ROUNDS: u32 = 256;

/// Threshold with the two classes that it separates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Threshold {
    /// Threshold, 0 to 255, not an integer in general. Pixels below are dark, others bright.
    pub level: f64,
    /// Number of iterations until convergence, at least 1.
    pub rounds: u32,
    /// Pixels below the threshold.
    pub dark: Class,
    /// Pixels at or above the threshold.
    pub bright: Class,
}

impl Threshold {
    /// Lowest gray level of the bright class, 1 to 255: a pixel is dark if it is smaller.
    #[must_use]
    pub fn first_bright(&self) -> u8 {
        // Both classes are nonempty: the level is above the lowest and at most the highest gray level.
        self.level.ceil() as u8
    }

    /// Difference between the means of the bright and the dark class, gray levels.
    #[must_use]
    pub fn contrast(&self) -> f64 {
        self.bright.mean() - self.dark.mean()
    }
}

/// One of the two classes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tone {
    /// Below the threshold.
    Dark,
    /// At or above the threshold.
    Bright,
}

/// Count and sum of the pixels of one class.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Class {
    /// Number of pixels.
    pub count: u64,
    /// Sum of their gray levels.
    pub sum: u64,
}

impl Class {
    /// Mean gray level; NaN for an empty class.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.sum as f64 / self.count as f64
    }

    fn without(self, other: Class) -> Class {
        Class { count: self.count - other.count, sum: self.sum - other.sum }
    }
}

/// Reason why there is no threshold.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum IsodataError {
    /// There are no pixels.
    #[error("there are no pixels")]
    Empty,
    /// The range of gray levels is below [`MIN_RANGE`].
    #[error("low contrast: all gray levels are near {mean:.1}")]
    LowContrast {
        /// Mean of all pixels.
        mean: f64,
    },
}

/// Computes the threshold of pixels in any order, in a few vectorized passes without a histogram.
///
/// # Errors
/// [`IsodataError`].
pub fn threshold_of_pixels(pixels: &[u8]) -> Result<Threshold, IsodataError> {
    let (all, range) = vectorize::run(Statistics(pixels));
    iterate(all, range, MAX_ROUNDS, |first_bright| dark_pixels(pixels, first_bright))
}

/// Computes the threshold within one class, ignoring the pixels of the other.
///
/// # Errors
/// [`IsodataError::LowContrast`] if the class has a single level.
pub fn threshold_of_class(
    pixels: &[u8],
    threshold: &Threshold,
    tone: Tone,
) -> Result<Threshold, IsodataError> {
    iterate_class(pixels, threshold, tone, MAX_ROUNDS)
}

/// Runs the first iteration of [`threshold_of_class`]: splits a class at its mean, in a single pass.
///
/// # Errors
/// [`IsodataError::LowContrast`] if the class has a single level.
pub fn halves_of_class(pixels: &[u8], threshold: &Threshold, tone: Tone) -> Result<Threshold, IsodataError> {
    iterate_class(pixels, threshold, tone, 1)
}

/// Computes the threshold from a histogram of gray levels.
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
    iterate(class(histogram), [lowest, highest], MAX_ROUNDS, |first_bright| {
        class(&histogram[..first_bright as usize])
    })
}

fn iterate_class(
    pixels: &[u8],
    threshold: &Threshold,
    tone: Tone,
    max_rounds: u32,
) -> Result<Threshold, IsodataError> {
    let (all, darker, range) = match tone {
        Tone::Dark => (threshold.dark, Class::default(), [0, threshold.first_bright() - 1]),
        Tone::Bright => (threshold.bright, threshold.dark, [threshold.first_bright(), u8::MAX]),
    };
    let dark_below = |first_bright| dark_pixels(pixels, first_bright).without(darker);
    if range[1] - range[0] < MIN_RANGE {
        return Err(IsodataError::LowContrast { mean: all.mean() });
    }
    iterate(all, range, max_rounds, dark_below)
}

/// Iterates for any source of class statistics; `dark_below` returns the pixels below a level.
fn iterate(
    all: Class,
    [lowest, highest]: [u8; 2],
    max_rounds: u32,
    dark_below: impl Fn(u8) -> Class,
) -> Result<Threshold, IsodataError> {
    if all.count == 0 {
        return Err(IsodataError::Empty);
    }
    let mean = all.mean();
    if highest - lowest < MIN_RANGE {
        return Err(IsodataError::LowContrast { mean });
    }
    // With two or more levels, the mean lies above the lowest and below the highest, and so does every midpoint of two
    // means.
    let mut threshold =
        Threshold { level: mean, rounds: 0, dark: Class::default(), bright: Class::default() };
    let mut split_at = None;
    while threshold.rounds < max_rounds {
        threshold.rounds += 1;
        let first_bright = threshold.first_bright();
        if split_at == Some(first_bright) {
            // The split is unchanged, and so is the midpoint of the means.
            break;
        }
        split_at = Some(first_bright);
        threshold.dark = dark_below(first_bright);
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

/// Pixels summed at a time in 16-bit vector lanes, which hold at most 255 values without overflow.
const LANES: usize = 64;
const BLOCK: usize = 255 * LANES;

/// Statistics of all pixels as one class, with the lowest and the highest level.
struct Statistics<'a>(&'a [u8]);

impl Kernel for Statistics<'_> {
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

/// Statistics of the pixels below a level. Saturating depths below the level give both: dark pixels are those with a
/// nonzero depth.
fn dark_pixels(pixels: &[u8], first_bright: u8) -> Class {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        #[allow(unsafe_code, reason = "guarded by the detection of AVX2")]
        return unsafe { dark_pixels_avx2(pixels, first_bright) };
    }
    dark_pixels_plain(pixels, first_bright)
}

fn dark_pixels_plain(pixels: &[u8], first_bright: u8) -> Class {
    let mut dark = Class::default();
    for block in pixels.chunks(BLOCK) {
        let (mut count, mut depths) = (0_u32, 0_u32);
        for &pixel in block {
            let depth = first_bright.saturating_sub(pixel);
            count += u32::from(depth != 0);
            depths += u32::from(depth);
        }
        dark.count += u64::from(count);
        dark.sum += u64::from(count * u32::from(first_bright) - depths);
    }
    dark
}

/// Three times as fast as the compiler's version of the loop above.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn dark_pixels_avx2(pixels: &[u8], first_bright: u8) -> Class {
    use std::arch::x86_64::{
        _mm256_add_epi64, _mm256_cmpeq_epi8, _mm256_sad_epu8, _mm256_set1_epi8, _mm256_setzero_si256,
        _mm256_sub_epi8, _mm256_subs_epu8,
    };
    let total = |sums| bytemuck::cast::<_, [u64; 4]>(sums).iter().sum::<u64>();
    let (level, zero) = (_mm256_set1_epi8(first_bright as i8), _mm256_setzero_si256());
    let (lanes, rest) = pixels.as_chunks::<32>();
    let (mut depths, mut bright) = (zero, zero);
    // At most as many as a byte can count.
    for block in lanes.chunks(255) {
        let mut counts = zero;
        for pixels in block {
            let depth = _mm256_subs_epu8(level, bytemuck::cast(*pixels));
            depths = _mm256_add_epi64(depths, _mm256_sad_epu8(depth, zero));
            counts = _mm256_sub_epi8(counts, _mm256_cmpeq_epi8(depth, zero));
        }
        bright = _mm256_add_epi64(bright, _mm256_sad_epu8(counts, zero));
    }
    let count = 32 * lanes.len() as u64 - total(bright);
    let rest = dark_pixels_plain(rest, first_bright);
    Class { count: count + rest.count, sum: count * u64::from(first_bright) - total(depths) + rest.sum }
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
                for first_bright in [1, 100, 128, 255] {
                    let plain = dark_pixels_plain(&pixels, first_bright);
                    assert_eq!(dark_pixels(&pixels, first_bright), plain, "{length}, {first_bright}");
                }
                assert_eq!(Statistics(&pixels).run(), vectorize::run(Statistics(&pixels)), "{length}");
            }
        }
    }

    #[test]
    fn a_class_is_thresholded_as_if_alone() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(6);
        for highest in [30, 200, 255] {
            let pixels: Vec<u8> = (0..5000).map(|_| random.random_range(0..=highest)).collect();
            let threshold = threshold_of_pixels(&pixels).unwrap();
            for tone in [Tone::Dark, Tone::Bright] {
                let is_in = |&pixel: &u8| (pixel < threshold.first_bright()) == (tone == Tone::Dark);
                let alone: Vec<u8> = pixels.iter().copied().filter(is_in).collect();
                let of_class = threshold_of_class(&pixels, &threshold, tone).unwrap();
                assert_eq!(Ok(of_class), threshold_of_pixels(&alone));
                let halves = halves_of_class(&pixels, &threshold, tone).unwrap();
                assert_eq!(halves.dark.sum + halves.bright.sum, of_class.dark.sum + of_class.bright.sum);
                let mean = alone.iter().map(|&pixel| f64::from(pixel)).sum::<f64>() / alone.len() as f64;
                assert!(halves.dark.mean() < mean && halves.bright.mean() >= mean);
            }
        }
        let pixels = [20, 20, 200, 200];
        let threshold = threshold_of_pixels(&pixels).unwrap();
        let low_contrast = Err(IsodataError::LowContrast { mean: 200.0 });
        assert_eq!(threshold_of_class(&pixels, &threshold, Tone::Bright), low_contrast);
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
    fn empty_and_uniform_images_are_rejected() {
        assert_eq!(threshold_of_pixels(&[]), Err(IsodataError::Empty));
        assert_eq!(threshold_of_histogram(&[0; 256]), Err(IsodataError::Empty));
        for tone in [0, 255] {
            let mean = f64::from(tone);
            assert_eq!(threshold_of_pixels(&[tone; 400]), Err(IsodataError::LowContrast { mean }));
        }
    }
}
