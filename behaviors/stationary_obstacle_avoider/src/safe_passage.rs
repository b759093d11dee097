//! Gaps between obstacles on the plane one meter ahead of the camera, and the choice of a point in one of them.
//!
//! Ohya, Kosaka & Kak (1998): obstacles and unobserved areas are assumed one meter ahead and widened by half the
//! robot's width. Differs from \[1\]: an explicit choice of the gap and of the point in it.

/// Distance of the plane ahead of the camera, meters.
pub const PLANE_M: f64 = 1.0;
/// Width up to which a gap is dropped, m.
const MIN_WIDTH_M: f64 = 1e-9;
/// Difference of distance from the goal up to which two gaps are equally good, m.
const TIE_M: f64 = 1e-9;

/// Interval on the plane, m, positive left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Right end, m.
    pub low: f64,
    /// Left end, m.
    pub high: f64,
}

impl Interval {
    /// Creates the interval from `low` to `high`, m.
    #[must_use]
    pub const fn new(low: f64, high: f64) -> Self {
        Self { low, high }
    }

    /// Returns the width, m; negative if the interval is empty.
    #[must_use]
    pub fn width(&self) -> f64 {
        self.high - self.low
    }

    /// Returns the interval extended by `margin` (m) at both ends.
    #[must_use]
    pub fn widened(&self, margin: f64) -> Self {
        Self::new(self.low - margin, self.high + margin)
    }
}

/// Point to steer for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aim {
    /// Gap that contains the point.
    pub gap: Interval,
    /// Lateral position on the plane, m, positive left.
    pub lateral_m: f64,
    /// True if the point differs from the goal.
    pub deviates: bool,
}

impl Aim {
    /// Returns its bearing from the camera's axis, rad, positive left.
    #[must_use]
    pub fn bearing(&self) -> f64 {
        (self.lateral_m / PLANE_M).atan()
    }
}

/// Free gaps: the open interval without the blocked ones. Reuses its buffers from frame to frame.
#[derive(Clone, Debug, Default)]
pub struct SafePassage {
    free: Vec<Interval>,
    spare: Vec<Interval>,
}

impl SafePassage {
    /// Resets the gaps: `open` is free, everything else is blocked.
    pub fn begin(&mut self, open: Interval) {
        self.free.clear();
        self.free.push(open);
        self.drop_narrow();
    }

    /// Blocks an interval; an interval with NaN blocks everything.
    pub fn block(&mut self, blocked: Interval) {
        if blocked.low.is_nan() || blocked.high.is_nan() {
            return self.free.clear();
        }
        self.spare.clear();
        for gap in &self.free {
            if blocked.high <= gap.low || blocked.low >= gap.high {
                self.spare.push(*gap);
                continue;
            }
            self.spare.push(Interval::new(blocked.high, gap.high));
            self.spare.push(Interval::new(gap.low, blocked.low));
        }
        std::mem::swap(&mut self.free, &mut self.spare);
        self.drop_narrow();
    }

    /// Returns the gaps, from left to right.
    #[must_use]
    pub fn free(&self) -> &[Interval] {
        &self.free
    }

    /// Returns the point nearest to `goal_m` (m, on the plane) that keeps `margin_m` (m), or half the width of a
    /// narrower gap, from the ends of its gap; of equally near ones that in the wider gap, then the left one. `None`
    /// if everything is blocked.
    #[must_use]
    pub fn choose(&self, goal_m: f64, margin_m: f64) -> Option<Aim> {
        self.choose_leaning(goal_m, 0.0, margin_m)
    }

    /// Like [`SafePassage::choose`], but compares the gaps by the distance from a position `lean_m` (m) to the left
    /// of the goal. A robot that passes an obstacle on one side thus stays on it, although the other side is slightly
    /// nearer.
    #[must_use]
    pub fn choose_leaning(&self, goal_m: f64, lean_m: f64, margin_m: f64) -> Option<Aim> {
        let aims = self.free.iter().map(|&gap| {
            let margin = margin_m.min(0.5 * gap.width());
            let (low, high) = (gap.low + margin, gap.high - margin);
            let lateral_m = if low < high { goal_m.clamp(low, high) } else { 0.5 * (gap.low + gap.high) };
            Aim { gap, lateral_m, deviates: (lateral_m - goal_m).abs() > TIE_M }
        });
        let off = |aim: &Aim| (aim.lateral_m - goal_m - lean_m).abs();
        aims.fold(None, |best: Option<Aim>, next| match best {
            None => Some(next),
            Some(best) => {
                let closer = off(&best) - off(&next);
                let is_better =
                    closer > TIE_M || (closer > -TIE_M && next.gap.width() > best.gap.width() + TIE_M);
                Some(if is_better { next } else { best })
            }
        })
    }

    fn drop_narrow(&mut self) {
        self.free.retain(|gap| gap.width() > MIN_WIDTH_M);
    }
}

/// Returns the interval of the plane that image region `index` of `count` covers; region 0 is the leftmost.
/// `half_view_m`: half the visible width of the plane, m.
#[must_use]
pub fn region_on_plane(index: usize, count: usize, half_view_m: f64) -> Interval {
    let width = 2.0 * half_view_m / count.max(1) as f64;
    let high = half_view_m - width * index as f64;
    Interval::new(high - width, high)
}
