//! Part of an image in which the floor may be.

use nalgebra::Vector2;
use yamabico_geometry::camera::{Mount, Pinhole};

use super::features::BlockGrid;

/// Height of the foreground as a share of twice the height of the horizon.
const FOREGROUND_HEIGHT: f32 = 0.12;
/// Half the width of the foreground as a share of half the image.
const FOREGROUND_WIDTH: f32 = 0.2;
/// Height, as a share of twice the height of the horizon, above which there is no floor: a margin above the horizon, which may be
/// tilted.
const NO_FLOOR_HEIGHT: f32 = 0.62;
/// Log odds of floor at the bottom, in the middle.
const BOTTOM_LOG_ODDS: f32 = 1.6;
/// Decrease of the log odds over twice the height of the horizon.
const LOG_ODDS_BY_HEIGHT: f32 = 6.5;
/// Decrease of the log odds from the foreground's side to the side of the image.
const LOG_ODDS_BY_SIDE: f32 = 2.0;

/// Part of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Directly in front of the robot; presumed to be floor while nothing else is known.
    Foreground,
    /// May be floor.
    Open,
    /// Above the horizon: never floor.
    NoFloor,
}

/// Part of an image in which the floor may be: below the horizon, and most likely in front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloorPlace {
    /// Height of the horizon above the image's bottom as a share of the image's height. Above 1 if the camera looks down on the
    /// floor only.
    horizon: f32,
}

impl FloorPlace {
    /// A level camera of unknown height.
    pub const UNKNOWN_CAMERA: Self = Self { horizon: 0.5 };

    /// Creates the place for a horizon at this height above the image's bottom, as a share of the image's height; clamped to
    /// 0.1 to 3.
    #[must_use]
    pub fn below_horizon(share: f32) -> Self {
        Self { horizon: if share.is_nan() { 0.5 } else { share.clamp(0.1, 3.0) } }
    }

    /// Creates the place for a mounted camera, from the height of the horizon in the image's middle column.
    #[must_use]
    pub fn of_camera(camera: &Pinhole, mount: &Mount) -> Self {
        let k = camera.intrinsics();
        let (width, height) = (f64::from(k.width), f64::from(k.height));
        let elevation = |v: f64| {
            let ray = camera.normalized_from_pixel(Vector2::new(0.5 * width, v))?.push(1.0);
            Some((mount.rotation_body_from_camera() * ray).normalize().z.asin())
        };
        // The elevation is nearly linear in the row; the image's middle and bottom give the scale.
        let ends = elevation(0.5 * height).zip(elevation(height - 1.0));
        let share = ends.map_or(0.5, |(middle, bottom)| {
            let per_height = (middle - bottom).max(1e-3) / 0.5;
            -bottom / per_height
        });
        Self::below_horizon(share as f32)
    }

    /// Height of the horizon above the image's bottom as a share of the image's height.
    #[must_use]
    pub fn horizon(&self) -> f32 {
        self.horizon
    }

    /// Returns the part in which a block lies, and the log odds that it is floor before its look is known.
    #[must_use]
    pub fn presumption(&self, grid: &BlockGrid, column: usize, row: usize) -> (Part, f32) {
        let height = (grid.rows as f32 - 0.5 - row as f32) / (grid.rows.max(1) as f32 * 2.0 * self.horizon);
        let side = ((column as f32 + 0.5) / grid.columns.max(1) as f32 - 0.5).abs() * 2.0;
        let part = if height > NO_FLOOR_HEIGHT {
            Part::NoFloor
        } else if height < FOREGROUND_HEIGHT && side < FOREGROUND_WIDTH {
            Part::Foreground
        } else {
            Part::Open
        };
        let beside = (side - FOREGROUND_WIDTH).max(0.0);
        (part, BOTTOM_LOG_ODDS - LOG_ODDS_BY_HEIGHT * height - LOG_ODDS_BY_SIDE * beside)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_geometry::camera::Intrinsics;

    #[test]
    fn a_level_camera_has_its_horizon_in_the_middle() {
        let camera = Pinhole::ideal(Intrinsics::from_horizontal_fov(320, 240, 1.0));
        let level = FloorPlace::of_camera(&camera, &Mount::tilted(0.5, 0.0));
        assert!((level.horizon - 0.5).abs() < 0.01, "{level:?}");
        let down = FloorPlace::of_camera(&camera, &Mount::tilted(0.5, 0.3));
        let up = FloorPlace::of_camera(&camera, &Mount::tilted(0.5, -0.2));
        assert!(down.horizon > 0.8 && up.horizon < 0.3, "{down:?} {up:?}");
        assert_eq!(FloorPlace::below_horizon(f32::NAN), FloorPlace::UNKNOWN_CAMERA);
    }

    #[test]
    fn the_foreground_is_at_the_bottom_in_the_middle() {
        let grid = BlockGrid::of(320, 240);
        let part = |column: usize, row: usize| FloorPlace::UNKNOWN_CAMERA.presumption(&grid, column, row).0;
        assert_eq!(part(20, 29), Part::Foreground);
        assert_eq!([part(0, 29), part(20, 20)], [Part::Open; 2]);
        assert_eq!([part(20, 5), part(0, 0)], [Part::NoFloor; 2]);
        let down = FloorPlace::below_horizon(1.2);
        assert!((0..30).all(|row| down.presumption(&grid, 3, row).0 != Part::NoFloor));
        let odds = |column, row| FloorPlace::UNKNOWN_CAMERA.presumption(&grid, column, row).1;
        assert!(odds(20, 29) > odds(20, 20) && odds(20, 29) > odds(2, 29));
    }
}
