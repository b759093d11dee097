//! Template matching: finding small image patches in the next frame.
//!
//! [`ssda`] minimizes the sum of absolute differences, [`correlation`] measures similarity independently of brightness.

pub mod correlation;
pub mod ssda;

use thiserror::Error;
use yamabico_core::image::ImageView;

/// Minimum standard deviation of a template, gray levels. Below it, the template matches everywhere.
pub const MIN_DEVIATION: f64 = 4.0;

/// Position of a patch in an image: its top left pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PatchOrigin {
    /// Column.
    pub u: usize,
    /// Row.
    pub v: usize,
}

/// Reason why there is no template.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum TemplateError {
    /// The standard deviation of the patch is below [`MIN_DEVIATION`].
    #[error("the contrast of the template is too low")]
    FlatTemplate,
    /// The patch is empty or exceeds the image.
    #[error("the patch is empty or exceeds the image")]
    Outside,
}

/// Patch of gray levels with its sums. Allocates only to grow.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Template {
    pixels: Vec<u8>,
    width: usize,
    height: usize,
    sum: u64,
    square_sum: u64,
}

impl Template {
    /// Creates a template from a whole image.
    #[must_use]
    pub fn of(image: ImageView<'_>) -> Self {
        let mut template = Self::default();
        template.fill(image.width(), image.height(), |u, v| image.pixel(u, v));
        template
    }

    /// Copies the patch of `width` x `height` pixels at `position`.
    ///
    /// # Errors
    /// `Outside` if the patch exceeds the image; the template is then unchanged. `FlatTemplate` if it has no contrast;
    /// the patch is copied nevertheless.
    pub fn take(
        &mut self,
        image: ImageView<'_>,
        position: PatchOrigin,
        width: usize,
        height: usize,
    ) -> Result<(), TemplateError> {
        let fits = |from: usize, size: usize, whole: usize| size > 0 && size <= whole && from <= whole - size;
        if !fits(position.u, width, image.width()) || !fits(position.v, height, image.height()) {
            return Err(TemplateError::Outside);
        }
        self.pixels.clear();
        for v in position.v..position.v + height {
            self.pixels.extend_from_slice(&image.row(v)[position.u..position.u + width]);
        }
        (self.width, self.height) = (width, height);
        self.add_up();
        self.check()
    }

    /// Fills the template with `level(column, row)`.
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

    /// Checks that the template has contrast.
    ///
    /// # Errors
    /// `FlatTemplate` if its standard deviation is below [`MIN_DEVIATION`], `Outside` if it is empty.
    pub fn check(&self) -> Result<(), TemplateError> {
        match self.deviation() {
            deviation if deviation >= MIN_DEVIATION => Ok(()),
            _ if self.pixels.is_empty() => Err(TemplateError::Outside),
            _ => Err(TemplateError::FlatTemplate),
        }
    }

    /// Width, px.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height, px.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// View of the patch; `None` for an empty template.
    #[must_use]
    pub fn view(&self) -> Option<ImageView<'_>> {
        ImageView::new(&self.pixels, self.width, self.height, self.width).ok()
    }

    /// Standard deviation of the gray levels; zero for an empty template.
    #[must_use]
    pub fn deviation(&self) -> f64 {
        let count = self.pixels.len().max(1) as f64;
        let mean = self.sum as f64 / count;
        (self.square_sum as f64 / count - mean * mean).max(0.0).sqrt()
    }

    fn row(&self, v: usize) -> &[u8] {
        &self.pixels[v * self.width..(v + 1) * self.width]
    }

    /// Pixels of the image under row `v` of the template at `position`.
    fn row_under<'a>(&self, image: &ImageView<'a>, position: PatchOrigin, v: usize) -> &'a [u8] {
        &image.row(position.v + v)[position.u..position.u + self.width]
    }
}

/// Range of template positions, both ends included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SearchArea {
    first: PatchOrigin,
    last: PatchOrigin,
}

impl SearchArea {
    /// All positions at which the template lies inside the image; `None` if it is larger than the image, or empty.
    #[must_use]
    pub fn whole(image: ImageView<'_>, template: &Template) -> Option<Self> {
        if template.pixels.is_empty() {
            return None;
        }
        let last = PatchOrigin {
            u: image.width().checked_sub(template.width)?,
            v: image.height().checked_sub(template.height)?,
        };
        Some(Self { first: PatchOrigin::default(), last })
    }

    /// Positions within `reach` columns of `middle`, in its row, at which the template lies inside the image; `None` if
    /// there is none.
    #[must_use]
    pub fn along_row(
        image: ImageView<'_>,
        template: &Template,
        middle: PatchOrigin,
        reach: usize,
    ) -> Option<Self> {
        let whole = Self::whole(image, template)?;
        let first = PatchOrigin { u: middle.u.saturating_sub(reach), v: middle.v };
        let last = PatchOrigin { u: middle.u.saturating_add(reach).min(whole.last.u), v: middle.v };
        (first.u <= last.u && middle.v <= whole.last.v).then_some(Self { first, last })
    }

    /// First position.
    #[must_use]
    pub fn first(&self) -> PatchOrigin {
        self.first
    }

    /// Last position.
    #[must_use]
    pub fn last(&self) -> PatchOrigin {
        self.last
    }

    /// Positions in raster order.
    pub fn positions(&self) -> impl Iterator<Item = PatchOrigin> + use<> {
        let Self { first, last } = *self;
        (first.v..=last.v).flat_map(move |v| (first.u..=last.u).map(move |u| PatchOrigin { u, v }))
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
        assert_eq!(template.take(image, PatchOrigin { u: 3, v: 1 }, 4, 4), Ok(()));
        assert_eq!((template.width(), template.height(), template.deviation()), (4, 4, 20.0));
        for (u, v, width, height) in
            [(7, 0, 4, 4), (0, 3, 4, 4), (0, 0, 11, 1), (usize::MAX, 0, 2, 2), (0, 0, 0, 3)]
        {
            let taken = template.take(image, PatchOrigin { u, v }, width, height);
            assert_eq!(taken, Err(TemplateError::Outside), "{u} {v} {width} {height}");
        }
        assert_eq!(template.deviation(), 20.0, "unchanged");
        assert_eq!(template.take(image, PatchOrigin { u: 0, v: 0 }, 4, 4), Err(TemplateError::FlatTemplate));
    }

    #[test]
    fn a_row_of_positions_ends_at_the_border() {
        let data = [0; 60];
        let image = ImageView::new(&data, 10, 6, 10).unwrap();
        let template = Template::of(ImageView::new(&data, 4, 2, 4).unwrap());
        let row = |u, v, reach| {
            SearchArea::along_row(image, &template, PatchOrigin { u, v }, reach)
                .map(|area| area.positions().map(|position| position.u).collect::<Vec<_>>())
        };
        assert_eq!(row(1, 4, 2), Some(vec![0, 1, 2, 3]));
        assert_eq!(row(6, 0, 1), Some(vec![5, 6]));
        assert_eq!(row(1, 5, 2), None);
        assert_eq!(row(9, 0, 2), None);
    }
}
