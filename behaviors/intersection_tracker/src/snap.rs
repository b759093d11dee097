//! Subpixel location of a vertical edge.

use nalgebra::Vector2;
use yamabico_core::image::ImageView;

/// Maximum half width of the window, pixels.
const MAX_REACH: usize = 16;
/// Fraction of the peak above which gradients count.
const SHARE_OF_PEAK: f64 = 0.3;
/// Minimum gradient of an edge, gray levels per pixel.
const MIN_GRADIENT: f64 = 2.0;

/// Brighter side of an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Brighter {
    /// Left of the edge.
    Left,
    /// Right of the edge.
    Right,
}

/// An edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Snapped {
    /// Column in the middle row, pixels.
    pub column: f64,
    /// Maximum gradient, gray levels per pixel.
    pub gradient: f64,
}

/// Search window for an edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SnapWindow {
    /// Center, pixels.
    pub middle: Vector2<f64>,
    /// Half width in columns, at most 16.
    pub reach: usize,
    /// Number of rows.
    pub rows: usize,
    /// Slope of the edge, columns per row.
    pub lean: f64,
    /// Brighter side of the edge.
    pub brighter: Brighter,
}

/// Returns the edge: its column in the middle row is the centroid of the gradient of the column means above 30 % of the
/// peak, around the peak. `None` if no gradient in the window has the right sign, or the window leaves the image.
#[must_use]
pub fn snap(image: ImageView<'_>, window: &SnapWindow) -> Option<Snapped> {
    let reach = window.reach.clamp(1, MAX_REACH);
    let (middle_u, middle_v) = (window.middle.x.round(), window.middle.y.round());
    let half_rows = 0.5 * (window.rows as f64 - 1.0);
    let widest = reach as f64 + 1.0 + window.lean.abs() * half_rows;
    let is_inside = middle_u - widest >= 0.0
        && middle_u + widest <= image.width() as f64 - 1.0
        && middle_v - half_rows >= 0.0
        && middle_v + half_rows <= image.height() as f64 - 1.0;
    if !is_inside {
        return None;
    }
    let mut sums = [0_u32; 2 * MAX_REACH + 3];
    let columns = 2 * reach + 3;
    for row in 0..window.rows {
        let below = row as f64 - half_rows;
        let first = middle_u + (window.lean * below).round() - (reach as f64 + 1.0);
        let line = image.row((middle_v + below).round() as usize);
        let line = line.get(first as usize..first as usize + columns)?;
        for (sum, &level) in sums.iter_mut().zip(line) {
            *sum += u32::from(level);
        }
    }
    let sign = if window.brighter == Brighter::Right { 0.5 } else { -0.5 };
    let gradient =
        |i: usize| sign * (f64::from(sums[i + 2]) - f64::from(sums[i])) / window.rows.max(1) as f64;
    let peak = (0..columns - 2).max_by(|&a, &b| gradient(a).total_cmp(&gradient(b)))?;
    let least = SHARE_OF_PEAK * gradient(peak);
    if gradient(peak) < MIN_GRADIENT {
        return None;
    }
    let counts = |i: &usize| gradient(*i) > least;
    let before = (0..peak).rev().take_while(counts);
    let (mut weight, mut moment) = (0.0, 0.0);
    for i in before.chain((peak..columns - 2).take_while(counts)) {
        weight += gradient(i) - least;
        moment += (gradient(i) - least) * i as f64;
    }
    let column = middle_u - reach as f64 + moment / weight;
    Some(Snapped { column, gradient: gradient(peak) })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A blurred step that leans, brighter on the right.
    fn image(column: f64, lean: f64) -> Vec<u8> {
        let level = |u: f64, v: f64| 80.0 + 60.0 / (1.0 + (-1.5 * (u - column - lean * (v - 30.0))).exp());
        (0..60).flat_map(|v| (0..80).map(move |u| level(f64::from(u), f64::from(v)).round() as u8)).collect()
    }

    fn find(column: f64, lean: f64, middle_u: f64, brighter: Brighter) -> Option<f64> {
        let data = image(column, lean);
        let image = ImageView::new(&data, 80, 60, 80).unwrap();
        let middle = Vector2::new(middle_u, 30.0);
        snap(image, &SnapWindow { middle, reach: 6, rows: 41, lean, brighter }).map(|edge| edge.column)
    }

    #[test]
    fn the_column_is_exact_to_a_tenth() {
        for (column, lean) in [(40.0, 0.0), (40.3, 0.0), (39.55, 0.05), (41.2, -0.08)] {
            let found = find(column, lean, 42.0, Brighter::Right).unwrap();
            assert!((found - column).abs() < 0.1, "{found} instead of {column}");
        }
    }

    #[test]
    fn the_wrong_polarity_and_the_border_give_nothing() {
        assert_eq!(find(40.0, 0.0, 40.0, Brighter::Left), None);
        assert_eq!(find(40.0, 0.0, 60.0, Brighter::Right), None);
        for outside in [3.0, 77.0, f64::NAN, -1e9] {
            assert_eq!(find(40.0, 0.0, outside, Brighter::Right), None);
        }
    }
}
