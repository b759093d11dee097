//! Template tracking of one vertical edge: search, subpixel refinement, and checks against drift.
//!
//! Kweon et al. (1991), section 4, search a template with SSDA and replace it every time. Differs from the
//! paper: the search runs along a row only, since an edge looks the same along its length; the edge is refined after each
//! match; a match must correlate, be unique, match backward in the last image, and agree with the first template (anchor).

use crate::template::correlation::{RowCorrelation, peak_offset};
use crate::template::ssda::search;
use crate::template::{PatchOrigin, SearchArea, Template, TemplateError};
use nalgebra::Vector2;
use yamabico_core::image::{GrayImage, ImageView};
use yamabico_core::message::Reason;

use crate::snap::{Brighter, SnapWindow, Snapped, snap};
use crate::strip::Strip;

/// Size of a template, pixels at an image width of 640 px.
const SIZE_AT_640_PX: [f64; 2] = [20.0, 40.0];
/// Minimum size, pixels.
const MIN_SIZE_PX: [usize; 2] = [10, 16];
/// Search range in columns to either side of the prediction, pixels at an image width of 640 px.
const REACH_AT_640_PX: f64 = 12.0;
/// Range in columns to either side of a match for the subpixel refinement, pixels at an image width of 640 px.
const SNAP_AT_640_PX: f64 = 5.0;
/// Distance from the best match (px) from which on another match must correlate less.
const APART_PX: usize = 4;
/// Minimum difference of the correlations.
const UNIQUE_BY: f64 = 0.05;
/// Minimum correlation at which the running template is replaced.
const REPLACE_ABOVE: f64 = 0.8;
/// Maximum difference between the match and the anchor match, and of the backward match, pixels.
const AGREE_PX: f64 = 1.5;
/// Growth in scale after which the anchor is replaced.
const RENEW_AT_SCALE: f64 = 1.5;

/// Prediction of an edge before the search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aim {
    /// Expected position, distorted pixels.
    pub pixel: Vector2<f64>,
    /// Maximum distance from there, pixels.
    pub gate_px: f64,
    /// Depth along the optical axis, m: gives the change in scale.
    pub depth_m: f64,
    /// Slope of the edge, columns per row.
    pub lean: f64,
}

/// The templates of one edge.
#[derive(Clone, Debug)]
pub struct EdgeTemplate {
    size: [usize; 2],
    reach: usize,
    snap_reach: usize,
    min_correlation: f64,
    brighter: Brighter,
    anchor: Patch,
    anchor_depth_m: f64,
    running: Patch,
    grown: GrayImage,
    scaled: Template,
    found: Template,
    /// A wider patch of the last image with a match.
    last: Patch,
    strip: Strip,
    alike: RowCorrelation,
}

/// A template and the column of the edge in it.
#[derive(Clone, Debug, Default)]
struct Patch {
    template: Template,
    edge: f64,
}

impl EdgeTemplate {
    /// Returns empty templates for images of this width. Matches must correlate by `min_correlation`, 0 to 1.
    #[must_use]
    pub fn new(image_width: u32, min_correlation: f64) -> Self {
        let scale = f64::from(image_width) / 640.0;
        let even = |px: f64, least: usize| ((0.5 * px * scale).round() as usize * 2).max(least);
        Self {
            size: [even(SIZE_AT_640_PX[0], MIN_SIZE_PX[0]), even(SIZE_AT_640_PX[1], MIN_SIZE_PX[1])],
            reach: ((REACH_AT_640_PX * scale).round() as usize).max(6),
            snap_reach: ((SNAP_AT_640_PX * scale).round() as usize).max(3),
            min_correlation,
            brighter: Brighter::Left,
            anchor: Patch::default(),
            anchor_depth_m: 1.0,
            running: Patch::default(),
            grown: GrayImage::default(),
            scaled: Template::default(),
            found: Template::default(),
            last: Patch::default(),
            strip: Strip::default(),
            alike: RowCorrelation::default(),
        }
    }

    /// Returns the rows above and below the prediction that must lie in the image.
    #[must_use]
    pub fn half_rows(&self) -> f64 {
        0.5 * self.size[1] as f64 + 5.0
    }

    /// Returns the edge of either polarity within the gate; `None` if there is none.
    #[must_use]
    pub fn edge_at(&self, image: ImageView<'_>, aim: &Aim) -> Option<(Snapped, Brighter)> {
        let reach = (aim.gate_px.ceil().max(2.0) as usize).min(self.snap_reach);
        let edges = [Brighter::Left, Brighter::Right].map(|brighter| {
            let window = SnapWindow { reach, brighter, ..self.window(aim, aim.pixel) };
            snap(image, &window).map(|edge| (edge, brighter))
        });
        let is_near = |(edge, _): &(Snapped, Brighter)| (edge.column - aim.pixel.x).abs() <= aim.gate_px;
        edges.into_iter().flatten().filter(is_near).max_by(|a, b| a.0.gradient.total_cmp(&b.0.gradient))
    }

    /// Takes the templates at an edge, and returns its refined column, pixels.
    ///
    /// # Errors
    /// `LowCorrelation` if there is no edge within the gate, `FlatTemplate` if it has no contrast, `Gated` if it is not in the
    /// image; tracking is impossible then.
    pub fn acquire(&mut self, image: ImageView<'_>, aim: &Aim) -> Result<f64, Reason> {
        let (edge, brighter) = self.edge_at(image, aim).ok_or(Reason::LowCorrelation)?;
        self.brighter = brighter;
        let at = Vector2::new(edge.column, aim.pixel.y);
        let mut strip = std::mem::take(&mut self.strip);
        let taken = self.cut(&mut strip, image, at).and_then(|at| {
            self.running.take(&strip, at, self.size, 0)?;
            self.renew(&strip, at, aim.depth_m)
        });
        self.strip = strip;
        taken.map(|()| edge.column)
    }

    /// Finds the edge in the next image.
    ///
    /// # Errors
    /// `LowCorrelation` for a weak match or one without a backward match, `Ambiguous` for one of several, `Gated` for one
    /// outside the gate or the image. The templates do not change then.
    pub fn track(&mut self, image: ImageView<'_>, aim: &Aim) -> Result<Snapped, Reason> {
        let mut strip = std::mem::take(&mut self.strip);
        let found = self.track_in(&mut strip, image, aim);
        self.strip = strip;
        found
    }

    fn track_in(&mut self, strip: &mut Strip, image: ImageView<'_>, aim: &Aim) -> Result<Snapped, Reason> {
        let expected = self.cut(strip, image, aim.pixel)?;
        let view = strip.view().ok_or(Reason::Gated)?;
        let middle = Strip::place(expected, self.running.edge, self.size[1]).ok_or(Reason::Gated)?;
        let area =
            SearchArea::along_row(view, &self.running.template, middle, self.reach).ok_or(Reason::Gated)?;
        let place = search(view, &self.running.template, &area, middle).position;
        self.alike.compute(view, &self.running.template, &area);
        let alike = self.alike.at(place.u).unwrap_or(0.0);
        if alike < self.min_correlation {
            return Err(Reason::LowCorrelation);
        }
        if !self.is_unique(place, alike) {
            return Err(Reason::Ambiguous);
        }
        let matched = place.u as f64 + self.offset(place) + self.running.edge;
        if !self.matches_backward(view, place, matched) {
            return Err(Reason::LowCorrelation);
        }
        let at = Vector2::new(strip.outside(matched), aim.pixel.y);
        let edge = snap(image, &self.window(aim, at)).ok_or(Reason::LowCorrelation)?;
        let is_near = (edge.column - aim.pixel.x).abs() <= aim.gate_px;
        if !is_near || (edge.column - at.x).abs() > 2.0 * AGREE_PX {
            return Err(Reason::Gated);
        }
        let at = strip.inside(Vector2::new(edge.column, aim.pixel.y));
        self.update(strip, at, aim.depth_m, alike);
        Ok(edge)
    }

    /// Cuts the strip around a pixel, and returns the coordinates of the pixel in it.
    fn cut(
        &self,
        strip: &mut Strip,
        image: ImageView<'_>,
        pixel: Vector2<f64>,
    ) -> Result<Vector2<f64>, Reason> {
        let [width, height] = self.size;
        let widest = width + 2 * (2 * self.reach + 2);
        let is_cut = strip.cut(image, pixel, widest, height + 2);
        if is_cut { Ok(strip.inside(pixel)) } else { Err(Reason::Gated) }
    }

    /// Returns true if every other position correlates clearly less than the best one.
    fn is_unique(&self, best: PatchOrigin, alike: f64) -> bool {
        let apart = self.alike.iter().filter(|(u, _)| u.abs_diff(best.u) > APART_PX);
        apart.fold(true, |is_unique, (_, other)| is_unique && other <= alike - UNIQUE_BY)
    }

    /// Returns the subpixel offset from the best column to the peak of the correlation; 0 at the ends of the range.
    fn offset(&self, place: PatchOrigin) -> f64 {
        let at = |u: usize| self.alike.at(u);
        let around = place.u.checked_sub(1).and_then(at).zip(at(place.u)).zip(at(place.u + 1));
        around.map_or(0.0, |((before, at), after)| peak_offset(before, at, after))
    }

    /// Returns true if the match, searched for in the last image, leads back to the edge.
    fn matches_backward(&mut self, view: ImageView<'_>, place: PatchOrigin, matched: f64) -> bool {
        let [width, height] = self.size;
        if self.found.take(view, place, width, height).is_err() {
            return false;
        }
        let Some(band) = self.last.template.view() else { return true };
        let Some(area) = SearchArea::whole(band, &self.found) else { return false };
        let in_patch = matched - place.u as f64;
        let start = PatchOrigin { u: (self.last.edge - in_patch).max(0.0) as usize, v: 0 };
        let back = search(band, &self.found, &area, start).position;
        // The backward match is accurate to whole columns.
        (back.u as f64 + in_patch - self.last.edge).abs() <= AGREE_PX + 0.5
    }

    fn update(&mut self, strip: &Strip, at: Vector2<f64>, depth_m: f64, alike: f64) {
        let scale = self.anchor_depth_m / depth_m;
        if alike >= REPLACE_ABOVE && self.anchor_agrees(strip, at, scale) {
            let is_kept = self.running.take(strip, at, self.size, 0).is_ok();
            if is_kept && scale > RENEW_AT_SCALE {
                // Without contrast the old anchor remains.
                let _ = self.renew(strip, at, depth_m);
            }
        }
        // A patch without contrast fails the backward match in the next image.
        let _ = self.last.take(strip, at, self.size, self.reach);
    }

    /// Returns true if the anchor, scaled by `scale`, matches at the edge.
    fn anchor_agrees(&mut self, strip: &Strip, at: Vector2<f64>, scale: f64) -> bool {
        let (Some(anchor), Some(view)) = (self.anchor.template.view(), strip.view()) else { return false };
        let [width, height] = self.size;
        let middle_u = 0.5 * width as f64;
        let grown = Grown { anchor, anchor_edge: self.anchor.edge, scale: scale.max(0.5) };
        grown.draw(&mut self.grown, width, height);
        let Ok(grown) = self.grown.view() else { return false };
        if self.scaled.take(grown, PatchOrigin::default(), width, height).is_err() {
            return false;
        }
        let Some(middle) = Strip::place(at, middle_u, height) else { return false };
        let reach = 2 * AGREE_PX.ceil() as usize;
        let Some(area) = SearchArea::along_row(view, &self.scaled, middle, reach) else { return false };
        self.alike.compute(view, &self.scaled, &area);
        let best = self.alike.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        best.is_some_and(|(u, alike)| {
            alike >= self.min_correlation && (u as f64 + middle_u - at.x).abs() <= AGREE_PX
        })
    }

    fn renew(&mut self, strip: &Strip, at: Vector2<f64>, depth_m: f64) -> Result<(), Reason> {
        self.anchor.take(strip, at, self.size, 0)?;
        self.anchor_depth_m = depth_m;
        self.last.take(strip, at, self.size, self.reach)
    }

    fn window(&self, aim: &Aim, middle: Vector2<f64>) -> SnapWindow {
        SnapWindow {
            middle,
            reach: self.snap_reach,
            rows: self.size[1] + 1,
            lean: aim.lean,
            brighter: self.brighter,
        }
    }
}

impl Patch {
    /// Takes the patch around an edge, `margin` columns wider on either side.
    fn take(
        &mut self,
        strip: &Strip,
        at: Vector2<f64>,
        [width, height]: [usize; 2],
        margin: usize,
    ) -> Result<(), Reason> {
        let place = Strip::place(at, (width / 2 + margin) as f64, height);
        let (Some(place), Some(view)) = (place, strip.view()) else { return Err(Reason::Gated) };
        match self.template.take(view, place, width + 2 * margin, height) {
            Err(TemplateError::Outside) => Err(Reason::Gated),
            taken => {
                self.edge = at.x - place.u as f64;
                taken.map_err(|_| Reason::FlatTemplate)
            }
        }
    }
}

/// A template scaled about its edge.
struct Grown<'a> {
    anchor: ImageView<'a>,
    anchor_edge: f64,
    scale: f64,
}

/// Source of a scaled column or row: the pixels before and after it, and the weight of the latter, of 256.
#[derive(Clone, Copy, Debug, Default)]
struct Between {
    before: usize,
    behind: usize,
    share: u32,
}

impl Between {
    /// Interpolates at position `at` of `count` pixels; the border is replicated.
    fn new(at: f64, count: usize) -> Self {
        let fixed = (256.0 * at.clamp(0.0, count as f64 - 1.0) + 0.5) as usize;
        let before = fixed / 256;
        Self { before, behind: (before + 1).min(count - 1), share: (fixed % 256) as u32 }
    }

    fn mix(self, before: u32, behind: u32) -> u32 {
        before * (256 - self.share) + behind * self.share
    }
}

/// Maximum number of columns of a scaled template.
const MAX_COLUMNS: usize = 256;

impl Grown<'_> {
    /// Draws the template, scaled to this size.
    fn draw(&self, out: &mut GrayImage, width: usize, height: usize) {
        let width = width.min(MAX_COLUMNS);
        out.resize(width, height);
        let mut columns = [Between::default(); MAX_COLUMNS];
        for (u, column) in columns.iter_mut().enumerate().take(width) {
            let from_edge = (u as f64 - 0.5 * width as f64) / self.scale;
            *column = Between::new(self.anchor_edge + from_edge, self.anchor.width());
        }
        let middle_v = 0.5 * height as f64;
        for (v, out) in out.pixels_mut().chunks_exact_mut(width).enumerate() {
            let row = Between::new(middle_v + (v as f64 - middle_v) / self.scale, self.anchor.height());
            let (upper, lower) = (self.anchor.row(row.before), self.anchor.row(row.behind));
            let down = |u: usize| row.mix(u32::from(upper[u]), u32::from(lower[u]));
            for (out, column) in out.iter_mut().zip(&columns) {
                let mixed = column.mix(down(column.before), down(column.behind));
                *out = ((mixed + (1 << 15)) >> 16) as u8;
            }
        }
    }
}
