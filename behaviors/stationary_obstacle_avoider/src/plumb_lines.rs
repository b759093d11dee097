//! Steps of brightness summed along plumb lines: the lines of a picture that vertical edges follow.
//!
//! A step is averaged over the height of a thing, which suppresses noise and the texture of floors. The derivative is sharpened
//! so that smooth gradients, such as reflections of windows on the floor, give no response.

use nalgebra::Vector3;
use yamabico_core::camera::{Mount, Pinhole};
use yamabico_core::image::ImageView;

/// Half width of the derivative, px, and its response to a unit step.
pub const HALF_WIDTH_PX: usize = 4;
const UNIT: f64 = 3.0;

/// Steps of a picture, summed along its plumb lines. Allocates when it is created and no more.
#[derive(Clone, Debug)]
pub struct PlumbLines {
    width: usize,
    height: usize,
    /// First row that is summed up.
    first: usize,
    /// Column in each row from `first` of each line; a line is identified by its column in the last row.
    columns: Vec<u16>,
    derivative: Vec<i16>,
    /// Sums of the derivative along the lines from `first` to each row.
    sums: Vec<i32>,
}

impl PlumbLines {
    /// Creates the sums from row `first` on for a camera and its mount. Ignores lens distortion.
    #[must_use]
    pub fn new(camera: &Pinhole, mount: &Mount, first: usize) -> Self {
        let k = camera.intrinsics();
        let (width, height) = (k.width as usize, k.height as usize);
        let last = height as f64 - 1.0;
        let camera_from_body = mount.rotation_body_from_camera().transpose();
        let nadir = k.matrix() * camera_from_body * Vector3::new(0.0, 0.0, -1.0);
        let rise = nadir.y - last * nadir.z;
        let rise = if rise.abs() < 1e-9 { 1e-9 } else { rise };
        let column = |(c, v): (f64, f64)| c + (v - last) * (nadir.x - c * nadir.z) / rise;
        let places = (first..height).flat_map(|v| (0..width).map(move |c| (c as f64, v as f64)));
        let columns = places.map(|place| column(place).round().clamp(0.0, width as f64 - 1.0) as u16);
        Self {
            width,
            height,
            first,
            columns: columns.collect(),
            derivative: vec![0; width],
            sums: vec![0; (height - first) * width],
        }
    }

    /// Number of lines.
    pub fn count(&self) -> usize {
        self.width
    }

    /// Column of a line in a row, px.
    pub fn column(&self, line: usize, row: usize) -> usize {
        usize::from(self.columns[(row - self.first) * self.width + line])
    }

    /// Columns of all lines in a row, px.
    pub fn columns(&self, row: usize) -> &[u16] {
        &self.columns[(row - self.first) * self.width..][..self.width]
    }

    /// Mean step from left to right of a line between two rows, gray levels.
    pub fn mean(&self, line: usize, from: usize, to: usize) -> f64 {
        let sum = |row: usize| self.sums[(row - self.first) * self.width + line];
        f64::from(sum(to) - sum(from)) / (UNIT * (to - from) as f64)
    }

    /// Sums up the steps of a picture below the row `floors` of each line; returns false, and keeps the last sums, if the picture
    /// is not of the camera's size.
    pub fn sum(&mut self, image: ImageView, floors: impl Fn(usize) -> usize) -> bool {
        if (image.width(), image.height()) != (self.width, self.height) {
            return false;
        }
        let width = self.width;
        self.sums[..width].fill(0);
        for v in self.first + 1..self.height {
            sharpened(image.row(v), &mut self.derivative);
            let at = (v - self.first) * width;
            let columns = &self.columns[at..at + width];
            let (before, here) = self.sums[at - width..at + width].split_at_mut(width);
            for c in 0..width {
                let step = if v > floors(c) { self.derivative[usize::from(columns[c])] } else { 0 };
                here[c] = before[c] + i32::from(step);
            }
        }
        true
    }
}

/// Computes the step between the neighbors of each pixel less the slope around it: [`UNIT`] for a unit step, zero for
/// a uniform slope.
fn sharpened(row: &[u8], out: &mut [i16]) {
    let width = row.len();
    out.fill(0);
    if width <= 2 * HALF_WIDTH_PX {
        return;
    }
    let inner = width - 2 * HALF_WIDTH_PX;
    let [a, b, c, d] =
        [0, HALF_WIDTH_PX - 1, HALF_WIDTH_PX + 1, 2 * HALF_WIDTH_PX].map(|start| &row[start..start + inner]);
    let out = &mut out[HALF_WIDTH_PX..HALF_WIDTH_PX + inner];
    for u in 0..inner {
        out[u] = 4 * (i16::from(c[u]) - i16::from(b[u])) - (i16::from(d[u]) - i16::from(a[u]));
    }
}
