//! Selection of the floor lines of the two walls among the lines along a corridor.
//!
//! Kweon et al. (1991), section 3.2, assumes that the floor lines are known. Here a candidate must run along the
//! corridor below the horizon, be long, and separate two brightness levels (which a joint between tiles does not). Of
//! two candidates the inner one is taken as the floor line and the outer one as the upper edge of the baseboard.

use nalgebra::Vector2;
use yamabico_geometry::image::ImageView;

use crate::corridor::wall_distance::CorridorView;

/// Straight edge along the corridor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CorridorLine {
    /// First endpoint, undistorted pixels.
    pub start: Vector2<f64>,
    /// Second endpoint, undistorted pixels.
    pub end: Vector2<f64>,
    /// Gray levels on both sides.
    pub sides: SideLevels,
}

/// Gray levels to the left and right of an edge, looking from its start to its end (u right, v down).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SideLevels {
    /// Gray level at the edge, extrapolated from the left side.
    pub left: f64,
    /// Gray level at the edge, extrapolated from the right side.
    pub right: f64,
    /// Mean absolute difference between the two sides at twice the sampling offset, gray levels.
    pub farther: f64,
}

impl SideLevels {
    /// Contrast of the edge, gray levels: the smaller of the differences at the edge and farther away. Zero for a thin
    /// line on a uniform floor.
    #[must_use]
    pub fn contrast(&self) -> f64 {
        (self.left - self.right).abs().min(self.farther)
    }
}

/// Thresholds and weights for selecting floor lines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloorLineRule {
    /// Minimum angle of a line's midpoint below the horizon, rad.
    pub below_horizon_rad: f64,
    /// Minimum lateral distance of a wall from the camera, m.
    pub nearest_m: f64,
    /// Maximum lateral distance of a wall from the camera, m.
    pub farthest_m: f64,
    /// Minimum contrast between the two sides, gray levels.
    pub min_contrast: f64,
    /// Contrast at which the score saturates, gray levels: below it, the score is proportional to contrast.
    pub full_contrast: f64,
    /// Length ratio above which an inner line outranks an outer one.
    pub inner_share: f64,
    /// Contrast ratio that the inner line must also have.
    pub inner_contrast: f64,
    /// Length ratio for an outer line that is brighter on the wall side, as the upper edge of a dark baseboard is.
    pub baseboard_share: f64,
    /// Minimum distance ratio of inner to outer line for the inner one to outrank the outer: a baseboard is low relative to
    /// the camera height.
    pub baseboard_ratio: f64,
    /// Maximum difference in lateral distance between two pieces of the same floor line, m.
    pub same_wall_m: f64,
    /// Minimum width of a corridor, m. Of two lines that are nearer to each other, one is a joint, the edge of a shadow, or a
    /// mirror image.
    pub min_width_m: f64,
}

impl Default for FloorLineRule {
    fn default() -> Self {
        Self {
            below_horizon_rad: 0.018,
            nearest_m: 0.2,
            farthest_m: 5.0,
            min_contrast: 8.0,
            full_contrast: 40.0,
            inner_share: 0.6,
            inner_contrast: 0.6,
            baseboard_share: 0.3,
            baseboard_ratio: 0.6,
            same_wall_m: 0.05,
            min_width_m: 0.8,
        }
    }
}

/// Distance of a wall with its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WallEstimate {
    /// Signed lateral distance, m, positive to the left.
    pub distance_m: f64,
    /// Standard deviation, m.
    pub sigma_m: f64,
}

/// Wall detected in one image, relative to the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetectedWall {
    /// Signed lateral distance, m, positive to the left.
    pub distance_m: f64,
    /// Endpoints of the piece with the largest weight, the one farther below the horizon first, undistorted pixels.
    pub ends: [Vector2<f64>; 2],
    /// True if the wall side is darker than the floor side, as with a floor that meets a dark baseboard.
    pub is_darker_at_the_wall: bool,
    /// Total length of the pieces in the image, pixels.
    pub length_px: f64,
}

/// Line that may be a floor line, with its lateral distance.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Candidate {
    distance_m: f64,
    length_px: f64,
    /// Weight of the distance: length in pixels times the squared sine of the angle below the horizon.
    weight: f64,
    ends: [Vector2<f64>; 2],
    contrast: f64,
    is_darker_at_the_wall: bool,
}

/// Finds floor lines. Reuses its buffers between frames.
#[derive(Clone, Debug, Default)]
pub struct FloorLineFinder {
    candidates: Vec<Candidate>,
}

/// Walls detected in one image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DetectedWalls {
    /// Wall on the left; its distance is positive.
    pub left: Option<DetectedWall>,
    /// Wall on the right; its distance is negative.
    pub right: Option<DetectedWall>,
}

impl FloorLineFinder {
    /// Finds the left and right wall among `lines`, which must pass through the vanishing point of `view`. Lines within
    /// three standard deviations of an expected wall score higher; other lines are still admitted, unless they are nearer than
    /// `floor_m` (m, left and right), where the floor is known to go on.
    pub fn find(
        &mut self,
        lines: impl Iterator<Item = CorridorLine>,
        view: &CorridorView,
        rule: &FloorLineRule,
        expected: [Option<WallEstimate>; 2],
        floor_m: [f64; 2],
    ) -> DetectedWalls {
        self.candidates.clear();
        self.candidates.extend(lines.filter_map(|line| candidate(&line, view, rule)));
        let left = |from_m: f64| self.best(1.0, floor_m[0].max(from_m), expected[0], rule);
        let right = |from_m: f64| self.best(-1.0, floor_m[1].max(from_m), expected[1], rule);
        let nearest = (left(0.0), right(0.0));
        let (Some((left_score, left_wall)), Some((right_score, right_wall))) = nearest else {
            return DetectedWalls { left: nearest.0.map(wall), right: nearest.1.map(wall) };
        };
        if left_wall.distance_m - right_wall.distance_m >= rule.min_width_m {
            return DetectedWalls { left: Some(left_wall), right: Some(right_wall) };
        }
        let outer_left = left(rule.min_width_m - right_wall.distance_m.abs());
        let outer_right = right(rule.min_width_m - left_wall.distance_m.abs());
        let score = |found: &Option<(f64, DetectedWall)>| found.map_or(0.0, |(score, _)| score);
        if left_score + score(&outer_right) > right_score + score(&outer_left) {
            DetectedWalls { left: Some(left_wall), right: outer_right.map(wall) }
        } else {
            DetectedWalls { left: outer_left.map(wall), right: Some(right_wall) }
        }
    }

    /// Finds the wall on a side (1 left, -1 right) among the lines at least `from_m` away, with its score.
    fn best(
        &self,
        side: f64,
        from_m: f64,
        expected: Option<WallEstimate>,
        rule: &FloorLineRule,
    ) -> Option<(f64, DetectedWall)> {
        let on_side = || self.candidates.iter().filter(|line| line.distance_m * side > from_m);
        let wall_of = |line: &Candidate| {
            let line = *line;
            on_side().filter(move |other| line.is_same_wall(other, rule))
        };
        let length = |line: &Candidate| wall_of(line).map(|piece| piece.length_px).sum::<f64>();
        let strength = |line: &Candidate| line.contrast.min(rule.full_contrast);
        let score = |line: &Candidate| {
            let length_px = length(line);
            let is_expected =
                expected.is_some_and(|wall| (line.distance_m - wall.distance_m).abs() < 3.0 * wall.sigma_m);
            let is_outer = on_side().any(|other| {
                // A line much farther inside is no foot of the wall that `line` may be the baseboard of, but a joint, or a mirror
                // image of the ceiling.
                let ratio = other.distance_m / line.distance_m;
                let is_inside =
                    (rule.baseboard_ratio..1.0).contains(&ratio) && !line.is_same_wall(other, rule);
                is_inside && length(other) >= line.outranking_share(other, rule) * length_px
            });
            let darker = if line.is_darker_at_the_wall { 1.2 } else { 1.0 };
            let expected_factor = if is_expected { 1.5 } else { 1.0 };
            let inner = if is_outer { 0.1 } else { 1.0 };
            length_px * darker * expected_factor * inner * strength(line)
        };
        let chosen = on_side().max_by(|a, b| score(a).total_cmp(&score(b)))?;
        let weight: f64 = wall_of(chosen).map(|line| line.weight).sum();
        let lowest = wall_of(chosen).max_by(|a, b| a.weight.total_cmp(&b.weight))?;
        let wall = DetectedWall {
            distance_m: wall_of(chosen).map(|line| line.weight * line.distance_m).sum::<f64>() / weight,
            ends: lowest.ends,
            is_darker_at_the_wall: lowest.is_darker_at_the_wall,
            length_px: length(chosen),
        };
        Some((score(chosen), wall))
    }
}

fn wall((_, wall): (f64, DetectedWall)) -> DetectedWall {
    wall
}

impl Candidate {
    /// Returns true if both lines are pieces of the same floor line.
    fn is_same_wall(&self, other: &Self, rule: &FloorLineRule) -> bool {
        (self.distance_m - other.distance_m).abs() < rule.same_wall_m
            && self.is_darker_at_the_wall == other.is_darker_at_the_wall
    }

    /// Length ratio that the inner line needs to outrank this line.
    fn outranking_share(&self, inner: &Self, rule: &FloorLineRule) -> f64 {
        match (inner.is_darker_at_the_wall, self.is_darker_at_the_wall) {
            // `inner` is the foot of a baseboard and `self` its upper edge.
            (true, false) => rule.baseboard_share,
            (false, true) => f64::INFINITY,
            _ => rule.inner_share,
        }
    }
}

/// Returns the candidate for a line, or `None` if it cannot be a floor line.
fn candidate(line: &CorridorLine, view: &CorridorView, rule: &FloorLineRule) -> Option<Candidate> {
    let middle = 0.5 * (line.start + line.end);
    let along = line.end - line.start;
    let length_px = along.norm();
    let sine_below = depression_sine(view, middle);
    if length_px < 1.0 || sine_below < rule.below_horizon_rad.sin() {
        return None;
    }
    let distance_m = view.lateral_distance(middle)?;
    if !(rule.nearest_m..=rule.farthest_m).contains(&distance_m.abs()) {
        return None;
    }
    let contrast = line.sides.contrast();
    if contrast < rule.min_contrast {
        return None;
    }
    // With v down, the left side of the direction start to end is at (along.y, -along.x).
    let to_the_left = Vector2::new(along.y, -along.x) / length_px;
    let left_distance_m = view.lateral_distance(middle + to_the_left)?;
    let wall_is_left = left_distance_m.abs() > distance_m.abs();
    let (at_the_wall, on_the_floor) =
        if wall_is_left { (line.sides.left, line.sides.right) } else { (line.sides.right, line.sides.left) };
    let starts_lower = depression_sine(view, line.start) > depression_sine(view, line.end);
    Some(Candidate {
        distance_m,
        length_px,
        weight: length_px * sine_below * sine_below,
        ends: if starts_lower { [line.start, line.end] } else { [line.end, line.start] },
        contrast,
        is_darker_at_the_wall: at_the_wall < on_the_floor,
    })
}

/// Sine of the angle between a pixel's ray and the horizon, positive below it.
fn depression_sine(view: &CorridorView, pixel: Vector2<f64>) -> f64 {
    let ray = view.corridor_from_camera * view.intrinsics.normalized_from_pixel(pixel).push(1.0);
    -ray.z / ray.norm()
}

/// Samples the gray levels beside the edge from `start` to `end`, in pixels of the distorted image.
///
/// Each level at the edge is a mean along the edge, extrapolated linearly from samples at `offset_px` and twice that
/// distance, so that a uniform brightness ramp has no contrast. Samples outside the image take the value of the border.
#[must_use]
pub fn side_levels(
    image: ImageView<'_>,
    start: Vector2<f64>,
    end: Vector2<f64>,
    offset_px: f64,
) -> SideLevels {
    const SAMPLES: u32 = 24;
    let along = end - start;
    let left = Vector2::new(along.y, -along.x) / along.norm().max(1.0) * offset_px;
    let mut sum = SideLevels { left: 0.0, right: 0.0, farther: 0.0 };
    for sample in 0..SAMPLES {
        let at = start + along * ((f64::from(sample) + 0.5) / f64::from(SAMPLES));
        let gray = |times: f64| {
            let at = at + left * times;
            f64::from(image.pixel(at.x.round().max(0.0) as usize, at.y.round().max(0.0) as usize))
        };
        let (far_left, far_right) = (gray(2.0), gray(-2.0));
        sum.left += 2.0 * gray(1.0) - far_left;
        sum.right += 2.0 * gray(-1.0) - far_right;
        sum.farther += (far_left - far_right).abs();
    }
    let samples = f64::from(SAMPLES);
    SideLevels { left: sum.left / samples, right: sum.right / samples, farther: sum.farther / samples }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::corridor::heading::CameraAttitude;
    use nalgebra::Vector3;
    use yamabico_geometry::camera::Intrinsics;

    fn view() -> CorridorView {
        let attitude = CameraAttitude { heading: 0.05, tilt: 0.1 };
        CorridorView::new(attitude, 0.0, 0.6, Intrinsics::from_horizontal_fov(640, 480, 1.05))
    }

    /// Returns a line along the corridor at lateral distance `d` and `height` above the floor, 2 m to `far` m ahead.
    fn line(d: f64, height: f64, far: f64, floor_gray: f64, wall_gray: f64) -> CorridorLine {
        let view = view();
        let pixel = |x: f64| {
            let camera = view.corridor_from_camera.transpose() * Vector3::new(x, d, height - 0.6);
            view.intrinsics.pixel_from_normalized(camera.xy() / camera.z)
        };
        // Looking from near to far, the left wall is to the left of its line.
        let (left, right) = if d > 0.0 { (wall_gray, floor_gray) } else { (floor_gray, wall_gray) };
        let sides = SideLevels { left, right, farther: (left - right).abs() };
        CorridorLine { start: pixel(2.0), end: pixel(far), sides }
    }

    fn find(lines: &[CorridorLine], expected: [Option<WallEstimate>; 2]) -> DetectedWalls {
        find_beyond(lines, expected, [0.0; 2])
    }

    fn find_beyond(
        lines: &[CorridorLine],
        expected: [Option<WallEstimate>; 2],
        floor_m: [f64; 2],
    ) -> DetectedWalls {
        let mut finder = FloorLineFinder::default();
        finder.find(lines.iter().copied(), &view(), &FloorLineRule::default(), expected, floor_m)
    }

    #[test]
    fn the_floor_line_wins_over_the_baseboard_and_the_joint() {
        let lines = [
            line(1.0, 0.0, 8.0, 120.0, 40.0),
            line(1.0, 0.1, 9.0, 40.0, 180.0),
            line(0.5, 0.0, 9.0, 120.0, 121.0),
            line(-0.9, 0.0, 8.0, 120.0, 40.0),
            line(-0.9, 0.1, 9.0, 40.0, 180.0),
            line(1.0, 2.4, 9.0, 120.0, 200.0),
        ];
        let walls = find(&lines, [None, None]);
        assert!((walls.left.unwrap().distance_m - 1.0).abs() < 1e-9);
        assert!((walls.right.unwrap().distance_m + 0.9).abs() < 1e-9);
    }

    #[test]
    fn pieces_of_one_wall_are_joined() {
        let lines = [line(1.0, 0.0, 4.0, 120.0, 40.0), line(1.01, 0.0, 8.0, 120.0, 40.0)];
        let wall = find(&lines, [None, None]).left.unwrap();
        assert!(wall.distance_m > 1.0 && wall.distance_m < 1.01);
        assert!(find(&lines, [None, None]).right.is_none());
    }

    #[test]
    fn an_expected_wall_is_preferred() {
        let lines = [line(1.0, 0.0, 6.0, 120.0, 40.0), line(1.6, 0.0, 6.0, 120.0, 40.0)];
        let expected = WallEstimate { distance_m: 1.58, sigma_m: 0.05 };
        assert!(find(&lines, [None, None]).left.unwrap().distance_m < 1.1);
        let only_outer = [line(1.0, 0.0, 2.6, 120.0, 40.0), line(1.6, 0.0, 6.0, 120.0, 40.0)];
        assert!(find(&only_outer, [Some(expected), None]).left.unwrap().distance_m > 1.5);
    }

    #[test]
    fn a_joint_is_no_wall_where_the_floor_goes_on() {
        let lines = [
            line(0.5, 0.0, 9.0, 120.0, 40.0),
            line(1.0, 0.0, 6.0, 120.0, 80.0),
            line(-0.7, 0.0, 8.0, 120.0, 40.0),
        ];
        let expected = WallEstimate { distance_m: 0.5, sigma_m: 0.02 };
        let walls = find_beyond(&lines, [Some(expected), None], [0.4, 0.8]);
        assert!((walls.left.unwrap().distance_m - 0.5).abs() < 1e-9 && walls.right.is_none(), "{walls:?}");
        let walls = find_beyond(&lines, [Some(expected), None], [0.6, 0.0]);
        assert!((walls.left.unwrap().distance_m - 1.0).abs() < 1e-9 && walls.right.is_some(), "{walls:?}");
    }

    #[test]
    fn a_corridor_is_not_narrower_than_one_can_pass() {
        let (near, reflection, far) = (
            line(-0.27, 0.0, 8.0, 120.0, 40.0),
            line(0.27, 0.0, 8.0, 120.0, 160.0),
            line(1.9, 0.0, 6.0, 120.0, 40.0),
        );
        let walls = find(&[near, reflection, far], [None, None]);
        assert!((walls.left.unwrap().distance_m - 1.9).abs() < 1e-9, "{walls:?}");
        assert!((walls.right.unwrap().distance_m + 0.27).abs() < 1e-9, "{walls:?}");
        let walls = find(&[near, reflection], [None, None]);
        assert!(walls.left.is_none() && walls.right.is_some(), "the weaker line is none: {walls:?}");
    }

    #[test]
    fn brightness_is_taken_on_its_side() {
        let beside = |level: &dyn Fn(u8) -> u8, u: f64, v: [f64; 2]| {
            let data: Vec<u8> = (0..30).flat_map(|_| (0..40).map(level)).collect();
            let image = ImageView::new(&data, 40, 30, 40).unwrap();
            side_levels(image, Vector2::new(u, v[0]), Vector2::new(u, v[1]), 4.0)
        };
        let step = |u: u8| if u < 20 { 50 } else { 200 };
        let up = beside(&step, 20.0, [28.0, 2.0]);
        assert_eq!((up.left, up.right, up.contrast()), (50.0, 200.0, 150.0));
        let outside = beside(&step, -9.0, [0.0, -5.0]);
        assert_eq!((outside.left, outside.right, outside.contrast()), (50.0, 50.0, 0.0));
        let ramp = beside(&|u| 3 * u, 20.0, [28.0, 2.0]);
        assert_eq!(ramp.contrast(), 0.0, "a ramp is no edge");
        let joint = beside(&|u| if (20..25).contains(&u) { 60 } else { 120 }, 20.0, [28.0, 2.0]);
        assert_eq!((joint.left, joint.contrast()), (120.0, 0.0), "a joint has the same floor on both sides");
        assert!(joint.right < 1.0, "{joint:?}");
    }
}
