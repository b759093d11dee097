//! Directions in which things hide the floor, as seen from the camera.

use nalgebra::{Point2, Vector2};

/// Directions of the fan, and its largest slope to each side.
const BINS: usize = 96;
const MAX_SLOPE: f64 = 1.2;

/// Distances from which the floor is hidden, by direction from the camera.
#[derive(Clone, Debug)]
pub(super) struct HiddenFan {
    camera: Point2<f64>,
    from_m: [f64; BINS],
}

impl HiddenFan {
    /// Creates the fan of a camera at `camera` (robot frame, m) that nothing hides the floor from.
    pub fn new(camera: Point2<f64>) -> Self {
        Self { camera, from_m: [f64::INFINITY; BINS] }
    }

    /// Forgets what hides the floor.
    pub fn clear(&mut self) {
        self.from_m = [f64::INFINITY; BINS];
    }

    /// Hides the floor behind a thing with a foot at `foot` (robot frame, m), from `depth_m` before it on.
    pub fn hide(&mut self, foot: Point2<f64>, depth_m: f64) {
        let off = foot - self.camera;
        for bin in bin(off).into_iter().flat_map(|bin| bin.saturating_sub(1)..(bin + 2).min(BINS)) {
            self.from_m[bin] = self.from_m[bin].min(off.norm() - depth_m);
        }
    }

    /// True if the floor at `place` (robot frame, m) is hidden.
    pub fn is_hidden(&self, place: Point2<f64>) -> bool {
        let off = place - self.camera;
        bin(off).is_some_and(|bin| off.norm() > self.from_m[bin])
    }
}

/// Direction in the fan, of an offset from the camera; `None` if it is not in it.
fn bin(off: Vector2<f64>) -> Option<usize> {
    let share = 0.5 + 0.5 * off.y / (off.x * MAX_SLOPE);
    (off.x > 0.0 && (0.0..1.0).contains(&share)).then_some((share * BINS as f64) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_nearest_hides_the_floor_behind_it() {
        let mut fan = HiddenFan::new(Point2::new(0.2, 0.0));
        fan.hide(Point2::new(2.2, 0.2), 0.05);
        fan.hide(Point2::new(1.2, 0.1), 0.05);
        assert!(fan.is_hidden(Point2::new(1.2, 0.1)) && fan.is_hidden(Point2::new(1.7, 0.15)));
        assert!(!fan.is_hidden(Point2::new(1.1, 0.09)), "before it");
        assert!(!fan.is_hidden(Point2::new(1.4, -0.3)), "another direction");
        fan.clear();
        assert!(!fan.is_hidden(Point2::new(1.7, 0.15)));
    }

    #[test]
    fn directions_cover_the_fan() {
        assert_eq!(bin(Vector2::new(1.0, 0.0)), Some(BINS / 2));
        assert!(bin(Vector2::new(1.0, 1.1)).is_some_and(|bin| bin > BINS * 9 / 10));
        assert_eq!(bin(Vector2::new(1.0, 1.3)), None);
        assert_eq!(bin(Vector2::new(-1.0, 0.0)), None);
        assert_eq!(bin(Vector2::new(f64::NAN, 0.0)), None);
    }
}
