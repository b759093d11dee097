//! Agreement of images in succession on a correction of the pose.

use nalgebra::Vector3;

/// Maximum difference between two corrections that agree, m and rad.
const TOLERANCE: (f64, f64) = (0.15, 0.05);
/// Shift from which a correction is a far one, m.
const FAR_M: f64 = 0.2;
/// Numbers of images in succession that must agree on a near correction and on a far one: two images from nearly the same place may
/// make the same mistake.
const IMAGES: (u32, u32) = (2, 5);

/// The last correction, (x, y, theta), and the number of images in succession that agree on it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Agreement {
    last: Option<(Vector3<f64>, u32)>,
}

impl Agreement {
    /// Takes the correction that the next image suggests, `None` if it suggests none; returns true if enough images agree on it.
    pub fn take(&mut self, correction: Option<Vector3<f64>>) -> bool {
        self.last = correction.map(|correction| {
            let agreed = self.last.filter(|(last, _)| agree(correction, *last));
            (correction, agreed.map_or(1, |(_, images)| images + 1))
        });
        self.last.is_some_and(|(correction, images)| {
            images >= if correction.xy().norm() > FAR_M { IMAGES.1 } else { IMAGES.0 }
        })
    }
}

/// Returns true if two corrections of (x, y, theta) agree.
#[must_use]
pub fn agree(correction: Vector3<f64>, other: Vector3<f64>) -> bool {
    let off = correction - other;
    off.xy().norm() < TOLERANCE.0 && off.z.abs() < TOLERANCE.1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_far_correction_needs_more_images_than_a_near_one() {
        let images = |shift_m: f64| {
            let mut agreement = Agreement::default();
            (1..10).find(|i| agreement.take(Some(Vector3::new(0.01 * f64::from(*i), shift_m, 0.1))))
        };
        assert_eq!(images(0.1), Some(2));
        assert_eq!(images(-0.5), Some(5));
    }

    #[test]
    fn an_image_that_contradicts_or_says_nothing_begins_anew() {
        let mut agreement = Agreement::default();
        let near = Some(Vector3::new(0.1, 0.0, 0.0));
        assert!(!agreement.take(near) && !agreement.take(None) && !agreement.take(near));
        assert!(!agreement.take(Some(Vector3::new(0.1, 0.0, 0.1))), "another heading");
        assert!(!agreement.take(near) && agreement.take(near) && agreement.take(near));
    }
}
