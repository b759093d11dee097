//! The gaps between what is in the way, on the plane one meter ahead of the camera, and the direction through one of them.
//!
//! Ohya, Kosaka & Kak (1998): obstacles and what is not seen are taken to stand one meter ahead, each widened by half the
//! robot. Differs from \[1\]: which gap is taken, and where in it, is stated here.

/// Distance of the plane ahead of the camera, meters.
pub const PLANE_M: f64 = 1.0;
/// A gap that is not wider is none, meters.
const NARROWEST_M: f64 = 1e-9;
/// Gaps whose aims are as far from the goal as this (m) are equally good.
const TIE_M: f64 = 1e-9;

/// Places on the plane from `low` to `high`, meters, positive to the left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The right end.
    pub low: f64,
    /// The left end.
    pub high: f64,
}

impl Interval {
    /// From `low` to `high`.
    #[must_use]
    pub const fn new(low: f64, high: f64) -> Self {
        Self { low, high }
    }

    /// Meters; negative where there is nothing between the ends.
    #[must_use]
    pub fn width(&self) -> f64 {
        self.high - self.low
    }

    /// The same with `margin` more on either side.
    #[must_use]
    pub fn widened(&self, margin: f64) -> Self {
        Self::new(self.low - margin, self.high + margin)
    }
}

/// Where to go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aim {
    /// The gap.
    pub gap: Interval,
    /// The place in it, meters.
    pub lateral_m: f64,
    /// Whether it is not where the goal lies.
    pub deviates: bool,
}

impl Aim {
    /// Its direction from the camera's axis, radians, positive left.
    #[must_use]
    pub fn bearing(&self) -> f64 {
        (self.lateral_m / PLANE_M).atan()
    }
}

/// The gaps, found by cutting away what is blocked. Keeps its memory from one picture to the next.
#[derive(Clone, Debug, Default)]
pub struct SafePassage {
    free: Vec<Interval>,
    spare: Vec<Interval>,
}

impl SafePassage {
    /// Begins with `open` free and everything else blocked.
    pub fn begin(&mut self, open: Interval) {
        self.free.clear();
        self.free.push(open);
        self.drop_narrow();
    }

    /// Blocks an interval; one that is not of two numbers blocks everything.
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

    /// The gaps, from left to right.
    #[must_use]
    pub fn free(&self) -> &[Interval] {
        &self.free
    }

    /// The place nearest to `goal_m` (m, on the plane) that keeps `margin_m` (or half the gap) from the ends of its gap; of
    /// equally near ones that in the wider gap, then the left one. `None` where everything is blocked.
    #[must_use]
    pub fn choose(&self, goal_m: f64, margin_m: f64) -> Option<Aim> {
        self.choose_leaning(goal_m, 0.0, margin_m)
    }

    /// As [`SafePassage::choose`], of the gap that is nearest to a place `lean_m` to the left of the goal: who has begun to
    /// pass on one side goes on there, though the other one may seem a little nearer now.
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
        self.free.retain(|gap| gap.width() > NARROWEST_M);
    }
}

/// What region `index` of `count` covers of the plane for a camera whose half view is `half_view_m` there: the leftmost
/// columns are region 0.
#[must_use]
pub fn region_on_plane(index: usize, count: usize, half_view_m: f64) -> Interval {
    let width = 2.0 * half_view_m / count.max(1) as f64;
    let high = half_view_m - width * index as f64;
    Interval::new(high - width, high)
}
