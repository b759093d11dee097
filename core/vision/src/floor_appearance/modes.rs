//! Gaussian modes of the features of blocks.

use super::features::Feature;

/// Iterations of the assignment of samples to modes.
const ITERATIONS: usize = 6;
/// Upper limit of the number of modes.
const MAX_MODES: usize = 8;
/// Squared Mahalanobis distance from all modes above which a sample begins a mode of its own.
const NEW_MODE: f32 = 4.0;
/// Number of samples that the minimum deviation counts for in the deviation of a mode.
const PRIOR_SAMPLES: f32 = 3.0;
/// Scale of the features within one surface.
const SCALE: Feature = [0.004, 0.004, 0.05, 0.25];
/// Extent of the features of all surfaces: chromaticities, log intensity, log gradient.
const EXTENT: Feature = [0.15, 0.15, 2.0, 3.0];
/// Square root of 2 pi.
const ROOT_TWO_PI: f32 = 2.506_628_3;

/// One Gaussian mode with independent features.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mode {
    /// Mean.
    pub mean: Feature,
    /// Standard deviation, positive.
    pub deviation: Feature,
    /// Share of the samples, or their number in a learned look.
    pub mass: f32,
}

impl Mode {
    /// Returns the squared Mahalanobis distance of a feature; chromaticities count for color images only.
    #[inline]
    #[must_use]
    pub fn distance_squared(&self, feature: &Feature, is_color: bool) -> f32 {
        distance_squared(feature, &self.mean, &reciprocal(&self.deviation, is_color))
    }
}

/// Kind of surfaces that modes describe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surfaces {
    /// Maximum number of modes, 1 to 8.
    pub max_modes: usize,
    /// Minimum deviation of a mode.
    pub min_deviation: Feature,
    /// Share of samples that no mode describes, 0 to 1.
    pub outliers: f32,
}

impl Surfaces {
    /// Floor: few materials, in light that varies along the floor.
    pub const FLOOR: Self = Self { max_modes: 4, min_deviation: [0.006, 0.006, 0.15, 0.25], outliers: 0.01 };
    /// Everything else: more materials, and objects never seen before.
    pub const OTHER: Self = Self { max_modes: 8, min_deviation: SCALE, outliers: 0.4 };
}

/// A mixture of modes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Modes {
    modes: Vec<Mode>,
    /// Per mode: reciprocal deviations; 0 for features that do not count.
    precisions: Vec<Feature>,
    /// Per mode: log of mass over normalization.
    log_peaks: Vec<f32>,
    /// Per sample: nearest mode, and squared distance from it.
    nearest: Vec<u8>,
    distances: Vec<f32>,
}

impl Modes {
    /// Fits modes to samples, beginning with their mean and then with the samples farthest from all modes.
    pub fn fit(&mut self, samples: &[Feature], surfaces: &Surfaces, is_color: bool) {
        self.modes.clear();
        if !samples.is_empty() {
            let (mean, variance, _) = moments(samples.iter());
            let scale = std::array::from_fn(|i| variance[i].sqrt().max(SCALE[i]));
            self.begin(samples, mean, scale, surfaces, is_color);
            for _ in 0..ITERATIONS {
                self.assign(samples);
                self.recenter(samples);
            }
            self.assign(samples);
            self.spread(samples, surfaces);
        }
        self.normalize(is_color);
    }

    /// Removes all modes, and reserves memory for this number of samples.
    pub fn reserve(&mut self, samples: usize) {
        let Self { modes, precisions, log_peaks, nearest, distances } = self;
        modes.clear();
        precisions.clear();
        log_peaks.clear();
        nearest.clear();
        distances.clear();
        modes.reserve(2 * MAX_MODES);
        precisions.reserve(2 * MAX_MODES);
        log_peaks.reserve(2 * MAX_MODES);
        nearest.reserve(samples);
        distances.reserve(samples);
    }

    /// Adds modes of another origin; both origins then have half of the mass.
    pub fn join(&mut self, modes: &[Mode], is_color: bool) {
        let sum: f32 = modes.iter().map(|mode| mode.mass).sum();
        let share = if self.modes.is_empty() { 1.0 } else { 0.5 };
        self.modes.iter_mut().for_each(|mode| mode.mass *= share);
        let scale = share / sum.max(f32::MIN_POSITIVE);
        self.modes.extend(modes.iter().map(|mode| Mode { mass: mode.mass * scale, ..*mode }));
        self.normalize(is_color);
    }

    /// The modes.
    #[must_use]
    pub fn modes(&self) -> &[Mode] {
        &self.modes
    }

    /// Returns the log density of a feature: the highest mode's, or that of the outliers.
    #[inline]
    #[must_use]
    pub fn log_density(&self, feature: &Feature, surfaces: &Surfaces, is_color: bool) -> f32 {
        let first = if is_color { 0 } else { 2 };
        let everywhere: f32 = -EXTENT[first..].iter().map(|extent| extent.ln()).sum::<f32>();
        let Some(highest) = self
            .modes
            .iter()
            .zip(&self.precisions)
            .zip(&self.log_peaks)
            .map(|((mode, precision), peak)| peak - 0.5 * distance_squared(feature, &mode.mean, precision))
            .reduce(f32::max)
        else {
            return everywhere;
        };
        let (a, b) = ((1.0 - surfaces.outliers).ln() + highest, surfaces.outliers.ln() + everywhere);
        a.max(b) + (-(a - b).abs()).exp().ln_1p()
    }

    /// Sets the initial centers.
    fn begin(
        &mut self,
        samples: &[Feature],
        mean: Feature,
        scale: Feature,
        surfaces: &Surfaces,
        is_color: bool,
    ) {
        let precision = reciprocal(&scale, is_color);
        self.precisions.clear();
        self.distances.clear();
        self.distances.resize(samples.len(), f32::INFINITY);
        let mut next = mean;
        while self.modes.len() < surfaces.max_modes.min(MAX_MODES) {
            self.modes.push(Mode { mean: next, deviation: scale, mass: 0.0 });
            self.precisions.push(precision);
            for (nearest, sample) in self.distances.iter_mut().zip(samples) {
                *nearest = nearest.min(distance_squared(sample, &next, &precision));
            }
            let farthest = self.distances.iter().zip(samples).max_by(|a, b| a.0.total_cmp(b.0));
            match farthest {
                Some((&distance, sample)) if distance >= NEW_MODE => next = *sample,
                _ => break,
            }
        }
    }

    fn assign(&mut self, samples: &[Feature]) {
        self.nearest.clear();
        self.nearest.resize(samples.len(), 0);
        self.distances.fill(f32::INFINITY);
        for (index, (mode, precision)) in self.modes.iter().zip(&self.precisions).enumerate() {
            let nearest = self.nearest.iter_mut().zip(&mut self.distances);
            for ((nearest, least), sample) in nearest.zip(samples) {
                let distance = distance_squared(sample, &mode.mean, precision);
                *nearest = if distance < *least { index as u8 } else { *nearest };
                *least = least.min(distance);
            }
        }
    }

    fn recenter(&mut self, samples: &[Feature]) {
        let mut sums = [([0.0; 4], 0.0_f32); MAX_MODES];
        for (sample, &nearest) in samples.iter().zip(&self.nearest) {
            let (sum, count) = &mut sums[usize::from(nearest) % MAX_MODES];
            (0..4).for_each(|i| sum[i] += sample[i]);
            *count += 1.0;
        }
        for (mode, (sum, count)) in self.modes.iter_mut().zip(sums) {
            if count > 0.0 {
                mode.mean = sum.map(|sum| sum / count);
            }
        }
    }

    fn spread(&mut self, samples: &[Feature], surfaces: &Surfaces) {
        let Self { modes, nearest, .. } = self;
        for (index, mode) in modes.iter_mut().enumerate() {
            let own =
                samples.iter().zip(nearest.iter()).filter(|(_, nearest)| usize::from(**nearest) == index);
            let (mean, variance, count) = moments(own.map(|(sample, _)| sample));
            mode.mass = count / samples.len() as f32;
            if count > 0.0 {
                mode.mean = mean;
                mode.deviation = std::array::from_fn(|i| {
                    let least = surfaces.min_deviation[i].powi(2);
                    let blended = (variance[i] * count + PRIOR_SAMPLES * least) / (count + PRIOR_SAMPLES);
                    (blended + least).sqrt()
                });
            }
        }
        modes.retain(|mode| mode.mass > 0.0);
    }

    fn normalize(&mut self, is_color: bool) {
        let first = if is_color { 0 } else { 2 };
        self.precisions.clear();
        self.precisions.extend(self.modes.iter().map(|mode| reciprocal(&mode.deviation, is_color)));
        self.log_peaks.clear();
        self.log_peaks.extend(self.modes.iter().map(|mode| {
            let width: f32 =
                mode.deviation[first..].iter().map(|deviation| (ROOT_TWO_PI * deviation).ln()).sum();
            mode.mass.ln() - width
        }));
    }
}

/// Returns the reciprocals of deviations; 0 for chromaticities of gray images.
fn reciprocal(deviation: &Feature, is_color: bool) -> Feature {
    std::array::from_fn(|i| if is_color || i >= 2 { 1.0 / deviation[i] } else { 0.0 })
}

#[inline(always)]
fn distance_squared(feature: &Feature, mean: &Feature, precision: &Feature) -> f32 {
    let scaled: Feature = std::array::from_fn(|i| (feature[i] - mean[i]) * precision[i]);
    (scaled[0] * scaled[0] + scaled[1] * scaled[1]) + (scaled[2] * scaled[2] + scaled[3] * scaled[3])
}

/// Returns mean, variance and number of samples; zeros without any.
fn moments<'a>(samples: impl Iterator<Item = &'a Feature> + Clone) -> (Feature, Feature, f32) {
    let (mut mean, mut variance, mut count) = ([0.0; 4], [0.0; 4], 0.0_f32);
    for sample in samples.clone() {
        (0..4).for_each(|i| mean[i] += sample[i]);
        count += 1.0;
    }
    mean = mean.map(|sum| sum / count.max(1.0));
    for sample in samples {
        (0..4).for_each(|i| variance[i] += (sample[i] - mean[i]).powi(2));
    }
    (mean, variance.map(|sum| sum / count.max(1.0)), count)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two_tones() -> Vec<Feature> {
        let near = |center: f32, i: usize| [0.33, 0.33, center + 0.01 * (i % 3) as f32, -3.0];
        (0..30).map(|i| near(if i % 10 == 0 { 5.0 } else { 4.0 }, i / 10)).collect()
    }

    #[test]
    fn two_tones_are_two_modes() {
        let mut modes = Modes::default();
        modes.fit(&two_tones(), &Surfaces::FLOOR, true);
        let dominant = modes.modes().iter().max_by(|a, b| a.mass.total_cmp(&b.mass)).unwrap();
        assert!((dominant.mean[2] - 4.01).abs() < 0.01 && (dominant.mass - 0.9).abs() < 1e-6, "{dominant:?}");
        let density = |intensity| modes.log_density(&[0.33, 0.33, intensity, -3.0], &Surfaces::FLOOR, true);
        assert!(density(4.0) > density(4.5) && density(5.0) > density(4.5), "between the tones is no tone");
        assert!(density(9.0) < density(4.5) && density(9.0).is_finite());
    }

    #[test]
    fn without_samples_everything_is_equally_likely() {
        let mut modes = Modes::default();
        modes.fit(&[], &Surfaces::OTHER, true);
        let density = |feature| modes.log_density(&feature, &Surfaces::OTHER, true);
        assert_eq!(density([0.1; 4]), density([0.4, 0.3, 5.0, -2.0]));
    }

    #[test]
    fn gray_ignores_chromaticity() {
        let mut modes = Modes::default();
        modes.fit(&two_tones(), &Surfaces::FLOOR, false);
        let density = |red| modes.log_density(&[red, 0.3, 4.0, -3.0], &Surfaces::FLOOR, false);
        assert_eq!(density(0.2), density(0.6));
    }
}
