//! Width of the corridor.

use crate::wall_track::CONFIRM_M;

/// Number of width measurements of which the median is taken.
const WIDTHS: usize = 15;
/// Driven distance without both walls after which the width is dropped, m.
const WIDTH_FORGET_M: f64 = 3.0;
/// Maximum difference between a measured and the known width, m.
const WIDTH_TOLERANCE_M: f64 = 0.15;

/// A distance or width that contradicts the known one, waiting to be confirmed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rival {
    pub distance_m: f64,
    pub for_m: f64,
}

/// Width of the corridor: the median of the last pairs of walls.
#[derive(Clone, Debug, Default)]
pub(crate) struct WidthMemory {
    widths: [f64; WIDTHS],
    count: usize,
    next: usize,
    unobserved_m: f64,
    rival: Option<Rival>,
}

impl WidthMemory {
    pub fn fits(&self, width_m: f64) -> bool {
        self.median_m().is_none_or(|known| (width_m - known).abs() <= WIDTH_TOLERANCE_M)
    }

    /// Registers a contradicting width. Once it is confirmed, drops the known width and returns true.
    pub fn contradict(&mut self, width_m: f64) -> bool {
        let rival = self
            .rival
            .filter(|rival| (rival.distance_m - width_m).abs() < WIDTH_TOLERANCE_M)
            .unwrap_or(Rival { distance_m: width_m, for_m: 0.0 });
        if rival.for_m >= CONFIRM_M {
            *self = Self::default();
            return true;
        }
        self.rival = Some(rival);
        false
    }

    pub fn add(&mut self, width_m: f64) {
        self.rival = None;
        self.widths[self.next] = width_m;
        self.next = (self.next + 1) % WIDTHS;
        self.count = (self.count + 1).min(WIDTHS);
        self.unobserved_m = 0.0;
    }

    pub fn drive(&mut self, meters: f64) {
        self.unobserved_m += meters;
        if let Some(rival) = &mut self.rival {
            rival.for_m += meters;
        }
        if self.unobserved_m > WIDTH_FORGET_M {
            *self = Self::default();
        }
    }

    pub fn median_m(&self) -> Option<f64> {
        let mut sorted = self.widths;
        let known = &mut sorted[..self.count];
        known.sort_by(f64::total_cmp);
        known.get(self.count / 2).copied()
    }
}
