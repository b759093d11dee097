//! Turn of a camera between two pictures, from the shift of the band around the horizon.
//!
//! The band is sampled over azimuth, so that a turn shifts all of it alike; what is far away is not shifted by anything else.

use nalgebra::{Point3, Vector3};
use yamabico_geometry::camera::{Mount, Pinhole};

use super::float_image::FloatImage;
use super::floor_motion::parabola;

/// Number of rows of the band, and its half height, rad.
const ROWS: usize = 12;
const HALF_RAD: f64 = 8.0 * std::f64::consts::PI / 180.0;
/// Width of the window whose mean is subtracted from each sample, as a share of the row. What changes slowly over a row stays in place
/// when the camera turns, such as the light that a lens takes from the edges of a picture: before a plain wall it would be a turn of zero.
const TREND_SHARE: f64 = 0.125;
/// Largest turn between two pictures, as a share of the field of view.
const MAX_SHARE: f64 = 0.4;
/// Correlation below which a turn is not known.
const MIN_CORRELATION: f64 = 0.5;
/// Standard deviation of the gray levels of a row, without its trend, below which it says nothing.
const MIN_CONTRAST: f64 = 1.0;

/// Band of gray levels around the horizon over azimuth, without what changes slowly.
#[derive(Clone, Debug, PartialEq)]
pub struct HorizonBand {
    rows: Vec<Vec<f64>>,
    /// Azimuth between two samples, rad.
    step: f64,
}

/// Turn between two pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeenTurn {
    /// Turn, rad, positive to the left.
    pub turn: f64,
    /// Correlation of the bands, 0 to 1.
    pub correlation: f64,
}

impl HorizonBand {
    /// Samples the band of a picture of the camera on this mount.
    #[must_use]
    pub fn of(image: &FloatImage, pinhole: &Pinhole, mount: &Mount) -> Self {
        let intrinsics = pinhole.intrinsics();
        let step = 1.0 / intrinsics.fx;
        let half = 0.5 * intrinsics.horizontal_fov();
        let count = (2.0 * half / step) as usize;
        let camera_from_level = Mount { pan: 0.0, ..*mount }.rotation_body_from_camera().transpose();
        let pixel = |azimuth: f64, elevation: f64| {
            let ray = Vector3::new(
                elevation.cos() * azimuth.cos(),
                -elevation.cos() * azimuth.sin(),
                elevation.sin(),
            );
            pinhole.project(&Point3::from(camera_from_level * ray * 10.0)).ok()
        };
        let row = |i: usize| -> Vec<f64> {
            let elevation = HALF_RAD * (2.0 * (i as f64 + 0.5) / ROWS as f64 - 1.0);
            let level = |k: usize| {
                let azimuth = -half + step * k as f64;
                pixel(azimuth, elevation).and_then(|at| image.sample(at)).unwrap_or(f64::NAN)
            };
            without_trend(&(0..count).map(level).collect::<Vec<_>>())
        };
        Self { rows: (0..ROWS).map(row).collect(), step }
    }

    /// Returns the turn from this picture to a later one; `None` if they do not agree.
    #[must_use]
    pub fn turn_to(&self, later: &Self) -> Option<SeenTurn> {
        let count = self.rows.first()?.len();
        let most = (MAX_SHARE * count as f64) as i32;
        // Coarsely first; the bands of neighboring pictures are smooth over some pixels.
        let best = (-most..=most)
            .step_by(2)
            .max_by(|a, b| self.score(later, *a).total_cmp(&self.score(later, *b)))?;
        let best =
            (best - 2..=best + 2).max_by(|a, b| self.score(later, *a).total_cmp(&self.score(later, *b)))?;
        if best.abs() >= most {
            return None;
        }
        let scores = [best - 1, best, best + 1].map(|shift| self.score(later, shift));
        // Towards +azimuth, to the right, moves what is seen while the robot turns left.
        let turn = (f64::from(best) + parabola(scores)) * self.step;
        (scores[1] >= MIN_CORRELATION).then_some(SeenTurn { turn, correlation: scores[1] })
    }

    /// Mean correlation of the rows where the later band is shifted by `shift` samples; -1 without rows of contrast.
    fn score(&self, later: &Self, shift: i32) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for (row, other) in self.rows.iter().zip(&later.rows) {
            let first = usize::try_from(-shift).unwrap_or(0);
            let start = usize::try_from(shift).unwrap_or(0);
            let length = row.len().saturating_sub(first.max(start));
            if let Some(correlation) = correlation(&row[first..first + length], &other[start..start + length])
            {
                sum += correlation;
                count += 1.0;
            }
        }
        if count > 0.0 { sum / count } else { -1.0 }
    }
}

/// Subtracts from each sample the mean of a window around it; a sample without a whole window is not known.
fn without_trend(row: &[f64]) -> Vec<f64> {
    let half = (0.5 * TREND_SHARE * row.len() as f64) as usize;
    let mut out = vec![f64::NAN; row.len()];
    for (window, middle) in row.windows(2 * half + 1).zip(half..) {
        out[middle] = row[middle] - window.iter().sum::<f64>() / window.len() as f64;
    }
    out
}

/// Correlation of two rows where both are known; `None` with little contrast or few samples.
fn correlation(a: &[f64], b: &[f64]) -> Option<f64> {
    let (mut count, mut sums, mut products) = (0.0, [0.0; 2], [0.0; 3]);
    for (a, b) in a.iter().zip(b).filter(|(a, b)| a.is_finite() && b.is_finite()) {
        count += 1.0;
        sums[0] += a;
        sums[1] += b;
        products[0] += a * a;
        products[1] += b * b;
        products[2] += a * b;
    }
    let [aa, bb, ab] = [
        products[0] - sums[0] * sums[0] / count,
        products[1] - sums[1] * sums[1] / count,
        products[2] - sums[0] * sums[1] / count,
    ];
    let is_clear = count > 40.0 && aa.min(bb) > count * MIN_CONTRAST * MIN_CONTRAST;
    is_clear.then(|| ab / (aa * bb).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_geometry::camera::Intrinsics;
    use yamabico_geometry::image::ImageView;

    /// Picture of far stripes by a camera turned by `heading`, rad to the left.
    fn picture(heading: f64, intrinsics: &Intrinsics) -> FloatImage {
        let level = |u: u32| {
            let azimuth = ((f64::from(u) - intrinsics.cx) / intrinsics.fx).atan() - heading;
            (128.0 + 50.0 * (9.0 * azimuth).sin() + 40.0 * (23.0 * azimuth + 1.0).sin()) as u8
        };
        let (width, height) = (intrinsics.width, intrinsics.height);
        let pixels: Vec<u8> = (0..width * height).map(|i| level(i % width)).collect();
        FloatImage::of(ImageView::new(&pixels, width as usize, height as usize, width as usize).unwrap())
    }

    #[test]
    fn a_turn_shifts_the_band() {
        let intrinsics = Intrinsics::from_horizontal_fov(320, 240, 1.05);
        let band = |heading: f64| {
            HorizonBand::of(&picture(heading, &intrinsics), &Pinhole::ideal(intrinsics), &Mount::level(0.5))
        };
        for turn in [0.0, 0.013, -0.05, 0.12] {
            let seen = band(0.3).turn_to(&band(0.3 + turn)).unwrap();
            assert!((seen.turn - turn).abs() < 4e-4, "{turn}: {seen:?}");
        }
    }

    #[test]
    fn a_plain_wall_is_no_turn_of_zero() {
        let intrinsics = Intrinsics::from_horizontal_fov(320, 240, 1.05);
        // A wall without edges, darker towards the edges of the picture, with noise that differs from picture to picture.
        let wall = |number: u32| {
            let level = |i: u32| {
                let off = (f64::from(i % 320) - intrinsics.cx) / intrinsics.cx;
                let mixed = (i ^ number << 20).wrapping_mul(2_654_435_761);
                let noise = f64::from((mixed ^ mixed >> 15).wrapping_mul(2_246_822_519) >> 13 & 15);
                (190.0 - 50.0 * off * off + noise) as u8
            };
            let pixels: Vec<u8> = (0..320 * 240).map(level).collect();
            let picture = FloatImage::of(ImageView::new(&pixels, 320, 240, 320).unwrap()).smoothed(1.0);
            HorizonBand::of(&picture, &Pinhole::ideal(intrinsics), &Mount::level(0.5))
        };
        assert_eq!(wall(1).turn_to(&wall(2)), None);
        let blank = HorizonBand { rows: vec![vec![7.0; 300]; ROWS], step: 0.003 };
        assert!(blank.turn_to(&blank).is_none());
    }
}
