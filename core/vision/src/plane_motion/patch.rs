//! Patches of pictures, sampled under an affine map.

use nalgebra::Vector2;

use super::quad_image::QuadImage;

/// Samples of a patch: five by five without the middle, over 7 x 7 pixels.
pub(super) const SAMPLES: usize = 24;

/// Samples around `center`, where one sample to the right is (`a[0]`, `a[2]`) px away and one below (`a[1]`, `a[3]`);
/// `None` too near to the border.
#[inline(always)]
pub(super) fn patch(image: &QuadImage, center: Vector2<f32>, a: &[f32; 4]) -> Option<[f32; SAMPLES]> {
    let (reach_x, reach_y) = (2.0 * (a[0].abs() + a[1].abs()), 2.0 * (a[2].abs() + a[3].abs()));
    let (right, bottom) = (image.width() as f32 - 2.0, image.height() as f32 - 2.0);
    let inside = center.x - reach_x > 1.0
        && center.x + reach_x < right
        && center.y - reach_y > 1.0
        && center.y + reach_y < bottom;
    if !inside {
        return None;
    }
    let (mut x, mut y) = ([0_f32; SAMPLES], [0_f32; SAMPLES]);
    for i in 0..SAMPLES {
        x[i] = center.x + a[0] * ACROSS[i] + a[1] * DOWN[i];
        y[i] = center.y + a[2] * ACROSS[i] + a[3] * DOWN[i];
    }
    Some(image.sample(&x, &y))
}

/// Places of the samples.
const ACROSS: [f32; SAMPLES] = places().0;
const DOWN: [f32; SAMPLES] = places().1;

const fn places() -> ([f32; SAMPLES], [f32; SAMPLES]) {
    let (mut across, mut down) = ([0.0; SAMPLES], [0.0; SAMPLES]);
    let (mut cell, mut i) = (0, 0);
    while cell < 25 {
        if cell != 12 {
            across[i] = (cell % 5) as f32 - 2.0;
            down[i] = (cell / 5) as f32 - 2.0;
            i += 1;
        }
        cell += 1;
    }
    (across, down)
}
