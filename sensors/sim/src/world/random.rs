//! Random placement of boxes, and random hallways for sweeps.

use rand::RngExt;

use super::{BoxItem, Corridor, CorridorDoor, Floor, Side, World};
use crate::random::stream;

impl BoxItem {
    /// Returns box number `index` in the run of `seed`, with its jitter and its color drawn.
    #[must_use]
    pub fn placed(&self, index: usize, seed: u64) -> Self {
        let mut rng = stream(seed, &format!("box {index}"));
        let mut within = |max: f64| rng.random_range(-1.0..=1.0) * max;
        let [x_m, y_m] = self.jitter_m.map(&mut within);
        let yaw_deg = self.yaw_deg + within(self.jitter_deg);
        let color = match self.colors.len() {
            0 => self.color,
            count => self.colors[rng.random_range(0..count)],
        };
        Self { at_m: [self.at_m[0] + x_m, self.at_m[1] + y_m], yaw_deg, color, ..self.clone() }
    }
}

impl World {
    /// Returns a hallway of this width with random doors (open and closed), boxes along the walls, window, baseboards, floor
    /// joints and colors. The same seed gives the same hallway.
    #[must_use]
    pub fn random_corridor(seed: u64, width_m: f64) -> Self {
        let mut rng = stream(seed, "random corridor");
        let mut corridor =
            Corridor { length_m: rng.random_range(14.0..24.0), width_m, ..Corridor::default() };
        let tone = rng.random_range(0.5..0.8_f32);
        corridor.color = [tone, tone * 0.98, tone * 0.92];
        corridor.lamp_spacing_m = rng.random_range(1.8..3.6);
        if rng.random_bool(0.15) {
            corridor.window = None;
        }
        if let Some(b) = &mut corridor.baseboard {
            b.height_m = rng.random_range(0.06..0.15);
            let dark = rng.random_range(0.05..0.25_f32);
            b.color = [dark, dark * 0.95, dark * 0.9];
        }
        for side in [Side::Left, Side::Right] {
            let mut x = corridor.start_x_m + rng.random_range(0.8..3.0);
            while x < corridor.end_x_m() - 1.0 {
                let door = CorridorDoor::closed(side, x);
                let open_deg = if rng.random_bool(0.3) { rng.random_range(40.0..100.0) } else { 0.0 };
                let wood = rng.random_range(0.5..1.6_f32);
                let color = door.color.map(|c| c * wood);
                corridor.doors.push(CorridorDoor { open_deg, color, ..door });
                x += rng.random_range(1.6..4.5);
            }
        }
        let mut boxes = Vec::new();
        for _ in 0..rng.random_range(0..4) {
            let side = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
            let white = rng.random_bool(0.5);
            boxes.push(BoxItem {
                at_m: [
                    rng.random_range(2.0..corridor.end_x_m() - 1.0),
                    side * (width_m / 2.0 - rng.random_range(0.2..0.35)),
                ],
                yaw_deg: rng.random_range(-45.0..45.0),
                color: if white { super::BOX_COLOR } else { [0.30, 0.19, 0.10] },
                ..BoxItem::default()
            });
        }
        let shade = rng.random_range(0.25..0.5_f32);
        let tiled = rng.random_bool(0.5);
        let floor = Floor {
            color: [shade, shade * 0.94, shade * 0.85],
            gloss: rng.random_range(0.0..0.6),
            joint_spacing_m: if tiled { [0.5, 0.5] } else { [0.0, 0.0] },
            ..Floor::default()
        };
        Self { texture_seed: seed, corridor: Some(corridor), boxes, floor, ..Self::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_moves_a_box_only_within_its_jitter() {
        let still = BoxItem { at_m: [3.0, 0.2], yaw_deg: 10.0, ..BoxItem::default() };
        let placed = still.placed(0, 7);
        assert_eq!((placed.at_m, placed.yaw_deg, placed.color), (still.at_m, still.yaw_deg, still.color));

        let colors = vec![[0.9; 3], [0.2; 3]];
        let loose =
            BoxItem { jitter_m: [1.0, 0.3], jitter_deg: 45.0, colors: colors.clone(), ..still.clone() };
        let boxes: Vec<_> = (0..64).map(|seed| loose.placed(0, seed)).collect();
        for (seed, placed) in boxes.iter().enumerate() {
            assert!((placed.at_m[0] - 3.0).abs() <= 1.0 && (placed.at_m[1] - 0.2).abs() <= 0.3);
            assert!((placed.yaw_deg - 10.0).abs() <= 45.0);
            assert_eq!(placed.at_m, loose.placed(0, seed as u64).at_m);
        }
        let spread = |index: usize| {
            let at = boxes.iter().map(|placed| placed.at_m[index]);
            at.clone().fold(f64::MIN, f64::max) - at.fold(f64::MAX, f64::min)
        };
        assert!(spread(0) > 1.5 && spread(1) > 0.45, "the seeds cover the jitter");
        assert!(colors.iter().all(|color| boxes.iter().any(|placed| placed.color == *color)));
        assert_ne!(loose.placed(0, 1).at_m, loose.placed(1, 1).at_m, "every box has its own jitter");
    }
}
