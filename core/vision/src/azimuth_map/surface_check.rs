use nalgebra::Point2;

use super::candidate_surfaces::SurfaceState;
use yamabico_geometry::Pose2;

/// What a range sensor tells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeReading {
    /// Map from sensor: the beam runs along its x.
    pub sensor: Pose2,
    /// Meters; `None` for no echo.
    pub range_m: Option<f64>,
    /// Standard deviation of the distance to the surface that is expected, meters.
    pub sigma_m: f64,
}

/// What a reading says about a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReadingClass {
    /// Nothing: the beam misses it, grazes it, or reaches not so far.
    Untestable,
    /// An echo from where the surface should be.
    At,
    /// No echo, or one from behind.
    Beyond,
    /// An echo from before it.
    Nearer,
}

/// How readings are judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceCheckRule {
    /// Least tolerance of the range, meters.
    pub min_tolerance_m: f64,
    /// Tolerance in standard deviations.
    pub tolerance_sigmas: f64,
    /// Largest angle between beam and normal, radians.
    pub max_incidence_rad: f64,
    /// Least distance of the hit from an end of the surface, meters.
    pub margin_m: f64,
    /// Readings beyond, one after the other while the robot comes nearer, that make a passage.
    pub min_beyond: u32,
    /// Readings at (or before) the surface, one after the other, that make it solid (or something before it).
    pub min_at: u32,
    /// Farthest range, meters.
    pub farthest_m: f64,
    /// Half the opening angle of the beam, radians: while its footprint reaches an end of the surface but for half of
    /// `beam_spare_m`, an echo may be that of the end, and does not make the surface solid. Zero for a ray.
    pub beam_half_angle_rad: f64,
    /// Width that the surface must have beyond the beam's where that meets its middle, meters.
    pub beam_spare_m: f64,
}

impl Default for SurfaceCheckRule {
    fn default() -> Self {
        Self { beam_half_angle_rad: 12.5_f64.to_radians(), beam_spare_m: 0.1, ..Self::ray() }
    }
}

impl SurfaceCheckRule {
    /// The rule for a beam without width.
    #[must_use]
    pub fn ray() -> Self {
        Self {
            min_tolerance_m: 0.10,
            tolerance_sigmas: 3.0,
            max_incidence_rad: 15_f64.to_radians(),
            margin_m: 0.05,
            min_beyond: 3,
            min_at: 2,
            farthest_m: 4.0,
            beam_half_angle_rad: 0.0,
            beam_spare_m: f64::NEG_INFINITY,
        }
    }
}

/// Finds out with a range sensor whether something stands between two edges. Decides once.
///
/// Yagi et al. (1995), section V: a passage is where the range stays greater than the distance while the robot comes nearer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceCheck {
    ends: [Point2<f64>; 2],
    rule: SurfaceCheckRule,
    state: SurfaceState,
    /// Readings of the same class, one after the other.
    run: (Option<ReadingClass>, u32),
    last_distance_m: Option<f64>,
}

impl SurfaceCheck {
    /// Nothing is known yet.
    #[must_use]
    pub fn new(ends: [Point2<f64>; 2], rule: SurfaceCheckRule) -> Self {
        Self { ends, rule, state: SurfaceState::Unknown, run: (None, 0), last_distance_m: None }
    }

    /// What is known.
    #[must_use]
    pub fn state(&self) -> SurfaceState {
        self.state
    }

    /// Takes a reading; its class, and the distance along the beam to where the surface would be, meters, if it is hit.
    pub fn take(&mut self, reading: &RangeReading) -> (ReadingClass, Option<f64>) {
        let (class, hit) = self.classify(reading);
        let distance_m = hit.map(|hit| hit.distance_m);
        let Some(hit) = hit.filter(|_| class != ReadingClass::Untestable) else {
            return (class, distance_m);
        };
        let is_nearing = self.last_distance_m.is_none_or(|last| hit.distance_m < last - 1e-9);
        self.last_distance_m = Some(hit.distance_m);
        let counts = match class {
            ReadingClass::Beyond => is_nearing,
            ReadingClass::At => self.holds_beam(&hit),
            _ => true,
        };
        let before = if self.run.0 == Some(class) { self.run.1 } else { 0 };
        self.run = (Some(class), before + u32::from(counts));
        if self.state == SurfaceState::Unknown {
            self.state = match class {
                ReadingClass::Beyond if self.run.1 >= self.rule.min_beyond => SurfaceState::Empty,
                ReadingClass::At if self.run.1 >= self.rule.min_at => SurfaceState::Solid,
                ReadingClass::Nearer if self.run.1 >= self.rule.min_at => SurfaceState::Nearer,
                _ => SurfaceState::Unknown,
            };
        }
        (class, distance_m)
    }

    fn classify(&self, reading: &RangeReading) -> (ReadingClass, Option<Hit>) {
        let Some(hit) = hit(self.ends, &reading.sensor) else { return (ReadingClass::Untestable, None) };
        let rule = &self.rule;
        let tolerance = rule.min_tolerance_m.max(rule.tolerance_sigmas * reading.sigma_m);
        let is_testable = hit.incidence_rad <= rule.max_incidence_rad
            && hit.from_end_m >= rule.margin_m
            && hit.distance_m + tolerance < rule.farthest_m;
        let class = match reading.range_m.filter(|range| !range.is_nan()) {
            _ if !is_testable => ReadingClass::Untestable,
            None => ReadingClass::Beyond,
            Some(range) if range > hit.distance_m + tolerance => ReadingClass::Beyond,
            Some(range) if range < hit.distance_m - tolerance => ReadingClass::Nearer,
            Some(_) => ReadingClass::At,
        };
        (class, Some(hit))
    }

    /// Whether the whole beam falls on the surface.
    fn holds_beam(&self, hit: &Hit) -> bool {
        let away_m = hit.distance_m * hit.incidence_rad.cos();
        let edge_rad = hit.incidence_rad + self.rule.beam_half_angle_rad;
        let reach_m = away_m * (edge_rad.tan() - hit.incidence_rad.tan());
        hit.from_end_m >= reach_m + 0.5 * self.rule.beam_spare_m
    }
}

#[derive(Clone, Copy)]
struct Hit {
    distance_m: f64,
    incidence_rad: f64,
    from_end_m: f64,
}

/// Where the axis of a sensor meets the segment.
fn hit([a, b]: [Point2<f64>; 2], sensor: &Pose2) -> Option<Hit> {
    let (sin, cos) = sensor.theta.sin_cos();
    let (along, to_a) = (b - a, a - sensor.position());
    let length = along.norm();
    let denominator = cos * along.y - sin * along.x;
    if !(length > 0.0 && denominator.abs() > 1e-12 * length) {
        return None;
    }
    let distance_m = (to_a.x * along.y - to_a.y * along.x) / denominator;
    let share = (to_a.x * sin - to_a.y * cos) / denominator;
    let is_hit = distance_m > 0.0 && (0.0..=1.0).contains(&share);
    let incidence_rad = (denominator.abs() / length).min(1.0).acos();
    is_hit.then(|| Hit { distance_m, incidence_rad, from_end_m: share.min(1.0 - share) * length })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check() -> SurfaceCheck {
        let ends = [Point2::new(2.0, -1.0), Point2::new(2.0, 1.0)];
        SurfaceCheck::new(ends, SurfaceCheckRule::default())
    }

    fn reading(x: f64, theta: f64, range_m: Option<f64>) -> RangeReading {
        RangeReading { sensor: Pose2::new(x, 0.0, theta), range_m, sigma_m: 0.02 }
    }

    #[test]
    fn readings_that_test_nothing_change_nothing() {
        let mut check = check();
        check.take(&reading(0.0, 0.0, None));
        check.take(&reading(0.1, 0.0, None));
        let before = check;
        for theta in [0.4, 1.0, 3.0, f64::NAN] {
            assert_eq!(check.take(&reading(0.2, theta, None)).0, ReadingClass::Untestable);
        }
        assert_eq!(check, before);
        check.take(&reading(0.2, 0.0, None));
        assert_eq!(check.state(), SurfaceState::Empty);
    }

    #[test]
    fn standing_still_before_no_echo_proves_no_passage() {
        let mut check = check();
        for _ in 0..10 {
            check.take(&reading(0.5, 0.0, None));
        }
        assert_eq!(check.state(), SurfaceState::Unknown);
    }

    #[test]
    fn a_wide_beam_hears_the_ends_of_a_narrow_gap() {
        let ends = [Point2::new(2.0, -0.3), Point2::new(2.0, 0.3)];
        let mut check = SurfaceCheck::new(ends, SurfaceCheckRule::default());
        for _ in 0..5 {
            assert_eq!(check.take(&reading(0.0, 0.0, Some(2.0))).0, ReadingClass::At);
        }
        assert_eq!(check.state(), SurfaceState::Unknown);
        for x in [1.2, 1.3] {
            check.take(&reading(x, 0.0, Some(2.0 - x)));
        }
        assert_eq!(check.state(), SurfaceState::Solid);
    }

    #[test]
    fn a_beam_beside_the_middle_hears_the_end_that_is_nearer() {
        let ends = [Point2::new(2.0, -0.8), Point2::new(2.0, 0.8)];
        let mut check = SurfaceCheck::new(ends, SurfaceCheckRule::default());
        // Wide enough in its middle, but the beam meets it 0.2 m from the left end.
        for _ in 0..5 {
            check.take(&RangeReading {
                sensor: Pose2::new(0.0, 0.6, 0.0),
                range_m: Some(2.0),
                sigma_m: 0.02,
            });
        }
        assert_eq!(check.state(), SurfaceState::Unknown);
        for _ in 0..2 {
            check.take(&reading(0.0, 0.0, Some(2.0)));
        }
        assert_eq!(check.state(), SurfaceState::Solid);
    }
}
