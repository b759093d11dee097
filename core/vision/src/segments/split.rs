//! Splitting of chains into straight pieces, with a line fit for each.

use super::edges::EdgePoint;
use crate::segment_fit::{FittedLine, Moments};
use nalgebra::Vector2;

/// Straight piece of an edge: moments, fitted line and extent.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    pub moments: Moments,
    pub line: FittedLine,
    /// Endpoints as positions along the line, px from its centroid.
    pub from: f64,
    pub to: f64,
    /// Sum of the gradients of the points.
    pub gradient: Vector2<f64>,
}

impl Piece {
    pub(super) fn length(&self) -> f64 {
        self.to - self.from
    }
}

/// Splits a chain where it deviates from its chord by more than `tolerance` px, and appends the pieces of at least
/// `min_length` px to `pieces`. `stack` is scratch memory.
pub(super) fn split_chain(
    chain: &[EdgePoint],
    tolerance: f32,
    min_length: f64,
    stack: &mut Vec<(u32, u32)>,
    pieces: &mut Vec<Piece>,
) {
    let min_points = (min_length * std::f64::consts::FRAC_1_SQRT_2) as u32;
    stack.clear();
    stack.push((0, chain.len() as u32));
    while let Some((begin, end)) = stack.pop() {
        if end - begin < min_points.max(2) {
            continue;
        }
        let part = &chain[begin as usize..end as usize];
        match farthest_from_chord(part, tolerance) {
            Some(cut) => {
                let cut = begin + cut as u32;
                stack.push((cut, end));
                stack.push((begin, cut + 1));
            }
            None => pieces.extend(fit(part).filter(|piece| piece.length() >= min_length)),
        }
    }
}

/// Finds the point farthest from the chord, if farther than `tolerance`. For a closed chain, whose endpoints meet, the
/// point farthest from them.
fn farthest_from_chord(part: &[EdgePoint], tolerance: f32) -> Option<usize> {
    let (first, last) = (part[0], part[part.len() - 1]);
    let (du, dv) = (last.u - first.u, last.v - first.v);
    let chord = (du * du + dv * dv).sqrt();
    let distance = |p: &EdgePoint| {
        let (u, v) = (p.u - first.u, p.v - first.v);
        if chord < 1.5 { (u * u + v * v).sqrt() } else { (u * dv - v * du).abs() / chord }
    };
    let (mut worst, mut cut) = (tolerance, None);
    for (i, p) in part.iter().enumerate() {
        let d = distance(p);
        if d > worst {
            (worst, cut) = (d, Some(i));
        }
    }
    cut.filter(|&i| i > 0 && i + 1 < part.len())
}

fn fit(part: &[EdgePoint]) -> Option<Piece> {
    let origin = part[0];
    let (mut u, mut v, mut uu, mut uv, mut vv, mut gx, mut gy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for p in part {
        let (du, dv) = (f64::from(p.u - origin.u), f64::from(p.v - origin.v));
        u += du;
        v += dv;
        uu += du * du;
        uv += du * dv;
        vv += dv * dv;
        gx += f64::from(p.gx);
        gy += f64::from(p.gy);
    }
    let count = part.len() as f64;
    let moments = Moments {
        count,
        mean: Vector2::new(f64::from(origin.u) + u / count, f64::from(origin.v) + v / count),
        uu: uu - u * u / count,
        uv: uv - u * v / count,
        vv: vv - v * v / count,
    };
    let line = moments.line()?;
    let position = |p: &EdgePoint| line.position_of(Vector2::new(f64::from(p.u), f64::from(p.v)));
    let (a, b) = (position(&part[0]), position(&part[part.len() - 1]));
    Some(Piece { moments, line, from: a.min(b), to: a.max(b), gradient: Vector2::new(gx, gy) })
}
