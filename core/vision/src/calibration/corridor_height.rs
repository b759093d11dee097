//! Height of a camera from the known width of a corridor: the floor lines of its walls give the width in camera heights.

use yamabico_geometry::camera::{Calibration, Mount, Pinhole};
use yamabico_geometry::image::ImageView;

use super::spread::{median, robust_sigma};
use crate::corridor::evidence::EvidenceObserver;
use crate::corridor::floor_lines::FloorLineRule;
use crate::corridor::observer::{CorridorCamera, CorridorObserver};
use crate::segments::SegmentConfig;

/// Heights at which a camera may be mounted, m.
pub const HEIGHTS_M: std::ops::RangeInclusive<f64> = 0.03..=3.0;
/// Widths that a corridor may have, m.
pub const WIDTHS_M: std::ops::RangeInclusive<f64> = 0.5..=10.0;
/// Standard deviation of tilt and roll from picture to picture, rad.
const SWAY_RAD: f64 = 1.0 * std::f64::consts::PI / 180.0;
/// Minimum number of pictures with both walls.
pub const MIN_WIDTHS: usize = 3;
/// Number of consecutive pictures that count as one.
const CORRELATED: f64 = 5.0;

/// Height of the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CorridorHeight {
    /// Height, m.
    pub height_m: f64,
    /// Standard deviation, m.
    pub sigma_m: f64,
    /// Number of pictures with both walls.
    pub pictures: usize,
}

/// Measures the width of the corridor in one picture, in heights of the camera, with an assumed height of `mount.z`; `None` where not both
/// walls are seen. The assumed height only says which floor lines may be walls.
#[must_use]
pub fn width_in_heights(image: ImageView<'_>, pinhole: &Pinhole, mount: &Mount) -> Option<f64> {
    let camera = CorridorCamera {
        pinhole: *pinhole,
        mount: Mount { x: 0.0, y: 0.0, pan: 0.0, ..*mount },
        calibration: Calibration::Measured,
        horizon_sigma_rad: SWAY_RAD,
    };
    let observer =
        CorridorObserver::with_segments(camera, FloorLineRule::default(), SegmentConfig::for_evidence());
    let seen = EvidenceObserver::new(observer, None).observe(image, None);
    let (left, right) =
        seen.observation.ok().filter(|_| !seen.is_far).and_then(|seen| seen.left.zip(seen.right))?;
    Some((left.distance_m - right.distance_m) / mount.z)
}

/// Returns the height from the widths of a corridor that is `width_m` wide at the floor; `None` with too few.
#[must_use]
pub fn height_of(widths_in_heights: &[f64], width_m: f64) -> Option<CorridorHeight> {
    let heights: Vec<f64> = widths_in_heights.iter().map(|width| width_m / width).collect();
    let height_m =
        median(&heights).filter(|height| HEIGHTS_M.contains(height) && heights.len() >= MIN_WIDTHS)?;
    let independent = (heights.len() as f64 / CORRELATED).max(1.0);
    // A median scatters 1.25 times as much as a mean.
    let sigma_m = 1.25 * robust_sigma(&heights)? / independent.sqrt();
    Some(CorridorHeight { height_m, sigma_m, pictures: heights.len() })
}
