//! Which of the lines along the corridor are the floor lines of its walls.
//!
//! Kweon et al. (1991), section 3.2, take them as given. Here a line must run along the corridor below the horizon, differ in
//! brightness from one side to the other (a joint between tiles does not), and be long; of two, the inner one is
//! the floor line and the outer one the upper edge of the skirting.

use nalgebra::Vector2;
use yamabico_geometry::image::ImageView;

use crate::corridor::wall_distance::CorridorView;

/// A straight edge along the corridor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CorridorLine {
    /// One end, undistorted pixels.
    pub start: Vector2<f64>,
    /// The other end, undistorted pixels.
    pub end: Vector2<f64>,
    /// The brightness on both sides.
    pub sides: Sides,
}

/// The brightness to the left and to the right of an edge, seen from start to end with u right and v down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sides {
    /// Gray level at the edge, coming from the left.
    pub left: f64,
    /// Gray level at the edge, coming from the right.
    pub right: f64,
    /// Mean difference between the two sides somewhat farther away, gray levels.
    pub farther: f64,
}

impl Sides {
    /// Gray levels by which the sides differ, both at the edge and farther away: nothing for a thin line between two halves
    /// of the same floor.
    #[must_use]
    pub fn contrast(&self) -> f64 {
        (self.left - self.right).abs().min(self.farther)
    }
}

/// How lines are judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloorLineRule {
    /// The middle of a line must lie so far below the horizon, radians.
    pub below_horizon_rad: f64,
    /// Nearer lines (m) to the left or right of the camera are none of a wall's.
    pub nearest_m: f64,
    /// Farther lines (m) are none of this corridor's.
    pub farthest_m: f64,
    /// Gray levels by which the two sides must differ.
    pub min_contrast: f64,
    /// Lines count in proportion to their contrast, up to so many gray levels.
    pub full_contrast: f64,
    /// An inner line with this share of the length outranks an outer one ...
    pub inner_share: f64,
    /// ... provided that it has this share of its contrast ...
    pub inner_contrast: f64,
    /// ... and with this share one that is brighter at the wall, as the upper edge of a dark skirting is ...
    pub skirting_share: f64,
    /// ... if its distance is at least this share: a skirting is low, seen from the camera's height.
    pub skirting_ratio: f64,
    /// Lines this near (m) to the chosen one are pieces of the same wall's.
    pub same_wall_m: f64,
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
            skirting_share: 0.3,
            skirting_ratio: 0.6,
            same_wall_m: 0.05,
        }
    }
}

/// Where a wall is expected, from the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExpectedWall {
    /// Signed distance, meters, positive on the left.
    pub distance_m: f64,
    /// Standard deviation, meters.
    pub sigma_m: f64,
}

/// A wall found in one picture, from the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeenWall {
    /// Signed distance, meters, positive on the left.
    pub distance_m: f64,
    /// The ends of its heaviest piece, the one farther from the horizon first; undistorted pixels.
    pub ends: [Vector2<f64>; 2],
    /// Whether the wall's side is the darker one, as it is where a floor meets a dark skirting.
    pub is_darker_at_the_wall: bool,
    /// Total length of its pieces in the picture, pixels.
    pub length_px: f64,
}

/// A line with its distance.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Candidate {
    distance_m: f64,
    length_px: f64,
    /// Weight of its distance: pixels of length times the squared sine of how far below the horizon it lies.
    weight: f64,
    ends: [Vector2<f64>; 2],
    contrast: f64,
    is_darker_at_the_wall: bool,
}

/// Finds the walls; keeps its buffers from picture to picture.
#[derive(Clone, Debug, Default)]
pub struct FloorLineFinder {
    candidates: Vec<Candidate>,
}

/// The walls of one picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SeenWalls {
    /// On the left, distance positive.
    pub left: Option<SeenWall>,
    /// On the right, distance negative.
    pub right: Option<SeenWall>,
}

impl FloorLineFinder {
    /// The walls among `lines`, each of which meets the vanishing point that `view` was made from. An expected wall is
    /// preferred, not demanded.
    pub fn find(
        &mut self,
        lines: impl Iterator<Item = CorridorLine>,
        view: &CorridorView,
        rule: &FloorLineRule,
        expected: [Option<ExpectedWall>; 2],
    ) -> SeenWalls {
        self.candidates.clear();
        self.candidates.extend(lines.filter_map(|line| candidate(&line, view, rule)));
        SeenWalls { left: self.best(1.0, expected[0], rule), right: self.best(-1.0, expected[1], rule) }
    }

    fn best(&self, side: f64, expected: Option<ExpectedWall>, rule: &FloorLineRule) -> Option<SeenWall> {
        let on_side = || self.candidates.iter().filter(|line| line.distance_m * side > 0.0);
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
                let is_inside =
                    other.distance_m.abs() < line.distance_m.abs() && !line.is_same_wall(other, rule);
                is_inside && length(other) >= line.share_to_yield_to(other, rule) * length_px
            });
            let darker = if line.is_darker_at_the_wall { 1.2 } else { 1.0 };
            let wanted = if is_expected { 1.5 } else { 1.0 };
            let inner = if is_outer { 0.1 } else { 1.0 };
            length_px * darker * wanted * inner * strength(line)
        };
        let chosen = on_side().max_by(|a, b| score(a).total_cmp(&score(b)))?;
        let weight: f64 = wall_of(chosen).map(|line| line.weight).sum();
        let lowest = wall_of(chosen).max_by(|a, b| a.weight.total_cmp(&b.weight))?;
        Some(SeenWall {
            distance_m: wall_of(chosen).map(|line| line.weight * line.distance_m).sum::<f64>() / weight,
            ends: lowest.ends,
            is_darker_at_the_wall: lowest.is_darker_at_the_wall,
            length_px: length(chosen),
        })
    }
}

impl Candidate {
    /// Whether the other line is a piece of the same wall's.
    fn is_same_wall(&self, other: &Self, rule: &FloorLineRule) -> bool {
        (self.distance_m - other.distance_m).abs() < rule.same_wall_m
            && self.is_darker_at_the_wall == other.is_darker_at_the_wall
    }

    /// Share of this line's length that an inner line needs to outrank it.
    fn share_to_yield_to(&self, inner: &Self, rule: &FloorLineRule) -> f64 {
        match (inner.is_darker_at_the_wall, self.is_darker_at_the_wall) {
            // From floor to skirting, then from skirting to wall.
            (true, false) if inner.distance_m / self.distance_m > rule.skirting_ratio => rule.skirting_share,
            (false, true) => f64::INFINITY,
            _ => rule.inner_share,
        }
    }
}

/// The line as a wall's, or `None` where it cannot be one.
fn candidate(line: &CorridorLine, view: &CorridorView, rule: &FloorLineRule) -> Option<Candidate> {
    let middle = 0.5 * (line.start + line.end);
    let along = line.end - line.start;
    let length_px = along.norm();
    let sine_below = depression_sine(view, middle);
    if length_px < 1.0 || sine_below < rule.below_horizon_rad.sin() {
        return None;
    }
    let distance_m = view.tied_distance(middle)?;
    if !(rule.nearest_m..=rule.farthest_m).contains(&distance_m.abs()) {
        return None;
    }
    let contrast = line.sides.contrast();
    if contrast < rule.min_contrast {
        return None;
    }
    // Seen from start to end in the picture (v down), the left side is at (along.y, -along.x).
    let to_the_left = Vector2::new(along.y, -along.x) / length_px;
    let beyond = view.tied_distance(middle + to_the_left)?;
    let wall_is_left = beyond.abs() > distance_m.abs();
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

/// Sine of the angle by which the ray of a pixel dips below the horizon.
fn depression_sine(view: &CorridorView, pixel: Vector2<f64>) -> f64 {
    let ray = view.corridor_from_camera * view.intrinsics.normalized_from_pixel(pixel).push(1.0);
    -ray.z / ray.norm()
}

/// The brightness beside the edge from `start` to `end`, pixels of the image as it is, u right, v down. The levels at the
/// edge are means along it at once and twice `offset_px` from it, extended to the edge, so that a brightness that changes
/// evenly across it gives the same level twice. Outside the image the border's level.
#[must_use]
pub fn sides(image: ImageView<'_>, start: Vector2<f64>, end: Vector2<f64>, offset_px: f64) -> Sides {
    const SAMPLES: u32 = 24;
    let along = end - start;
    let left = Vector2::new(along.y, -along.x) / along.norm().max(1.0) * offset_px;
    let mut sum = Sides { left: 0.0, right: 0.0, farther: 0.0 };
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
    Sides { left: sum.left / samples, right: sum.right / samples, farther: sum.farther / samples }
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

    /// A line along the corridor at `d` and `height` above the floor, from 2 to `far` meters ahead.
    fn line(d: f64, height: f64, far: f64, floor_gray: f64, wall_gray: f64) -> CorridorLine {
        let view = view();
        let pixel = |x: f64| {
            let camera = view.corridor_from_camera.transpose() * Vector3::new(x, d, height - 0.6);
            view.intrinsics.pixel_from_normalized(camera.xy() / camera.z)
        };
        // From near to far the left wall is on the left of its line.
        let (left, right) = if d > 0.0 { (wall_gray, floor_gray) } else { (floor_gray, wall_gray) };
        let sides = Sides { left, right, farther: (left - right).abs() };
        CorridorLine { start: pixel(2.0), end: pixel(far), sides }
    }

    fn find(lines: &[CorridorLine], expected: [Option<ExpectedWall>; 2]) -> SeenWalls {
        let mut finder = FloorLineFinder::default();
        finder.find(lines.iter().copied(), &view(), &FloorLineRule::default(), expected)
    }

    #[test]
    fn the_floor_line_wins_over_the_skirting_and_the_joint() {
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
        let expected = ExpectedWall { distance_m: 1.58, sigma_m: 0.05 };
        assert!(find(&lines, [None, None]).left.unwrap().distance_m < 1.1);
        let only_outer = [line(1.0, 0.0, 2.6, 120.0, 40.0), line(1.6, 0.0, 6.0, 120.0, 40.0)];
        assert!(find(&only_outer, [Some(expected), None]).left.unwrap().distance_m > 1.5);
    }

    #[test]
    fn brightness_is_taken_on_its_side() {
        let beside = |level: &dyn Fn(u8) -> u8, u: f64, v: [f64; 2]| {
            let data: Vec<u8> = (0..30).flat_map(|_| (0..40).map(level)).collect();
            let image = ImageView::new(&data, 40, 30, 40).unwrap();
            sides(image, Vector2::new(u, v[0]), Vector2::new(u, v[1]), 4.0)
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
