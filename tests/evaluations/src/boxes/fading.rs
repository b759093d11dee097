//! Boxes that fade into their background, and the contrast needed to detect them.

use rand::RngExt;
use yamabico_sim::world::Color;

use super::hallway::{Hallway, REGIONS, SIZE};

/// Standard deviation of the camera's noise, gray levels.
const NOISE: f64 = 2.0;
/// Width of the outline of a box, columns.
const OUTLINE_PX: usize = 2;

/// Result of one image of a faded box.
pub struct Faded {
    /// Maximum difference to the background along the vertical outlines of the box, gray levels.
    pub contrast: f64,
    /// True if the box is reported as an obstacle.
    pub is_found: bool,
}

/// Evaluates at least `images` images of boxes of this color whose difference to the background is limited, everywhere, to a value
/// drawn from 0 to `max` gray levels.
pub fn faded_boxes(hallway: &mut Hallway, color: Color, images: usize, max: f64) -> Vec<Faded> {
    let empty = hallway.empty.clone();
    let mut faded = Vec::new();
    while faded.len() < images {
        let item = hallway.random_box();
        let [scene, black, white] = [color, [0.0; 3], [1.0; 3]].map(|color| hallway.scene(&item, color));
        for region in 0..REGIONS {
            let Some((_, robot)) = hallway.pose_for(&item, region) else { continue };
            let [with, without, black, white] =
                [&scene, &empty, &black, &white].map(|scene| hallway.noiseless_image(scene, robot));
            let limit = hallway.rng.random_range(0.0..max);
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
                let noisy = f64::from(without[at]) + difference + NOISE * hallway.normal();
                *pixel = noisy.round().clamp(0.0, 255.0) as u8;
            }
            let flagged = hallway.flagged(&pixels, robot);
            let covered = hallway.covered(&item, robot);
            let is_found = (0..REGIONS).any(|region| flagged[region] && covered[region]);
            faded.push(Faded { contrast: outline, is_found });
        }
    }
    faded
}

/// Returns center, share detected (percent) and number of images of each bin of contrast, `width` gray levels wide, up to `max`.
pub fn curve(faded: &[Faded], width: f64, max: f64) -> Vec<(f64, f64, usize)> {
    let bins = (max / width).round() as usize;
    let bin = |bin: usize| {
        let (low, high) = (width * bin as f64, width * (bin + 1) as f64);
        let here: Vec<&Faded> = faded.iter().filter(|f| (low..high).contains(&f.contrast)).collect();
        let found = here.iter().filter(|faded| faded.is_found).count();
        (!here.is_empty()).then(|| (0.5 * (low + high), 100.0 * found as f64 / here.len() as f64, here.len()))
    };
    (0..bins).filter_map(bin).collect()
}
