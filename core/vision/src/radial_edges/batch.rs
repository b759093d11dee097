use std::f32::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{Matrix2, Vector2};

#[derive(Clone, Copy, Debug)]
pub(super) struct Geometry {
    pub(super) center: Vector2<f32>,
    pub(super) mirror_from_image: Matrix2<f32>,
    /// Displacement of a pixel with increasing azimuth, times its distance from the center.
    pub(super) around: Matrix2<f32>,
    pub(super) min_slope: f32,
    pub(super) max_oblique: f32,
    pub(super) squared_radii: [f32; 2],
}

/// Number of points that are classified at a time.
pub(super) const BATCH: usize = 256;

#[derive(Clone, Debug)]
pub(super) struct Batch {
    pub(super) count: usize,
    position: [[f32; BATCH]; 2],
    slope: [[f32; BATCH]; 2],
    pub(super) turn: [f32; BATCH],
    pub(super) length: [f32; BATCH],
    pub(super) weight: [f32; BATCH],
    pub(super) sign: [u8; BATCH],
}

impl Batch {
    pub(super) fn new() -> Self {
        let empty = [0.0; BATCH];
        Self {
            count: 0,
            position: [empty; 2],
            slope: [empty; 2],
            turn: empty,
            length: empty,
            weight: empty,
            sign: [0; BATCH],
        }
    }
}

impl Batch {
    #[inline(always)]
    pub(super) fn push(&mut self, at: [f32; 2], slope: [i16; 2], geometry: &Geometry) {
        let i = self.count;
        for axis in 0..2 {
            self.position[axis][i] = at[axis] - geometry.center[axis];
            self.slope[axis][i] = f32::from(slope[axis]);
        }
        self.count += 1;
    }

    #[inline(always)]
    pub(super) fn classify(&mut self, count: usize, geometry: &Geometry) {
        let [x, y] = self.position.each_ref().map(|values| &values[..count]);
        let [gx, gy] = self.slope.each_ref().map(|values| &values[..count]);
        let (turn, length) = (&mut self.turn[..count], &mut self.length[..count]);
        let (weight, sign) = (&mut self.weight[..count], &mut self.sign[..count]);
        let (m, a) = (geometry.mirror_from_image, geometry.around);
        let [nearest, farthest] = geometry.squared_radii;
        for i in 0..count {
            let ahead = m.m11 * x[i] + m.m12 * y[i];
            let left = m.m21 * x[i] + m.m22 * y[i];
            let squared = ahead * ahead + left * left;
            let across = gx[i] * (a.m11 * x[i] + a.m12 * y[i]) + gy[i] * (a.m21 * x[i] + a.m22 * y[i]);
            let along = gx[i] * x[i] + gy[i] * y[i];
            let min_across = geometry.min_slope * geometry.min_slope * squared;
            let is_edge = (squared >= nearest)
                & (squared <= farthest)
                & (across * across >= min_across)
                & (along.abs() <= geometry.max_oblique * across.abs());
            let longest = x[i].abs().max(y[i].abs());
            let size = (x[i] * x[i] + y[i] * y[i]).sqrt();
            length[i] = if is_edge { size / longest } else { 0.0 };
            weight[i] = squared * size / longest;
            turn[i] = turn_of(ahead, left);
            sign[i] = u8::from(across < 0.0);
        }
    }
}

/// Azimuth of a vector, rad in [0, 2 pi], within 3e-6, by a polynomial over an eighth of a turn.
#[inline(always)]
fn turn_of(x: f32, y: f32) -> f32 {
    let (a, b) = (x.abs(), y.abs());
    let is_steep = b > a;
    let ratio = if is_steep { a } else { b } / if is_steep { b } else { a };
    let s = ratio * ratio;
    let eighth = ratio
        * (0.999_977_3
            + s * (-0.332_623_47
                + s * (0.193_543_46 + s * (-0.116_432_87 + s * (0.052_653_32 - s * 0.011_721_2)))));
    let quarter = if is_steep { FRAC_PI_2 - eighth } else { eighth };
    let half = if x < 0.0 { PI - quarter } else { quarter };
    if y < 0.0 { TAU - half } else { half }
}

#[cfg(test)]
mod tests {
    use super::turn_of;
    use yamabico_geometry::wrap_angle;

    #[test]
    fn the_polynomial_matches_the_angle() {
        for i in 0..10_000 {
            let angle = f64::from(i) * 6.283e-4;
            let (sin, cos) = angle.sin_cos();
            let error = f64::from(turn_of(100.0 * cos as f32, 100.0 * sin as f32)) - angle;
            assert!(wrap_angle(error).abs() < 3e-6, "{angle}: {error}");
        }
    }
}
