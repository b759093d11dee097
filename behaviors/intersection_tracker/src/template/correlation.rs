//! Zero-mean normalized cross-correlation (ZNCC) of a template, invariant to brightness and contrast.

use super::{PatchOrigin, SearchArea, Template};
use yamabico_core::image::ImageView;
use yamabico_vision::vectorize::{self, Kernel};

/// Template position with its correlation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CorrelationMatch {
    /// Position of the template's top left pixel.
    pub position: PatchOrigin,
    /// Correlation coefficient, -1 to 1.
    pub correlation: f64,
}

/// Computes the correlation at `position`, at which the template must lie inside the image. Returns 1 if both are equal up
/// to brightness and contrast, 0 if either has no contrast.
#[must_use]
pub fn correlation(image: ImageView<'_>, template: &Template, position: PatchOrigin) -> f64 {
    let (mut sum, mut square_sum, mut product_sum) = (0_u64, 0_u64, 0_u64);
    for v in 0..template.height {
        let (mut row_sum, mut row_squares, mut row_products) = (0_u32, 0_u32, 0_u32);
        for (&ours, &theirs) in template.row(v).iter().zip(template.row_under(&image, position, v)) {
            let (ours, theirs) = (u32::from(ours), u32::from(theirs));
            row_sum += theirs;
            row_squares += theirs * theirs;
            row_products += ours * theirs;
        }
        sum += u64::from(row_sum);
        square_sum += u64::from(row_squares);
        product_sum += u64::from(row_products);
    }
    coefficient(template, Sums { sum, square_sum, product_sum })
}

/// Sums over the pixels under a template.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Sums {
    sum: u64,
    square_sum: u64,
    product_sum: u64,
}

fn coefficient(template: &Template, under: Sums) -> f64 {
    let count = template.pixels.len() as u64;
    let spread = |sum: u64, square_sum: u64| (count * square_sum - sum * sum) as f64;
    let both = (spread(template.sum, template.square_sum) * spread(under.sum, under.square_sum)).sqrt();
    if both == 0.0 {
        return 0.0;
    }
    ((count * under.product_sum) as f64 - (template.sum * under.sum) as f64) / both
}

/// Number of positions computed in parallel.
const LANES: usize = 8;

/// Correlations at all positions of the first row of a search area. Equal to [`correlation`] at each position, but
/// several times as fast. Reuses its buffers.
#[derive(Clone, Debug, Default)]
pub struct RowCorrelation {
    first_u: usize,
    correlations: Vec<f64>,
    /// Image rows under the template, each padded to a whole number of lanes.
    under: Vec<u8>,
    products: Vec<[u32; LANES]>,
    sums: Vec<u32>,
    square_sums: Vec<u32>,
}

impl RowCorrelation {
    /// Computes the correlations of the first row of `area`.
    pub fn compute(&mut self, image: ImageView<'_>, template: &Template, area: &SearchArea) {
        let (first, last) = (area.first, area.last);
        let positions = last.u + 1 - first.u;
        let columns = positions + template.width - 1;
        let blocks = positions.div_ceil(LANES);
        let stride = columns + LANES * blocks - positions;
        self.under.clear();
        for v in first.v..first.v + template.height {
            self.under.extend_from_slice(&image.row(v)[first.u..][..columns]);
            self.under.resize(self.under.len() + stride - columns, 0);
        }
        self.products.clear();
        self.products.resize(blocks, [0; LANES]);
        for sums in [&mut self.sums, &mut self.square_sums] {
            sums.clear();
            sums.resize(stride, 0);
        }
        vectorize::run(Along {
            under: &self.under,
            template,
            products: &mut self.products,
            sums: &mut self.sums,
            square_sums: &mut self.square_sums,
        });
        self.first_u = first.u;
        self.correlations.clear();
        let mut under = Sums::default();
        let products = self.products.as_flattened();
        for column in 0..columns {
            under.sum += u64::from(self.sums[column]);
            under.square_sum += u64::from(self.square_sums[column]);
            let Some(position) = (column + 1).checked_sub(template.width) else { continue };
            under.product_sum = u64::from(products[position]);
            self.correlations.push(coefficient(template, under));
            under.sum -= u64::from(self.sums[position]);
            under.square_sum -= u64::from(self.square_sums[position]);
        }
    }

    /// Correlation with the template's left column at `u`; `None` outside the area.
    #[must_use]
    pub fn at(&self, u: usize) -> Option<f64> {
        self.correlations.get(u.checked_sub(self.first_u)?).copied()
    }

    /// Columns with their correlations.
    pub fn iter(&self) -> impl Iterator<Item = (usize, f64)> {
        self.correlations.iter().enumerate().map(|(i, &correlation)| (self.first_u + i, correlation))
    }
}

/// Column sums over the template's height, and products at each position.
struct Along<'a> {
    under: &'a [u8],
    template: &'a Template,
    products: &'a mut [[u32; LANES]],
    sums: &'a mut [u32],
    square_sums: &'a mut [u32],
}

impl Kernel for Along<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let stride = self.sums.len();
        for under in self.under.chunks_exact(stride) {
            for ((sum, squares), &level) in self.sums.iter_mut().zip(&mut *self.square_sums).zip(under) {
                *sum += u32::from(level);
                *squares += u32::from(level) * u32::from(level);
            }
        }
        let width = self.template.width;
        for (block, products) in self.products.iter_mut().enumerate() {
            let mut lanes = [0; LANES];
            let rows = self.template.pixels.chunks_exact(width).zip(self.under.chunks_exact(stride));
            for (ours, under) in rows {
                for (&level, under) in ours.iter().zip(under[block * LANES..].windows(LANES)) {
                    for (lane, &theirs) in lanes.iter_mut().zip(under) {
                        *lane += u32::from(level) * u32::from(theirs);
                    }
                }
            }
            *products = lanes;
        }
    }
}

/// Finds the position with the largest correlation; of equal ones the first in raster order.
#[must_use]
pub fn best_correlation(image: ImageView<'_>, template: &Template, area: &SearchArea) -> CorrelationMatch {
    let mut best = CorrelationMatch { position: area.first, correlation: f64::NEG_INFINITY };
    for position in area.positions() {
        let correlation = correlation(image, template, position);
        if correlation > best.correlation {
            best = CorrelationMatch { position, correlation };
        }
    }
    best
}

/// Sub-pixel offset of the vertex of the parabola through three adjacent correlations, columns within ±0.5. Zero if the
/// parabola is convex.
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
        assert!((correlation(view(dim.leak()), &template, PatchOrigin::default()) - 1.0).abs() < 1e-12);
        assert!((correlation(view(negative.leak()), &template, PatchOrigin::default()) + 1.0).abs() < 1e-12);
        assert_eq!(correlation(view(&[90; 35]), &template, PatchOrigin::default()), 0.0);
    }

    #[test]
    fn a_row_equals_single_positions() {
        let data: Vec<u8> = (0..60 * 20_usize).map(|i| (i * i / 7 + 13 * (i % 11)) as u8).collect();
        let image = ImageView::new(&data, 60, 20, 60).unwrap();
        let mut template = Template::default();
        template.take(image, PatchOrigin { u: 21, v: 3 }, 13, 9).unwrap();
        let area = SearchArea::along_row(image, &template, PatchOrigin { u: 20, v: 3 }, 12).unwrap();
        let mut row = RowCorrelation::default();
        row.compute(image, &template, &area);
        assert_eq!(row.iter().count(), 25);
        for position in area.positions() {
            assert_eq!(row.at(position.u), Some(correlation(image, &template, position)));
        }
        assert_eq!((row.at(7), row.at(33), row.at(21)), (None, None, Some(1.0)));
    }

    #[test]
    fn the_peak_stays_within_half_a_column() {
        assert!((peak_offset(0.5, 1.0, 0.75) - 1.0 / 6.0).abs() < 1e-12);
        assert_eq!(peak_offset(0.9, 0.8, 0.9), 0.0);
        assert_eq!(peak_offset(0.0, 1.0, 1.0), 0.5);
    }
}
