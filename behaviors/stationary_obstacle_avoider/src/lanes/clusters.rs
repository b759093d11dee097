//! Occupied cells as circles, for the output `obstacles`.

use nalgebra::{Point2, Vector2};
use yamabico_core::message::Obstacle;

use super::occupancy::CELL_M;

/// Maximum number of circles.
const MAX_CIRCLES: usize = 32;
/// Confidence of a circle: its cells are occupied.
const CONFIDENCE: f64 = 0.9;

/// Circles that hold neighboring cells. Allocates when it is created and no more.
#[derive(Clone, Debug)]
pub(super) struct Clusters {
    circles: Vec<Obstacle>,
}

impl Default for Clusters {
    fn default() -> Self {
        Self { circles: Vec::with_capacity(MAX_CIRCLES) }
    }
}

impl Clusters {
    /// Groups the cells at `places` (m). Cells beyond the maximum number of circles are left out.
    pub fn group(&mut self, places: &[Point2<f32>]) -> &[Obstacle] {
        self.circles.clear();
        for place in places.iter().map(|place| place.cast::<f64>()) {
            let away = |circle: &Obstacle| -> Vector2<f64> { place - Point2::new(circle.x, circle.y) };
            let is_beside = |circle: &&mut Obstacle| away(circle).norm() < circle.radius_m + 2.0 * CELL_M;
            let has_room = self.circles.len() < MAX_CIRCLES;
            match self.circles.iter_mut().find(is_beside) {
                Some(circle) => {
                    // The circle grows until it holds the cell.
                    let away = away(circle);
                    let beyond_m = 0.5 * (away.norm() + 0.5 * CELL_M - circle.radius_m);
                    if let Some(direction) = away.try_normalize(1e-9).filter(|_| beyond_m > 0.0) {
                        (circle.x, circle.y) =
                            (circle.x + direction.x * beyond_m, circle.y + direction.y * beyond_m);
                        circle.radius_m += beyond_m;
                    }
                }
                None if has_room => self.circles.push(Obstacle {
                    x: place.x,
                    y: place.y,
                    radius_m: 0.5 * CELL_M,
                    covariance: [CELL_M * CELL_M, 0.0, 0.0, CELL_M * CELL_M],
                    confidence: CONFIDENCE,
                }),
                None => {}
            }
        }
        &self.circles
    }
}

#[cfg(test)]
mod tests {
    use yamabico_core::geometry::Hypotenuse;

    use super::*;

    #[test]
    fn neighbors_share_a_circle_and_others_do_not() {
        let mut places: Vec<_> = (0..7).map(|i| Point2::new(1.5_f32, 0.05 * i as f32)).collect();
        places.push(Point2::new(1.0, -0.6));
        let mut clusters = Clusters::default();
        let circles = clusters.group(&places);
        assert_eq!(circles.len(), 2);
        for place in &places[..7] {
            let off = (circles[0].x - f64::from(place.x)).hypotenuse(circles[0].y - f64::from(place.y));
            assert!(off <= circles[0].radius_m + 0.5 * CELL_M, "{place:?} is outside of {:?}", circles[0]);
        }
        assert!((circles[0].radius_m - 0.175).abs() < 0.06, "{}", circles[0].radius_m);
    }

    #[test]
    fn their_number_is_bounded() {
        let places: Vec<_> = (0..100).map(|i| Point2::new(0.5 * i as f32, 0.0)).collect();
        assert_eq!(Clusters::default().group(&places).len(), MAX_CIRCLES);
        assert!(Clusters::default().group(&[]).is_empty());
    }
}
