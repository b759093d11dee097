use super::batch::{BATCH, Batch, Geometry};
use super::rows::{Columns, Row};
use crate::azimuth_profile::AzimuthProfile;
use crate::vectorize::Kernel;
use yamabico_geometry::image::ImageView;

#[derive(Clone, Debug)]
pub(super) struct Work {
    sums: Vec<i16>,
    slope: Vec<i16>,
    /// Derivative along v of three rows; row v in slot v % 3.
    ring: [Vec<i16>; 3],
    flags: Vec<u8>,
    batch: Batch,
}

impl Work {
    pub(super) fn new(width: usize) -> Self {
        let buffer = || vec![0; width + 64];
        Self {
            sums: buffer(),
            slope: buffer(),
            ring: [buffer(), buffer(), buffer()],
            flags: vec![0; width + 64],
            batch: Batch::new(),
        }
    }
}

pub(super) struct Scan<'a> {
    pub(super) image: ImageView<'a>,
    pub(super) geometry: &'a Geometry,
    pub(super) min_slope: i16,
    pub(super) rows: &'a [Row],
    pub(super) work: &'a mut Work,
    pub(super) profile: &'a mut AzimuthProfile,
}

impl Kernel for Scan<'_> {
    type Output = ();

    #[inline(always)]
    fn run(mut self) {
        for v in 1..self.rows.len().saturating_sub(1) {
            // Row v - 1 can be processed once the derivatives of row v are available.
            for columns in self.rows[v].slopes {
                self.slopes(v, columns);
            }
            let Row { vertical, horizontal, .. } = self.rows[v - 1];
            self.vertical(v - 1, vertical);
            for columns in horizontal {
                self.horizontal(v - 1, columns);
            }
        }
        self.classify();
    }
}

impl Scan<'_> {
    /// Computes the derivative along v of a range of columns.
    #[inline(always)]
    fn slopes(&mut self, v: usize, [start, end]: Columns) {
        if start >= end {
            return;
        }
        let wide = end - start + 2;
        let row = |v: usize| &self.image.row(v)[start - 1..][..wide];
        let sums = &mut self.work.sums[..wide];
        row_differences(row(v - 1), row(v + 1), sums);
        smooth(sums, &mut self.work.ring[v % 3][start..end]);
    }

    /// Adds points of edges nearer to vertical.
    #[inline(always)]
    fn vertical(&mut self, v: usize, [start, end]: Columns) {
        if start >= end {
            return;
        }
        let wide = end - start + 4;
        let row = |v: usize| &self.image.row(v)[start - 2..][..wide];
        let sums = &mut self.work.sums[..wide];
        column_sums(row(v - 1), row(v), row(v + 1), sums);
        let slope = &mut self.work.slope[..wide - 2];
        differences(&sums[..wide - 2], &sums[2..], slope);
        let count = end - start;
        let (left, here, right) = (&slope[..count], &slope[1..][..count], &slope[2..][..count]);
        let flags = &mut self.work.flags[..count.next_multiple_of(32)];
        flag(left, here, right, self.min_slope, flags);
        for i in 0..flags.len() / 32 {
            each_flag(&self.work.flags[32 * i..][..32], |j| {
                let i = 32 * i + j;
                let near = [i, i + 1, i + 2].map(|i| self.work.slope[i]);
                let u = start + i;
                let other = along_v(self.image, u, v);
                let at = [u as f32 + between(near), v as f32];
                self.work.batch.push(at, [near[1], other], self.geometry);
            });
            if self.work.batch.count + 32 > BATCH {
                self.classify();
            }
        }
    }

    /// Adds points of edges nearer to horizontal.
    #[inline(always)]
    fn horizontal(&mut self, v: usize, [start, end]: Columns) {
        if start >= end {
            return;
        }
        let count = end - start;
        let row = |v: usize| &self.work.ring[v % 3][start..end];
        let (above, here, below) = (row(v + 2), row(v), row(v + 1));
        let flags = &mut self.work.flags[..count.next_multiple_of(32)];
        flag(above, here, below, self.min_slope, flags);
        for i in 0..flags.len() / 32 {
            each_flag(&self.work.flags[32 * i..][..32], |j| {
                let u = start + 32 * i + j;
                let near = [v + 2, v, v + 1].map(|v| self.work.ring[v % 3][u]);
                let other = along_u(self.image, u, v);
                let at = [u as f32, v as f32 + between(near)];
                self.work.batch.push(at, [other, near[1]], self.geometry);
            });
            if self.work.batch.count + 32 > BATCH {
                self.classify();
            }
        }
    }

    /// Classifies the points of the batch and adds those of radial edges to the profile.
    #[inline(always)]
    fn classify(&mut self) {
        let (batch, geometry) = (&mut self.work.batch, self.geometry);
        let count = batch.count.next_multiple_of(8).min(BATCH);
        batch.classify(count, geometry);
        for i in 0..batch.count {
            if batch.length[i] > 0.0 {
                self.profile.add_wrapped(
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

/// Sums three rows with weights 1 2 1.
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

/// Smooths by 1 2 1; `values` has one more element on either side.
#[inline(always)]
fn smooth(values: &[i16], out: &mut [i16]) {
    let count = out.len();
    let (left, here, right) = (&values[..count], &values[1..][..count], &values[2..][..count]);
    for i in 0..count {
        out[i] = left[i] + 2 * here[i] + right[i];
    }
}

/// Flags each value whose magnitude is at least `min_slope`, greater than the one before and not less than the one
/// after; clears the remaining flags.
#[inline(always)]
fn flag(before: &[i16], here: &[i16], behind: &[i16], min_slope: i16, flags: &mut [u8]) {
    let count = here.len();
    let (before, behind) = (&before[..count], &behind[..count]);
    let (flags, padding) = flags.split_at_mut(count);
    padding.fill(0);
    for i in 0..count {
        let (l, c, r) = (before[i].abs(), here[i].abs(), behind[i].abs());
        flags[i] = u8::from(c > l) & u8::from(c >= r) & u8::from(c >= min_slope);
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

/// Sub-pixel offset of the extremum from the middle value, px, -0.5 to 0.5: the vertex of a parabola.
#[inline(always)]
fn between(slopes: [i16; 3]) -> f32 {
    let [l, c, r] = slopes.map(|slope| f32::from(slope.abs()));
    0.5 * (l - r) / (l - 2.0 * c + r)
}

#[inline(always)]
fn along_u(image: ImageView, u: usize, v: usize) -> i16 {
    let at = |v: usize| {
        let row = &image.row(v)[u - 1..=u + 1];
        i16::from(row[2]) - i16::from(row[0])
    };
    at(v - 1) + 2 * at(v) + at(v + 1)
}

#[inline(always)]
fn along_v(image: ImageView, u: usize, v: usize) -> i16 {
    let (above, below) = (&image.row(v - 1)[u - 1..=u + 1], &image.row(v + 1)[u - 1..=u + 1]);
    let at = |i: usize| i16::from(below[i]) - i16::from(above[i]);
    at(0) + 2 * at(1) + at(2)
}
