//! Sequential similarity detection: the place where a template differs least, each comparison ending as soon as it cannot
//! win.
//!
//! Kweon et al. (1991), section 4. Differs from \[1\]: the bound is the best sum so far, so that the answer is that of an
//! exhaustive search; [`classic`], with their constant threshold, is there for comparison.

use super::{Place, SearchArea, Template};
use yamabico_geometry::image::ImageView;

/// A place and how much the template differs there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Match {
    /// Where.
    pub place: Place,
    /// Sum of absolute differences, gray levels.
    pub sad: u32,
}

/// The place in `area` with the smallest sum of absolute differences, of several the first one row by row. Looks from `start`
/// outwards, so that a good bound comes early; the answer does not depend on it.
#[must_use]
pub fn search(image: ImageView<'_>, template: &Template, area: &SearchArea, start: Place) -> Match {
    let (first, last) = (area.first, area.last);
    let mut best = Match { place: first, sad: u32::MAX };
    for v in outwards(start.v, first.v, last.v) {
        for u in outwards(start.u, first.u, last.u) {
            let place = Place { u, v };
            let sad = bounded_sad(&image, template, place, best.sad);
            let is_earlier = (v, u) < (best.place.v, best.place.u);
            if sad < best.sad || (sad == best.sad && is_earlier) {
                best = Match { place, sad };
            }
        }
    }
    best
}

/// The sum of absolute differences at `place`, or any sum above `bound` once it is.
fn bounded_sad(image: &ImageView<'_>, template: &Template, place: Place, bound: u32) -> u32 {
    let mut sad = 0;
    for v in 0..template.height {
        let (ours, theirs) = (template.row(v), template.row_under(image, place, v));
        sad += ours.iter().zip(theirs).map(|(&a, &b)| u32::from(a.abs_diff(b))).sum::<u32>();
        if sad > bound {
            break;
        }
    }
    sad
}

/// `from` to `to`, both included, the nearest to `start` first.
fn outwards(start: usize, from: usize, to: usize) -> impl Iterator<Item = usize> {
    let start = start.clamp(from, to);
    let farthest = (start - from).max(to - start);
    (0..=farthest).flat_map(move |step| {
        let left = (step <= start - from).then(|| start - step);
        let right = (step > 0 && step <= to - start).then(|| start + step);
        left.into_iter().chain(right)
    })
}

/// What the reference search found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counted {
    /// The place and its sum.
    pub best: Match,
    /// Pixels that were compared.
    pub evaluated: u64,
}

/// The reference for [`search`]: pixel by pixel in a spread order, place by place in raster order, counting the pixels
/// compared; a place is left as soon as its sum is no smaller than the best.
#[must_use]
pub fn search_counted(image: ImageView<'_>, template: &Template, area: &SearchArea) -> Counted {
    let mut best = Match { place: area.first, sad: u32::MAX };
    let mut evaluated = 0;
    for place in area.places() {
        let mut sad = 0;
        let mut is_complete = true;
        for difference in differences(&image, template, place) {
            evaluated += 1;
            sad += difference;
            if sad >= best.sad {
                is_complete = false;
                break;
            }
        }
        if is_complete {
            best = Match { place, sad };
        }
    }
    Counted { best, evaluated }
}

/// The winner under a constant threshold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Classic {
    /// Where.
    pub place: Place,
    /// Pixels whose cumulative difference stayed within the threshold.
    pub count: u32,
    /// The difference where it stopped, that of the exceeding pixel included, gray levels.
    pub partial_error: u32,
}

/// The place whose cumulative difference stays within `threshold` for the most pixels; of several the one with the smaller
/// difference at its end, then the first one row by row. For comparison: the threshold depends on the noise.
#[must_use]
pub fn classic(image: ImageView<'_>, template: &Template, area: &SearchArea, threshold: u32) -> Classic {
    let mut best = Classic { place: area.first, count: 0, partial_error: u32::MAX };
    for place in area.places() {
        let (mut count, mut partial_error) = (0, 0);
        for difference in differences(&image, template, place) {
            partial_error += difference;
            if partial_error > threshold {
                break;
            }
            count += 1;
        }
        if count > best.count || (count == best.count && partial_error < best.partial_error) {
            best = Classic { place, count, partial_error };
        }
    }
    best
}

/// The absolute differences of all pixels at `place`, in an order that spreads over the template.
fn differences<'a>(
    image: &'a ImageView<'_>,
    template: &'a Template,
    place: Place,
) -> impl Iterator<Item = u32> + 'a {
    visiting_order(template.pixels.len()).map(move |index| {
        let (u, v) = (index % template.width, index / template.width);
        let theirs = image.pixel(place.u + u, place.v + v);
        u32::from(template.pixels[index].abs_diff(theirs))
    })
}

/// 0 to `count` - 1, each once, in steps of the golden section: the same order every time.
pub fn visiting_order(count: usize) -> impl Iterator<Item = usize> {
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
            prop_assert_eq!(search(image, &template, &area, Place { u, v }), counted.best);
            let exhaustive = area.places().map(|place| bounded_sad(&image, &template, place, u32::MAX)).min();
            prop_assert_eq!(exhaustive, Some(counted.best.sad));
            prop_assert!(counted.evaluated <= area.places().count() as u64 * 12);
        }
    }
}
