//! Known answers of the localization by azimuths and by the outline of the floor.

use nalgebra::{Matrix3, Point2, Vector2};
use serde_json::Value;
use yamabico_core::camera::{FloorFormula, HyperboloidalMirror, Mirror, MirrorCamera, MirrorImage};
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_map_localizer::azimuth::{
    BearingPair, EdgeLandmark, JointCompatibility, JointRule, LeverArm, Loss, PanSearch, SeenBearing,
    SolverRule, most_likely_pose,
};
use yamabico_map_localizer::belief::Belief;
use yamabico_map_localizer::floor_outline::{
    Fit, FitRule, FloorLocalizer, FloorOutline, FloorPlan, FloorProblem, FloorRule, LineMeasurement,
    NormalEquations, OutlineFitter, OutlineRule, PlanPlacement,
};
use yamabico_testkit::vectors::{for_each_case, hash_of_mask, list, number, omni};
use yamabico_vision::azimuth_profile::EdgeSign;
use yamabico_vision::bit_image::BitImage;
use yamabico_vision::polygon::{contains, convex_hull};

fn point(value: &Value) -> Point2<f64> {
    Point2::new(number(&value[0]), number(&value[1]))
}

fn points(value: &Value) -> Vec<Point2<f64>> {
    list(value).iter().map(point).collect()
}

fn pose(value: &Value) -> Pose2 {
    Pose2::new(number(&value[0]), number(&value[1]), number(&value[2]))
}

fn matrix(value: &Value) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| number(&value[i][j]))
}

fn sign(value: &Value) -> Option<EdgeSign> {
    Some(if number(value) > 0.0 { EdgeSign::Brighter } else { EdgeSign::Darker })
}

fn close(actual: f64, expected: f64, tolerance: f64, what: &str) {
    let error = (actual - expected).abs();
    assert!(error <= tolerance * (1.0 + expected.abs()), "{what}: {actual}, not {expected}");
}

fn close_pose(actual: &Pose2, expected: &Pose2, tolerance: f64, what: &str) {
    close(actual.x, expected.x, tolerance, what);
    close(actual.y, expected.y, tolerance, what);
    assert!(angle_difference(actual.theta, expected.theta).abs() <= tolerance, "{what}: heading");
}

fn close_matrix(actual: &Matrix3<f64>, expected: &Value, tolerance: f64, what: &str) {
    for i in 0..3 {
        for j in 0..3 {
            close(actual[(i, j)], number(&expected[i][j]), tolerance, what);
        }
    }
}

#[test]
fn copis_association() {
    for_each_case(&omni("copis_association"), |case, id| {
        let belief = Belief { pose: pose(&case["predicted"]), covariance: matrix(&case["cov"]) };
        let landmarks: Vec<_> = list(&case["landmarks"])
            .iter()
            .map(|edge| EdgeLandmark { position: point(edge), sign: sign(&edge[2]), sigma_m: 0.0 })
            .collect();
        let sigma_rad = number(&case["sigma"]);
        let seen: Vec<_> = list(&case["detections"])
            .iter()
            .map(|edge| SeenBearing { azimuth_rad: number(&edge[0]), sign: sign(&edge[1]), sigma_rad })
            .collect();
        let expected: Vec<_> =
            list(&case["assignment"]).iter().map(|n| usize::try_from(n.as_i64().unwrap()).ok()).collect();
        let strict = JointRule { conditional_gate: f64::INFINITY, ..JointRule::default() };
        for rule in [strict, JointRule::default()] {
            let mut joint = JointCompatibility::new(rule, 20);
            let pairing = joint.pair(&belief, LeverArm::zeros(), &landmarks, &seen);
            assert_eq!(joint.landmark_of_seen(), expected, "{id}");
            close(pairing.distance_squared, number(&case["joint_d2"]), 1e-8, id);
            assert!(pairing.is_complete, "{id}");
            for (edge, expected) in list(&case["individual_candidates"]).iter().enumerate() {
                let mut found: Vec<_> = joint.candidates_of(edge).collect();
                found.sort_unstable();
                let expected: Vec<_> = list(expected).iter().map(|n| n.as_u64().unwrap() as usize).collect();
                assert_eq!(found, expected, "{id}: edge {edge}");
            }
        }
    });
}

#[test]
fn copis_localize() {
    for_each_case(&omni("copis_localize"), |case, id| {
        let sigma_rad = number(&case["sigma"]);
        let pairs = |list_of: &Value| -> Vec<BearingPair> {
            list(list_of)
                .iter()
                .map(|pair| BearingPair {
                    landmark: EdgeLandmark { position: point(&pair[0]), sign: None, sigma_m: 0.0 },
                    seen: SeenBearing { azimuth_rad: number(&pair[1]), sign: None, sigma_rad },
                })
                .collect()
        };
        let clean = pairs(&case["pairs"]);
        let predicted = pose(&case["predicted"]);
        let prior = Belief { pose: predicted, covariance: matrix(&case["prior_cov"]) };
        let lever = LeverArm::zeros();

        let search = &case["pan_search"];
        let found = PanSearch::default().find(&clean, predicted.theta).unwrap();
        assert_eq!(i64::from(found.step), search["k"].as_i64().unwrap(), "{id}");
        let pose_of = |at: &str, pan: &str| {
            let position = point(&search[at]);
            Pose2::new(position.x, position.y, number(&search[pan]))
        };
        close_pose(&found.coarse, &pose_of("pos", "pan"), 1e-8, id);
        close_pose(&found.pose, &pose_of("pos_refined", "pan_refined"), 1e-8, id);
        close(found.cost, number(&search["cost"]), 1e-8, id);

        for (key, prior) in [("gn", None), ("map", Some(&prior))] {
            let found = most_likely_pose(&clean, &predicted, prior, &SolverRule::exact(Loss::Squares), lever)
                .unwrap();
            close_pose(&found.belief.pose, &pose(&case[key]["pose"]), 1e-8, &format!("{id}: {key}"));
            close_matrix(&found.belief.covariance, &case[key]["cov"], 1e-8, &format!("{id}: {key}"));
            close(found.chi_squared, number(&case[key]["chi2"]), 1e-8, &format!("{id}: {key}"));
        }
        let with_outlier = pairs(&case["huber_map"]["outlier_pairs"]);
        let rule = SolverRule::exact(Loss::Huber(1.345));
        let found = most_likely_pose(&with_outlier, &predicted, Some(&prior), &rule, lever).unwrap();
        close_pose(&found.belief.pose, &pose(&case["huber_map"]["pose"]), 1e-8, &format!("{id}: huber"));
    });
}

#[test]
fn sek_linstep() {
    for_each_case(&omni("sek_linstep"), |case, id| {
        let mut equations = NormalEquations::default();
        for (i, at) in list(&case["points"]).iter().enumerate() {
            equations.add(&LineMeasurement {
                point: point(at).coords,
                normal: point(&case["normals"][i]).coords,
                offset: number(&case["offsets"][i]),
                weight: number(&case["weights"][i]),
                shift_slope: 0.0,
            });
        }
        let (matrix, right) = equations.pose_block();
        let size = matrix.amax();
        for i in 0..3 {
            for j in 0..3 {
                let error = (matrix[(i, j)] - number(&case["N"][i][j])).abs();
                assert!(error <= 1e-9 * size, "{id}: matrix");
            }
            close(right[i], number(&case["g"][i]), 1e-9, id);
        }
        match case["abz"].as_array() {
            None => assert_eq!(equations.solve_pose(1000.0), None, "{id}"),
            Some(expected) => {
                close(equations.condition(1000.0), number(&case["cond_scaled"]), 1e-9, id);
                let (step, _) = equations.solve_pose(1000.0).unwrap();
                for i in 0..3 {
                    close(step[i], number(&expected[i]), 1e-9, id);
                }
            }
        }
    });
}

const OUTLINE: OutlineRule = OutlineRule { height_m: 0.165, max_radius_px: 108.0 };
/// Height of the effective viewpoint, mm.
const FOCUS_MM: f64 = 205.083_716_678_843_8;

fn camera() -> MirrorCamera {
    let formula = FloorFormula { a: 10_120.0, b: 20.54, c: 2.298e5 };
    let mirror = HyperboloidalMirror::from_floor_formula(formula, OUTLINE.height_m).unwrap();
    let image = MirrorImage::centered(256, 220).with_ring(1.0, 113.5).unwrap();
    MirrorCamera::new(image, Mirror::Hyperboloidal(mirror)).unwrap()
}

fn field() -> FloorPlan {
    FloorPlan::football_field(1.37, 1.55, 0.7625, 0.25).unwrap()
}

fn exact() -> FitRule {
    FitRule {
        min_shift_m: 1e-12,
        min_turn_rad: 1e-12,
        min_shift_px: 1e-9,
        max_iterations: 60,
        ..FitRule::default()
    }
}

/// Returns the number of a line in the paper: back of the goal, end line and side line on the positive side, then
/// those on the negative side.
fn paper_line(plan: &FloorPlan, line: usize) -> u64 {
    let (normal, offset) = plan.line(line).unwrap();
    let first = match () {
        () if normal.y.abs() > 0.5 => 3,
        () if offset > 1.5 => 1,
        () => 2,
    };
    if normal.x + normal.y > 0.0 { first } else { first + 3 }
}

fn pose_mm(placement: &PlanPlacement) -> [Pose2; 2] {
    let PlanPlacement { center, axis_rad } = *placement;
    let robot_from_plan = Pose2::new(1e3 * center.x, 1e3 * center.y, axis_rad);
    let one = robot_from_plan.inverse();
    [one, Pose2::new(0.0, 0.0, std::f64::consts::PI).compose(&one)]
}

fn fit(outline: &mut FloorOutline, rule: &FitRule) -> (Fit, PlanPlacement, Vec<u64>) {
    let (plan, camera) = (field(), camera());
    let mut fitter = OutlineFitter::default();
    let start = fitter.initial_placement(outline).unwrap();
    let fit = fitter.fit(outline, &plan, start, rule, (&camera, &OUTLINE)).unwrap();
    (fit, start, fitter.lines().map(|line| paper_line(&plan, line)).collect())
}

/// Returns the mask of the field's floor seen by a camera, with boxes on it.
fn render(truth: &Pose2, boxes: &[Value], height_mm: f64, camera: &MirrorCamera) -> BitImage {
    let (a, b, w, g) = (1370.0, 1550.0, 762.5, 250.0);
    let half = [(b, -g), (b, g), (a, g), (a, w), (-a, w), (-a, g)];
    let field: Vec<_> =
        half.into_iter().chain(half.map(|(x, y)| (-x, -y))).map(|(x, y)| Point2::new(x, y)).collect();
    let robot = truth.position();
    let shadows: Vec<Vec<_>> = boxes
        .iter()
        .map(|at| {
            let [x, y, side, yaw] = [0, 1, 2, 3].map(|i| number(&at[i]));
            let box_pose = Pose2::new(x, y, yaw);
            let half = 0.5 * side;
            let mut corners: Vec<_> = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                .map(|(i, j)| box_pose.transform_point(Point2::new(i * half, j * half)))
                .to_vec();
            let far = FOCUS_MM / (FOCUS_MM - height_mm);
            corners.extend(corners.clone().iter().map(|corner| robot + (corner - robot) * far));
            let mut hull = Vec::new();
            convex_hull(&mut corners, &mut hull);
            hull
        })
        .collect();
    let mut mask = BitImage::new(256, 220);
    for v in 0..220 {
        for u in 0..256 {
            let at = camera.image().mirror_from_pixel(Vector2::new(u as f64, v as f64));
            let radius = at.norm();
            if radius >= OUTLINE.max_radius_px {
                continue;
            }
            // The center within 1 px is outside of the ring and always on the floor.
            let floor = camera.floor_radius_m(radius.max(1.0), OUTLINE.height_m).unwrap();
            let on_map = truth.transform_point(Point2::from(at * (1e3 * floor / radius.max(1.0))));
            if contains(&field, on_map) && !shadows.iter().any(|shadow| contains(shadow, on_map)) {
                mask.set(u, v);
            }
        }
    }
    mask
}

/// Returns the hash of all pixels, row by row.
fn hash(mask: &BitImage) -> String {
    let rows = (0..mask.height()).flat_map(|v| (0..mask.width()).map(move |u| mask.get(u, v)));
    hash_of_mask(rows)
}

#[test]
fn sek_selfloc() {
    let camera = camera();
    let mut rendered = 0;
    for_each_case(&omni("sek_selfloc"), |case, id| {
        let hull = points(&case["hull"]);
        let expect = &case["expect"];
        if case["kind"] == "failure" {
            let mut localizer = FloorLocalizer::new(field(), camera.clone(), FloorRule::new(OUTLINE));
            let problem = localizer.locate_hull(&hull, None).unwrap_err();
            let name = match problem {
                FloorProblem::TooFewCorners { .. } => "too_few_points",
                FloorProblem::Singular | FloorProblem::Gap { .. } | FloorProblem::Area { .. } => {
                    "singular_or_low_coverage"
                }
                other => panic!("{id}: {other}"),
            };
            assert_eq!(Some(name), expect["reason"].as_str(), "{id}");
            return;
        }
        let truth = pose(&case["true_pose"]);
        let mut outline = FloorOutline::default();
        let is_rendered = case["kind"] == "rendered_mask";
        if is_rendered {
            let mask = render(&truth, list(&case["boxes"]), number(&case["box_height"]), &camera);
            assert_eq!(u64::from(mask.count()), case["ones"].as_u64().unwrap(), "{id}");
            assert_eq!(Some(hash(&mask).as_str()), case["fnv1a64"].as_str(), "{id}");
            outline.take_mask(&mask, &camera, &OUTLINE).unwrap();
            assert_eq!(outline.hull().len(), hull.len(), "{id}");
            assert!(hull.iter().all(|corner| outline.hull().contains(corner)), "{id}");
            rendered += 1;
        }
        outline.take_hull(&hull, &camera, &OUTLINE);
        let (found, start, lines) = fit(&mut outline, &exact());
        assert!(found.is_converged, "{id}");
        close(1e3 * start.center.x, number(&expect["g0"][0]), 1e-9, id);
        close(1e3 * start.center.y, number(&expect["g0"][1]), 1e-9, id);
        assert!((start.axis_rad - number(&expect["psi0"])).sin().abs() < 1e-9, "{id}: axis");
        let heading = case["predicted_heading"].as_f64().unwrap_or(truth.theta);
        let mut poses = pose_mm(&found.placement);
        poses.sort_by(|a, b| {
            let off = |pose: &Pose2| angle_difference(pose.theta, heading).abs();
            off(a).total_cmp(&off(b))
        });
        for (pose_of, key) in poses.iter().zip(["pose", "other"]) {
            let expected = pose(&expect[key]);
            assert!(pose_of.distance(&expected) < 1e-6, "{id}: {pose_of:?}, not {expected:?}");
            assert!(angle_difference(pose_of.theta, expected.theta).abs() < 1e-9, "{id}: heading");
        }
        assert!((found.rms_px - number(&expect["rms_px"])).abs() < 1e-8, "{id}: rms");
        if is_rendered {
            let expected: Vec<_> =
                list(&expect["line_of_point"]).iter().map(|line| line.as_u64().unwrap()).collect();
            // If the axis points the other way, the lines are those of the opposite side.
            let turned: Vec<_> = lines.iter().map(|line| (line + 2) % 6 + 1).collect();
            assert!(lines == expected || turned == expected, "{id}: {lines:?}");
            assert_eq!(u64::from(found.iterations), expect["iters_converged"].as_u64().unwrap(), "{id}");
            for (axis, unit) in [1e3, 1e3, 1.0].into_iter().enumerate() {
                let expected = number(&expect["first_step"][axis]);
                close(unit * found.first_step[axis].abs(), expected.abs(), 1e-7, id);
            }
        } else {
            assert!(poses[0].distance(&truth) < 1e-6 || case["kind"] == "ambiguity", "{id}: truth");
        }
    });
    assert!(rendered > 0);
}

#[test]
fn sek_selfloc_bias() {
    for_each_case(&omni("sek_selfloc_bias"), |case, id| {
        let hull = points(&case["hull"]);
        let truth = pose(&case["true_pose"]);
        let find = |rule: &FitRule| {
            let mut outline = FloorOutline::default();
            outline.take_hull(&hull, &camera(), &OUTLINE);
            let (found, ..) = fit(&mut outline, rule);
            let off = |pose: &Pose2| angle_difference(pose.theta, truth.theta).abs();
            let [one, other] = pose_mm(&found.placement);
            (found, if off(&one) < off(&other) { one } else { other })
        };
        let (found, with_shift) = find(&FitRule { shift_sigma_px: Some(f64::INFINITY), ..exact() });
        let expected = pose(&case["pose"]);
        let distance = with_shift.distance(&expected);
        assert!(distance < 1e-6, "{id}: {distance} mm");
        assert!(angle_difference(with_shift.theta, expected.theta).abs() < 1e-9, "{id}: heading");
        assert!((found.shift_px - number(&case["beta"])).abs() < 1e-9, "{id}: shift");
        // Without the shift, corners are outside of the plan and equally far from two lines, so the result depends on
        // rounding. It must be worse; the value is not compared.
        let (_, without) = find(&exact());
        assert!(without.distance(&truth) >= with_shift.distance(&truth) - 1e-6, "{id}: without");
    });
}
