//! Points at which two dark and two bright regions meet, as the inner corners of a checkerboard.
//!
//! The determinant of the second derivatives is negative at a saddle of the gray levels, whatever the light. A candidate must also
//! alternate four times on a circle around it.

use nalgebra::{Matrix2, Vector2};
use std::f64::consts::{PI, TAU};

use super::float_image::FloatImage;

/// Radius of the circle on which gray levels alternate, px.
const RING_PX: f64 = 4.0;
/// Number of samples on the circle.
const RING: usize = 32;
/// Minimum difference between the bright and the dark regions on the circle, gray levels.
const MIN_CONTRAST: f64 = 12.0;
/// Minimum correlation of opposite points on the circle.
const MIN_SYMMETRY: f64 = 0.5;
/// Response below which a point is none, as a share of the strongest one.
const MIN_SHARE: f32 = 0.01;
/// Radius in pixels within which a candidate must be the strongest.
const APART_PX: isize = 2;
/// Maximum number of points; the strongest are kept.
const MAX_POINTS: usize = 4000;

/// Point at which two lines between dark and bright cross.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SaddlePoint {
    /// Position, px.
    pub at: Vector2<f64>,
    /// Unit vectors along the two lines; the second lies less than half a turn after the first, from +u to +v.
    pub lines: [Vector2<f64>; 2],
    /// True if the region from the first line to the second is dark.
    pub is_dark_between: bool,
    /// Difference between bright and dark regions, gray levels.
    pub contrast: f64,
}

/// Finds the saddle points of an image that was smoothed by about 1 px, strongest first.
#[must_use]
pub fn saddle_points(image: &FloatImage) -> Vec<SaddlePoint> {
    let (width, height) = (image.width as isize, image.height as isize);
    if width < 16 || height < 16 {
        return Vec::new();
    }
    let mut response = vec![0.0_f32; image.data.len()];
    let margin = 2;
    for v in margin..height - margin {
        for u in margin..width - margin {
            let at = |du: isize, dv: isize| image.data[((v + dv) * width + u + du) as usize];
            let uu = at(1, 0) + at(-1, 0) - 2.0 * at(0, 0);
            let vv = at(0, 1) + at(0, -1) - 2.0 * at(0, 0);
            let uv = 0.25 * (at(1, 1) + at(-1, -1) - at(1, -1) - at(-1, 1));
            response[(v * width + u) as usize] = (uv * uv - uu * vv).max(0.0);
        }
    }
    let threshold = MIN_SHARE * response.iter().copied().fold(0.0, f32::max);
    let mut peaks: Vec<(f32, isize, isize)> = Vec::new();
    for v in margin..height - margin {
        for u in margin..width - margin {
            let here = response[(v * width + u) as usize];
            if here > threshold.max(1.0) && is_strongest(&response, [width, height], [u, v]) {
                peaks.push((here, u, v));
            }
        }
    }
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
    peaks.truncate(MAX_POINTS);
    let point = |&(_, u, v): &(f32, isize, isize)| saddle_at(image, Vector2::new(u as f64, v as f64));
    peaks.iter().filter_map(point).collect()
}

/// Returns the saddle point near `start`, a pixel or a predicted position; `None` if there is none within 2 px.
#[must_use]
pub fn saddle_at(image: &FloatImage, start: Vector2<f64>) -> Option<SaddlePoint> {
    let mut at = start;
    for _ in 0..5 {
        let step = saddle_step(image, at)?;
        at += step;
        if step.norm() < 0.01 {
            break;
        }
    }
    if (at - start).norm() > 2.0 {
        return None;
    }
    ring(image, at)
}

fn is_strongest(response: &[f32], [width, height]: [isize; 2], [u, v]: [isize; 2]) -> bool {
    let here = response[(v * width + u) as usize];
    for dv in -APART_PX..=APART_PX {
        for du in -APART_PX..=APART_PX {
            let (x, y) = (u + du, v + dv);
            if (du, dv) == (0, 0) || x < 0 || y < 0 || x >= width || y >= height {
                continue;
            }
            let there = response[(y * width + x) as usize];
            // Of equal neighbors the first counts.
            if there > here || (there == here && (dv, du) < (0, 0)) {
                return false;
            }
        }
    }
    true
}

/// Returns the step to the stationary point of the quadratic surface through the 3 x 3 samples around `at`.
fn saddle_step(image: &FloatImage, at: Vector2<f64>) -> Option<Vector2<f64>> {
    let sample = |du: f64, dv: f64| image.sample(at + Vector2::new(du, dv));
    let center = sample(0.0, 0.0)?;
    let (left, right, up, down) =
        (sample(-1.0, 0.0)?, sample(1.0, 0.0)?, sample(0.0, -1.0)?, sample(0.0, 1.0)?);
    let uv = 0.25 * (sample(1.0, 1.0)? + sample(-1.0, -1.0)? - sample(1.0, -1.0)? - sample(-1.0, 1.0)?);
    let second = Matrix2::new(left + right - 2.0 * center, uv, uv, up + down - 2.0 * center);
    let first = Vector2::new(0.5 * (right - left), 0.5 * (down - up));
    if second.determinant() >= 0.0 {
        return None;
    }
    let step = -(second.try_inverse()? * first);
    let length = step.norm();
    Some(if length > 1.0 { step / length } else { step })
}

/// Checks the circle around a point, and finds the directions of its lines.
fn ring(image: &FloatImage, at: Vector2<f64>) -> Option<SaddlePoint> {
    let mut levels = [0.0; RING];
    for (i, level) in levels.iter_mut().enumerate() {
        let angle = i as f64 / RING as f64 * TAU;
        *level = image.sample(at + RING_PX * Vector2::new(angle.cos(), angle.sin()))?;
    }
    let (low, high) =
        levels.iter().fold((f64::MAX, f64::MIN), |(low, high), &level| (low.min(level), high.max(level)));
    let middle = 0.5 * (low + high);
    if high - low < MIN_CONTRAST {
        return None;
    }
    let mean = levels.iter().sum::<f64>() / RING as f64;
    let (mut product, mut square) = (0.0, 0.0);
    for i in 0..RING {
        product += (levels[i] - mean) * (levels[(i + RING / 2) % RING] - mean);
        square += (levels[i] - mean).powi(2);
    }
    if product < MIN_SYMMETRY * square {
        return None;
    }
    // Angles at which the circle crosses the middle level, and whether it becomes darker there.
    let mut crossings: Vec<(f64, bool)> = Vec::with_capacity(4);
    for i in 0..RING {
        let (a, b) = (levels[i] - middle, levels[(i + 1) % RING] - middle);
        if (a < 0.0) != (b < 0.0) {
            crossings.push(((i as f64 + a / (a - b)) / RING as f64 * TAU, b < 0.0));
        }
    }
    if crossings.len() != 4 {
        return None;
    }
    let [first, second] = [0, 1].map(|i| line_angle(crossings[i].0, crossings[i + 2].0));
    let [first, second] = [first?, second?];
    let between = second - first;
    if !(0.15 * PI..0.85 * PI).contains(&between) {
        return None;
    }
    Some(SaddlePoint {
        at,
        lines: [first, second].map(|angle| Vector2::new(angle.cos(), angle.sin())),
        is_dark_between: crossings[0].1,
        contrast: high - low,
    })
}

/// Returns the angle of the line through two points of the circle at these angles; `None` if they are not opposite.
fn line_angle(one: f64, opposite: f64) -> Option<f64> {
    let excess = opposite - one - PI;
    (excess.abs() < 0.6).then_some(one + 0.5 * excess)
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_geometry::image::ImageView;

    #[test]
    fn a_crossing_is_found_and_a_plain_corner_is_not() {
        let crossing = Vector2::new(30.3, 22.7);
        let pixels: Vec<u8> = (0..64 * 48)
            .map(|i| {
                let (u, v) = (f64::from(i % 64), f64::from(i / 64));
                let (du, dv) = (u - crossing.x, v - crossing.y);
                let side = |distance: f64| (distance / 0.8).clamp(-1.0, 1.0);
                let checker = side(du + 0.2 * dv) * side(dv - 0.1 * du);
                let corner = if u > 50.0 && v > 36.0 { -60.0 } else { 0.0 };
                (128.0 + 80.0 * checker + corner).clamp(0.0, 255.0) as u8
            })
            .collect();
        let image = FloatImage::of(ImageView::new(&pixels, 64, 48, 64).unwrap()).smoothed(1.0);
        let found = saddle_points(&image);
        assert_eq!(found.len(), 1, "{found:?}");
        assert!((found[0].at - crossing).norm() < 0.1, "{found:?}");
        assert!(found[0].contrast > 100.0);
        assert!(saddle_points(&FloatImage::default()).is_empty());
    }
}
