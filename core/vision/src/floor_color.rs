//! Colors that count as floor: a box of thresholds, or a table of 32 x 32 x 32 color classes.
//!
//! Sekimori, Usui, Masutani & Miyazaki recognize the floor by its color alone.

use serde::{Deserialize, Serialize};

use super::bit_image::{BitImage, pack};
use super::vectorize::{self, Kernel};
use yamabico_geometry::image::RgbView;

/// Number of classes per channel of a table.
const CLASSES: usize = 32;

/// Red, green, blue.
pub type Color = [u8; 3];

/// Color range: lower and upper threshold per channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ColorBox {
    /// Lower thresholds of red, green and blue.
    #[schemars(inner(range(min = 0, max = 255)), extend("former_name" = "least"))]
    pub min: Color,
    /// Upper thresholds of red, green and blue.
    #[schemars(inner(range(min = 0, max = 255)), extend("former_name" = "most"))]
    pub max: Color,
}

impl ColorBox {
    /// Returns true if the color lies within the thresholds, inclusive.
    #[inline(always)]
    #[must_use]
    pub fn contains(&self, color: Color) -> bool {
        // No short-circuit evaluation, so that it vectorizes.
        let within = |i: usize| (color[i] >= self.min[i]) & (color[i] <= self.max[i]);
        within(0) & within(1) & within(2)
    }

    /// Returns the box widened by `levels` on either side of each channel.
    #[must_use]
    pub fn widened(&self, levels: u8) -> Self {
        Self {
            min: self.min.map(|level| level.saturating_sub(levels)),
            max: self.max.map(|level| level.saturating_add(levels)),
        }
    }

    /// Returns the box with each threshold moved toward that of another box, by at most `levels`.
    #[must_use]
    pub fn towards(&self, other: &ColorBox, levels: u8) -> Self {
        let step = |from: u8, to: u8| to.clamp(from.saturating_sub(levels), from.saturating_add(levels));
        Self {
            min: std::array::from_fn(|i| step(self.min[i], other.min[i])),
            max: std::array::from_fn(|i| step(self.max[i], other.max[i])),
        }
    }

    /// Maximum width of a channel, gray levels.
    #[must_use]
    pub fn spread(&self) -> u8 {
        let spread = |i: usize| self.max[i].saturating_sub(self.min[i]);
        spread(0).max(spread(1)).max(spread(2))
    }
}

/// Classification of 32 x 32 x 32 colors as floor or other.
#[derive(Clone, PartialEq, Eq)]
pub struct ColorTable {
    /// One word per class of red and green, with one bit per class of blue.
    words: Box<[u32; CLASSES * CLASSES]>,
}

impl Default for ColorTable {
    fn default() -> Self {
        Self { words: Box::new([0; CLASSES * CLASSES]) }
    }
}

impl std::fmt::Debug for ColorTable {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "ColorTable({} of {} colors)", self.count(), CLASSES.pow(3))
    }
}

impl ColorTable {
    /// Returns true if the color's class is floor.
    #[inline(always)]
    #[must_use]
    pub fn contains(&self, [red, green, blue]: Color) -> bool {
        let index = (usize::from(red) >> 3) << 5 | usize::from(green) >> 3;
        self.words[index] >> (blue >> 3) & 1 == 1
    }

    /// Marks the color's class as floor.
    pub fn insert(&mut self, [red, green, blue]: Color) {
        self.words[(usize::from(red) >> 3) << 5 | usize::from(green) >> 3] |= 1 << (blue >> 3);
    }

    /// Marks every class that overlaps the box as floor.
    pub fn insert_box(&mut self, colors: &ColorBox) {
        let classes = |i: usize| colors.min[i] >> 3..=colors.max[i] >> 3;
        for red in classes(0) {
            for green in classes(1) {
                classes(2).for_each(|blue| self.insert([red << 3, green << 3, blue << 3]));
            }
        }
    }

    /// Number of classes that are floor.
    #[must_use]
    pub fn count(&self) -> u32 {
        self.words.iter().map(|word| word.count_ones()).sum()
    }

    /// Serializes the table as 32 lines of hexadecimal digits: one line per class of red, eight digits per class of
    /// green, lowest bit for the lowest blue.
    #[must_use]
    pub fn to_lines(&self) -> Vec<String> {
        let line = |words: &[u32]| words.iter().map(|word| format!("{word:08x}")).collect();
        self.words.chunks_exact(CLASSES).map(line).collect()
    }

    /// Parses the output of [`ColorTable::to_lines`]; `None` for any other text.
    #[must_use]
    pub fn from_lines<S: AsRef<str>>(lines: &[S]) -> Option<Self> {
        let mut table = Self::default();
        if lines.len() != CLASSES {
            return None;
        }
        for (words, line) in table.words.chunks_exact_mut(CLASSES).zip(lines) {
            let (digits, rest) = line.as_ref().as_bytes().as_chunks::<8>();
            if digits.len() != CLASSES || !rest.is_empty() {
                return None;
            }
            for (word, digits) in words.iter_mut().zip(digits) {
                let text = std::str::from_utf8(digits).ok()?;
                *word = u32::from_str_radix(text, 16).ok()?;
            }
        }
        Some(table)
    }
}

/// Color model of a floor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FloorColors {
    /// Thresholds: fast, and sufficient for one floor under uniform light.
    Box(ColorBox),
    /// Table of color classes.
    Table(ColorTable),
}

impl FloorColors {
    /// Returns true if the color is floor.
    #[must_use]
    pub fn contains(&self, color: Color) -> bool {
        match self {
            FloorColors::Box(colors) => colors.contains(color),
            FloorColors::Table(table) => table.contains(color),
        }
    }

    /// Sets the pixels of `mask` whose color is floor. Only the `columns` of each row are examined; all other pixels,
    /// and rows without an entry, stay unset.
    pub fn mark(&self, image: RgbView, columns: &[std::ops::Range<u32>], mask: &mut BitImage) {
        mask.clear(image.width(), image.height());
        match self {
            FloorColors::Box(colors) => {
                vectorize::run(Mark { image, columns, mask, classes: Thresholds::new(colors) });
            }
            FloorColors::Table(table) => vectorize::run(Mark { image, columns, mask, classes: table }),
        }
    }
}

/// Classifier of 64 pixels at a time.
trait Classes {
    /// Returns one bit per pixel, the first pixel in the lowest bit.
    fn word(&self, colors: &[Color; 64]) -> u64;
}

impl Classes for &ColorTable {
    #[inline(always)]
    fn word(&self, colors: &[Color; 64]) -> u64 {
        let mut flags = [0; 64];
        for (flag, &color) in flags.iter_mut().zip(colors) {
            *flag = u8::from(self.contains(color));
        }
        pack(&flags)
    }
}

/// Box with its thresholds repeated for 64 interleaved pixels: all channels are compared alike, then the three bits of
/// each pixel are combined.
struct Thresholds {
    min: [u8; 192],
    /// Upper minus lower threshold. Meaningless for an empty channel: the box is then empty.
    span: [u8; 192],
    is_empty: bool,
}

impl Thresholds {
    fn new(colors: &ColorBox) -> Self {
        let channels = |levels: Color| std::array::from_fn(|i| levels[i % 3]);
        let span = std::array::from_fn(|i| colors.max[i].wrapping_sub(colors.min[i]));
        let is_empty = (0..3).any(|i| colors.max[i] < colors.min[i]);
        Self { min: channels(colors.min), span: channels(span), is_empty }
    }
}

impl Classes for Thresholds {
    #[inline(always)]
    fn word(&self, colors: &[Color; 64]) -> u64 {
        if self.is_empty {
            return 0;
        }
        let bytes = colors.as_flattened();
        let mut flags = [0; 192];
        for (((flag, &byte), &min), &span) in flags.iter_mut().zip(bytes).zip(&self.min).zip(&self.span) {
            *flag = u8::from(byte.wrapping_sub(min) <= span);
        }
        let [a, b, c] = [0, 1, 2].map(|i| pack(flags.as_chunks::<64>().0.get(i).unwrap_or(&[0; 64])));
        // Combines the three bits of a pixel at the position of its first.
        let first = a & (a >> 1 | b << 63) & (a >> 2 | b << 62);
        let second = b & (b >> 1 | c << 63) & (b >> 2 | c << 62);
        let third = c & c >> 1 & c >> 2;
        every_third(first) | every_third(second >> 2) << 22 | every_third(third >> 1) << 43
    }
}

/// Gathers every third bit, starting with the lowest.
#[inline(always)]
fn every_third(mut bits: u64) -> u64 {
    bits &= 0x9249_2492_4924_9249;
    bits = (bits | bits >> 2) & 0x30c3_0c30_c30c_30c3;
    bits = (bits | bits >> 4) & 0xf00f_00f0_0f00_f00f;
    bits = (bits | bits >> 8) & 0x00ff_0000_ff00_00ff;
    bits = (bits | bits >> 16) & 0x00ff_0000_0000_ffff;
    (bits | bits >> 32) & 0x003f_ffff
}

struct Mark<'a, C> {
    image: RgbView<'a>,
    columns: &'a [std::ops::Range<u32>],
    mask: &'a mut BitImage,
    classes: C,
}

impl<C: Classes> Kernel for Mark<'_, C> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for (v, columns) in self.columns.iter().enumerate().take(self.image.height()) {
            let end = (columns.end as usize).min(self.image.width());
            // Processes whole words, then clips them to the columns.
            let first = columns.start as usize / 64;
            if columns.start as usize >= end {
                continue;
            }
            let pixels = &self.image.row(v)[64 * first..];
            let words = &mut self.mask.row_mut(v)[first..end.div_ceil(64)];
            let (whole, rest) = pixels.as_chunks::<64>();
            for (word, colors) in words.iter_mut().zip(whole) {
                *word = self.classes.word(colors);
            }
            if let Some(word) = words.get_mut(whole.len()) {
                let mut colors = [[0; 3]; 64];
                colors[..rest.len()].copy_from_slice(rest);
                *word = self.classes.word(&colors) & ((1 << rest.len()) - 1);
            }
            words[0] &= u64::MAX << (columns.start % 64);
            if !end.is_multiple_of(64) {
                words[words.len() - 1] &= (1 << (end % 64)) - 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GREEN: ColorBox = ColorBox { min: [16, 80, 24], max: [79, 255, 103] };

    #[test]
    fn a_table_of_a_box_marks_what_the_box_marks() {
        let data: Vec<u8> = (0..3 * 150 * 7_usize).map(|i| (i * i * 31 + i * 7) as u8).collect();
        let image = RgbView::new(&data, 150, 7, 450).unwrap();
        let mut table = ColorTable::default();
        table.insert_box(&GREEN);
        assert_eq!(table.count(), 8 * 22 * 10);
        let columns = [0..150, 3..149, 64..128, 63..65, 10..10, 140..900];
        let (mut by_box, mut by_table) = (BitImage::default(), BitImage::default());
        FloorColors::Box(GREEN).mark(image, &columns, &mut by_box);
        FloorColors::Table(table).mark(image, &columns, &mut by_table);
        let mut count = 0;
        for v in 0..7 {
            for u in 0..150 {
                let is_asked = columns.get(v).is_some_and(|columns| columns.contains(&(u as u32)));
                let is_floor = is_asked && GREEN.contains(image.pixel(u, v));
                assert_eq!((by_box.get(u, v), by_table.get(u, v)), (is_floor, is_floor), "{u}, {v}");
                count += u32::from(is_floor);
            }
        }
        assert!(count > 10 && by_box.count() == count, "{count}");
    }

    #[test]
    fn an_empty_box_has_no_color() {
        let data: Vec<u8> = (0..3 * 64).map(|i| i as u8).collect();
        let image = RgbView::new(&data, 64, 1, 192).unwrap();
        let mut mask = BitImage::default();
        let empty = ColorBox { min: [0, 9, 0], max: [255, 8, 255] };
        FloorColors::Box(empty).mark(image, std::slice::from_ref(&(0..64)), &mut mask);
        assert_eq!(mask.count(), 0);
        assert_eq!(every_third(1 | 1 << 3 | 1 << 30 | 1 << 63), 1 | 2 | 1 << 10 | 1 << 21);
    }

    #[test]
    fn a_box_moves_step_by_step() {
        let moved = GREEN.towards(&ColorBox { min: [10, 200, 24], max: [255, 255, 0] }, 20);
        assert_eq!(moved, ColorBox { min: [10, 100, 24], max: [99, 255, 83] });
        assert_eq!(GREEN.widened(30), ColorBox { min: [0, 50, 0], max: [109, 255, 133] });
        assert_eq!((GREEN.spread(), moved.spread()), (175, 155));
    }

    #[test]
    fn a_table_survives_serialization() {
        let mut table = ColorTable::default();
        table.insert([255, 0, 255]);
        table.insert([8, 130, 40]);
        let lines = table.to_lines();
        assert_eq!(ColorTable::from_lines(&lines), Some(table));
        assert_eq!(ColorTable::from_lines(&lines[1..]), None);
        assert_eq!(ColorTable::from_lines(&vec!["é"; 32]), None);
    }
}
