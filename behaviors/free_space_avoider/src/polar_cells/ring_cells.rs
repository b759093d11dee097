//! Number of set pixels in polar cells around the center of a mirror image, from a precomputed template.
//!
//! Sekimori, Usui, Masutani & Miyazaki cut the image with a mask of ring sectors and label the connected components.
//! Differs from \[1\]: set pixels are counted per cell, which gives the same shares without labels and centroids.

use std::f64::consts::TAU;
use std::ops::Range;

use nalgebra::Vector2;

use yamabico_core::camera::MirrorImage;
use yamabico_vision::bit_image::BitImage;
use yamabico_vision::vectorize::{self, Kernel};

/// Angular tolerance for pixels on the border between two directions, rad: they belong to the left one.
const BORDER_RAD: f64 = 1e-9;
/// Minimum share of a cell inside the image. A cell with less is not visible.
const MIN_SHOWN: f64 = 0.5;

/// Reason why there is no template.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RingError {
    /// The number of rings or directions is out of range.
    #[error(
        "{rings} rings with {directions} directions are not possible: use 1 to 64 rings and 3 to 360 directions"
    )]
    Size {
        /// Number of rings.
        rings: usize,
        /// Number of directions.
        directions: usize,
    },
    /// The radii do not increase.
    #[error("the radii of the ring edges must increase, from 0 px or more")]
    Edges,
}

/// Assignment of pixels to polar cells. Cell `i * directions + j` lies in ring i, counted outward, and in direction j,
/// with azimuths from 2 pi j / directions to 2 pi (j + 1) / directions, counterclockwise from straight ahead.
#[derive(Clone, Debug)]
pub struct RingCells {
    width: usize,
    height: usize,
    rings: usize,
    directions: usize,
    /// Words of a mask with the bits of a cell; the runs of one cell are contiguous.
    runs: Vec<Run>,
    /// End index of each cell's runs.
    ends: Vec<u32>,
    areas: Vec<u32>,
    is_shown: Vec<bool>,
    columns: Vec<Range<u32>>,
}

#[derive(Clone, Copy, Debug)]
struct Run {
    word: u32,
    bits: u64,
}

impl RingCells {
    /// Creates the template for images of this mirror, with ring edges at these radii (pixels in the mirror plane,
    /// increasing). `around_px` widens the columns of interest beyond the outer ring.
    ///
    /// # Errors
    /// [`RingError`].
    pub fn new(
        image: &MirrorImage,
        edges_px: &[f64],
        directions: usize,
        around_px: f64,
    ) -> Result<Self, RingError> {
        let rings = edges_px.len().saturating_sub(1);
        if !(1..=64).contains(&rings) || !(3..=360).contains(&directions) {
            return Err(RingError::Size { rings, directions });
        }
        if !edges_px.is_sorted_by(|a, b| a < b) || edges_px[0] < 0.0 || !edges_px[rings].is_finite() {
            return Err(RingError::Edges);
        }
        let (width, height) = (image.width as usize, image.height as usize);
        let mask = BitImage::new(width, height);
        let mut runs: Vec<Vec<Run>> = vec![Vec::new(); rings * directions];
        let mut columns = Vec::with_capacity(height);
        for v in 0..height {
            let mut covered: Option<Range<u32>> = None;
            for u in 0..width {
                let point = image.mirror_from_pixel(Vector2::new(u as f64, v as f64));
                if point.norm() <= edges_px[rings] + around_px {
                    let start = covered.map_or(u as u32, |covered| covered.start);
                    covered = Some(start..u as u32 + 1);
                }
                let Some(cell) = cell(point, edges_px, directions) else { continue };
                let (word, bit) = (mask.word_index(u, v) as u32, 1 << (u % 64));
                match runs[cell].last_mut().filter(|run| run.word == word) {
                    Some(run) => run.bits |= bit,
                    None => runs[cell].push(Run { word, bits: bit }),
                }
            }
            columns.push(covered.unwrap_or(0..0));
        }
        let areas: Vec<u32> =
            runs.iter().map(|runs| runs.iter().map(|run| run.bits.count_ones()).sum()).collect();
        // Image area of a unit area in the mirror plane.
        let scale = (image.outward(0.0).perp(&image.around(0.0))).abs();
        let is_shown = (0..rings * directions).map(|cell| {
            let [inner, outer] = [0, 1].map(|next| edges_px[cell / directions + next]);
            let whole_px = 0.5 * TAU / directions as f64 * (outer * outer - inner * inner) * scale;
            areas[cell] > 0 && f64::from(areas[cell]) >= MIN_SHOWN * whole_px
        });
        let is_shown = is_shown.collect();
        let mut end = 0;
        let ends = runs.iter().map(|runs| {
            end += runs.len() as u32;
            end
        });
        let ends = ends.collect();
        let runs = runs.concat();
        Ok(Self { width, height, rings, directions, runs, ends, areas, is_shown, columns })
    }

    /// Number of rings.
    #[must_use]
    pub fn rings(&self) -> usize {
        self.rings
    }

    /// Number of directions.
    #[must_use]
    pub fn directions(&self) -> usize {
        self.directions
    }

    /// Number of pixels in each cell.
    #[must_use]
    pub fn areas(&self) -> &[u32] {
        &self.areas
    }

    /// Returns true if at least half of the cell lies inside the image.
    #[must_use]
    pub fn is_shown(&self, cell: usize) -> bool {
        self.is_shown.get(cell).is_some_and(|&is_shown| is_shown)
    }

    /// Columns of interest in each row.
    #[must_use]
    pub fn columns(&self) -> &[Range<u32>] {
        &self.columns
    }

    /// Writes to `counts` the number of set pixels of the mask in each cell; zeros for a mask of another size.
    pub fn count(&self, mask: &BitImage, counts: &mut Vec<u32>) {
        counts.clear();
        counts.resize(self.areas.len(), 0);
        if (mask.width(), mask.height()) == (self.width, self.height) {
            vectorize::run(Count { cells: self, words: mask.words(), counts });
        }
    }
}

/// Returns the cell of a point in the mirror plane.
fn cell(point: Vector2<f64>, edges_px: &[f64], directions: usize) -> Option<usize> {
    let square = point.norm_squared();
    let ring =
        edges_px.windows(2).position(|edge| edge[0] * edge[0] <= square && square < edge[1] * edge[1])?;
    let azimuth = point.y.atan2(point.x).rem_euclid(TAU) + BORDER_RAD;
    Some(ring * directions + (azimuth / (TAU / directions as f64)).floor() as usize % directions)
}

struct Count<'a> {
    cells: &'a RingCells,
    words: &'a [u64],
    counts: &'a mut [u32],
}

impl Kernel for Count<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let mut begin = 0;
        for (count, &end) in self.counts.iter_mut().zip(&self.cells.ends) {
            let end = end as usize;
            for run in &self.cells.runs[begin..end] {
                *count += (self.words[run.word as usize] & run.bits).count_ones();
            }
            begin = end;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image() -> MirrorImage {
        MirrorImage::centered(256, 220)
    }

    #[test]
    fn each_pixel_counts_for_the_cell_that_it_lies_in() {
        let image = image().with_center(Vector2::new(140.3, 100.2)).unwrap();
        let edges = [20.0, 50.0, 77.5, 95.0];
        let cells = RingCells::new(&image, &edges, 12, 3.0).unwrap();
        let mut mask = BitImage::new(256, 220);
        (0..220).for_each(|v| (0..256).filter(|u| u * v % 3 == 0).for_each(|u| mask.set(u, v)));
        let mut expected = vec![0; 36];
        for (u, v) in mask.pixels() {
            let point = image.mirror_from_pixel(Vector2::new(u as f64, v as f64));
            let ring = edges.iter().filter(|&&edge| edge <= point.norm()).count();
            if (1..4).contains(&ring) {
                let j = (point.y.atan2(point.x).rem_euclid(TAU) / TAU * 12.0) as usize;
                expected[12 * (ring - 1) + j] += 1;
                assert!(cells.columns()[v].contains(&(u as u32)));
            }
        }
        let mut counts = Vec::new();
        cells.count(&mask, &mut counts);
        assert_eq!(counts, expected);
        cells.count(&BitImage::new(255, 220), &mut counts);
        assert_eq!(counts, [0; 36]);
    }

    #[test]
    fn cells_outside_the_image_are_not_shown() {
        let cells = RingCells::new(&image(), &[80.0, 100.0, 150.0, 165.0], 8, 0.0).unwrap();
        assert!((0..8).all(|cell| cells.is_shown(cell)));
        assert!((16..24).all(|cell| !cells.is_shown(cell)) && !cells.is_shown(99));
        let wide = image().with_orientation(nalgebra::Matrix2::new(0.0, -0.5, -1.0, 0.0)).unwrap();
        let cells = RingCells::new(&wide, &[20.0, 50.0], 8, 0.0).unwrap();
        assert!((0..8).all(|cell| cells.is_shown(cell)), "pixels that are not square");
    }

    #[test]
    fn impossible_rings_are_refused() {
        let refused = |edges: &[f64], directions| RingCells::new(&image(), edges, directions, 0.0).err();
        assert!(matches!(refused(&[5.0], 32), Some(RingError::Size { rings: 0, .. })));
        assert!(matches!(refused(&[5.0, 9.0], 2), Some(RingError::Size { .. })));
        for edges in [[5.0, 5.0], [-1.0, 5.0], [5.0, f64::NAN], [5.0, f64::INFINITY]] {
            assert_eq!(refused(&edges, 32), Some(RingError::Edges));
        }
    }
}
