//! One picture row from the lines that cross it: pixels that show one polygon, and pixels on an edge.

use super::spans::{Line, NOTHING};

/// Polygons that are told apart in one edge pixel; more are counted to the first.
const SLOTS: usize = 6;
/// Marks a pixel that a line sees an edge in.
const MIXED: u16 = u16::MAX - 1;

/// A polygon's part of an edge pixel.
#[derive(Clone, Copy, Debug, Default)]
pub struct Part {
    pub polygon: u16,
    /// Share of the pixel, 0 to 1.
    pub share: f32,
    /// Center of that share in the picture.
    pub x: f32,
    pub y: f32,
}

/// What one row shows.
#[derive(Default)]
pub struct Row {
    width: usize,
    /// Height in the picture and share of the row of each line.
    lines: Vec<(f64, f32)>,
    whole: Vec<u16>,
    parts: Vec<[Part; SLOTS]>,
    counts: Vec<u8>,
}

/// A piece of a row.
pub enum Piece<'a> {
    /// Pixels `start..end` show this polygon alone.
    Run { start: usize, end: usize, polygon: u16 },
    /// Pixel `x` shows several.
    Edge { x: usize, parts: &'a [Part] },
}

impl Row {
    /// Forgets everything, for a picture `width` wide.
    pub fn clear(&mut self, width: usize) {
        self.width = width;
        self.lines.clear();
        self.parts.resize(width, [Part::default(); SLOTS]);
        self.counts.clear();
        self.counts.resize(width, 0);
    }

    /// Takes over the row's next line: its height `y` in the picture, and its share of the row.
    pub fn add(&mut self, y: f64, share: f32, line: &Line) {
        let base = self.lines.len() * self.width;
        self.lines.push((y, share));
        if self.whole.len() < base + self.width {
            self.whole.resize(base + self.width, NOTHING);
        }
        for pair in line.stretches.windows(2) {
            let (a, b, polygon) = (pair[0].start, pair[1].start, pair[0].polygon);
            let (ia, ib) = (a as usize, b as usize);
            if ia == ib {
                self.partial(base, ia, polygon, [a, b], y, share);
                continue;
            }
            let mut start = ia;
            if a > ia as f64 {
                self.partial(base, ia, polygon, [a, (ia + 1) as f64], y, share);
                start += 1;
            }
            self.whole[base + start..base + ib].fill(polygon);
            if b > ib as f64 {
                self.partial(base, ib, polygon, [ib as f64, b], y, share);
            }
        }
    }

    /// Hands out the row from left to right.
    pub fn pieces(&mut self, mut draw: impl FnMut(Piece<'_>)) {
        let (w, lines) = (self.width, self.lines.len());
        let mut x = 0;
        while x < w {
            let polygon = self.whole[x];
            let uniform = |whole: &[u16], x: usize| (0..lines).all(|l| whole[l * w + x] == polygon);
            if polygon != MIXED && uniform(&self.whole, x) {
                let start = x;
                while x < w && uniform(&self.whole, x) {
                    x += 1;
                }
                draw(Piece::Run { start, end: x, polygon });
                continue;
            }
            for l in 0..lines {
                let polygon = self.whole[l * w + x];
                if polygon != MIXED {
                    let (y, share) = self.lines[l];
                    self.note(x, polygon, share, x as f64 + 0.5, y);
                }
            }
            let count = usize::from(self.counts[x]);
            for part in &mut self.parts[x][..count] {
                part.x /= part.share;
                part.y /= part.share;
            }
            draw(Piece::Edge { x, parts: &self.parts[x][..count] });
            x += 1;
        }
    }

    fn partial(&mut self, base: usize, x: usize, polygon: u16, span: [f64; 2], y: f64, share: f32) {
        let x = x.min(self.width - 1);
        self.whole[base + x] = MIXED;
        self.note(x, polygon, share * (span[1] - span[0]) as f32, 0.5 * (span[0] + span[1]), y);
    }

    fn note(&mut self, x: usize, polygon: u16, share: f32, center_x: f64, center_y: f64) {
        let count = usize::from(self.counts[x]);
        let parts = &mut self.parts[x];
        let slot = parts[..count].iter().position(|p| p.polygon == polygon).unwrap_or_else(|| {
            if count == SLOTS {
                return 0;
            }
            parts[count] = Part { polygon, ..Part::default() };
            self.counts[x] += 1;
            count
        });
        let part = &mut parts[slot];
        part.share += share;
        part.x += share * center_x as f32;
        part.y += share * center_y as f32;
    }
}
