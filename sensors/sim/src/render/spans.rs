//! Visible polygons along a scan line, exact to the crossing of two edges or two planes.

/// Index that stands for no polygon.
pub const NOTHING: u16 = u16::MAX;

/// Outline of a polygon that a scan line may cross.
pub trait Outline {
    /// Returns the interval of the scan line `y` inside the outline.
    fn span(&self, y: f64) -> Option<(f64, f64)>;

    /// Returns slope and offset of 1 / depth along the scan line `y`.
    fn inverse_depth(&self, y: f64) -> (f64, f64);
}

/// Part of a scan line that shows one polygon, up to the start of the next.
#[derive(Clone, Copy, Debug)]
pub struct Stretch {
    pub start: f64,
    pub polygon: u16,
}

/// Scan line.
#[derive(Default)]
pub struct Line {
    /// Visible polygons from left to right; the last stretch is [`NOTHING`] at the end of the line.
    pub stretches: Vec<Stretch>,
    pieces: Vec<Stretch>,
}

impl Line {
    /// Finds the visible polygons on the scan line `y` between its two ends; `candidates` are indices of `outlines`.
    pub fn scan<O: Outline>(&mut self, outlines: &[O], candidates: &[u16], y: f64, ends: [f64; 2]) {
        self.stretches.clear();
        self.stretches.extend(ends.map(|start| Stretch { start, polygon: NOTHING }));
        for &c in candidates {
            if let Some((low, high)) = outlines[usize::from(c)].span(y) {
                let (low, high) = (low.max(ends[0]), high.min(ends[1]));
                if high - low > 1e-6 {
                    self.insert(outlines, c, y, low, high);
                }
            }
        }
    }

    fn insert<O: Outline>(&mut self, outlines: &[O], new: u16, y: f64, low: f64, high: f64) {
        let depth = |p: u16| outlines[usize::from(p)].inverse_depth(y);
        let (slope, offset) = depth(new);
        let mut first = 0;
        while self.stretches[first + 1].start <= low {
            first += 1;
        }
        let mut end = first;
        let mut changed = false;
        self.pieces.clear();
        while self.stretches[end].start < high {
            let old = self.stretches[end];
            let stop = self.stretches[end + 1].start;
            let (from, to) = (old.start.max(low), stop.min(high));
            if old.start < low {
                push(&mut self.pieces, old.start, old.polygon);
            }
            if old.polygon == NOTHING {
                push(&mut self.pieces, from, new);
                changed = true;
            } else {
                let (s, o) = depth(old.polygon);
                let ahead = |x: f64| (slope - s) * x + (offset - o);
                let (a, b) = (ahead(from), ahead(to));
                let bias = 1e-9;
                if a > bias || b > bias {
                    changed = true;
                    let cross = from + (to - from) * (a / (a - b));
                    if a <= bias && b > bias {
                        push(&mut self.pieces, from, old.polygon);
                        push(&mut self.pieces, if a < 0.0 { cross } else { from }, new);
                    } else {
                        push(&mut self.pieces, from, new);
                        if b < -bias {
                            push(&mut self.pieces, cross, old.polygon);
                        }
                    }
                } else {
                    push(&mut self.pieces, from, old.polygon);
                }
            }
            if to < stop {
                push(&mut self.pieces, to, old.polygon);
            }
            end += 1;
        }
        if changed {
            self.stretches.splice(first..end, self.pieces.iter().copied());
        }
    }
}

/// Appends a stretch. It replaces a last stretch with the same start, and is merged with one of the same polygon.
#[inline]
fn push(pieces: &mut Vec<Stretch>, start: f64, polygon: u16) {
    if let Some(last) = pieces.last_mut() {
        if last.polygon == polygon {
            return;
        }
        if start <= last.start {
            last.polygon = polygon;
            return;
        }
    }
    pieces.push(Stretch { start, polygon });
}
