//! Square window of cells that rolls along with a robot: a cell keeps its slot in an array while it is in the window.

use nalgebra::Point2;

/// Numbers beyond which cells are not told apart.
const MAX_NUMBER: f64 = 1e12;

/// Window of cells. A cell is stored at its numbers modulo the size of the window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RollingWindow {
    cells: usize,
    cell_m: f64,
    /// Cell numbers of the lower corner.
    corner: [i64; 2],
}

impl RollingWindow {
    /// Creates a window of `cells` x `cells` cells with sides of `cell_m` (m) around the origin.
    #[must_use]
    pub fn new(cells: usize, cell_m: f64) -> Self {
        let half = cells as i64 / 2;
        Self { cells, cell_m, corner: [-half, -half] }
    }

    /// Moves the window so that `position` (m) is in its middle, and passes the slot of each cell that enters it to `clear`.
    pub fn advance(&mut self, position: Point2<f64>, mut clear: impl FnMut(usize)) {
        let size = self.cells as i64;
        for (axis, meters) in [position.x, position.y].into_iter().enumerate() {
            let new = self.number(meters) - size / 2;
            let old = std::mem::replace(&mut self.corner[axis], new);
            let entered =
                if new > old { (old + size).max(new)..new + size } else { new..old.min(new + size) };
            for number in entered {
                let slot = number.rem_euclid(size) as usize;
                for other in 0..self.cells {
                    clear(if axis == 0 { slot + other * self.cells } else { slot * self.cells + other });
                }
            }
        }
    }

    /// Returns the number along an axis of the cell that holds the coordinate `meters`.
    #[must_use]
    pub fn number(&self, meters: f64) -> i64 {
        (meters / self.cell_m).floor().clamp(-MAX_NUMBER, MAX_NUMBER) as i64
    }

    /// Returns the middle of the cell with these numbers, m.
    #[must_use]
    pub fn middle(&self, numbers: [i64; 2]) -> Point2<f64> {
        let [x, y] = numbers.map(|number| (number as f64 + 0.5) * self.cell_m);
        Point2::new(x, y)
    }

    /// Returns the slot of the cell that holds `place` (m); `None` if it is outside of the window or not finite.
    #[must_use]
    pub fn slot(&self, place: Point2<f64>) -> Option<usize> {
        let numbers = [self.number(place.x), self.number(place.y)];
        let size = self.cells as i64;
        let is_inside = |axis: usize| (0..size).contains(&(numbers[axis] - self.corner[axis]));
        let slot = |axis: usize| numbers[axis].rem_euclid(size) as usize;
        (place.x.is_finite() && place.y.is_finite() && is_inside(0) && is_inside(1))
            .then(|| slot(0) + slot(1) * self.cells)
    }

    /// Returns the slot of the cell in a column and row of the window, both counted from its lower corner and below the number
    /// of cells on a side.
    #[must_use]
    pub fn slot_of(&self, column: usize, row: usize) -> usize {
        let remainder = |axis: usize, index: usize| {
            let at = self.corner[axis].rem_euclid(self.cells as i64) as usize + index;
            if at < self.cells { at } else { at - self.cells }
        };
        remainder(0, column) + remainder(1, row) * self.cells
    }

    /// Returns the slots of the cells up to `reach` columns and rows away from the one that is stored in `slot`, those beyond the
    /// window's border left out.
    pub fn neighbors(&self, slot: usize, reach: i64) -> impl Iterator<Item = usize> {
        let size = self.cells as i64;
        let at = |axis: usize, slot: usize| (slot as i64 - self.corner[axis]).rem_euclid(size);
        let around =
            move |at: i64| ((at - reach).max(0)..(at + reach + 1).min(size)).map(|index| index as usize);
        let (column, row) = (at(0, slot % self.cells), at(1, slot / self.cells));
        around(row).flat_map(move |row| around(column).map(move |column| self.slot_of(column, row)))
    }

    /// Returns the middle of the cell that is stored in `slot`, m.
    #[must_use]
    pub fn place(&self, slot: usize) -> Point2<f64> {
        let size = self.cells as i64;
        let number =
            |axis: usize, slot: usize| self.corner[axis] + (slot as i64 - self.corner[axis]).rem_euclid(size);
        self.middle([number(0, slot % self.cells), number(1, slot / self.cells)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_keep_their_slots_while_they_are_in_the_window() {
        let mut window = RollingWindow::new(16, 0.1);
        let place = Point2::new(0.33, -0.27);
        let slot = window.slot(place).expect("inside");
        assert!((window.place(slot) - place).amax() <= 0.05 + 1e-12);
        let mut cleared = Vec::new();
        for step in 0..8 {
            let robot = Point2::new(0.1 * f64::from(step), -0.05 * f64::from(step));
            window.advance(robot, |slot| cleared.push(slot));
            assert_eq!(window.slot(place), Some(slot));
        }
        assert!(!cleared.contains(&slot) && !cleared.is_empty());
        window.advance(Point2::new(5.0, 0.0), |slot| cleared.push(slot));
        assert_eq!(window.slot(place), None);
        assert!(cleared.contains(&slot));
    }

    #[test]
    fn columns_and_rows_count_from_the_lower_corner() {
        let mut window = RollingWindow::new(16, 0.1);
        window.advance(Point2::new(3.21, -7.55), |_| ());
        let corner = window.place(window.slot_of(0, 0));
        for (column, row) in [(0, 0), (15, 3), (7, 15)] {
            let place = window.place(window.slot_of(column, row));
            let expected = corner + nalgebra::Vector2::new(column as f64, row as f64) * 0.1;
            assert!((place - expected).amax() < 1e-9, "{place:?}");
            assert_eq!(window.slot(place), Some(window.slot_of(column, row)));
        }
    }

    #[test]
    fn absurd_places_are_outside() {
        let mut window = RollingWindow::new(16, 0.1);
        for absurd in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(window.slot(Point2::new(absurd, 0.0)), None);
            let mut cleared = 0;
            window.advance(Point2::new(absurd, 1e300), |_| cleared += 1);
            assert!(cleared <= 2 * 16 * 16);
        }
    }
}
