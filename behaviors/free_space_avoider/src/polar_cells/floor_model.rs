//! Colors of the floor: learned in advance, or taken in front of the robot at the start and tracked.

use std::f64::consts::FRAC_PI_3;

use nalgebra::Vector2;
use yamabico_core::camera::MirrorImage;
use yamabico_core::image::RgbView;
use yamabico_vision::floor_color::{ColorBox, FloorColors};
use yamabico_vision::floor_sample::FloorSample;

/// Maximum spread of the colors of a floor patch, levels.
const MAX_SPREAD: u8 = 80;
/// Share of outliers among the pixels of a patch, at either end of each channel.
const OUTLIERS: f64 = 0.05;
/// Level up to which all channels of a patch are too dark for a color.
const DARK: u8 = 24;
/// Level from which on all channels of a patch are overexposed.
const GLARE: u8 = 250;
/// Maximum change of the color limits per frame, levels.
const STEP: u8 = 1;
/// Maximum growth of the spread since the start, levels.
const MAX_GROWTH: u8 = 24;
/// Interval between sampled pixels when the floor is tracked.
const SAMPLE_INTERVAL: usize = 3;

/// Model of the floor's colors.
#[derive(Clone, Debug)]
pub struct FloorModel {
    colors: Option<FloorColors>,
    seed: Option<Seed>,
    /// Pixels of the innermost ring, (u, v); those ahead come first.
    ring: Vec<(u16, u16)>,
    /// Number of pixels ahead.
    ahead: usize,
    sample: FloorSample,
}

/// Rules for colors taken from the floor around the robot.
#[derive(Clone, Copy, Debug)]
struct Seed {
    tolerance: u8,
    max_spread: u8,
}

impl FloorModel {
    /// Creates a model of learned colors, which do not change.
    #[must_use]
    pub fn learned(colors: FloorColors) -> Self {
        Self { colors: Some(colors), seed: None, ring: Vec::new(), ahead: 0, sample: FloorSample::default() }
    }

    /// Creates a model without colors. They are taken from the ring between two radii (pixels of the mirror plane),
    /// within 60 degrees of straight ahead, and widened by `tolerance` levels.
    #[must_use]
    pub fn seeded(image: &MirrorImage, from_px: f64, to_px: f64, tolerance: u8) -> Self {
        let mut ring = Vec::new();
        let mut beside = Vec::new();
        for v in 0..image.height.min(u32::from(u16::MAX)) {
            for u in 0..image.width.min(u32::from(u16::MAX)) {
                let point = image.mirror_from_pixel(Vector2::new(f64::from(u), f64::from(v)));
                if (from_px..to_px).contains(&point.norm()) {
                    let is_ahead = point.y.atan2(point.x).abs() <= FRAC_PI_3;
                    if is_ahead { &mut ring } else { &mut beside }.push((u as u16, v as u16));
                }
            }
        }
        let ahead = ring.len();
        ring.append(&mut beside);
        let seed = Some(Seed { tolerance, max_spread: 0 });
        Self { colors: None, seed, ring, ahead, sample: FloorSample::default() }
    }

    /// Returns the colors; `None` before they were taken.
    #[must_use]
    pub fn colors(&self) -> Option<&FloorColors> {
        self.colors.as_ref()
    }

    /// Takes the colors in front of the robot, if there are none yet. Returns true if there are colors; a patch that is
    /// dark, overexposed or of several colors gives none.
    pub fn begin(&mut self, image: RgbView) -> bool {
        if self.colors.is_none() {
            let patch = self.ring.get(..self.ahead).unwrap_or(&[]);
            self.colors = take(&mut self.sample, patch, image, &mut self.seed);
        }
        self.colors.is_some()
    }

    /// Takes the colors all around the robot again, as after a change of the light, if the whole ring is of one color:
    /// with an obstacle it is not. Learned colors stay. Returns true if the colors were replaced.
    pub fn begin_again(&mut self, image: RgbView) -> bool {
        let taken = take(&mut self.sample, &self.ring, image, &mut self.seed);
        let is_new = taken.is_some();
        self.colors = taken.or(self.colors.take());
        is_new
    }

    /// Tracks slow changes of the light: moves the limits toward the floor colors in the innermost ring.
    pub fn follow(&mut self, image: RgbView) {
        let (Some(seed), Some(FloorColors::Box(colors))) = (&self.seed, &mut self.colors) else { return };
        self.sample.clear();
        for &(u, v) in self.ring.iter().step_by(SAMPLE_INTERVAL) {
            let color = image.pixel(usize::from(u), usize::from(v));
            if colors.contains(color) {
                self.sample.add(color);
            }
        }
        if let Some(seen) = self.sample.quantile_range(OUTLIERS) {
            let moved = colors.towards(&seen.widened(seed.tolerance), STEP);
            if moved.spread() <= seed.max_spread {
                *colors = moved;
            }
        }
    }
}

/// Takes the colors of a patch; `None` if it is dark, overexposed or of several colors.
fn take(
    sample: &mut FloorSample,
    patch: &[(u16, u16)],
    image: RgbView,
    seed: &mut Option<Seed>,
) -> Option<FloorColors> {
    let seed = seed.as_mut()?;
    sample.clear();
    patch.iter().for_each(|&(u, v)| sample.add(image.pixel(usize::from(u), usize::from(v))));
    let seen: ColorBox = sample.quantile_range(OUTLIERS)?;
    let is_dark = seen.max.iter().all(|&level| level <= DARK);
    let is_glare = seen.min.iter().all(|&level| level >= GLARE);
    if seen.spread() > MAX_SPREAD || is_dark || is_glare {
        return None;
    }
    let colors = seen.widened(seed.tolerance);
    seed.max_spread = colors.spread().saturating_add(MAX_GROWTH);
    Some(FloorColors::Box(colors))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: usize = 100;

    fn image(color_at: impl Fn(usize, usize) -> [u8; 3]) -> Vec<u8> {
        (0..SIZE * SIZE).flat_map(|i| color_at(i % SIZE, i / SIZE)).collect()
    }

    fn view(data: &[u8]) -> RgbView<'_> {
        RgbView::new(data, SIZE, SIZE, 3 * SIZE).unwrap()
    }

    fn model() -> FloorModel {
        FloorModel::seeded(&MirrorImage::centered(SIZE as u32, SIZE as u32), 20.0, 30.0, 20)
    }

    fn has(model: &FloorModel, color: [u8; 3]) -> bool {
        model.colors().is_some_and(|colors| colors.contains(color))
    }

    #[test]
    fn a_patch_ahead_is_floor_unless_dark_or_overexposed_or_of_several_colors() {
        let mut model = model();
        for color in [[5, 9, 3], [255, 255, 252]] {
            assert!(!model.begin(view(&image(|_, _| color))));
        }
        assert!(!model.begin(view(&image(|u, _| if u % 2 == 0 { [200, 30, 30] } else { [40, 180, 60] }))));
        // Green ahead (image up), blue behind.
        let half = image(|_, v| if v < SIZE / 2 { [40, 140, 50] } else { [20, 30, 160] });
        assert!(model.begin(view(&half)));
        assert!(has(&model, [55, 125, 60]) && !has(&model, [20, 30, 160]));
        assert!(!model.begin_again(view(&half)), "all around there are two colors");
        assert!(model.begin_again(view(&image(|_, _| [150, 150, 120]))));
        assert!(has(&model, [150, 150, 120]) && !has(&model, [40, 140, 50]));
    }

    #[test]
    fn slow_changes_are_tracked_and_the_colors_do_not_spread() {
        let mut model = model();
        assert!(model.begin(view(&image(|_, _| [60, 140, 60]))));
        for step in 0..60 {
            let level = 140 + step;
            model.follow(view(&image(|_, _| [60, level, 60])));
            assert!(has(&model, [60, level, 60]), "{level}");
        }
        assert!(!has(&model, [60, 140, 60]));
        model.follow(view(&image(|_, _| [60, 60, 160])));
        assert!(!has(&model, [60, 60, 160]), "a sudden change is not tracked");
        let mut learned = FloorModel::learned(model.colors().cloned().unwrap());
        assert!(learned.begin(view(&image(|_, _| [9, 9, 9]))) && !learned.begin_again(view(&half_gray())));
    }

    fn half_gray() -> Vec<u8> {
        image(|_, _| [128, 128, 128])
    }
}
