use nalgebra::{Point2, Rotation2, Vector2};
use thiserror::Error;
use yamabico_core::geometry::Pose2;
use yamabico_vision::polygon::{PolygonMoments, convex_hull};

/// Straight part of the floor's outline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutlineSegment {
    /// Ends, m; the floor is on the left when going from the first to the second.
    pub ends: [Point2<f64>; 2],
}

/// Line of the plan: all points p with `normal` . p = `offset_m`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PlanLine {
    /// Unit normal away from the floor.
    pub normal: Vector2<f64>,
    pub offset_m: f64,
}

/// Segment of the plan with the index of its line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PlanSegment {
    pub from: Point2<f64>,
    pub to: Point2<f64>,
    pub along: Vector2<f64>,
    pub squared_m2: f64,
    pub line: usize,
}

/// Outline of a floor in the plan frame: the origin is the centroid of its convex hull, and x is the hull's long axis.
#[derive(Clone, Debug, PartialEq)]
pub struct FloorPlan {
    pub(super) lines: Vec<PlanLine>,
    pub(super) segments: Vec<PlanSegment>,
    map_from_plan: Pose2,
    hull_area_m2: f64,
    is_symmetric: bool,
}

/// Reason why segments do not form a floor plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum FloorPlanError {
    /// Fewer than three segments, or one with zero length or an end that is not finite.
    #[error("an outline must have at least three segments with finite ends and a length above zero")]
    Segments,
    /// The convex hull of the segments has no area.
    #[error("the outline encloses no area")]
    NoArea,
}

/// Tolerance of lengths and offsets for rounding errors, m.
const ROUNDING_M: f64 = 1e-9;

impl FloorPlan {
    /// Creates a plan from straight segments in the map frame. Gaps between segments are permitted and are not used for
    /// localization.
    ///
    /// # Errors
    /// Fewer than three valid segments, or no area.
    pub fn new(outline: &[OutlineSegment]) -> Result<Self, FloorPlanError> {
        let is_valid = |segment: &OutlineSegment| {
            let [a, b] = segment.ends;
            (b - a).norm() > ROUNDING_M && (b - a).norm().is_finite()
        };
        if outline.len() < 3 || !outline.iter().all(is_valid) {
            return Err(FloorPlanError::Segments);
        }
        let mut ends: Vec<_> = outline.iter().flat_map(|segment| segment.ends).collect();
        let mut hull = Vec::new();
        convex_hull(&mut ends, &mut hull);
        let moments = PolygonMoments::of(&hull).ok_or(FloorPlanError::NoArea)?;
        let snap = |value: f64| if value.abs() < 1e-12 { 0.0 } else { value };
        let center = moments.center();
        let axis = if moments.has_axis() { moments.long_axis_rad() } else { 0.0 };
        let map_from_plan = Pose2 { x: snap(center.x), y: snap(center.y), theta: snap(axis) };
        let mut plan = Self {
            lines: Vec::new(),
            segments: Vec::with_capacity(outline.len()),
            map_from_plan,
            hull_area_m2: moments.area,
            is_symmetric: false,
        };
        let plan_from_map = map_from_plan.inverse();
        for segment in outline {
            plan.add(segment.ends.map(|end| plan_from_map.transform_point(end)));
        }
        plan.is_symmetric = plan.has_half_turn_symmetry();
        Ok(plan)
    }

    /// Creates a plan from the corners of a floor, counterclockwise.
    ///
    /// # Errors
    /// Fewer than three valid sides, or no area.
    pub fn from_polygon(corners: &[Point2<f64>]) -> Result<Self, FloorPlanError> {
        let segments: Vec<_> =
            yamabico_vision::polygon::sides(corners).map(|ends| OutlineSegment { ends }).collect();
        Self::new(&segments)
    }

    /// Creates a football field with its goals from half its length, half its length including the goals, half its
    /// width, and half the width of a goal, m. The sides of the goals are not part of the outline.
    ///
    /// # Errors
    /// A dimension is not finite, or the field has no area.
    pub fn football_field(
        half_length_m: f64,
        half_with_goals_m: f64,
        half_width_m: f64,
        half_goal_m: f64,
    ) -> Result<Self, FloorPlanError> {
        let (length, goals, width, goal) = (half_length_m, half_with_goals_m, half_width_m, half_goal_m);
        let half = [
            [(goals, -goal), (goals, goal)],
            [(length, -width), (length, -goal)],
            [(length, goal), (length, width)],
            [(length, width), (-length, width)],
        ];
        let turned = half.map(|ends| ends.map(|(x, y)| (-x, -y)));
        let segments: Vec<_> = half
            .into_iter()
            .chain(turned)
            .map(|ends| OutlineSegment { ends: ends.map(|(x, y)| Point2::new(x, y)) })
            .collect();
        Self::new(&segments)
    }

    /// Returns the number of lines; collinear segments count once.
    #[must_use]
    pub fn lines(&self) -> usize {
        self.lines.len()
    }

    /// Returns the outward unit normal and the offset (m) of a line in the plan frame.
    #[must_use]
    pub fn line(&self, index: usize) -> Option<(Vector2<f64>, f64)> {
        self.lines.get(index).map(|line| (line.normal, line.offset_m))
    }

    /// Returns the pose of the plan frame in the map frame.
    #[must_use]
    pub fn map_from_plan(&self) -> Pose2 {
        self.map_from_plan
    }

    /// Returns the area of the convex hull, m².
    #[must_use]
    pub fn hull_area_m2(&self) -> f64 {
        self.hull_area_m2
    }

    /// Returns true if the plan is symmetric under half a turn, so that each image has two solutions.
    #[must_use]
    pub fn is_symmetric(&self) -> bool {
        self.is_symmetric
    }

    fn add(&mut self, [from, to]: [Point2<f64>; 2]) {
        let along = to - from;
        let normal = Vector2::new(along.y, -along.x).normalize();
        let line = PlanLine { normal, offset_m: normal.dot(&from.coords) };
        let known = self.lines.iter().position(|known| is_same(known, &line));
        let index = known.unwrap_or(self.lines.len());
        if known.is_none() {
            self.lines.push(line);
        }
        self.segments.push(PlanSegment { from, to, along, squared_m2: along.norm_squared(), line: index });
    }

    fn has_half_turn_symmetry(&self) -> bool {
        let turn = Rotation2::new(std::f64::consts::PI);
        self.segments.iter().all(|segment| {
            let (from, to) = (turn * segment.from, turn * segment.to);
            self.segments.iter().any(|other| {
                let apart = |a: Point2<f64>, b: Point2<f64>| (a - b).norm() < 1e-6;
                apart(other.from, from) && apart(other.to, to)
            })
        })
    }
}

fn is_same(a: &PlanLine, b: &PlanLine) -> bool {
    (a.normal - b.normal).norm() < 1e-9 && (a.offset_m - b.offset_m).abs() < ROUNDING_M
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_has_six_lines_and_is_symmetric() {
        let field = FloorPlan::football_field(1.37, 1.55, 0.7625, 0.25).unwrap();
        assert_eq!((field.lines(), field.segments.len()), (6, 8));
        assert!(field.is_symmetric());
        assert_eq!(field.map_from_plan(), Pose2::IDENTITY);
        assert!((field.hull_area_m2() - 4.543).abs() < 1e-9);
        assert!((0..6).all(|i| field.line(i).is_some_and(|(_, offset)| offset > 0.7)));
    }

    #[test]
    fn an_l_shaped_floor_is_not_symmetric() {
        let corners = [(0.0, 0.0), (4.0, 0.0), (4.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)];
        let plan = FloorPlan::from_polygon(&corners.map(|(x, y)| Point2::new(x, y))).unwrap();
        assert!(!plan.is_symmetric());
        assert_eq!(plan.lines(), 6);
        assert_eq!(FloorPlan::new(&[]), Err(FloorPlanError::Segments));
        let flat = [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)].map(|(x, y)| Point2::new(x, y));
        assert_eq!(FloorPlan::from_polygon(&flat), Err(FloorPlanError::NoArea));
    }
}
