//! Which colors are floor now: learned before, or seen before the robot at the start and followed with care.

use std::f64::consts::FRAC_PI_3;

use nalgebra::Vector2;
use yamabico_core::camera::MirrorImage;
use yamabico_core::image::RgbView;
use yamabico_vision::floor_color::{ColorBox, FloorColors};
use yamabico_vision::floor_sample::FloorSample;

/// A patch whose colors spread by more (levels) is not of one floor.
const MAX_SPREAD: u8 = 80;
/// This share of the pixels of a patch may have any color, at either end.
const OUTLIERS: f64 = 0.05;
/// A patch with no channel above this is dark, and shows nothing.
const DARK: u8 = 24;
/// A patch with all channels above this is overexposed, and shows nothing.
const GLARE: u8 = 250;
/// The colors follow the floor by so many levels a frame ...
const STEP: u8 = 1;
/// ... and never spread by more than so many levels beyond what they did at the start.
const MAX_GROWTH: u8 = 24;
/// One pixel of so many is looked at to follow the floor.
const EVERY: usize = 3;

/// The floor's colors.
#[derive(Clone, Debug)]
pub struct FloorModel {
    colors: Option<FloorColors>,
    seed: Option<Seed>,
    /// Pixels of the innermost ring, (u, v), those ahead first.
    ring: Vec<(u16, u16)>,
    ahead: usize,
    sample: FloorSample,
}

/// How colors are taken from the floor around the robot.
#[derive(Clone, Copy, Debug)]
struct Seed {
    tolerance: u8,
    max_spread: u8,
}

impl FloorModel {
    /// Colors that were learned and do not change.
    #[must_use]
    pub fn learned(colors: FloorColors) -> Self {
        Self { colors: Some(colors), seed: None, ring: Vec::new(), ahead: 0, sample: FloorSample::default() }
    }

    /// Colors to be seen in the ring between two radii (pixels of the mirror plane), within 60 degrees of ahead, give or take
    /// so many levels.
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

    /// The colors; `None` before the floor was seen.
    #[must_use]
    pub fn colors(&self) -> Option<&FloorColors> {
        self.colors.as_ref()
    }

    /// Takes the colors before the robot for floor, where it has none yet. Tells whether it has any then: not where that
    /// is dark, overexposed or of more than one color.
    pub fn begin(&mut self, picture: RgbView) -> bool {
        if self.colors.is_none() {
            let patch = self.ring.get(..self.ahead).unwrap_or(&[]);
            self.colors = take(&mut self.sample, patch, picture, &mut self.seed);
        }
        self.colors.is_some()
    }

    /// Takes the colors all around for floor, where all around is of one color: an obstacle is not, a lamp of another
    /// color makes it so. Learned colors stay. Tells whether it did.
    pub fn begin_again(&mut self, picture: RgbView) -> bool {
        let taken = take(&mut self.sample, &self.ring, picture, &mut self.seed);
        let is_new = taken.is_some();
        self.colors = taken.or(self.colors.take());
        is_new
    }

    /// Follows slow changes of the light: moves the thresholds towards the colors that are floor in the innermost ring.
    pub fn follow(&mut self, picture: RgbView) {
        let (Some(seed), Some(FloorColors::Box(colors))) = (&self.seed, &mut self.colors) else { return };
        self.sample.clear();
        for &(u, v) in self.ring.iter().step_by(EVERY) {
            let color = picture.pixel(usize::from(u), usize::from(v));
            if colors.contains(color) {
                self.sample.add(color);
            }
        }
        if let Some(seen) = self.sample.middle(OUTLIERS) {
            let moved = colors.towards(&seen.widened(seed.tolerance), STEP);
            if moved.spread() <= seed.max_spread {
                *colors = moved;
            }
        }
    }
}

/// The colors of a patch.
fn take(
    sample: &mut FloorSample,
    patch: &[(u16, u16)],
    picture: RgbView,
    seed: &mut Option<Seed>,
) -> Option<FloorColors> {
    let seed = seed.as_mut()?;
    sample.clear();
    patch.iter().for_each(|&(u, v)| sample.add(picture.pixel(usize::from(u), usize::from(v))));
    let seen: ColorBox = sample.middle(OUTLIERS)?;
    let is_dark = seen.most.iter().all(|&level| level <= DARK);
    let is_glare = seen.least.iter().all(|&level| level >= GLARE);
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

    fn picture(color_at: impl Fn(usize, usize) -> [u8; 3]) -> Vec<u8> {
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
    fn what_lies_ahead_is_floor_unless_it_shows_nothing() {
        let mut model = model();
        for color in [[5, 9, 3], [255, 255, 252]] {
            assert!(!model.begin(view(&picture(|_, _| color))));
        }
        assert!(!model.begin(view(&picture(|u, _| if u % 2 == 0 { [200, 30, 30] } else { [40, 180, 60] }))));
        // Green ahead (image up), blue behind.
        let half = picture(|_, v| if v < SIZE / 2 { [40, 140, 50] } else { [20, 30, 160] });
        assert!(model.begin(view(&half)));
        assert!(has(&model, [55, 125, 60]) && !has(&model, [20, 30, 160]));
        assert!(!model.begin_again(view(&half)), "all around there are two colors");
        assert!(model.begin_again(view(&picture(|_, _| [150, 150, 120]))));
        assert!(has(&model, [150, 150, 120]) && !has(&model, [40, 140, 50]));
    }

    #[test]
    fn slow_changes_are_followed_and_the_colors_do_not_spread() {
        let mut model = model();
        assert!(model.begin(view(&picture(|_, _| [60, 140, 60]))));
        for step in 0..60 {
            let level = 140 + step;
            model.follow(view(&picture(|_, _| [60, level, 60])));
            assert!(has(&model, [60, level, 60]), "{level}");
        }
        assert!(!has(&model, [60, 140, 60]));
        model.follow(view(&picture(|_, _| [60, 60, 160])));
        assert!(!has(&model, [60, 60, 160]), "a sudden change is not followed");
        let mut learned = FloorModel::learned(model.colors().cloned().unwrap());
        assert!(learned.begin(view(&picture(|_, _| [9, 9, 9]))) && !learned.begin_again(view(&half_gray())));
    }

    fn half_gray() -> Vec<u8> {
        picture(|_, _| [128, 128, 128])
    }
}
