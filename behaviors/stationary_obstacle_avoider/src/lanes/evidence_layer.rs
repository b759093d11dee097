//! Log odds of cells by one kind of evidence, which counts once an update and fades.

use nalgebra::Point2;
use yamabico_vision::rolling_window::RollingWindow;

/// Kind of evidence by the camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Evidence {
    /// The floor's look: where it ends.
    Look,
    /// Upright edges, and where the floor ends at an echo.
    Upright,
    /// Motion between pictures.
    Motion,
}

/// Log odds of the cells by one kind of evidence.
#[derive(Clone, Debug)]
pub(super) struct Layer {
    pub odds: Vec<f32>,
    limits: (f32, f32),
    /// Number of the update that changed a cell last: each update counts once.
    updated: Vec<u32>,
    update: u32,
}

impl Layer {
    /// Creates a layer without evidence for that many cells; the log odds stay within `limits`.
    pub fn new(cells: usize, limits: (f32, f32)) -> Self {
        Self { odds: vec![0.0; cells], limits, updated: vec![0; cells], update: 0 }
    }

    /// Moves the log odds of each cell toward zero by `step`, which depends on the cell and its log odds.
    pub fn fade(&mut self, step: impl Fn(usize, f32) -> f32) {
        for (slot, odds) in self.odds.iter_mut().enumerate() {
            let step = step(slot, *odds);
            *odds -= odds.clamp(-step, step);
        }
    }

    /// Adds `evidence` to the cells at `places`, once to each cell.
    pub fn add(&mut self, window: &RollingWindow, places: impl Iterator<Item = Point2<f64>>, evidence: f32) {
        self.begin();
        places.filter_map(|place| window.slot(place)).for_each(|slot| self.add_to(slot, evidence));
    }

    /// Adds `evidence`, which is negative, to the cells at `places`, once to each cell, unless the cell is at its `limit` already.
    pub fn lower(
        &mut self,
        window: &RollingWindow,
        places: impl Iterator<Item = Point2<f64>>,
        evidence: f32,
        limit: impl Fn(usize) -> f32,
    ) {
        self.begin();
        for slot in places.filter_map(|place| window.slot(place)) {
            if self.odds[slot] > limit(slot) {
                self.add_to(slot, evidence);
            }
        }
    }

    /// Begins an update.
    pub fn begin(&mut self) {
        self.update = self.update.wrapping_add(1);
    }

    /// Adds `evidence` to a cell, unless this update has already.
    pub fn add_to(&mut self, slot: usize, evidence: f32) {
        if std::mem::replace(&mut self.updated[slot], self.update) != self.update {
            self.odds[slot] = (self.odds[slot] + evidence).clamp(self.limits.0, self.limits.1);
        }
    }
}
