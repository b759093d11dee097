//! Zero-mean normalised cross-correlation: how alike a template and a place are, whatever the brightness and the contrast.

use super::{Place, SearchArea, Template};
use crate::image::ImageView;

/// A place and how alike it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alike {
    /// Where.
    pub place: Place,
    /// -1 to 1.
    pub correlation: f64,
}

/// The correlation at `place`, where the template must lie in the picture: 1 for the same up to brightness and contrast, 0
/// where either has no contrast.
#[must_use]
pub fn correlation(image: ImageView<'_>, template: &Template, place: Place) -> f64 {
    let (mut sum, mut square_sum, mut product_sum) = (0_u64, 0_u64, 0_u64);
    for v in 0..template.height {
        let (mut row_sum, mut row_squares, mut row_products) = (0_u32, 0_u32, 0_u32);
        for (&ours, &theirs) in template.row(v).iter().zip(template.row_under(&image, place, v)) {
            let (ours, theirs) = (u32::from(ours), u32::from(theirs));
            row_sum += theirs;
            row_squares += theirs * theirs;
            row_products += ours * theirs;
        }
        sum += u64::from(row_sum);
        square_sum += u64::from(row_squares);
        product_sum += u64::from(row_products);
    }
    let count = template.pixels.len() as u64;
    let spread = |sum: u64, square_sum: u64| (count * square_sum - sum * sum) as f64;
    let both = (spread(template.sum, template.square_sum) * spread(sum, square_sum)).sqrt();
    if both == 0.0 {
        return 0.0;
    }
    ((count * product_sum) as f64 - (template.sum * sum) as f64) / both
}

/// The most alike place, of several the first one row by row.
#[must_use]
pub fn most_alike(image: ImageView<'_>, template: &Template, area: &SearchArea) -> Alike {
    let mut best = Alike { place: area.first, correlation: f64::NEG_INFINITY };
    for place in area.places() {
        let correlation = correlation(image, template, place);
        if correlation > best.correlation {
            best = Alike { place, correlation };
        }
    }
    best
}

/// Columns from the middle one of three neighbouring correlations to the peak of the parabola through them, within half a
/// column; zero where they bend upwards.
#[must_use]
pub fn peak_offset(before: f64, at: f64, after: f64) -> f64 {
    let bend = before - 2.0 * at + after;
    if bend < 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(scale: f64, offset: f64) -> Vec<u8> {
        (0..35).map(|i| (offset + scale * f64::from(i * i % 17)) as u8).collect()
    }

    #[test]
    fn brightness_and_contrast_do_not_matter() {
        let (bright, dim, negative) = (ramp(8.0, 60.0), ramp(4.0, 10.0), ramp(-8.0, 200.0));
        let view = |data: &'static [u8]| ImageView::new(data, 7, 5, 7).unwrap();
        let template = Template::of(view(bright.leak()));
        assert!((correlation(view(dim.leak()), &template, Place::default()) - 1.0).abs() < 1e-12);
        assert!((correlation(view(negative.leak()), &template, Place::default()) + 1.0).abs() < 1e-12);
        assert_eq!(correlation(view(&[90; 35]), &template, Place::default()), 0.0);
    }

    #[test]
    fn the_peak_stays_within_half_a_column() {
        assert!((peak_offset(0.5, 1.0, 0.75) - 1.0 / 6.0).abs() < 1e-12);
        assert_eq!(peak_offset(0.9, 0.8, 0.9), 0.0);
        assert_eq!(peak_offset(0.0, 1.0, 1.0), 0.5);
    }
}
