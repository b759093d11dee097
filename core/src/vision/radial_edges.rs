//! Radial edges of a mirror camera's picture: vertical edges of the surroundings, each at one azimuth.
//!
//! Yagi, Nishizawa & Yachida (1995), section II. Differs from \[1\]: points are thinned across the edge and placed
//! between the pixels, and those far from the centre, whose azimuth is sharper, count for more.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{Matrix2, Vector2};
use thiserror::Error;

use super::azimuth_profile::{AzimuthEdge, AzimuthProfile, ProfileRule};
use super::vectorise::{self, Kernel};
use crate::camera::MirrorImage;
use crate::image::ImageView;

/// What is a point of a radial edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadialEdgeRule {
    /// Least slope across the edge, sums of the Sobel operator (an ideal step of g grey levels gives 4 g), 1 to 1020.
    pub least_slope: f64,
    /// Largest angle between the slope and the way of growing azimuth, radians, 0 to pi/4.
    pub most_oblique_rad: f64,
    /// Nearest to the centre, pixels.
    pub inner_radius_px: f64,
    /// Farthest from the centre, pixels.
    pub outer_radius_px: f64,
}

impl RadialEdgeRule {
    /// The rule for the ring of a mirror: a pixel of rim and 30 pixels about the centre tell nothing.
    #[must_use]
    pub fn within(image: &MirrorImage) -> Self {
        Self {
            least_slope: 60.0,
            most_oblique_rad: 15_f64.to_radians(),
            inner_radius_px: (image.blind_radius_px() + 2.0).max(30.0),
            outer_radius_px: image.rim_radius_px() - 2.0,
        }
    }
}

/// The picture is not of the size that the camera's description tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("a picture of {width} x {height} pixels is not that of the mirror camera")]
pub struct WrongSize {
    /// Columns of the picture.
    pub width: usize,
    /// Rows of the picture.
    pub height: usize,
}

/// The detector, with its buffers.
#[derive(Clone, Debug)]
pub struct RadialEdges {
    size: [usize; 2],
    geometry: Geometry,
    least_along_axis: i16,
    rows: Vec<Row>,
    work: Work,
    profile: AzimuthProfile,
}

/// Columns of a row in the ring, `start..end`.
type Columns = [usize; 2];

/// Where a row is looked at: edges nearer to upright in the picture are thinned along the row, the others along the column.
#[derive(Clone, Copy, Debug, Default)]
struct Row {
    upright: Columns,
    level: [Columns; 2],
    /// Columns whose derivative along v this row or a neighbour needs.
    slopes: [Columns; 2],
}

#[derive(Clone, Copy, Debug)]
struct Geometry {
    centre: Vector2<f32>,
    mirror_from_image: Matrix2<f32>,
    /// How a pixel moves on the way of growing azimuth, times its distance from the centre.
    around: Matrix2<f32>,
    least_slope: f32,
    most_oblique: f32,
    squared_radii: [f32; 2],
}

#[derive(Clone, Debug)]
struct Work {
    sums: Vec<i16>,
    slope: Vec<i16>,
    /// Derivative along v of three rows; row v in slot v % 3.
    ring: [Vec<i16>; 3],
    flags: Vec<u8>,
    batch: Batch,
}

/// Points yet to be judged.
const BATCH: usize = 256;

#[derive(Clone, Debug)]
struct Batch {
    count: usize,
    position: [[f32; BATCH]; 2],
    slope: [[f32; BATCH]; 2],
    turn: [f32; BATCH],
    length: [f32; BATCH],
    weight: [f32; BATCH],
    sign: [u8; BATCH],
}

impl RadialEdges {
    /// A detector for the picture of a mirror.
    #[must_use]
    pub fn new(image: &MirrorImage, rule: &RadialEdgeRule, profile: ProfileRule) -> Self {
        let unit = |p: Vector2<f64>| image.mirror_from_pixel(image.centre() + p);
        let mirror_from_image = Matrix2::from_columns(&[unit(Vector2::x()), unit(Vector2::y())]);
        let turned = Matrix2::new(0.0, -1.0, 1.0, 0.0) * mirror_from_image;
        let image_from_mirror = Matrix2::from_columns(&[image.outward(0.0), image.around(0.0)]);
        // A slope that passes the test of the angle has at least this share along the axis across the edge.
        let oblique = rule.most_oblique_rad.tan().clamp(0.0, 1.0);
        let stretch = image_from_mirror.singular_values().max();
        let share = (1.0 - oblique) * std::f64::consts::FRAC_1_SQRT_2 / stretch;
        let size = [image.width as usize, image.height as usize];
        let buffer = || vec![0; size[0] + 64];
        Self {
            size,
            geometry: Geometry {
                centre: image.centre().cast(),
                mirror_from_image: mirror_from_image.cast(),
                around: (image_from_mirror * turned).cast(),
                least_slope: rule.least_slope as f32,
                most_oblique: oblique as f32,
                squared_radii: [rule.inner_radius_px, rule.outer_radius_px]
                    .map(|r| (r.max(1.0) * r.max(1.0)) as f32),
            },
            least_along_axis: (rule.least_slope * share).clamp(1.0, 1020.0) as i16,
            rows: rows(size, image.centre(), rule.outer_radius_px * stretch),
            work: Work {
                sums: buffer(),
                slope: buffer(),
                ring: [buffer(), buffer(), buffer()],
                flags: vec![0; size[0] + 64],
                batch: Batch::new(),
            },
            profile: AzimuthProfile::new(profile),
        }
    }

    /// Finds the edges of a picture, by growing azimuth.
    ///
    /// # Errors
    /// [`WrongSize`], with no edges left from the picture before.
    pub fn find(&mut self, picture: ImageView) -> Result<&[AzimuthEdge], WrongSize> {
        self.profile.clear();
        let [width, height] = [picture.width(), picture.height()];
        if [width, height] != self.size {
            return Err(WrongSize { width, height });
        }
        vectorise::run(Whole {
            picture,
            geometry: &self.geometry,
            least: self.least_along_axis,
            rows: &self.rows,
            work: &mut self.work,
            profile: &mut self.profile,
        });
        Ok(self.profile.find())
    }

    /// The profile of the picture seen last.
    #[must_use]
    pub fn profile(&self) -> &AzimuthProfile {
        &self.profile
    }
}

fn rows([width, height]: [usize; 2], centre: Vector2<f64>, radius_px: f64) -> Vec<Row> {
    // Two columns and rows at the border have no neighbours to be compared with.
    let inside = |from: f64, to: f64| -> Columns {
        let last = width.saturating_sub(3) as f64;
        let (from, to) = (from.ceil().max(2.0), to.floor().min(last));
        if from <= to { [from as usize, to as usize + 1] } else { [0, 0] }
    };
    let mut rows = vec![Row::default(); height];
    for (v, row) in rows.iter_mut().enumerate().take(height.saturating_sub(2)).skip(2) {
        let down = v as f64 - centre.y;
        let half = (radius_px * radius_px - down * down).max(0.0).sqrt();
        let upright = half.min(down.abs());
        row.upright = inside(centre.x - upright, centre.x + upright);
        if half > down.abs() {
            let next = f64::MIN_POSITIVE + down.abs();
            let left = inside(centre.x - half, (centre.x - next).ceil() - 1.0);
            let right = inside((centre.x + next).floor() + 1.0, centre.x + half);
            row.level = [left, right];
        }
    }
    for v in 1..height.saturating_sub(1) {
        for side in 0..2 {
            let near = [v - 1, v, v + 1].map(|v| rows[v].level[side]);
            let filled = || near.iter().filter(|columns| columns[0] < columns[1]);
            let start = filled().map(|columns| columns[0]).min();
            let end = filled().map(|columns| columns[1]).max();
            rows[v].slopes[side] = [start.unwrap_or(0), end.unwrap_or(0)];
        }
    }
    rows
}

impl Batch {
    fn new() -> Self {
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

struct Whole<'a> {
    picture: ImageView<'a>,
    geometry: &'a Geometry,
    least: i16,
    rows: &'a [Row],
    work: &'a mut Work,
    profile: &'a mut AzimuthProfile,
}

impl Kernel for Whole<'_> {
    type Output = ();

    #[inline(always)]
    fn run(mut self) {
        for v in 1..self.rows.len().saturating_sub(1) {
            // Row v - 1 is judged as soon as the derivatives of row v are there.
            for columns in self.rows[v].slopes {
                self.slopes(v, columns);
            }
            let Row { upright, level, .. } = self.rows[v - 1];
            self.upright(v - 1, upright);
            for columns in level {
                self.level(v - 1, columns);
            }
        }
        self.judge();
    }
}

impl Whole<'_> {
    /// Derivative along v of some columns of a row.
    #[inline(always)]
    fn slopes(&mut self, v: usize, [start, end]: Columns) {
        if start >= end {
            return;
        }
        let wide = end - start + 2;
        let row = |v: usize| &self.picture.row(v)[start - 1..][..wide];
        let sums = &mut self.work.sums[..wide];
        row_differences(row(v - 1), row(v + 1), sums);
        smooth(sums, &mut self.work.ring[v % 3][start..end]);
    }

    /// Points of edges that are nearer to upright.
    #[inline(always)]
    fn upright(&mut self, v: usize, [start, end]: Columns) {
        if start >= end {
            return;
        }
        let wide = end - start + 4;
        let row = |v: usize| &self.picture.row(v)[start - 2..][..wide];
        let sums = &mut self.work.sums[..wide];
        column_sums(row(v - 1), row(v), row(v + 1), sums);
        let slope = &mut self.work.slope[..wide - 2];
        differences(&sums[..wide - 2], &sums[2..], slope);
        let count = end - start;
        let (left, here, right) = (&slope[..count], &slope[1..][..count], &slope[2..][..count]);
        let flags = &mut self.work.flags[..count.next_multiple_of(32)];
        flag(left, here, right, self.least, flags);
        for i in 0..flags.len() / 32 {
            each_flag(&self.work.flags[32 * i..][..32], |j| {
                let i = 32 * i + j;
                let near = [i, i + 1, i + 2].map(|i| self.work.slope[i]);
                let u = start + i;
                let other = along_v(self.picture, u, v);
                let at = [u as f32 + between(near), v as f32];
                self.work.batch.push(at, [near[1], other], self.geometry);
            });
            if self.work.batch.count + 32 > BATCH {
                self.judge();
            }
        }
    }

    /// Points of edges that are nearer to level.
    #[inline(always)]
    fn level(&mut self, v: usize, [start, end]: Columns) {
        if start >= end {
            return;
        }
        let count = end - start;
        let row = |v: usize| &self.work.ring[v % 3][start..end];
        let (above, here, below) = (row(v + 2), row(v), row(v + 1));
        let flags = &mut self.work.flags[..count.next_multiple_of(32)];
        flag(above, here, below, self.least, flags);
        for i in 0..flags.len() / 32 {
            each_flag(&self.work.flags[32 * i..][..32], |j| {
                let u = start + 32 * i + j;
                let near = [v + 2, v, v + 1].map(|v| self.work.ring[v % 3][u]);
                let other = along_u(self.picture, u, v);
                let at = [u as f32, v as f32 + between(near)];
                self.work.batch.push(at, [other, near[1]], self.geometry);
            });
            if self.work.batch.count + 32 > BATCH {
                self.judge();
            }
        }
    }

    /// Judges the points of the batch and counts those that belong to a radial edge.
    #[inline(always)]
    fn judge(&mut self) {
        let (batch, geometry) = (&mut self.work.batch, self.geometry);
        let count = batch.count.next_multiple_of(8).min(BATCH);
        batch.judge(count, geometry);
        for i in 0..batch.count {
            if batch.length[i] > 0.0 {
                self.profile.add_in_turn(
                    batch.turn[i],
                    usize::from(batch.sign[i]),
                    batch.length[i],
                    batch.weight[i],
                );
            }
        }
        batch.count = 0;
    }
}

/// Three rows, weighted 1 2 1.
#[inline(always)]
fn column_sums(above: &[u8], here: &[u8], below: &[u8], out: &mut [i16]) {
    let count = out.len();
    let (above, here, below) = (&above[..count], &here[..count], &below[..count]);
    for i in 0..count {
        out[i] = i16::from(above[i]) + 2 * i16::from(here[i]) + i16::from(below[i]);
    }
}

#[inline(always)]
fn differences(left: &[i16], right: &[i16], out: &mut [i16]) {
    let count = out.len();
    let (left, right) = (&left[..count], &right[..count]);
    for i in 0..count {
        out[i] = right[i] - left[i];
    }
}

#[inline(always)]
fn row_differences(above: &[u8], below: &[u8], out: &mut [i16]) {
    let count = out.len();
    let (above, below) = (&above[..count], &below[..count]);
    for i in 0..count {
        out[i] = i16::from(below[i]) - i16::from(above[i]);
    }
}

/// Three neighbours, weighted 1 2 1; `values` has one more on either side.
#[inline(always)]
fn smooth(values: &[i16], out: &mut [i16]) {
    let count = out.len();
    let (left, here, right) = (&values[..count], &values[1..][..count], &values[2..][..count]);
    for i in 0..count {
        out[i] = left[i] + 2 * here[i] + right[i];
    }
}

/// Sets the flag of each value that is large enough and, but for its sign, greater than the one before and no less than the
/// one behind; clears the flags beyond.
#[inline(always)]
fn flag(before: &[i16], here: &[i16], behind: &[i16], least: i16, flags: &mut [u8]) {
    let count = here.len();
    let (before, behind) = (&before[..count], &behind[..count]);
    let (flags, beyond) = flags.split_at_mut(count);
    beyond.fill(0);
    for i in 0..count {
        let (l, c, r) = (before[i].abs(), here[i].abs(), behind[i].abs());
        flags[i] = u8::from(c > l) & u8::from(c >= r) & u8::from(c >= least);
    }
}

#[inline(always)]
fn each_flag(flags: &[u8], mut take: impl FnMut(usize)) {
    if flags.iter().fold(0, |any, flag| any | flag) == 0 {
        return;
    }
    for (eight, flags) in flags.as_chunks::<8>().0.iter().enumerate() {
        let mut word = u64::from_le_bytes(*flags);
        while word != 0 {
            take(8 * eight + word.trailing_zeros() as usize / 8);
            word &= word - 1;
        }
    }
}

/// Where between the neighbours the extremum of the middle one lies, pixels from it, -0.5 to 0.5: that of a parabola.
#[inline(always)]
fn between(slopes: [i16; 3]) -> f32 {
    let [l, c, r] = slopes.map(|slope| f32::from(slope.abs()));
    0.5 * (l - r) / (l - 2.0 * c + r)
}

#[inline(always)]
fn along_u(picture: ImageView, u: usize, v: usize) -> i16 {
    let at = |v: usize| {
        let row = &picture.row(v)[u - 1..=u + 1];
        i16::from(row[2]) - i16::from(row[0])
    };
    at(v - 1) + 2 * at(v) + at(v + 1)
}

#[inline(always)]
fn along_v(picture: ImageView, u: usize, v: usize) -> i16 {
    let (above, below) = (&picture.row(v - 1)[u - 1..=u + 1], &picture.row(v + 1)[u - 1..=u + 1]);
    let at = |i: usize| i16::from(below[i]) - i16::from(above[i]);
    at(0) + 2 * at(1) + at(2)
}

impl Batch {
    #[inline(always)]
    fn push(&mut self, at: [f32; 2], slope: [i16; 2], geometry: &Geometry) {
        let i = self.count;
        for axis in 0..2 {
            self.position[axis][i] = at[axis] - geometry.centre[axis];
            self.slope[axis][i] = f32::from(slope[axis]);
        }
        self.count += 1;
    }

    #[inline(always)]
    fn judge(&mut self, count: usize, geometry: &Geometry) {
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
            let least = geometry.least_slope * geometry.least_slope * squared;
            let is_edge = (squared >= nearest)
                & (squared <= farthest)
                & (across * across >= least)
                & (along.abs() <= geometry.most_oblique * across.abs());
            let longest = x[i].abs().max(y[i].abs());
            let size = (x[i] * x[i] + y[i] * y[i]).sqrt();
            length[i] = if is_edge { size / longest } else { 0.0 };
            weight[i] = squared * size / longest;
            turn[i] = turn_of(ahead, left);
            sign[i] = u8::from(across < 0.0);
        }
    }
}

/// The direction of a vector, radians in [0, 2 pi], within 3e-6, by a polynomial over an eighth of the turn.
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
    use super::*;
    use crate::geometry::wrap_angle;
    use crate::image::GrayImage;
    use crate::vision::azimuth_profile::EdgeSign;

    /// A ring of flat shades between some azimuths, as a camera with square pixels sees it.
    fn picture(image: &MirrorImage, borders: &[(f64, u8)]) -> GrayImage {
        let mut picture = GrayImage::new(image.width as usize, image.height as usize);
        let width = picture.width();
        const FINE: usize = 6;
        for (i, out) in picture.pixels_mut().iter_mut().enumerate() {
            let mut sum = 0.0;
            for k in 0..FINE * FINE {
                let shift = |k: usize| (k as f64 + 0.5) / FINE as f64 - 0.5;
                let at = Vector2::new((i % width) as f64, (i / width) as f64)
                    + Vector2::new(shift(k % FINE), shift(k / FINE));
                let turn = image.azimuth_from_pixel(at).unwrap_or(0.0).rem_euclid(std::f64::consts::TAU);
                let shade = borders
                    .iter()
                    .rev()
                    .find(|(from, _)| turn >= *from)
                    .unwrap_or(&borders[borders.len() - 1]);
                sum += f64::from(shade.1);
            }
            *out = (sum / (FINE * FINE) as f64).round() as u8;
        }
        picture
    }

    fn cameras() -> Vec<MirrorImage> {
        let image = MirrorImage::centred(256, 240).with_ring(0.0, 118.0).unwrap();
        let turned = |m: [f64; 4]| {
            image
                .with_centre(Vector2::new(130.3, 117.2))
                .unwrap()
                .with_orientation(Matrix2::new(m[0], m[1], m[2], m[3]))
                .unwrap()
        };
        let (sin, cos) = 0.6_f64.sin_cos();
        vec![image, turned([0.0, -1.0, 1.0, 0.0]), turned([cos, -sin, sin, cos])]
    }

    #[test]
    fn edges_are_found_where_they_are_whatever_the_orientation() {
        let borders: Vec<(f64, u8)> =
            (0..12).map(|i| (0.1 + 0.52 * f64::from(i), if i % 2 == 0 { 180 } else { 90 })).collect();
        for image in cameras() {
            let picture = picture(&image, &borders);
            let rule = RadialEdgeRule::within(&image);
            let mut edges = RadialEdges::new(&image, &rule, ProfileRule::default());
            let found = edges.find(picture.view().unwrap()).unwrap();
            assert_eq!(found.len(), borders.len());
            for (azimuth, shade) in &borders {
                let edge = found
                    .iter()
                    .min_by(|a, b| {
                        let off = |e: &AzimuthEdge| wrap_angle(e.azimuth_rad - azimuth).abs();
                        off(a).total_cmp(&off(b))
                    })
                    .unwrap();
                let error = wrap_angle(edge.azimuth_rad - azimuth).abs();
                assert!(error < 0.03_f64.to_radians(), "{azimuth}: {} degrees", error.to_degrees());
                let sign = if *shade == 180 { EdgeSign::Brighter } else { EdgeSign::Darker };
                assert_eq!(edge.sign, sign);
                // From 30 to 116 pixels, but for the ends.
                assert!((80.0..90.0).contains(&edge.length_px), "{} px", edge.length_px);
                assert!(edge.sigma_rad(0.3, 0.0) < 0.06_f64.to_radians());
            }
        }
    }

    #[test]
    fn the_two_instruction_sets_agree() {
        let image = cameras()[1];
        let borders: Vec<(f64, u8)> = (0..40).map(|i| (0.15 * f64::from(i), (i * 37 % 200) as u8)).collect();
        let picture = picture(&image, &borders);
        let view = picture.view().unwrap();
        let mut edges = RadialEdges::new(&image, &RadialEdgeRule::within(&image), ProfileRule::default());
        let fast = edges.find(view).unwrap().to_vec();
        edges.profile.clear();
        Whole {
            picture: view,
            geometry: &edges.geometry,
            least: edges.least_along_axis,
            rows: &edges.rows,
            work: &mut edges.work,
            profile: &mut edges.profile,
        }
        .run();
        assert_eq!(edges.profile.find(), fast);
        assert!(fast.len() > 20);
    }

    #[test]
    fn rings_and_plain_pictures_have_no_radial_edges() {
        let image = cameras()[0];
        let mut edges = RadialEdges::new(&image, &RadialEdgeRule::within(&image), ProfileRule::default());
        let mut plain = GrayImage::new(256, 240);
        plain.pixels_mut().fill(99);
        assert_eq!(edges.find(plain.view().unwrap()).unwrap(), []);
        for (i, out) in plain.pixels_mut().iter_mut().enumerate() {
            let r = image.mirror_from_pixel(Vector2::new((i % 256) as f64, (i / 256) as f64)).norm();
            *out = if (r / 10.0) as usize % 2 == 0 { 60 } else { 190 };
        }
        let found = edges.find(plain.view().unwrap()).unwrap();
        assert!(found.is_empty(), "{found:?}");
    }

    #[test]
    fn another_size_is_refused_and_tiny_pictures_are_borne() {
        let image = cameras()[0];
        let mut edges = RadialEdges::new(&image, &RadialEdgeRule::within(&image), ProfileRule::default());
        let small = GrayImage::new(100, 100);
        assert_eq!(edges.find(small.view().unwrap()), Err(WrongSize { width: 100, height: 100 }));
        for size in [1, 2, 3, 4, 5, 8] {
            let image = MirrorImage::centred(size, size);
            let mut edges = RadialEdges::new(&image, &RadialEdgeRule::within(&image), ProfileRule::default());
            let picture = GrayImage::new(size as usize, size as usize);
            assert_eq!(edges.find(picture.view().unwrap()).map(<[_]>::len), Ok(0));
        }
    }

    #[test]
    fn the_polynomial_is_the_angle() {
        for i in 0..10_000 {
            let angle = f64::from(i) * 6.283e-4;
            let (sin, cos) = angle.sin_cos();
            let error = f64::from(turn_of(100.0 * cos as f32, 100.0 * sin as f32)) - angle;
            assert!(wrap_angle(error).abs() < 3e-6, "{angle}: {error}");
        }
    }
}
