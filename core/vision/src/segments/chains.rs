//! Edge following: links edge pixels into chains of consistent gradient direction.

use super::edges::{EDGE, EdgeMap, EdgePoint, SECTOR, SECTORS, STRONG};

/// Chains of edge points of one image, with the buffers for following them.
#[derive(Clone, Debug, Default)]
pub(super) struct Chains {
    /// Points of all chains, chain by chain, in order along each.
    pub points: Vec<EdgePoint>,
    /// End index of each chain in `points`.
    pub ends: Vec<u32>,
    /// Pixels of the current chain, from its seed forward and backward.
    ahead: Vec<u32>,
    behind: Vec<u32>,
}

/// Index offsets of the three neighbors that may continue a chain, best first, for each gradient sector.
type Steps = [[isize; 3]; SECTORS];

impl Chains {
    /// Follows every edge that has a strong pixel, as long as neighbors differ by at most one sector (22.5 to 45
    /// degrees), and keeps chains of at least `min_points`. Clears the marks of `edges`.
    ///
    /// Seeds are searched only in every `min_points / 2`-th row and column: any edge that is long enough crosses one,
    /// and most specks do not. Differs from full hysteresis: the edge must be strong at such a crossing.
    pub(super) fn follow(&mut self, edges: &mut EdgeMap, min_points: usize) {
        self.points.clear();
        self.ends.clear();
        let steps = steps(edges.width() as isize);
        let width = edges.width();
        let pitch = (min_points / 2).max(1);
        for row in 0..edges.marks.len() / width {
            let step = if row % pitch == 0 { 1 } else { pitch };
            for seed in (row * width..(row + 1) * width).step_by(step) {
                if edges.marks[seed] & STRONG != 0 {
                    self.follow_from(seed, edges, &steps, min_points);
                }
            }
        }
    }

    fn follow_from(&mut self, seed: usize, edges: &mut EdgeMap, steps: &Steps, min_points: usize) {
        let mark = edges.marks[seed];
        self.ahead.clear();
        self.behind.clear();
        self.ahead.push(seed as u32);
        walk(seed, mark, 0, &mut edges.marks, steps, &mut self.ahead);
        walk(seed, mark, SECTORS as u8 / 2, &mut edges.marks, steps, &mut self.behind);
        if self.ahead.len() + self.behind.len() < min_points {
            return;
        }
        for &pixel in self.behind.iter().rev() {
            self.points.push(edges.point(pixel as usize));
        }
        for &pixel in &self.ahead {
            self.points.push(edges.point(pixel as usize));
        }
        self.ends.push(self.points.len() as u32);
    }
}

/// Walks from `seed`, excluded, and appends each pixel to `out`; `turn` is 0 for forward and half the number of sectors
/// for backward. Clears the marks of visited pixels.
#[inline(always)]
fn walk(seed: usize, mark: u8, turn: u8, marks: &mut [u8], steps: &Steps, out: &mut Vec<u32>) {
    marks[seed] = 0;
    let (mut here, mut sector) = (seed, mark & SECTOR);
    loop {
        let offsets = &steps[usize::from((sector + turn) & SECTOR)];
        // Selections instead of branches: the branch would be unpredictable.
        let (mut there, mut mark) = (0, 0);
        for step in [offsets[2], offsets[1], offsets[0]] {
            let candidate = here.wrapping_add_signed(step);
            let found = marks.get(candidate).copied().unwrap_or(0);
            (there, mark) = if agrees(found, sector) { (candidate, found) } else { (there, mark) };
        }
        if mark == 0 {
            return;
        }
        marks[there] = 0;
        out.push(there as u32);
        (here, sector) = (there, mark & SECTOR);
    }
}

/// Returns true if the mark is an edge in the same or an adjacent sector (0, 1 or 2 after the shift by one).
#[inline(always)]
fn agrees(mark: u8, sector: u8) -> bool {
    (mark & EDGE != 0) & ((mark.wrapping_sub(sector).wrapping_add(1) & SECTOR) <= 2)
}

/// Offsets along the edge, which runs a quarter turn after its gradient: nearest direction first.
fn steps(width: isize) -> Steps {
    std::array::from_fn(|sector| {
        // Middle of the sector plus a quarter turn, in 1/8 turns.
        let eighths = (sector as f64 + 0.5) / 2.0 + 2.0;
        let nearest = eighths.round();
        let second = if eighths > nearest { nearest + 1.0 } else { nearest - 1.0 };
        let third = 2.0 * nearest - second;
        [nearest, second, third].map(|eighth| match (eighth as isize).rem_euclid(8) {
            0 => 1,
            1 => width + 1,
            2 => width,
            3 => width - 1,
            4 => -1,
            5 => -width - 1,
            6 => -width,
            _ => 1 - width,
        })
    })
}

#[cfg(test)]
mod tests {
    use yamabico_geometry::Hypotenuse;

    use super::super::edges::UNITS_PER_LEVEL;
    use super::*;
    use yamabico_geometry::image::ImageView;

    #[test]
    fn closed_outlines_are_followed_all_around() {
        let (width, height) = (80, 70);
        let disc = |u: usize, v: usize| {
            let radius = (u as f64 - 40.0).hypotenuse(v as f64 - 35.0);
            (50.0 + 150.0 * (25.5 - radius).clamp(0.0, 1.0)) as u8
        };
        let square =
            |u: usize, v: usize| if (20..60).contains(&u) && (15..55).contains(&v) { 200 } else { 50 };
        for (shape, chains, points) in
            [(&disc as &dyn Fn(usize, usize) -> u8, 1..=2, 130..=150), (&square, 1..=4, 145..=165)]
        {
            let data: Vec<u8> = (0..width * height).map(|i| shape(i % width, i / width)).collect();
            let mut edges = EdgeMap::default();
            let image = ImageView::new(&data, width, height, width).unwrap();
            edges.find(image, 10.0 * UNITS_PER_LEVEL, 20.0 * UNITS_PER_LEVEL);
            let mut found = Chains::default();
            found.follow(&mut edges, 10);
            assert!(chains.contains(&found.ends.len()), "{:?}", found.ends);
            assert!(points.contains(&found.points.len()), "{}", found.points.len());
        }
    }
}
