//! Zero-mean normalized cross-correlation: how alike a template and a place are, whatever the brightness and the contrast.

use super::{Place, SearchArea, Template};
use crate::vectorize::{self, Kernel};
use yamabico_geometry::image::ImageView;

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
    coefficient(template, Sums { sum, square_sum, product_sum })
}

/// What a correlation is made of: sums over the pixels under a template.
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

/// Places that are worked out at once.
const LANES: usize = 8;

/// The correlations at all places of one row of an area, from its first column on: the same as [`correlation`] gives place by
/// place, several times as fast. Keeps its buffers.
#[derive(Clone, Debug, Default)]
pub struct RowCorrelation {
    first_u: usize,
    correlations: Vec<f64>,
    /// The rows under the template, each longer by what the last lanes reach beyond the area.
    under: Vec<u8>,
    products: Vec<[u32; LANES]>,
    sums: Vec<u32>,
    square_sums: Vec<u32>,
}

impl RowCorrelation {
    /// Works out the correlations of the first row of `area`.
    pub fn compute(&mut self, image: ImageView<'_>, template: &Template, area: &SearchArea) {
        let (first, last) = (area.first, area.last);
        let places = last.u + 1 - first.u;
        let columns = places + template.width - 1;
        let blocks = places.div_ceil(LANES);
        let stride = columns + LANES * blocks - places;
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
            let Some(place) = (column + 1).checked_sub(template.width) else { continue };
            under.product_sum = u64::from(products[place]);
            self.correlations.push(coefficient(template, under));
            under.sum -= u64::from(self.sums[place]);
            under.square_sum -= u64::from(self.square_sums[place]);
        }
    }

    /// The correlation with the template's left column at `u`; `None` outside the area.
    #[must_use]
    pub fn at(&self, u: usize) -> Option<f64> {
        self.correlations.get(u.checked_sub(self.first_u)?).copied()
    }

    /// Columns and correlations.
    pub fn iter(&self) -> impl Iterator<Item = (usize, f64)> {
        self.correlations.iter().enumerate().map(|(i, &correlation)| (self.first_u + i, correlation))
    }
}

/// Sums of the columns under all places of a row, and of the products at each place.
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

/// The most alike place, of several the first one row by row.
#[must_use]
pub fn max_alike(image: ImageView<'_>, template: &Template, area: &SearchArea) -> Alike {
    let mut best = Alike { place: area.first, correlation: f64::NEG_INFINITY };
    for place in area.places() {
        let correlation = correlation(image, template, place);
        if correlation > best.correlation {
            best = Alike { place, correlation };
        }
    }
    best
}

/// Columns from the middle one of three neighboring correlations to the peak of the parabola through them, within half a
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
    fn a_row_at_once_is_as_place_by_place() {
        let data: Vec<u8> = (0..60 * 20_usize).map(|i| (i * i / 7 + 13 * (i % 11)) as u8).collect();
        let image = ImageView::new(&data, 60, 20, 60).unwrap();
        let mut template = Template::default();
        template.take(image, Place { u: 21, v: 3 }, 13, 9).unwrap();
        let area = SearchArea::along_row(image, &template, Place { u: 20, v: 3 }, 12).unwrap();
        let mut row = RowCorrelation::default();
        row.compute(image, &template, &area);
        assert_eq!(row.iter().count(), 25);
        for place in area.places() {
            assert_eq!(row.at(place.u), Some(correlation(image, &template, place)));
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
