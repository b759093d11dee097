//! Cells that the camera has seen as floor, however long ago.

use super::evidence_layer::Layer;

/// Limits of the log odds that a cell is no floor: two pictures change what it is taken for.
const LIMITS: (f32, f32) = (-2.0, 2.0);
/// Log odds from which a cell was seen as floor: by two pictures, or by look and motion in one, since a single look may be wrong.
const SEEN: f32 = -1.3;

/// Evidence by the camera of what is floor, which does not fade, and what is taken for floor without any.
#[derive(Clone, Debug)]
pub(super) struct SeenFloor {
    layer: Layer,
    presumed: Vec<bool>,
}

impl SeenFloor {
    /// Creates a record of that many cells, none of them seen.
    pub fn new(cells: usize) -> Self {
        Self { layer: Layer::new(cells, LIMITS), presumed: vec![false; cells] }
    }

    /// Forgets a cell.
    pub fn clear(&mut self, slot: usize) {
        (self.layer.odds[slot], self.presumed[slot]) = (0.0, false);
    }

    /// Begins an update.
    pub fn begin(&mut self) {
        self.layer.begin();
    }

    /// Adds `evidence` (log odds of no floor) to a cell, unless this update has already.
    pub fn add_to(&mut self, slot: usize, evidence: f32) {
        self.layer.add_to(slot, evidence);
        self.presumed[slot] &= evidence < 0.0;
    }

    /// Takes a cell for floor until something else is seen there.
    pub fn presume(&mut self, slot: usize) {
        self.presumed[slot] = true;
    }

    /// True if a cell was seen as floor, and as nothing else since.
    pub fn is_seen(&self, slot: usize) -> bool {
        self.layer.odds[slot] <= SEEN
    }

    /// True if a cell was seen as floor, or is taken for it.
    pub fn is_taken(&self, slot: usize) -> bool {
        self.presumed[slot] || self.is_seen(slot)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::super::occupancy::OccupancyGrid;
    use super::*;

    fn see(floor: &mut SeenFloor, evidence: f32) {
        floor.begin();
        floor.add_to(0, evidence);
    }

    #[test]
    fn two_pictures_show_floor_and_a_thing_takes_it_away() {
        let mut floor = SeenFloor::new(2);
        see(&mut floor, -0.7);
        floor.add_to(0, -0.7);
        assert!(!floor.is_seen(0), "one picture may be wrong, and counts once");
        see(&mut floor, -0.7);
        assert!(floor.is_seen(0) && floor.is_taken(0) && !floor.is_seen(1));
        see(&mut floor, 1.3);
        assert!(!floor.is_taken(0));
        (0..2).for_each(|_| see(&mut floor, -0.7));
        floor.clear(0);
        assert!(!floor.is_taken(0));
    }

    #[test]
    fn floor_that_is_presumed_was_not_seen_and_is_no_more_where_something_else_is() {
        let mut floor = SeenFloor::new(1);
        floor.presume(0);
        assert!(floor.is_taken(0) && !floor.is_seen(0));
        see(&mut floor, -0.7);
        assert!(floor.is_taken(0));
        see(&mut floor, 1.3);
        assert!(!floor.is_taken(0));
    }

    #[test]
    fn floor_that_was_seen_does_not_fade_and_doubt_shows_none() {
        let mut grid = OccupancyGrid::default();
        let (start, place, other) = (Point2::new(0.5, 0.5), Point2::new(1.52, 0.03), Point2::new(1.52, 0.33));
        grid.presume_floor(Point2::origin(), 1.2);
        assert!(grid.is_taken_for_floor(start) && !grid.is_taken_for_floor(place));
        (0..2).for_each(|_| grid.add_floor([(place, true)].into_iter(), -0.7));
        (0..60).for_each(|_| grid.advance(Point2::origin(), 1.0, |_| false));
        assert!(grid.shows_floor(place) && !grid.is_taken_for_floor(other));
        grid.add_thing([(place, false)].into_iter(), 1.3);
        assert!(!grid.is_taken_for_floor(place), "something stands there, or has");
        grid.doubt(Point2::origin());
        assert!(grid.is_taken_for_floor(place) && grid.is_taken_for_floor(other));
        assert!(!grid.shows_floor(place), "it must be seen again");
    }
}
