//! Templates: small patches of a picture that are looked for in the next one.
//!
//! [`ssda`] finds the place of the smallest sum of absolute differences, [`correlation`] tells how alike a place is
//! whatever the brightness.

pub mod correlation;
pub mod ssda;

use thiserror::Error;
use yamabico_geometry::image::ImageView;

/// Below this standard deviation (gray levels) a template looks the same everywhere.
pub const MIN_DEVIATION: f64 = 4.0;

/// The top left pixel of a patch in a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Place {
    /// Column.
    pub u: usize,
    /// Row.
    pub v: usize,
}

/// Why there is no template.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum TemplateError {
    /// Its standard deviation is below [`MIN_DEVIATION`].
    #[error("the template has no contrast")]
    FlatTemplate,
    /// The patch is empty or does not lie in the picture.
    #[error("the patch does not lie in the picture")]
    Outside,
}

/// A patch of gray levels and its sums. Filled again it allocates only to grow.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Template {
    pixels: Vec<u8>,
    width: usize,
    height: usize,
    sum: u64,
    square_sum: u64,
}

impl Template {
    /// The whole of a picture.
    #[must_use]
    pub fn of(image: ImageView<'_>) -> Self {
        let mut template = Self::default();
        template.fill(image.width(), image.height(), |u, v| image.pixel(u, v));
        template
    }

    /// Takes the patch of `width` x `height` pixels at `place`.
    ///
    /// # Errors
    /// `Outside` for a patch that does not lie in the picture; the template then keeps what it held. `FlatTemplate` for one
    /// without contrast; it is taken all the same.
    pub fn take(
        &mut self,
        image: ImageView<'_>,
        place: Place,
        width: usize,
        height: usize,
    ) -> Result<(), TemplateError> {
        let fits = |from: usize, size: usize, whole: usize| size > 0 && size <= whole && from <= whole - size;
        if !fits(place.u, width, image.width()) || !fits(place.v, height, image.height()) {
            return Err(TemplateError::Outside);
        }
        self.pixels.clear();
        for v in place.v..place.v + height {
            self.pixels.extend_from_slice(&image.row(v)[place.u..place.u + width]);
        }
        (self.width, self.height) = (width, height);
        self.add_up();
        self.check()
    }

    /// Takes `width` x `height` gray levels, asked for by column and row.
    pub fn fill(&mut self, width: usize, height: usize, level: impl Fn(usize, usize) -> u8) {
        self.pixels.clear();
        self.pixels
            .extend((0..height).flat_map(|v| (0..width).map(move |u| (u, v))).map(|(u, v)| level(u, v)));
        (self.width, self.height) = (width, height);
        self.add_up();
    }

    fn add_up(&mut self) {
        (self.sum, self.square_sum) = (0, 0);
        for row in self.pixels.chunks_exact(self.width.max(1)) {
            self.sum += u64::from(row.iter().map(|&level| u32::from(level)).sum::<u32>());
            self.square_sum += u64::from(row.iter().map(|&level| u32::from(level).pow(2)).sum::<u32>());
        }
    }

    /// Whether it can be told from its surroundings.
    ///
    /// # Errors
    /// `FlatTemplate` below [`MIN_DEVIATION`], `Outside` for one without pixels.
    pub fn check(&self) -> Result<(), TemplateError> {
        match self.deviation() {
            deviation if deviation >= MIN_DEVIATION => Ok(()),
            _ if self.pixels.is_empty() => Err(TemplateError::Outside),
            _ => Err(TemplateError::FlatTemplate),
        }
    }

    /// Columns.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// As a picture; `None` for one without pixels.
    #[must_use]
    pub fn view(&self) -> Option<ImageView<'_>> {
        ImageView::new(&self.pixels, self.width, self.height, self.width).ok()
    }

    /// Standard deviation of its gray levels; zero for one without pixels.
    #[must_use]
    pub fn deviation(&self) -> f64 {
        let count = self.pixels.len().max(1) as f64;
        let mean = self.sum as f64 / count;
        (self.square_sum as f64 / count - mean * mean).max(0.0).sqrt()
    }

    fn row(&self, v: usize) -> &[u8] {
        &self.pixels[v * self.width..(v + 1) * self.width]
    }

    /// The same columns of row `v` of a picture, the template being at `place`.
    fn row_under<'a>(&self, image: &ImageView<'a>, place: Place, v: usize) -> &'a [u8] {
        &image.row(place.v + v)[place.u..place.u + self.width]
    }
}

/// Places to be looked at: columns and rows of the top left pixel, both ends included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SearchArea {
    first: Place,
    last: Place,
}

impl SearchArea {
    /// Every place at which the template lies in the picture; `None` where it is larger, or empty.
    #[must_use]
    pub fn whole(image: ImageView<'_>, template: &Template) -> Option<Self> {
        if template.pixels.is_empty() {
            return None;
        }
        let last = Place {
            u: image.width().checked_sub(template.width)?,
            v: image.height().checked_sub(template.height)?,
        };
        Some(Self { first: Place::default(), last })
    }

    /// The places of one row, up to `reach` columns to either side of `middle`, at which the template lies in the picture;
    /// `None` where there is none.
    #[must_use]
    pub fn along_row(image: ImageView<'_>, template: &Template, middle: Place, reach: usize) -> Option<Self> {
        let whole = Self::whole(image, template)?;
        let first = Place { u: middle.u.saturating_sub(reach), v: middle.v };
        let last = Place { u: middle.u.saturating_add(reach).min(whole.last.u), v: middle.v };
        (first.u <= last.u && middle.v <= whole.last.v).then_some(Self { first, last })
    }

    /// First column and row.
    #[must_use]
    pub fn first(&self) -> Place {
        self.first
    }

    /// Last column and row.
    #[must_use]
    pub fn last(&self) -> Place {
        self.last
    }

    /// The places row by row.
    pub fn places(&self) -> impl Iterator<Item = Place> + use<> {
        let Self { first, last } = *self;
        (first.v..=last.v).flat_map(move |v| (first.u..=last.u).map(move |u| Place { u, v }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_outside_and_without_contrast_are_refused() {
        let data: Vec<u8> = (0..60).map(|i| if i % 10 < 5 { 50 } else { 90 }).collect();
        let image = ImageView::new(&data, 10, 6, 10).unwrap();
        let mut template = Template::default();
        assert_eq!(template.check(), Err(TemplateError::Outside));
        assert_eq!(template.take(image, Place { u: 3, v: 1 }, 4, 4), Ok(()));
        assert_eq!((template.width(), template.height(), template.deviation()), (4, 4, 20.0));
        for (u, v, width, height) in
            [(7, 0, 4, 4), (0, 3, 4, 4), (0, 0, 11, 1), (usize::MAX, 0, 2, 2), (0, 0, 0, 3)]
        {
            let taken = template.take(image, Place { u, v }, width, height);
            assert_eq!(taken, Err(TemplateError::Outside), "{u} {v} {width} {height}");
        }
        assert_eq!(template.deviation(), 20.0, "what it held is kept");
        assert_eq!(template.take(image, Place { u: 0, v: 0 }, 4, 4), Err(TemplateError::FlatTemplate));
    }

    #[test]
    fn a_row_of_places_ends_at_the_border() {
        let data = [0; 60];
        let image = ImageView::new(&data, 10, 6, 10).unwrap();
        let template = Template::of(ImageView::new(&data, 4, 2, 4).unwrap());
        let row = |u, v, reach| {
            SearchArea::along_row(image, &template, Place { u, v }, reach)
                .map(|area| area.places().map(|place| place.u).collect::<Vec<_>>())
        };
        assert_eq!(row(1, 4, 2), Some(vec![0, 1, 2, 3]));
        assert_eq!(row(6, 0, 1), Some(vec![5, 6]));
        assert_eq!(row(1, 5, 2), None);
        assert_eq!(row(9, 0, 2), None);
    }
}
