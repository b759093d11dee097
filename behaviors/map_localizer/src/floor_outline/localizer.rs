use nalgebra::{Matrix3, Point2};
use yamabico_core::camera::MirrorCamera;
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_vision::bit_image::BitImage;

use super::fit::{Fit, FitRule, OutlineFitter, PlanPlacement};
use super::floor_fix::{FloorFix, FloorProblem, FloorSolution};
use super::floor_plan::FloorPlan;
use super::outline::{FloorOutline, OutlineRule};
use crate::belief::Belief;

/// Parameters and acceptance limits of the localization.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloorRule {
    /// Selection of the corners.
    pub outline: OutlineRule,
    /// Parameters of the fit.
    pub fit: FitRule,
    /// Minimum number of corners.
    pub min_corners: usize,
    /// Maximum condition number of the equations.
    pub max_condition: f64,
    /// Maximum root mean square of the residuals, px.
    pub max_rms_px: f64,
    /// Range of the outline's area as a fraction of the plan's hull.
    pub area_range: [f64; 2],
    /// Maximum angle between the directions of adjacent corners, rad.
    pub max_gap_rad: f64,
    /// Maximum squared Mahalanobis distance from the prediction, three degrees of freedom.
    pub jump_gate: f64,
    /// Minimum standard deviation of a corner for the covariance, px.
    pub min_sigma_px: f64,
    /// Distance of the heading error from a quarter turn below which two symmetric solutions are ambiguous, rad.
    pub ambiguous_rad: f64,
}

impl FloorRule {
    /// Creates the default rule for this selection of corners.
    #[must_use]
    pub fn new(outline: OutlineRule) -> Self {
        Self {
            outline,
            fit: FitRule::default(),
            min_corners: 6,
            max_condition: 1e6,
            max_rms_px: 1.5,
            area_range: [0.5, 1.15],
            max_gap_rad: 150_f64.to_radians(),
            jump_gate: 16.266_236_196_238_13,
            min_sigma_px: 0.2,
            ambiguous_rad: 10_f64.to_radians(),
        }
    }
}

/// Localizer by the outline of the floor. Reuses its buffers.
#[derive(Clone, Debug)]
pub struct FloorLocalizer {
    plan: FloorPlan,
    camera: MirrorCamera,
    rule: FloorRule,
    outline: FloorOutline,
    fitter: OutlineFitter,
    directions: Vec<f64>,
}

impl FloorLocalizer {
    /// Creates a localizer for a plan and an upright mirror camera with its axis at the origin of the robot frame.
    #[must_use]
    pub fn new(plan: FloorPlan, camera: MirrorCamera, rule: FloorRule) -> Self {
        Self {
            plan,
            camera,
            rule,
            outline: FloorOutline::default(),
            fitter: OutlineFitter::default(),
            directions: Vec::new(),
        }
    }

    /// Returns the camera.
    #[must_use]
    pub fn camera(&self) -> &MirrorCamera {
        &self.camera
    }

    /// Returns the height of the mirror above the floor, m.
    #[must_use]
    pub fn height_m(&self) -> f64 {
        self.rule.outline.height_m
    }

    /// Returns the floor plan.
    #[must_use]
    pub fn plan(&self) -> &FloorPlan {
        &self.plan
    }

    /// Returns the outline of the last image.
    #[must_use]
    pub fn outline(&self) -> &FloorOutline {
        &self.outline
    }

    /// Finds the pose from a mask of the floor. The fit starts at the prediction, if given; if that fails, at the
    /// moments.
    ///
    /// # Errors
    /// The outline does not determine the pose, does not fit the plan or contradicts the prediction.
    pub fn locate(&mut self, mask: &BitImage, predicted: Option<&Belief>) -> Result<FloorFix, FloorProblem> {
        self.outline
            .take_mask(mask, &self.camera, &self.rule.outline)
            .map_err(|_| FloorProblem::ImageSizeError)?;
        self.locate_outline(predicted)
    }

    /// Like [`FloorLocalizer::locate`], but from a hull in the mirror plane, px.
    ///
    /// # Errors
    /// The outline does not determine the pose, does not fit the plan or contradicts the prediction.
    pub fn locate_hull(
        &mut self,
        hull: &[Point2<f64>],
        predicted: Option<&Belief>,
    ) -> Result<FloorFix, FloorProblem> {
        self.outline.take_hull(hull, &self.camera, &self.rule.outline);
        self.locate_outline(predicted)
    }

    fn locate_outline(&mut self, predicted: Option<&Belief>) -> Result<FloorFix, FloorProblem> {
        let corners = self.outline.vertices().len();
        if corners < self.rule.min_corners {
            return Err(FloorProblem::TooFewCorners { corners });
        }
        let fraction = self.fitter.area_m2(&self.outline) / self.plan.hull_area_m2();
        let [min, max] = self.rule.area_range;
        if !(min..=max).contains(&fraction) {
            return Err(FloorProblem::Area { fraction });
        }
        let gap_rad = self.max_gap_rad();
        let is_covered = gap_rad <= self.rule.max_gap_rad;
        if !is_covered {
            return Err(FloorProblem::Gap { gap_rad });
        }
        if let Some(belief) = predicted {
            let start = self.placement_at(&belief.pose);
            if let Ok(found) = self.fit_and_check(start, predicted) {
                return Ok(found);
            }
            // Undoes a shift of the corners by the fit.
            self.outline.project_shifted(&self.camera, &self.rule.outline, 0.0);
        }
        let start = self.fitter.initial_placement(&self.outline).ok_or(FloorProblem::Singular)?;
        if self.plan.is_symmetric() {
            return self.fit_and_check(start, predicted);
        }
        let turned = PlanPlacement { axis_rad: start.axis_rad + std::f64::consts::PI, ..start };
        let one = self.fit_and_check(start, predicted);
        self.outline.project_shifted(&self.camera, &self.rule.outline, 0.0);
        match (one, self.fit_and_check(turned, predicted)) {
            (Ok(a), Ok(b)) => Ok(if b.rms_px < a.rms_px { b } else { a }),
            (Ok(found), Err(_)) | (Err(_), Ok(found)) => Ok(found),
            (Err(problem), Err(_)) => Err(problem),
        }
    }

    /// Fits from an initial placement and checks the result.
    fn fit_and_check(
        &mut self,
        start: PlanPlacement,
        predicted: Option<&Belief>,
    ) -> Result<FloorFix, FloorProblem> {
        let camera = (&self.camera, &self.rule.outline);
        let fit = self
            .fitter
            .fit(&mut self.outline, &self.plan, start, &self.rule.fit, camera)
            .filter(|fit| fit.condition <= self.rule.max_condition)
            .ok_or(FloorProblem::Singular)?;
        let fits = fit.rms_px <= self.rule.max_rms_px;
        if !fits {
            return Err(FloorProblem::Residual { rms_px: fit.rms_px });
        }
        let found = self.poses(&fit);
        let (pose, solution) = self.choose(found, predicted);
        let belief = Belief { pose, covariance: self.covariance(&fit, &pose) };
        if let Some(predicted) = predicted {
            let both = Belief { pose, covariance: belief.covariance + predicted.covariance };
            let distance_squared = both.distance_squared(&predicted.pose);
            let is_near = distance_squared <= self.rule.jump_gate;
            if !is_near {
                return Err(FloorProblem::Jump { distance_squared });
            }
        }
        let (rms_px, shift_px, iterations) = (fit.rms_px, fit.shift_px, fit.iterations);
        let corners = self.outline.vertices().len();
        Ok(FloorFix { belief, solution, rms_px, shift_px, corners, iterations })
    }

    fn placement_at(&self, map_from_robot: &Pose2) -> PlanPlacement {
        let robot_from_plan = map_from_robot.inverse().compose(&self.plan.map_from_plan());
        PlanPlacement { center: robot_from_plan.position(), axis_rad: robot_from_plan.theta }
    }

    /// Returns both solutions; the second one is valid for a symmetric plan only. Sekimori et al. (2001), equations 19
    /// to 21, corrected.
    fn poses(&self, fit: &Fit) -> [Pose2; 2] {
        let robot_from_plan =
            Pose2::new(fit.placement.center.x, fit.placement.center.y, fit.placement.axis_rad);
        let half_turn = Pose2::new(0.0, 0.0, std::f64::consts::PI);
        let map_from_plan = self.plan.map_from_plan();
        let pose = robot_from_plan.inverse();
        [map_from_plan.compose(&pose), map_from_plan.compose(&half_turn).compose(&pose)]
    }

    fn choose(&self, [one, other]: [Pose2; 2], predicted: Option<&Belief>) -> (Pose2, FloorSolution) {
        if !self.plan.is_symmetric() {
            return (one, FloorSolution::Unique);
        }
        let Some(predicted) = predicted else { return (one, FloorSolution::Ambiguous { other }) };
        let off = angle_difference(one.theta, predicted.pose.theta).abs();
        let quarter = std::f64::consts::FRAC_PI_2;
        let (pose, other) = if off < quarter { (one, other) } else { (other, one) };
        if (off - quarter).abs() < self.rule.ambiguous_rad {
            (pose, FloorSolution::Ambiguous { other })
        } else {
            (pose, FloorSolution::Unique)
        }
    }

    /// Returns the covariance of the pose from that of the fit.
    fn covariance(&self, fit: &Fit, pose: &Pose2) -> Matrix3<f64> {
        let sigma = fit.rms_px.max(self.rule.min_sigma_px);
        let plan = self.plan.map_from_plan();
        // Pose in the plan frame, where both solutions have the same covariance.
        let at = plan.inverse().compose(pose);
        let sign = if angle_difference(-fit.placement.axis_rad, at.theta).abs() < std::f64::consts::FRAC_PI_2
        {
            1.0
        } else {
            -1.0
        };
        let pose_from_fit = Matrix3::new(sign, 0.0, at.y, 0.0, sign, -at.x, 0.0, 0.0, -1.0);
        let (sin, cos) = plan.theta.sin_cos();
        let turn = Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0);
        let jacobian = turn * pose_from_fit;
        jacobian * (fit.inverse * (sigma * sigma)) * jacobian.transpose()
    }

    fn max_gap_rad(&mut self) -> f64 {
        self.directions.clear();
        self.directions
            .extend(self.outline.vertices().iter().map(|vertex| vertex.outward.y.atan2(vertex.outward.x)));
        self.directions.sort_unstable_by(f64::total_cmp);
        let (Some(first), Some(last)) = (self.directions.first(), self.directions.last()) else {
            return std::f64::consts::TAU;
        };
        let closing = first + std::f64::consts::TAU - last;
        self.directions.windows(2).map(|pair| pair[1] - pair[0]).fold(closing, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::camera::{FloorFormula, HyperboloidalMirror, Mirror, MirrorImage};
    use yamabico_vision::polygon::{convex_hull, sides};

    const OUTLINE: OutlineRule = OutlineRule { height_m: 0.165, max_radius_px: 108.0 };

    fn camera() -> MirrorCamera {
        let formula = FloorFormula { a: 10_120.0, b: 20.54, c: 2.298e5 };
        let mirror = HyperboloidalMirror::from_floor_formula(formula, OUTLINE.height_m).unwrap();
        let image = MirrorImage::centered(256, 220).with_ring(1.0, 113.5).unwrap();
        MirrorCamera::new(image, Mirror::Hyperboloidal(mirror)).unwrap()
    }

    fn field() -> Vec<Point2<f64>> {
        let half =
            [(1.55, -0.25), (1.55, 0.25), (1.37, 0.25), (1.37, 0.7625), (-1.37, 0.7625), (-1.37, 0.25)];
        half.into_iter().chain(half.map(|(x, y)| (-x, -y))).map(|(x, y)| Point2::new(x, y)).collect()
    }

    fn localizer() -> FloorLocalizer {
        let plan = FloorPlan::football_field(1.37, 1.55, 0.7625, 0.25).unwrap();
        FloorLocalizer::new(plan, camera(), FloorRule::new(OUTLINE))
    }

    /// Returns the hull of a floor in the mirror plane without noise.
    fn hull(floor: &[Point2<f64>], robot: &Pose2) -> Vec<Point2<f64>> {
        let camera = camera();
        let robot_from_map = robot.inverse();
        let mut seen = Vec::new();
        for [a, b] in sides(floor) {
            for i in 0..40 {
                let point = robot_from_map.transform_point(a + (b - a) * (f64::from(i) / 40.0));
                let distance = point.coords.norm();
                if let Ok(radius) = camera.radius_px(distance, -OUTLINE.height_m) {
                    seen.push(Point2::from(point.coords * (radius / distance)));
                }
            }
        }
        let mut hull = Vec::new();
        convex_hull(&mut seen, &mut hull);
        hull.retain(|corner| corner.coords.norm() < OUTLINE.max_radius_px);
        hull
    }

    fn near(belief: &Pose2, other: &Pose2) -> bool {
        belief.distance(other) < 1e-3 && angle_difference(belief.theta, other.theta).abs() < 1e-3
    }

    #[test]
    fn the_pose_is_found_from_a_poor_prediction() {
        let truth = Pose2::new(0.4, 0.15, 0.6);
        let seen = hull(&field(), &truth);
        let mut localizer = localizer();
        for (x, y, turn) in
            [(0.15, 0.15, 15.0), (-0.15, 0.15, -15.0), (0.15, -0.15, -15.0), (-0.15, -0.15, 15.0)]
        {
            let pose = Pose2::new(truth.x + x, truth.y + y, truth.theta + f64::to_radians(turn));
            let fix = localizer.locate_hull(&seen, Some(&Belief::new(pose, 0.15, 0.26))).unwrap();
            assert!(near(&fix.belief.pose, &truth), "{:?}", fix.belief.pose);
            assert_eq!(fix.solution, FloorSolution::Unique);
        }
    }

    #[test]
    fn without_a_prediction_there_are_two_symmetric_solutions() {
        let truth = Pose2::new(0.4, 0.15, 0.6);
        let fix = localizer().locate_hull(&hull(&field(), &truth), None).unwrap();
        let FloorSolution::Ambiguous { other } = fix.solution else { panic!("{fix:?}") };
        let pose = fix.belief.pose;
        assert!((pose.x + other.x).abs() < 1e-12 && (pose.y + other.y).abs() < 1e-12);
        assert!((angle_difference(pose.theta, other.theta).abs() - std::f64::consts::PI).abs() < 1e-12);
        assert!(near(&pose, &truth) || near(&other, &truth));
        // A quarter turn from both, the prediction selects neither.
        let aside = Belief::new(Pose2::new(0.4, 0.15, 0.6 + 1.55), 1.0, 1.0);
        let fix = localizer().locate_hull(&hull(&field(), &truth), Some(&aside)).unwrap();
        assert!(matches!(fix.solution, FloorSolution::Ambiguous { .. }));
    }

    #[test]
    fn rotating_the_robot_changes_the_heading_only() {
        let (one, two) = (Pose2::new(-0.5, 0.2, 0.3), Pose2::new(-0.5, 0.2, 1.1));
        let mut localizer = localizer();
        let found = [one, two].map(|robot| {
            let seen = hull(&field(), &robot);
            localizer.locate_hull(&seen, Some(&Belief::new(robot, 0.1, 0.1))).unwrap().belief
        });
        assert!(found[0].pose.distance(&found[1].pose) < 1e-4);
        assert!((angle_difference(found[1].pose.theta, found[0].pose.theta) - 0.8).abs() < 1e-4);
        let [a, b] = found.map(|belief| belief.covariance);
        assert!((a - b).norm() < 1e-2 * a.norm(), "{a} {b}");
    }

    #[test]
    fn an_l_shaped_floor_has_one_solution() {
        let floor = [(0.0, 0.0), (2.4, 0.0), (2.4, 0.9), (1.0, 0.9), (1.0, 1.8), (0.0, 1.8)]
            .map(|(x, y)| Point2::new(x, y));
        let plan = FloorPlan::from_polygon(&floor).unwrap();
        let mut localizer = FloorLocalizer::new(plan, camera(), FloorRule::new(OUTLINE));
        let truth = Pose2::new(0.6, 0.7, 2.5);
        let fix = localizer.locate_hull(&hull(&floor, &truth), None).unwrap();
        assert_eq!(fix.solution, FloorSolution::Unique);
        assert!(near(&fix.belief.pose, &truth), "{:?}", fix.belief.pose);
    }

    #[test]
    fn another_floor_and_an_occluded_one_are_rejected() {
        let truth = Pose2::new(0.4, 0.15, 0.6);
        let seen = hull(&field(), &truth);
        let mut localizer = localizer();
        let ahead: Vec<_> = seen.iter().copied().filter(|corner| corner.x > 20.0).collect();
        let problem = localizer.locate_hull(&ahead, None).unwrap_err();
        assert!(matches!(problem, FloorProblem::Area { .. } | FloorProblem::Gap { .. }), "{problem}");
        let round: Vec<_> = (0..40)
            .map(|i| {
                let (sin, cos) = (0.157 * f64::from(i)).sin_cos();
                Point2::new(95.0 * cos, 95.0 * sin)
            })
            .collect();
        let problem = localizer.locate_hull(&round, None).unwrap_err();
        assert!(matches!(problem, FloorProblem::Residual { .. } | FloorProblem::Singular), "{problem}");
        let known = Belief::new(Pose2::new(-0.9, -0.4, 0.5), 0.05, 0.05);
        let problem = localizer.locate_hull(&seen, Some(&known)).unwrap_err();
        assert!(matches!(problem, FloorProblem::Jump { .. }), "{problem}");
        let mask = BitImage::new(100, 100);
        assert_eq!(localizer.locate(&mask, None), Err(FloorProblem::ImageSizeError));
        let empty = BitImage::new(256, 220);
        assert_eq!(localizer.locate(&empty, None), Err(FloorProblem::TooFewCorners { corners: 0 }));
    }
}
