use nalgebra::{Matrix3, Point2, Vector2, Vector3};
use yamabico_core::camera::MirrorCamera;
use yamabico_core::geometry::wrap_angle;
use yamabico_vision::polygon::PolygonMoments;

use super::floor_plan::FloorPlan;
use super::normal_equations::{LineMeasurement, NormalEquations};
use super::outline::{FloorOutline, OutlineRule, OutlineVertex};

/// What becomes of corners that lie far off.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Robust {
    /// They count as much as any other.
    #[default]
    None,
    /// They count less beyond so many pixels.
    Huber(f64),
    /// They do not count beyond so many pixels.
    Drop(f64),
}

/// How the outline is fitted to the plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitRule {
    /// A shift below this (meters) and a turn below `min_turn_rad` are the last.
    pub min_shift_m: f64,
    /// See `min_shift_m`.
    pub min_turn_rad: f64,
    /// A step of the common shift below this is the last, pixels.
    pub min_shift_px: f64,
    /// Most steps.
    pub max_iterations: u32,
    /// What becomes of corners that lie far off.
    pub robust: Robust,
    /// Standard deviation of a common shift of all corners in the picture, outwards, pixels, which is then estimated as well;
    /// infinite for one of which nothing is known; `None` for no shift.
    pub shift_sigma_px: Option<f64>,
}

impl Default for FitRule {
    fn default() -> Self {
        Self {
            min_shift_m: 1e-4,
            min_turn_rad: 1e-4,
            min_shift_px: 1e-3,
            max_iterations: 20,
            robust: Robust::None,
            shift_sigma_px: None,
        }
    }
}

/// Where the fit begins and where it is: the center of the plan in the robot's frame, and the direction of its x axis there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// Meters, robot's frame.
    pub center: Point2<f64>,
    /// Radians, robot's frame.
    pub axis_rad: f64,
}

/// An outline that was fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// The center of the plan and the direction of its x axis, robot's frame.
    pub place: Start,
    /// The first correction (a, b, zeta), m and rad.
    pub first_step: Vector3<f64>,
    /// Steps until it stood still.
    pub iterations: u32,
    /// Whether it stood still. If not, it is the best of the places it went through.
    pub is_settled: bool,
    /// Root of the mean weighted square of the residuals, pixels.
    pub rms_px: f64,
    /// The common shift of the corners, pixels outwards; 0 if it is not estimated.
    pub shift_px: f64,
    /// Inverse of the matrix of (a, b, zeta).
    pub inverse: Matrix3<f64>,
    /// Condition of the equations, meters.
    pub condition: f64,
}

/// Fits outlines to a plan. Keeps its buffers.
#[derive(Clone, Debug, Default)]
pub struct OutlineFitter {
    corners: Vec<Point2<f64>>,
    work: Vec<Assigned>,
}

/// The line of a corner, and how far the corner may move without coming nearer to another.
#[derive(Clone, Copy, Debug, Default)]
struct Assigned {
    line: usize,
    slack_m: f64,
}

impl OutlineFitter {
    /// Where the moments of the outline put the plan's center and axis; the axis may be the other way round. `None` for an outline
    /// without area.
    pub fn start(&mut self, outline: &FloorOutline) -> Option<Start> {
        let moments = self.moments(outline)?;
        Some(Start { center: moments.center(), axis_rad: moments.long_axis_rad() })
    }

    /// Area of the outline on the floor, square meters.
    pub fn area_m2(&mut self, outline: &FloorOutline) -> f64 {
        self.moments(outline).map_or(0.0, |moments| moments.area)
    }

    /// The line of the plan that each corner was put on.
    pub fn lines(&self) -> impl Iterator<Item = usize> {
        self.work.iter().map(|assigned| assigned.line)
    }

    /// Fits; `None` where the corners leave the place open.
    ///
    /// With a common shift the corners of `outline` are left where the shift puts them.
    pub fn fit(
        &mut self,
        outline: &mut FloorOutline,
        plan: &FloorPlan,
        start: Start,
        rule: &FitRule,
        camera: (&MirrorCamera, &OutlineRule),
    ) -> Option<Fit> {
        let mut place = start;
        let mut shift_px = 0.0;
        let mut first_step = None;
        let mut best: Option<Fit> = None;
        self.work.clear();
        self.work.resize(outline.vertices().len(), Assigned::default());
        for iteration in 1..=rule.max_iterations.max(1) {
            let (equations, cost) = self.equations(outline.vertices(), plan, &place, rule, shift_px);
            let (step, shift_step, inverse) = solve(&equations, rule)?;
            let first = *first_step.get_or_insert(step);
            let here = Fit {
                place,
                first_step: first,
                iterations: iteration,
                is_settled: false,
                rms_px: (cost / outline.vertices().len().max(1) as f64).sqrt(),
                shift_px,
                inverse,
                condition: f64::INFINITY,
            };
            // Rounding alone makes no place better than a later one.
            if best.is_none_or(|best| here.rms_px <= best.rms_px * (1.0 + 1e-9)) {
                best = Some(here);
            }
            place = moved(&place, &step);
            let most = self.max_move(outline.vertices(), &place, &step);
            for assigned in &mut self.work {
                assigned.slack_m -= 2.0 * most;
            }
            if rule.shift_sigma_px.is_some() {
                shift_px += shift_step;
                outline.project_shifted(camera.0, camera.1, shift_px);
                self.work.fill(Assigned::default());
            }
            let is_settled = step.x.abs() <= rule.min_shift_m
                && step.y.abs() <= rule.min_shift_m
                && step.z.abs() <= rule.min_turn_rad
                && shift_step.abs() <= rule.min_shift_px;
            if is_settled {
                let (equations, cost) = self.equations(outline.vertices(), plan, &place, rule, shift_px);
                let rms_px = (cost / outline.vertices().len().max(1) as f64).sqrt();
                let condition = equations.condition(1.0);
                return Some(Fit { place, is_settled, rms_px, shift_px, condition, ..here });
            }
        }
        // It goes round in circles: the best place of the circle counts.
        let mut best = best?;
        if rule.shift_sigma_px.is_some() {
            outline.project_shifted(camera.0, camera.1, best.shift_px);
        }
        self.work.fill(Assigned::default());
        let (equations, _) = self.equations(outline.vertices(), plan, &best.place, rule, best.shift_px);
        best.condition = equations.condition(1.0);
        Some(best)
    }

    fn moments(&mut self, outline: &FloorOutline) -> Option<PolygonMoments> {
        self.corners.clear();
        self.corners.extend(outline.vertices().iter().map(|vertex| vertex.point_in_robot));
        PolygonMoments::of(&self.corners)
    }

    /// The equations at a place, and the weighted sum of squares.
    fn equations(
        &mut self,
        vertices: &[OutlineVertex],
        plan: &FloorPlan,
        place: &Start,
        rule: &FitRule,
        shift_px: f64,
    ) -> (NormalEquations, f64) {
        let mut equations = NormalEquations::default();
        let mut cost = 0.0;
        let (sin, cos) = place.axis_rad.sin_cos();
        let turn = |v: Vector2<f64>| Vector2::new(cos * v.x + sin * v.y, cos * v.y - sin * v.x);
        for (vertex, assigned) in vertices.iter().zip(&mut self.work) {
            let point = turn(vertex.point_in_robot - place.center);
            if assigned.slack_m <= 0.0 {
                *assigned = assign(plan, point);
            }
            let line = &plan.lines[assigned.line];
            let off_px = (line.normal.dot(&point) - line.offset_m) / vertex.slope_m_per_px;
            let shift_slope = match rule.shift_sigma_px {
                Some(_) => -vertex.slope_m_per_px * line.normal.dot(&turn(vertex.outward)),
                None => 0.0,
            };
            let weight = vertex.weight() * rule.robust.weight(off_px.abs());
            cost += off_px * off_px;
            equations.add(&LineMeasurement {
                point,
                normal: line.normal,
                offset: line.offset_m,
                weight,
                shift_slope,
            });
        }
        let prior = rule.shift_sigma_px.map_or(0.0, |sigma| 1.0 / (sigma * sigma));
        equations.matrix[(3, 3)] += prior;
        equations.right[3] -= prior * shift_px;
        (equations, cost)
    }

    /// How far a step moves any corner at most.
    fn max_move(&self, vertices: &[OutlineVertex], place: &Start, step: &Vector3<f64>) -> f64 {
        let farthest = vertices
            .iter()
            .map(|vertex| (vertex.point_in_robot - place.center).norm_squared())
            .fold(0.0, f64::max)
            .sqrt();
        step.x.hypot(step.y) + step.z.abs() * (farthest + step.x.hypot(step.y))
    }
}

impl Robust {
    fn weight(self, off_px: f64) -> f64 {
        match self {
            Self::None => 1.0,
            Self::Huber(knee) if off_px > knee => knee / off_px,
            Self::Drop(end) if off_px > end => 0.0,
            Self::Huber(_) | Self::Drop(_) => 1.0,
        }
    }
}

/// The nearest line by the distance from its segments, and by how much it is nearer than any other.
fn assign(plan: &FloorPlan, point: Vector2<f64>) -> Assigned {
    let (mut best, mut line, mut second) = (f64::INFINITY, 0, f64::INFINITY);
    for segment in &plan.segments {
        let away = point - segment.from.coords;
        let share = away.dot(&segment.along) / segment.squared_m2;
        // Beyond a common end two segments are equally far, to the last bit: the first one counts.
        let off = match share {
            _ if share >= 1.0 => point - segment.to.coords,
            _ if share > 0.0 => away - segment.along * share,
            _ => away,
        };
        let squared = off.norm_squared();
        if squared < best {
            if segment.line != line {
                second = best;
            }
            (best, line) = (squared, segment.line);
        } else if segment.line != line {
            second = second.min(squared);
        }
    }
    Assigned { line, slack_m: second.sqrt() - best.sqrt() }
}

/// The correction of the place, of the shift, and the inverse of the matrix of the place.
fn solve(equations: &NormalEquations, rule: &FitRule) -> Option<(Vector3<f64>, f64, Matrix3<f64>)> {
    match rule.shift_sigma_px {
        None => equations.solve_pose(1.0).map(|(step, inverse)| (step, 0.0, inverse)),
        Some(_) => equations.solve_all().map(|(step, inverse)| {
            (step.fixed_rows::<3>(0).into(), step.w, inverse.fixed_view::<3, 3>(0, 0).into())
        }),
    }
}

/// Sekimori et al. (2001), equations 16 to 18, corrected: the shift belongs to the frame that is turned already.
fn moved(place: &Start, step: &Vector3<f64>) -> Start {
    let axis_rad = place.axis_rad + step.z;
    let (sin, cos) = axis_rad.sin_cos();
    Start {
        center: Point2::new(
            place.center.x - step.x * cos + step.y * sin,
            place.center.y - step.x * sin - step.y * cos,
        ),
        axis_rad: wrap_angle(axis_rad),
    }
}
