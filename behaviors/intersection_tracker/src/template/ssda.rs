//! Sequential similarity detection algorithm (SSDA): minimum of the sum of absolute differences, with each comparison
//! ending as soon as it cannot win.
//!
//! Kweon et al. (1991), section 4. Differs from \[1\]: the bound is the smallest sum so far, so that the result is that
//! of an exhaustive search. [`threshold_search`] has their constant threshold, for comparison.

use super::{PatchOrigin, SearchArea, Template};
use yamabico_core::image::ImageView;

/// Template position with its sum of absolute differences.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SsdaMatch {
    /// Position of the template's top left pixel.
    pub position: PatchOrigin,
    /// Sum of absolute differences, gray levels.
    pub sad: u32,
}

/// Finds the position in `area` with the smallest sum of absolute differences; of equal ones the first in raster order.
/// Searches from `start` outward for an early tight bound; the result does not depend on `start`.
#[must_use]
pub fn search(image: ImageView<'_>, template: &Template, area: &SearchArea, start: PatchOrigin) -> SsdaMatch {
    let (first, last) = (area.first, area.last);
    let mut best = SsdaMatch { position: first, sad: u32::MAX };
    for v in outwards(start.v, first.v, last.v) {
        for u in outwards(start.u, first.u, last.u) {
            let position = PatchOrigin { u, v };
            let sad = bounded_sad(&image, template, position, best.sad);
            let is_earlier = (v, u) < (best.position.v, best.position.u);
            if sad < best.sad || (sad == best.sad && is_earlier) {
                best = SsdaMatch { position, sad };
            }
        }
    }
    best
}

/// Sum of absolute differences at `position`; any value above `bound` if the sum exceeds it.
fn bounded_sad(image: &ImageView<'_>, template: &Template, position: PatchOrigin, bound: u32) -> u32 {
    let mut sad = 0;
    for v in 0..template.height {
        let (ours, theirs) = (template.row(v), template.row_under(image, position, v));
        sad += ours.iter().zip(theirs).map(|(&a, &b)| u32::from(a.abs_diff(b))).sum::<u32>();
        if sad > bound {
            break;
        }
    }
    sad
}

/// Iterates over `from..=to` in order of distance from `start`.
fn outwards(start: usize, from: usize, to: usize) -> impl Iterator<Item = usize> {
    let start = start.clamp(from, to);
    let farthest = (start - from).max(to - start);
    (0..=farthest).flat_map(move |step| {
        let left = (step <= start - from).then(|| start - step);
        let right = (step > 0 && step <= to - start).then(|| start + step);
        left.into_iter().chain(right)
    })
}

/// Result of the reference search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CountedSearch {
    /// Best match.
    pub best: SsdaMatch,
    /// Number of pixels compared.
    pub evaluated: u64,
}

/// Reference implementation of [`search`]: positions in raster order, pixels in a scattered order. Rejects a position
/// as soon as its sum reaches the smallest so far, and counts the pixels compared.
#[must_use]
pub fn search_counted(image: ImageView<'_>, template: &Template, area: &SearchArea) -> CountedSearch {
    let mut best = SsdaMatch { position: area.first, sad: u32::MAX };
    let mut evaluated = 0;
    for position in area.positions() {
        let mut sad = 0;
        let mut is_complete = true;
        for difference in differences(&image, template, position) {
            evaluated += 1;
            sad += difference;
            if sad >= best.sad {
                is_complete = false;
                break;
            }
        }
        if is_complete {
            best = SsdaMatch { position, sad };
        }
    }
    CountedSearch { best, evaluated }
}

/// Result of the search with a constant threshold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ThresholdMatch {
    /// Position of the template's top left pixel.
    pub position: PatchOrigin,
    /// Number of pixels for which the cumulative difference stayed within the threshold.
    pub count: u32,
    /// Cumulative difference at the end, including the pixel that exceeded the threshold, gray levels.
    pub partial_error: u32,
}

/// Finds the position whose cumulative difference stays within `threshold` for the most pixels; of equal ones the one
/// with the smaller final difference, then the first in raster order. Reference only: the right threshold depends on
/// the noise.
#[must_use]
pub fn threshold_search(
    image: ImageView<'_>,
    template: &Template,
    area: &SearchArea,
    threshold: u32,
) -> ThresholdMatch {
    let mut best = ThresholdMatch { position: area.first, count: 0, partial_error: u32::MAX };
    for position in area.positions() {
        let (mut count, mut partial_error) = (0, 0);
        for difference in differences(&image, template, position) {
            partial_error += difference;
            if partial_error > threshold {
                break;
            }
            count += 1;
        }
        if count > best.count || (count == best.count && partial_error < best.partial_error) {
            best = ThresholdMatch { position, count, partial_error };
        }
    }
    best
}

/// Absolute differences of all pixels at `position`, in a scattered order.
fn differences<'a>(
    image: &'a ImageView<'_>,
    template: &'a Template,
    position: PatchOrigin,
) -> impl Iterator<Item = u32> + 'a {
    visiting_order(template.pixels.len()).map(move |index| {
        let (u, v) = (index % template.width, index / template.width);
        let theirs = image.pixel(position.u + u, position.v + v);
        u32::from(template.pixels[index].abs_diff(theirs))
    })
}

/// Permutation of 0 to `count` - 1 in steps of the golden section, always the same.
fn visiting_order(count: usize) -> impl Iterator<Item = usize> {
    const GOLDEN_SECTION: f64 = 0.618_033_988_7;
    let mut step = (GOLDEN_SECTION * count as f64).floor() as usize;
    while step > 1 && greatest_common_divisor(step, count) != 1 {
        step -= 1;
    }
    let step = step.max(1);
    (0..count).map(move |k| k * step % count)
}

fn greatest_common_divisor(mut a: usize, mut b: usize) -> usize {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn every_pixel_is_visited_once() {
        for count in [0, 1, 2, 3, 48, 80, 384, 800] {
            let mut order: Vec<_> = visiting_order(count).collect();
            order.sort_unstable();
            assert!(order.iter().copied().eq(0..count), "{count}");
        }
    }

    #[test]
    fn outwards_visits_all_nearest_first() {
        assert_eq!(outwards(3, 1, 6).collect::<Vec<_>>(), [3, 2, 4, 1, 5, 6]);
        assert_eq!(outwards(9, 1, 3).collect::<Vec<_>>(), [3, 2, 1]);
        assert_eq!(outwards(0, 2, 2).collect::<Vec<_>>(), [2]);
    }

    proptest! {
        #[test]
        fn the_search_is_exhaustive_from_any_start(
            data in prop::collection::vec(0_u8..6, 12 * 9),
            u in 0_usize..12,
            v in 0_usize..9,
        ) {
            let image = ImageView::new(&data, 12, 9, 12).unwrap();
            let mut template = Template::default();
            template.fill(4, 3, |u, v| data[7 * u + 5 * v]);
            let area = SearchArea::whole(image, &template).unwrap();
            let counted = search_counted(image, &template, &area);
            prop_assert_eq!(search(image, &template, &area, PatchOrigin { u, v }), counted.best);
            let exhaustive = area.positions().map(|position| bounded_sad(&image, &template, position, u32::MAX)).min();
            prop_assert_eq!(exhaustive, Some(counted.best.sad));
            prop_assert!(counted.evaluated <= area.positions().count() as u64 * 12);
        }
    }
}
