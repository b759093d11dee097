//! Places where something has come that showed floor a moment ago: what moves.

use yamabico_vision::rolling_window::RollingWindow;

/// Time since a place last showed floor up to which what stands there now has come, s.
const RECENT_S: f64 = 1.5;
/// The same for what a sonar hears aside, where the camera looked before the robot came so far, s.
const HEARD_RECENT_S: f64 = 6.0;
/// Time for which what has come may move on, s.
pub(super) const STAYS_S: f64 = 5.0;
/// Cells around what stands that its own errors reach.
const NEAR_CELLS: i64 = 2;
/// Time long ago, s.
const NEVER_S: f64 = f64::NEG_INFINITY;

/// Times at which the cells of a window showed floor, and became occupied, on the window's own clock.
#[derive(Clone, Debug)]
pub(super) struct Arrivals {
    now_s: f64,
    floor_s: Vec<f64>,
    /// Time at which something came; `NEVER_S` where it was not seen to come.
    came_s: Vec<f64>,
    is_occupied: Vec<bool>,
    /// True where what came is no mirror image, if it came.
    is_sure: Vec<bool>,
    new: Vec<usize>,
}

impl Arrivals {
    /// Creates a record without arrivals for that many cells.
    pub fn new(cells: usize) -> Self {
        Self {
            now_s: 0.0,
            floor_s: vec![NEVER_S; cells],
            came_s: vec![NEVER_S; cells],
            is_occupied: vec![false; cells],
            is_sure: vec![false; cells],
            new: Vec::with_capacity(cells),
        }
    }

    /// Lets the clock advance, s.
    pub fn advance(&mut self, elapsed_s: f64) {
        self.now_s += elapsed_s;
    }

    /// Forgets a cell.
    pub fn clear(&mut self, slot: usize) {
        (self.floor_s[slot], self.came_s[slot], self.is_occupied[slot]) = (NEVER_S, NEVER_S, false);
    }

    /// Takes in which cells of the window are occupied, and which show floor. What becomes occupied beside what stands is its edge,
    /// seen anew. What comes to a cell that is not sure may be a mirror image.
    pub fn update(
        &mut self,
        window: &RollingWindow,
        is_occupied: impl Fn(usize) -> bool,
        is_floor: impl Fn(usize) -> bool,
        is_sure: impl Fn(usize) -> bool,
    ) {
        self.new.clear();
        for slot in 0..self.is_occupied.len() {
            if is_floor(slot) {
                self.floor_s[slot] = self.now_s;
            }
            let was_occupied = std::mem::replace(&mut self.is_occupied[slot], is_occupied(slot));
            if self.is_occupied[slot] && !was_occupied {
                let is_recent = self.now_s - self.floor_s[slot] < RECENT_S;
                self.came_s[slot] = if is_recent { self.now_s } else { NEVER_S };
                self.is_sure[slot] = is_sure(slot);
                self.new.push(slot);
            }
        }
        let mut new = std::mem::take(&mut self.new);
        new.retain(|&slot| self.is_beside_what_stands(window, slot));
        for &slot in &new {
            self.came_s[slot] = NEVER_S;
        }
        self.new = new;
    }

    /// True if something that was not seen to come stands at a cell or beside it, as far as its own errors reach.
    pub fn is_beside_what_stands(&self, window: &RollingWindow, slot: usize) -> bool {
        window.neighbors(slot, NEAR_CELLS).any(|slot| self.is_occupied[slot] && !self.has_come(slot))
    }

    /// True if a cell showed floor so lately that what a sonar hears there has come, and nothing that was not seen to come stands beside it.
    pub fn was_floor(&self, window: &RollingWindow, slot: usize) -> bool {
        self.now_s - self.floor_s[slot] < HEARD_RECENT_S && !self.is_beside_what_stands(window, slot)
    }

    /// True if what occupies a cell was seen to come.
    pub fn has_come(&self, slot: usize) -> bool {
        self.came_s[slot] > NEVER_S
    }

    /// True if what occupies a cell came there some seconds ago at most, and is no mirror image.
    pub fn moves(&self, slot: usize) -> bool {
        self.is_occupied[slot] && self.is_sure[slot] && self.now_s - self.came_s[slot] < STAYS_S
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::*;

    const CELLS: usize = 32;

    /// Cells of a window in which pictures follow each other by 0.1 s.
    struct Ground {
        window: RollingWindow,
        arrivals: Arrivals,
    }

    impl Ground {
        fn new() -> Self {
            Self { window: RollingWindow::new(CELLS, 0.05), arrivals: Arrivals::new(CELLS * CELLS) }
        }

        /// A picture in which the places at the coordinates `occupied` along x are occupied, and the others floor if `shows_floor`.
        fn see(&mut self, occupied: &[f64], shows_floor: bool) {
            let slots: Vec<_> = occupied.iter().filter_map(|&x| self.slot(x)).collect();
            self.arrivals.advance(0.1);
            let is_occupied = |slot: usize| slots.contains(&slot);
            self.arrivals.update(
                &self.window,
                is_occupied,
                |slot| shows_floor && !is_occupied(slot),
                |_| true,
            );
        }

        fn slot(&self, x: f64) -> Option<usize> {
            self.window.slot(Point2::new(x, 0.02))
        }

        fn moves(&self, x: f64) -> bool {
            self.slot(x).is_some_and(|slot| self.arrivals.moves(slot))
        }
    }

    #[test]
    fn what_comes_where_floor_was_moves_until_it_has_stayed() {
        let mut ground = Ground::new();
        ground.see(&[], true);
        ground.see(&[0.52], true);
        assert!(ground.moves(0.52) && !ground.moves(0.02));
        (0..40).for_each(|_| ground.see(&[0.52], true));
        assert!(ground.moves(0.52));
        (0..20).for_each(|_| ground.see(&[0.52], true));
        assert!(!ground.moves(0.52), "it has stayed");
    }

    #[test]
    fn what_walks_on_goes_on_moving() {
        let mut ground = Ground::new();
        ground.see(&[], true);
        for step in 0..100 {
            let x = 0.01 * f64::from(step) - 0.5;
            ground.see(&[x, x + 0.05], true);
            assert!(ground.moves(x) || ground.moves(x + 0.05), "step {step}");
        }
    }

    #[test]
    fn what_was_not_seen_to_come_stands() {
        let mut ground = Ground::new();
        ground.see(&[], false);
        ground.see(&[0.52], false);
        assert!(!ground.moves(0.52), "nothing was seen there before");
        ground.see(&[0.52], true);
        ground.see(&[0.46, 0.52], true);
        assert!(!ground.moves(0.46), "an edge seen anew");
        ground.see(&[0.46, 0.52, 0.22], true);
        assert!(ground.moves(0.22) && !ground.moves(0.46));
        ground.arrivals.clear(ground.slot(0.22).expect("inside"));
        assert!(!ground.moves(0.22));
    }

    #[test]
    fn what_comes_beside_what_stands_is_its_edge_alone_on_each_side() {
        let mut ground = Ground::new();
        ground.see(&[0.02], false);
        let come = [0.07, 0.12, 0.17, 0.22];
        for side in [1.0, -1.0] {
            ground.see(&[0.02], true);
            let places: Vec<f64> = come.iter().map(|x| 0.02 + side * (x - 0.02)).collect();
            ground.see(&[&[0.02], &places[..]].concat(), true);
            let moves: Vec<bool> = places.iter().map(|&x| ground.moves(x)).collect();
            assert_eq!(moves, [false, false, true, true], "side {side}");
        }
    }
}
