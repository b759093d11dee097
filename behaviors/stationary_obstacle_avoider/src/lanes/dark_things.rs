//! Things that are darker than the floor, which the sonars' silence cannot outvote.
//!
//! Smooth surfaces give no echo at most angles. Light and paper on the floor give none either, but they are brighter than it. Shadows are
//! dark, too: where the floor has texture, their motion shows that they are flat. On a floor that mirrors, nothing counts as dark.

/// Log odds of a dark thing to which silence can lower a cell: a look that was confirmed outvotes it.
const SILENCE: f32 = -3.0;

/// Cells in which the look has shown something darker than the floor since floor was seen there.
#[derive(Clone, Debug)]
pub(super) struct DarkThings {
    is_dark: Vec<bool>,
}

impl DarkThings {
    /// Creates a window without dark things, of that many cells.
    pub fn new(cells: usize) -> Self {
        Self { is_dark: vec![false; cells] }
    }

    /// Takes note of a thing in a cell.
    pub fn add_to(&mut self, slot: usize, is_darker: bool) {
        self.is_dark[slot] |= is_darker;
    }

    /// Forgets what was seen in a cell.
    pub fn clear(&mut self, slot: usize) {
        self.is_dark[slot] = false;
    }

    /// Log odds to which silence can lower a cell; without a dark thing as far as it goes.
    pub fn silence_limit(&self, slot: usize) -> f32 {
        if self.is_dark[slot] { SILENCE } else { f32::NEG_INFINITY }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;
    use yamabico_core::geometry::Pose2;
    use yamabico_core::message::{Beam, NO_ECHO};

    use super::super::occupancy::OccupancyGrid;

    #[test]
    fn silence_outvotes_the_look_of_what_is_brighter_than_the_floor() {
        let silent = Beam { cone_rad: 0.6, flags: NO_ECHO, ..Beam::default() };
        let place = Point2::new(1.02, 0.03);
        let stays = |looks: &[bool], floor: usize| {
            let mut grid = OccupancyGrid::default();
            looks.iter().for_each(|&is_darker| grid.add_thing([(place, is_darker)].into_iter(), 1.3));
            (0..floor).for_each(|_| grid.add_floor([(place, true)].into_iter(), -0.7));
            (0..5).for_each(|_| grid.add_thing([(place, false)].into_iter(), 1.3));
            (0..100).for_each(|_| grid.add_beam(&silent, &Pose2::IDENTITY, |_| true));
            grid.occupied().next().is_some()
        };
        assert!(!stays(&[false; 5], 0), "light on the floor gives no echo");
        assert!(stays(&[true; 5], 0) && stays(&[false, true, false, false, false], 0), "no light is dark");
        assert!(!stays(&[true; 5], 12), "floor was seen there since");
    }
}
