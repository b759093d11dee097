//! Resolves the scan lines of an image row into pixels with one polygon and edge pixels.

use super::spans::{Line, NOTHING};

/// Maximum number of polygons in an edge pixel; further ones are added to the first.
const SLOTS: usize = 6;
/// Marks a pixel in which a scan line crosses an edge.
const MIXED: u16 = u16::MAX - 1;

/// Part of an edge pixel that shows one polygon.
#[derive(Clone, Copy, Debug, Default)]
pub struct Part {
    pub polygon: u16,
    /// Fraction of the pixel, 0 to 1.
    pub share: f32,
    /// Center of that part in the image.
    pub x: f32,
    pub y: f32,
}

/// One image row.
#[derive(Default)]
pub struct Row {
    width: usize,
    /// Image coordinate y of each scan line, and its fraction of the row.
    lines: Vec<(f64, f32)>,
    whole: Vec<u16>,
    parts: Vec<[Part; SLOTS]>,
    counts: Vec<u8>,
}

/// Piece of a row.
pub enum Piece<'a> {
    /// Pixels `start..end` that show one polygon.
    Run { start: usize, end: usize, polygon: u16 },
    /// Pixel `x`, which shows several polygons.
    Edge { x: usize, parts: &'a [Part] },
}

impl Row {
    /// Clears the row, for images of this width.
    pub fn clear(&mut self, width: usize) {
        self.width = width;
        self.lines.clear();
        self.parts.resize(width, [Part::default(); SLOTS]);
        self.counts.clear();
        self.counts.resize(width, 0);
    }

    /// Adds the next scan line, at image coordinate `y`, with its fraction of the row.
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

    /// Calls `draw` with the pieces of the row, from left to right.
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
