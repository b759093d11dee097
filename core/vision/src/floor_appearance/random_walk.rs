//! Random walk with restarts on the grid of blocks.

use super::boundaries::Boundaries;
use crate::vectorize::{self, Kernel};

/// Iterations of the conjugate gradients.
const ITERATIONS: usize = 20;

/// Solver for the probabilities of floor. Reuses its buffers.
///
/// Minimizes the sum of conductance times squared difference over neighbors, plus anchor times squared difference from
/// the block's own probability: a diagonally dominant linear system.
#[derive(Clone, Debug, Default)]
pub struct RandomWalk {
    /// Conductances to the right and below, with one row of zeros on either side.
    right: Vec<f32>,
    below: Vec<f32>,
    diagonal: Vec<f32>,
    inverse: Vec<f32>,
    solution: Vec<f32>,
    residual: Vec<f32>,
    /// With one row of zeros on either side.
    direction: Vec<f32>,
    image: Vec<f32>,
}

impl RandomWalk {
    /// Returns the probability of each block. `own` are the blocks' own probabilities, `anchors` (positive) the strength with
    /// which each holds to its own.
    pub fn solve(&mut self, columns: usize, boundaries: &Boundaries, own: &[f32], anchors: &[f32]) -> &[f32] {
        vectorize::run(Solve { walk: self, columns, boundaries, own, anchors });
        &self.solution
    }

    /// Sets up the system and the first direction.
    #[inline(always)]
    fn begin(&mut self, columns: usize, boundaries: &Boundaries, own: &[f32], anchors: &[f32]) {
        pad(&mut self.right, boundaries.right(), columns);
        pad(&mut self.below, boundaries.below(), columns);
        let neighbors = Neighbors::of(&self.right, &self.below, columns, own.len());
        self.diagonal.clear();
        self.diagonal.extend((0..own.len()).map(|i| {
            anchors[i] + neighbors.left[i] + neighbors.right[i] + neighbors.above[i] + neighbors.below[i]
        }));
        self.inverse.clear();
        self.inverse.extend(self.diagonal.iter().map(|diagonal| 1.0 / diagonal));
        self.solution.clear();
        self.solution.extend_from_slice(own);
        pad(&mut self.direction, own, columns);
        self.image.resize(own.len(), 0.0);
        neighbors.apply(&self.diagonal, &self.direction, &mut self.image);
        self.residual.clear();
        self.residual.extend((0..own.len()).map(|i| anchors[i] * own[i] - self.image[i]));
        let start = self.residual.iter().zip(&self.inverse).map(|(residual, inverse)| residual * inverse);
        self.direction[columns..].iter_mut().zip(start).for_each(|(direction, start)| *direction = start);
    }

    /// Conjugate gradients with the diagonal as preconditioner.
    #[inline(always)]
    fn iterate(&mut self, columns: usize) {
        let count = self.solution.len();
        let mut power = weighted_dot(&self.residual, &self.residual, &self.inverse);
        for _ in 0..ITERATIONS {
            let neighbors = Neighbors::of(&self.right, &self.below, columns, count);
            neighbors.apply(&self.diagonal, &self.direction, &mut self.image);
            let direction = &mut self.direction[columns..columns + count];
            let curvature = dot(direction, &self.image);
            if curvature <= f32::MIN_POSITIVE || power <= f32::MIN_POSITIVE {
                break;
            }
            let step = power / curvature;
            let state = self.solution.iter_mut().zip(&mut self.residual);
            for ((solution, residual), (direction, image)) in state.zip(direction.iter().zip(&self.image)) {
                *solution += step * direction;
                *residual -= step * image;
            }
            let next = weighted_dot(&self.residual, &self.residual, &self.inverse);
            let ratio = next / power;
            let state = self.residual.iter().zip(&self.inverse);
            for (direction, (residual, inverse)) in direction.iter_mut().zip(state) {
                *direction = residual * inverse + ratio * *direction;
            }
            power = next;
        }
    }
}

struct Solve<'a> {
    walk: &'a mut RandomWalk,
    columns: usize,
    boundaries: &'a Boundaries,
    own: &'a [f32],
    anchors: &'a [f32],
}

impl Kernel for Solve<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        self.walk.begin(self.columns, self.boundaries, self.own, self.anchors);
        self.walk.iterate(self.columns);
    }
}

/// Conductances of each block to its four neighbors.
struct Neighbors<'a> {
    columns: usize,
    left: &'a [f32],
    right: &'a [f32],
    above: &'a [f32],
    below: &'a [f32],
}

impl<'a> Neighbors<'a> {
    /// Takes padded conductances to the right and below.
    #[inline(always)]
    fn of(right: &'a [f32], below: &'a [f32], columns: usize, count: usize) -> Self {
        Self {
            columns,
            left: &right[columns - 1..][..count],
            right: &right[columns..][..count],
            above: &below[..count],
            below: &below[columns..][..count],
        }
    }

    /// Multiplies the system's matrix with a padded vector.
    #[inline(always)]
    fn apply(&self, diagonal: &[f32], x: &[f32], out: &mut [f32]) {
        let count = out.len();
        let at = |offset: usize| &x[offset..][..count];
        let (left, here, right) = (at(self.columns - 1), at(self.columns), at(self.columns + 1));
        let (above, below) = (at(0), at(2 * self.columns));
        let diagonal = &diagonal[..count];
        for i in 0..count {
            let across = self.left[i] * left[i] + self.right[i] * right[i];
            let along = self.above[i] * above[i] + self.below[i] * below[i];
            out[i] = diagonal[i] * here[i] - across - along;
        }
    }
}

/// Copies values with `margin` zeros on either side.
fn pad(out: &mut Vec<f32>, values: &[f32], margin: usize) {
    out.clear();
    out.resize(margin, 0.0);
    out.extend_from_slice(values);
    out.resize(2 * margin + values.len(), 0.0);
}

/// Sum of products in eight interleaved parts, so that it vectorizes.
#[inline(always)]
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let (a, b) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    let mut parts = [0.0; 8];
    for (a, b) in a.0.iter().zip(b.0) {
        (0..8).for_each(|i| parts[i] += a[i] * b[i]);
    }
    let rest: f32 = a.1.iter().zip(b.1).map(|(a, b)| a * b).sum();
    parts.iter().sum::<f32>() + rest
}

/// Sum of products of three, likewise.
#[inline(always)]
fn weighted_dot(a: &[f32], b: &[f32], weights: &[f32]) -> f32 {
    let (a, b, weights) = (a.as_chunks::<8>(), b.as_chunks::<8>(), weights.as_chunks::<8>());
    let mut parts = [0.0; 8];
    for ((a, b), weights) in a.0.iter().zip(b.0).zip(weights.0) {
        (0..8).for_each(|i| parts[i] += a[i] * b[i] * weights[i]);
    }
    let rest: f32 = a.1.iter().zip(b.1).zip(weights.1).map(|((a, b), weight)| a * b * weight).sum();
    parts.iter().sum::<f32>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::floor_appearance::features::{Blocks, Picture};
    use yamabico_geometry::image::ImageView;

    #[test]
    fn an_anchor_fills_its_surface_up_to_the_edge() {
        let data: Vec<u8> = (0..128 * 128).map(|i| if i / 128 < 63 { 40 } else { 140 }).collect();
        let mut blocks = Blocks::default();
        blocks.measure(Picture::Gray(ImageView::new(&data, 128, 128, 128).unwrap()));
        let (columns, rows) = (blocks.grid().columns, blocks.grid().rows);
        let mut boundaries = Boundaries::default();
        boundaries.measure(&blocks, &vec![false; columns * rows]);
        let edge = (rows - 1) / 2;
        let own: Vec<f32> =
            (0..columns * rows).map(|i| if i / columns > edge + 3 { 0.9 } else { 0.3 }).collect();
        let anchors = vec![0.1; columns * rows];
        let mut walk = RandomWalk::default();
        let probabilities = walk.solve(columns, &boundaries, &own, &anchors).to_vec();
        let at = |row: usize| probabilities[row * columns + 3];
        assert!(at(edge + 2) > 0.5 && at(edge - 2) < 0.35, "{} {}", at(edge + 2), at(edge - 2));
        let mut padded = Vec::new();
        pad(&mut padded, &probabilities, columns);
        let mut product = vec![0.0; own.len()];
        Neighbors::of(&walk.right, &walk.below, columns, own.len()).apply(
            &walk.diagonal,
            &padded,
            &mut product,
        );
        let errors = product.iter().zip(&own).map(|(product, own)| (product - 0.1 * own).abs());
        assert!(errors.fold(0.0, f32::max) < 0.01, "20 iterations suffice");
    }
}
