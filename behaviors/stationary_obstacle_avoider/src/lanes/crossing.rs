//! What crosses the way, by what the camera saw come and by echoes that came suddenly near.

use yamabico_core::geometry::Pose2;

use super::sudden_echo::SuddenEcho;

/// Number of cells around the path that were seen to become occupied from which something crosses, and below which it no longer
/// does: legs that pass, and turns of the robot, leave few of them.
const COMES_CELLS: usize = 6;
const STAYS_CELLS: usize = 3;

/// Whether something crosses the way.
#[derive(Clone, Debug, Default)]
pub(super) struct Crossing {
    echo: SuddenEcho,
    is_seen: bool,
}

impl Crossing {
    /// Takes in the range ahead (m, infinite without an echo) that a robot at `pose` (odometry) measures at `now_s` (s).
    pub fn hear(&mut self, now_s: f64, range_m: f64, pose: Pose2) {
        self.echo.update(now_s, range_m, pose);
    }

    /// Takes in the number of cells around the path that something came to; none if pictures do not tell.
    pub fn see(&mut self, cells: usize) {
        self.is_seen = cells >= if self.is_seen { STAYS_CELLS } else { COMES_CELLS };
    }

    /// True if something crosses the way.
    pub fn is_there(&self, now_s: f64) -> bool {
        self.is_seen || self.echo.moves(now_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_come_crosses_until_hardly_anything_of_it_is_left() {
        let mut crossing = Crossing::default();
        for (cells, crosses) in [(5, false), (6, true), (4, true), (3, true), (2, false), (4, false), (7, true)] {
            crossing.see(cells);
            assert_eq!(crossing.is_there(1.0), crosses, "{cells} cells");
        }
    }
}
