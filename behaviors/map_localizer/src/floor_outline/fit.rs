use nalgebra::{Matrix3, Point2, Vector2, Vector3};
use yamabico_core::camera::MirrorCamera;
use yamabico_core::geometry::{Hypotenuse, wrap_angle};
use yamabico_vision::polygon::PolygonMoments;

use super::floor_plan::FloorPlan;
use super::normal_equations::{LineMeasurement, NormalEquations};
use super::outline::{FloorOutline, OutlineRule, OutlineVertex};

/// Robust weighting of the residuals of corners.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Robust {
    /// Equal weights.
    #[default]
    None,
    /// Huber weights above this residual, px.
    Huber(f64),
    /// Zero weight above this residual, px.
    Drop(f64),
}

/// Parameters of the fit of an outline to a plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitRule {
    /// Translation per iteration below which the fit has converged, m.
    pub min_shift_m: f64,
    /// Rotation per iteration below which the fit has converged, rad.
    pub min_turn_rad: f64,
    /// Change of the common shift per iteration below which the fit has converged, px.
    pub min_shift_px: f64,
    /// Maximum number of iterations.
    pub max_iterations: u32,
    /// Robust weighting of the residuals.
    pub robust: Robust,
    /// Standard deviation of a common outward shift of all corners in the image, px, which is estimated with the pose;
    /// infinite without prior knowledge; `None` for a fit without a shift.
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

/// Placement of the plan in the robot frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanPlacement {
    /// Center of the plan in the robot frame, m.
    pub center: Point2<f64>,
    /// Direction of the plan's x axis in the robot frame, rad.
    pub axis_rad: f64,
}

/// Result of fitting an outline to a plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Fitted placement of the plan.
    pub placement: PlanPlacement,
    /// First correction (a, b, zeta), m and rad.
    pub first_step: Vector3<f64>,
    /// Number of iterations.
    pub iterations: u32,
    /// True if the fit converged; otherwise the placement is the best of all iterations.
    pub is_converged: bool,
    /// Root mean square of the residuals, px.
    pub rms_px: f64,
    /// Common outward shift of the corners, px; 0 if not estimated.
    pub shift_px: f64,
    /// Inverse of the matrix of (a, b, zeta).
    pub inverse: Matrix3<f64>,
    /// Condition number of the equations, for points in meters.
    pub condition: f64,
}

/// Fitter of outlines to a plan. Reuses its buffers.
#[derive(Clone, Debug, Default)]
pub struct OutlineFitter {
    corners: Vec<Point2<f64>>,
    assignments: Vec<Assignment>,
}

/// Assignment of a corner to a line of the plan.
#[derive(Clone, Copy, Debug, Default)]
struct Assignment {
    line: usize,
    /// Difference between the distances to the second nearest and the nearest line, less twice the motion since, m; the
    /// assignment is valid while positive.
    slack_m: f64,
}

impl OutlineFitter {
    /// Returns the placement of the plan from the moments of the outline, ambiguous by half a turn; `None` for an
    /// outline without area.
    pub fn initial_placement(&mut self, outline: &FloorOutline) -> Option<PlanPlacement> {
        let moments = self.moments(outline)?;
        Some(PlanPlacement { center: moments.center(), axis_rad: moments.long_axis_rad() })
    }

    /// Returns the area of the outline on the floor, m².
    pub fn area_m2(&mut self, outline: &FloorOutline) -> f64 {
        self.moments(outline).map_or(0.0, |moments| moments.area)
    }

    /// Returns the line of the plan that each corner is assigned to.
    pub fn lines(&self) -> impl Iterator<Item = usize> {
        self.assignments.iter().map(|assignment| assignment.line)
    }

    /// Fits the outline to the plan; `None` if the corners do not determine the placement.
    ///
    /// If a common shift is estimated, the corners of `outline` are left shifted.
    pub fn fit(
        &mut self,
        outline: &mut FloorOutline,
        plan: &FloorPlan,
        start: PlanPlacement,
        rule: &FitRule,
        camera: (&MirrorCamera, &OutlineRule),
    ) -> Option<Fit> {
        let mut placement = start;
        let mut shift_px = 0.0;
        let mut first_step = None;
        let mut best: Option<Fit> = None;
        self.assignments.clear();
        self.assignments.resize(outline.vertices().len(), Assignment::default());
        for iteration in 1..=rule.max_iterations.max(1) {
            let (equations, cost) = self.equations(outline.vertices(), plan, &placement, rule, shift_px);
            let (step, shift_step, inverse) = solve(&equations, rule)?;
            let first = *first_step.get_or_insert(step);
            let here = Fit {
                placement,
                first_step: first,
                iterations: iteration,
                is_converged: false,
                rms_px: (cost / outline.vertices().len().max(1) as f64).sqrt(),
                shift_px,
                inverse,
                condition: f64::INFINITY,
            };
            // The tolerance keeps rounding errors from preferring an earlier iteration.
            if best.is_none_or(|best| here.rms_px <= best.rms_px * (1.0 + 1e-9)) {
                best = Some(here);
            }
            placement = moved(&placement, &step);
            let max_motion = self.max_motion_m(outline.vertices(), &placement, &step);
            for assignment in &mut self.assignments {
                assignment.slack_m -= 2.0 * max_motion;
            }
            if rule.shift_sigma_px.is_some() {
                shift_px += shift_step;
                outline.project_shifted(camera.0, camera.1, shift_px);
                self.assignments.fill(Assignment::default());
            }
            let is_converged = step.x.abs() <= rule.min_shift_m
                && step.y.abs() <= rule.min_shift_m
                && step.z.abs() <= rule.min_turn_rad
                && shift_step.abs() <= rule.min_shift_px;
            if is_converged {
                let (equations, cost) = self.equations(outline.vertices(), plan, &placement, rule, shift_px);
                let rms_px = (cost / outline.vertices().len().max(1) as f64).sqrt();
                let condition = equations.condition(1.0);
                return Some(Fit { placement, is_converged, rms_px, shift_px, condition, ..here });
            }
        }
        // Without convergence (such as in a cycle) the best iteration counts.
        let mut best = best?;
        if rule.shift_sigma_px.is_some() {
            outline.project_shifted(camera.0, camera.1, best.shift_px);
        }
        self.assignments.fill(Assignment::default());
        let (equations, _) = self.equations(outline.vertices(), plan, &best.placement, rule, best.shift_px);
        best.condition = equations.condition(1.0);
        Some(best)
    }

    fn moments(&mut self, outline: &FloorOutline) -> Option<PolygonMoments> {
        self.corners.clear();
        self.corners.extend(outline.vertices().iter().map(|vertex| vertex.point_in_robot));
        PolygonMoments::of(&self.corners)
    }

    /// Returns the normal equations at a placement and the sum of squared residuals, px².
    fn equations(
        &mut self,
        vertices: &[OutlineVertex],
        plan: &FloorPlan,
        placement: &PlanPlacement,
        rule: &FitRule,
        shift_px: f64,
    ) -> (NormalEquations, f64) {
        let mut equations = NormalEquations::default();
        let mut cost = 0.0;
        let (sin, cos) = placement.axis_rad.sin_cos();
        let turn = |v: Vector2<f64>| Vector2::new(cos * v.x + sin * v.y, cos * v.y - sin * v.x);
        for (vertex, assignment) in vertices.iter().zip(&mut self.assignments) {
            let point = turn(vertex.point_in_robot - placement.center);
            if assignment.slack_m <= 0.0 {
                *assignment = assign(plan, point);
            }
            let line = &plan.lines[assignment.line];
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

    /// Returns an upper bound of the motion of a corner by a step, m.
    fn max_motion_m(
        &self,
        vertices: &[OutlineVertex],
        placement: &PlanPlacement,
        step: &Vector3<f64>,
    ) -> f64 {
        let farthest = vertices
            .iter()
            .map(|vertex| (vertex.point_in_robot - placement.center).norm_squared())
            .fold(0.0, f64::max)
            .sqrt();
        step.x.hypotenuse(step.y) + step.z.abs() * (farthest + step.x.hypotenuse(step.y))
    }
}

impl Robust {
    fn weight(self, off_px: f64) -> f64 {
        match self {
            Self::None => 1.0,
            Self::Huber(limit) if off_px > limit => limit / off_px,
            Self::Drop(limit) if off_px > limit => 0.0,
            Self::Huber(_) | Self::Drop(_) => 1.0,
        }
    }
}

/// Assigns a point to the line with the nearest segment.
fn assign(plan: &FloorPlan, point: Vector2<f64>) -> Assignment {
    let (mut best, mut line, mut second) = (f64::INFINITY, 0, f64::INFINITY);
    for segment in &plan.segments {
        let away = point - segment.from.coords;
        let fraction = away.dot(&segment.along) / segment.squared_m2;
        // Past a common end, the distances to both segments are bitwise equal and the first segment is chosen.
        let off = match fraction {
            _ if fraction >= 1.0 => point - segment.to.coords,
            _ if fraction > 0.0 => away - segment.along * fraction,
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
    Assignment { line, slack_m: second.sqrt() - best.sqrt() }
}

/// Returns the corrections of the placement and of the shift, and the inverse of the placement's matrix.
fn solve(equations: &NormalEquations, rule: &FitRule) -> Option<(Vector3<f64>, f64, Matrix3<f64>)> {
    match rule.shift_sigma_px {
        None => equations.solve_pose(1.0).map(|(step, inverse)| (step, 0.0, inverse)),
        Some(_) => equations.solve_all().map(|(step, inverse)| {
            (step.fixed_rows::<3>(0).into(), step.w, inverse.fixed_view::<3, 3>(0, 0).into())
        }),
    }
}

/// Applies a correction. Sekimori et al. (2001), equations 16 to 18, corrected: the shift is in the rotated frame.
fn moved(placement: &PlanPlacement, step: &Vector3<f64>) -> PlanPlacement {
    let axis_rad = placement.axis_rad + step.z;
    let (sin, cos) = axis_rad.sin_cos();
    PlanPlacement {
        center: Point2::new(
            placement.center.x - step.x * cos + step.y * sin,
            placement.center.y - step.x * sin - step.y * cos,
        ),
        axis_rad: wrap_angle(axis_rad),
    }
}
