//! Boxes that fade into what is behind them: how much they must stand out to be seen.

use rand::RngExt;
use yamabico_sim::world::Color;

use crate::course::{Course, REGIONS, SIZE};

/// Standard deviation of the camera's noise, gray levels.
const NOISE: f64 = 2.0;
/// The outline of a box is so wide, columns.
const OUTLINE_PX: usize = 2;

/// A picture of a faded box and what became of it.
pub struct Faded {
    /// The largest difference along an upright outline of the box to what is behind it, gray levels.
    pub contrast: f64,
    /// Whether it was found.
    pub is_found: bool,
}

/// At least `images` pictures of a box of this color that nowhere stands out by more than a limit drawn from 0 to `most`
/// (gray levels) from what is behind it.
pub fn faded_boxes(course: &mut Course, color: Color, images: usize, most: f64) -> Vec<Faded> {
    let empty = course.empty.clone();
    let mut faded = Vec::new();
    while faded.len() < images {
        let item = course.item();
        let [scene, black, white] = [color, [0.0; 3], [1.0; 3]].map(|color| course.scene(&item, color));
        for region in 0..REGIONS {
            let Some((_, robot)) = course.pose_for(&item, region) else { continue };
            let [with, without, black, white] =
                [&scene, &empty, &black, &white].map(|scene| course.quiet_picture(scene, robot));
            let limit = course.rng.random_range(0.0..most);
            let mut outline = 0.0_f64;
            let is_box = |at: usize| white[at].abs_diff(black[at]) > 25;
            let mut pixels = vec![0; with.len()];
            for (at, pixel) in pixels.iter_mut().enumerate() {
                let difference = (f64::from(with[at]) - f64::from(without[at])).clamp(-limit, limit);
                let u = at % SIZE.0 as usize;
                let is_inner = u >= OUTLINE_PX && u + OUTLINE_PX < SIZE.0 as usize;
                if is_inner && is_box(at) && !(is_box(at - OUTLINE_PX) && is_box(at + OUTLINE_PX)) {
                    outline = outline.max(difference.abs());
                }
                let noisy = f64::from(without[at]) + difference + NOISE * course.normal();
                *pixel = noisy.round().clamp(0.0, 255.0) as u8;
            }
            let flagged = course.flagged(&pixels, robot);
            let covered = course.covered(&item, robot);
            let is_found = (0..REGIONS).any(|region| flagged[region] && covered[region]);
            faded.push(Faded { contrast: outline, is_found });
        }
    }
    faded
}

/// The share found (percent) and the number of pictures for each `width` gray levels of contrast up to `most`: middle, share, n.
pub fn curve(faded: &[Faded], width: f64, most: f64) -> Vec<(f64, f64, usize)> {
    let bins = (most / width).round() as usize;
    let bin = |bin: usize| {
        let (low, high) = (width * bin as f64, width * (bin + 1) as f64);
        let here: Vec<&Faded> = faded.iter().filter(|f| (low..high).contains(&f.contrast)).collect();
        let found = here.iter().filter(|faded| faded.is_found).count();
        (!here.is_empty()).then(|| (0.5 * (low + high), 100.0 * found as f64 / here.len() as f64, here.len()))
    };
    (0..bins).filter_map(bin).collect()
}
