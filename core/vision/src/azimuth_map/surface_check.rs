use nalgebra::Point2;

use super::candidate_surfaces::SurfaceState;
use yamabico_geometry::Pose2;

/// Measurement of a range sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeReading {
    /// Pose of the sensor, map from sensor. The beam points along its x axis.
    pub sensor: Pose2,
    /// Range, m; `None` without an echo.
    pub range_m: Option<f64>,
    /// Standard deviation of the predicted distance to the surface, m.
    pub sigma_m: f64,
}

/// Result of comparing a reading with a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReadingClass {
    /// No information: the beam misses or grazes the surface, or the surface is out of range.
    Untestable,
    /// Echo at the distance of the surface.
    At,
    /// No echo, or an echo from beyond the surface.
    Beyond,
    /// Echo from in front of the surface.
    Nearer,
}

/// Parameters of the surface check.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceCheckRule {
    /// Minimum range tolerance, m.
    pub min_tolerance_m: f64,
    /// Range tolerance, standard deviations.
    pub tolerance_sigmas: f64,
    /// Maximum angle of incidence, rad.
    pub max_incidence_rad: f64,
    /// Minimum distance of the hit from an end of the surface, m.
    pub margin_m: f64,
    /// Number of consecutive `Beyond` readings, at decreasing distance, that establish a passage.
    pub min_beyond: u32,
    /// Number of consecutive `At` (or `Nearer`) readings that establish a surface (or an object in front of it).
    pub min_at: u32,
    /// Maximum range, m.
    pub farthest_m: f64,
    /// Half the opening angle of the beam, rad; zero for a ray. An echo counts as `At` only if the footprint stays
    /// clear of both ends of the surface by half of `beam_spare_m`; otherwise it may come from an end.
    pub beam_half_angle_rad: f64,
    /// Margin between the beam's footprint and the width of the surface, both sides together, m.
    pub beam_spare_m: f64,
}

impl Default for SurfaceCheckRule {
    fn default() -> Self {
        Self { beam_half_angle_rad: 12.5_f64.to_radians(), beam_spare_m: 0.1, ..Self::ray() }
    }
}

impl SurfaceCheckRule {
    /// Parameters for a beam without width.
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

/// Checks with a range sensor if a surface stands between two edges. The first decision is final.
///
/// Yagi et al. (1995), section V: a passage is where the range stays larger than the distance to the surface while the
/// robot approaches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceCheck {
    ends: [Point2<f64>; 2],
    rule: SurfaceCheckRule,
    state: SurfaceState,
    /// Class and number of consecutive readings.
    run: (Option<ReadingClass>, u32),
    last_distance_m: Option<f64>,
}

impl SurfaceCheck {
    /// Creates a check in state `Unknown`.
    #[must_use]
    pub fn new(ends: [Point2<f64>; 2], rule: SurfaceCheckRule) -> Self {
        Self { ends, rule, state: SurfaceState::Unknown, run: (None, 0), last_distance_m: None }
    }

    /// Current state.
    #[must_use]
    pub fn state(&self) -> SurfaceState {
        self.state
    }

    /// Updates the state with a reading. Returns its class and the distance to the surface along the beam, m, if the
    /// beam hits it.
    pub fn update(&mut self, reading: &RangeReading) -> (ReadingClass, Option<f64>) {
        let (class, hit) = self.classify(reading);
        let distance_m = hit.map(|hit| hit.distance_m);
        let Some(hit) = hit.filter(|_| class != ReadingClass::Untestable) else {
            return (class, distance_m);
        };
        let is_nearing = self.last_distance_m.is_none_or(|last| hit.distance_m < last - 1e-9);
        self.last_distance_m = Some(hit.distance_m);
        let counts = match class {
            ReadingClass::Beyond => is_nearing,
            ReadingClass::At => self.contains_beam(&hit),
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

    /// Returns true if the whole beam falls on the surface.
    fn contains_beam(&self, hit: &Hit) -> bool {
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

/// Intersection of the sensor axis with the segment.
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
    fn untestable_readings_are_ignored() {
        let mut check = check();
        check.update(&reading(0.0, 0.0, None));
        check.update(&reading(0.1, 0.0, None));
        let before = check;
        for theta in [0.4, 1.0, 3.0, f64::NAN] {
            assert_eq!(check.update(&reading(0.2, theta, None)).0, ReadingClass::Untestable);
        }
        assert_eq!(check, before);
        check.update(&reading(0.2, 0.0, None));
        assert_eq!(check.state(), SurfaceState::Empty);
    }

    #[test]
    fn a_passage_needs_an_approach() {
        let mut check = check();
        for _ in 0..10 {
            check.update(&reading(0.5, 0.0, None));
        }
        assert_eq!(check.state(), SurfaceState::Unknown);
    }

    #[test]
    fn a_wide_beam_may_hit_the_ends_of_a_narrow_gap() {
        let ends = [Point2::new(2.0, -0.3), Point2::new(2.0, 0.3)];
        let mut check = SurfaceCheck::new(ends, SurfaceCheckRule::default());
        for _ in 0..5 {
            assert_eq!(check.update(&reading(0.0, 0.0, Some(2.0))).0, ReadingClass::At);
        }
        assert_eq!(check.state(), SurfaceState::Unknown);
        for x in [1.2, 1.3] {
            check.update(&reading(x, 0.0, Some(2.0 - x)));
        }
        assert_eq!(check.state(), SurfaceState::Solid);
    }

    #[test]
    fn an_off_center_beam_may_hit_the_nearer_end() {
        let ends = [Point2::new(2.0, -0.8), Point2::new(2.0, 0.8)];
        let mut check = SurfaceCheck::new(ends, SurfaceCheckRule::default());
        // Wide enough in its middle, but the beam hits it 0.2 m from the left end.
        for _ in 0..5 {
            check.update(&RangeReading {
                sensor: Pose2::new(0.0, 0.6, 0.0),
                range_m: Some(2.0),
                sigma_m: 0.02,
            });
        }
        assert_eq!(check.state(), SurfaceState::Unknown);
        for _ in 0..2 {
            check.update(&reading(0.0, 0.0, Some(2.0)));
        }
        assert_eq!(check.state(), SurfaceState::Solid);
    }
}
