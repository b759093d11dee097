//! Known answers of the vision modules: segment_fit, segment_image, median3 and vp_vote_refine.

use crate::vote_density::{VoteKernel, vote_density, vote_peak};
use nalgebra::Vector2;
use serde_json::Value;
use std::f64::consts::PI;
use yamabico_geometry::camera::Intrinsics;
use yamabico_geometry::image::{GrayImage, ImageView};
use yamabico_testkit::vectors::perspective;
use yamabico_vision::median::Median3;
use yamabico_vision::segment_fit::fit_segment;
use yamabico_vision::segments::{Segment, SegmentConfig, SegmentDetector};
use yamabico_vision::vanishing_point::{
    RefineRule, VanishingPointConfig, VanishingPointError, VanishingPointFinder, VotingLine, refine,
};

#[test]
fn segment_fit() {
    for_each_case("segment_fit", |case| {
        let points = pairs(&case.input["points"]);
        let fit = fit_segment(points.iter().copied()).unwrap();
        let line = fit.line;
        case.check("centroid", line.centroid.as_slice());
        case.check("length", &[(fit.p1 - fit.p0).norm()]);
        case.check("rms", &[line.rms]);
        case.check("sigma_mid", &[line.sigma_mid]);
        case.check("sigma_angle", &[line.sigma_angle]);
        let expected = case.expect["direction_angle"].as_f64().unwrap();
        let difference = (line.angle - expected).rem_euclid(PI);
        assert!(difference.min(PI - difference) <= case.tolerance("direction_angle"), "{}: angle", case.id);
        // Near the vertical the direction is ambiguous; all signed values follow it.
        let is_turned = (line.angle - expected).abs() > 1.0;
        let (p0, p1) = if is_turned { (fit.p1, fit.p0) } else { (fit.p0, fit.p1) };
        let sign = if is_turned { -1.0 } else { 1.0 };
        case.check("p0", p0.as_slice());
        case.check("p1", p1.as_slice());
        case.check("normal", (line.normal * sign).as_slice());
        case.check("rho", &[line.rho * sign]);
    });
}

#[test]
fn segment_image() {
    for_each_case("segment_image", |case| {
        let number = |key: &str| case.input[key].as_f64().unwrap();
        let (width, height) = (number("width") as usize, number("height") as usize);
        let (sin, cos) = number("alpha_deg").to_radians().sin_cos();
        let (low, high, blur) = (number("lo"), number("hi"), number("blur_width"));
        let mut data = vec![0; width * height];
        for (i, pixel) in data.iter_mut().enumerate() {
            let across = (i % width) as f64 * cos + (i / width) as f64 * sin - number("rho");
            *pixel = (low + (high - low) * (0.5 + across / blur).clamp(0.0, 1.0)).round() as u8;
        }
        let mut detector = SegmentDetector::new(SegmentConfig::default());
        let image = ImageView::new(&data, width, height, width).unwrap();
        // A single edge is rejected, but remains available.
        let found =
            detector.detect(image).map(<[Segment]>::len).unwrap_or_else(|_| detector.segments().len());
        let min = case.expect["segments_min"].as_u64().unwrap() as usize;
        let max = case.expect["segments_max"].as_u64().unwrap() as usize;
        assert!((min..=max).contains(&found), "{}: {found} segments", case.id);
        let strongest = detector
            .segments()
            .iter()
            .max_by(|a, b| (a.mean_gradient * a.length).total_cmp(&(b.mean_gradient * b.length)))
            .unwrap();
        let alpha = strongest.normal.y.atan2(strongest.normal.x);
        let difference = (alpha - case.expect["alpha"].as_f64().unwrap()).rem_euclid(PI);
        assert!(difference.min(PI - difference) <= case.tolerance("alpha"), "{}: alpha {alpha}", case.id);
        let expected_normal = Vector2::new(cos, sin);
        let rho = strongest.rho * strongest.normal.dot(&expected_normal).signum();
        assert!((rho - number("rho")).abs() <= case.tolerance("rho"), "{}: rho {rho}", case.id);
    });
}

#[test]
fn median3() {
    for_each_case("median3", |case| {
        let (data, width, height) = image_of(&case.input["image"]);
        let (expected, ..) = image_of(&case.expect["image"]);
        let mut out = GrayImage::default();
        Median3::default().filter(ImageView::new(&data, width, height, width).unwrap(), &mut out);
        assert_eq!(out.pixels(), expected, "{}", case.id);
    });
}

#[test]
fn vp_vote_refine() {
    let params = perspective("vp_vote_refine")["params"].clone();
    let param = |key: &str| params[key].as_f64().unwrap();
    let kernel = VoteKernel {
        sigma_times_length_px2: param("c_sigma_px2"),
        sigma_min_px: param("sigma_min"),
        sigma_max_px: param("sigma_max"),
    };
    let rule = RefineRule {
        sigma_end_px: param("sigma_endpoint"),
        gate_min_px: param("gate_min_px"),
        first_gate_px: param("gate_min_px"),
        sigma_floor_px: 0.0,
        min_eigen_ratio: param("kappa_eig_ratio"),
        step_px: 1e-12,
        max_rounds: 200,
    };
    for_each_case("vp_vote_refine", |case| {
        let lines: Vec<VotingLine> = case.input["segments"]
            .as_array()
            .unwrap()
            .iter()
            .enumerate()
            .map(|(i, ends)| {
                let [u0, v0, u1, v1] = numbers(ends)[..] else { panic!("{}: a segment of four", case.id) };
                let segment = Segment::between(Vector2::new(u0, v0), Vector2::new(u1, v1), 0.5).unwrap();
                VotingLine::new(i, &segment)
            })
            .collect();
        check_votes(case, &lines, &kernel);
        check_refined(case, &lines, &rule);
        check_found(case, &rule);
    });
}

/// The full search ends at the same point as the refinement; with outliers, within its standard deviation.
fn check_found(case: &Case, rule: &RefineRule) {
    let refined = &case.expect["refined"];
    let is_searched = refined["inliers"].as_array().is_some_and(|inliers| inliers.len() >= 3);
    if refined["status"] != "ok" || !is_searched {
        return;
    }
    let segments: Vec<Segment> = case.input["segments"]
        .as_array()
        .unwrap()
        .iter()
        .map(|ends| {
            let ends = numbers(ends);
            Segment::between(Vector2::new(ends[0], ends[1]), Vector2::new(ends[2], ends[3]), 0.5).unwrap()
        })
        .collect();
    let camera = Intrinsics::from_horizontal_fov(640, 480, 1.0);
    let config = VanishingPointConfig {
        refine: RefineRule { first_gate_px: 8.0, ..*rule },
        horizon_sigma_rad: 10.0,
        vertical_rad: 0.0,
        horizontal_rad: 0.0,
        min_length_px: 0.0,
        max_sigma_px: 100.0,
        ..VanishingPointConfig::default()
    };
    let mut finder = VanishingPointFinder::new(config);
    let found = finder.find(&segments, &camera, None).unwrap_or_else(|e| panic!("{}: {e}", case.id));
    let vp = numbers(&refined["vp"]);
    let cov = &refined["cov"];
    let sigma_px = (cov[0][0].as_f64().unwrap() + cov[1][1].as_f64().unwrap()).sqrt();
    let apart_px = (found.pixel - Vector2::new(vp[0], vp[1])).norm();
    // Among outliers there are several sets of lines that agree; without, there is one.
    let limit_px = if numbers(&refined["inliers"]).len() == segments.len() { 1e-5 } else { sigma_px };
    assert!(apart_px <= limit_px, "{}: {apart_px} px from the reference, sigma {sigma_px} px", case.id);
}

fn check_votes(case: &Case, lines: &[VotingLine], kernel: &VoteKernel) {
    if case.input["window"].is_null() {
        return;
    }
    let [u0, u1, v0, v1] = numbers(&case.input["window"])[..] else { panic!("{}: window", case.id) };
    let (peak, value) = vote_peak(lines, u0 as i32..=u1 as i32, v0 as i32..=v1 as i32, kernel).unwrap();
    assert_eq!(
        vec![f64::from(peak.x), f64::from(peak.y)],
        numbers(&case.expect["belief_peak"]),
        "{}",
        case.id
    );
    case.check("belief_peak_value", &[value]);
    for probe in case.expect["belief_probe"].as_array().into_iter().flatten() {
        let at = numbers(&probe["at"]);
        let value = vote_density(lines, Vector2::new(at[0], at[1]), kernel);
        case.close("belief_probe", value, probe["value"].as_f64().unwrap());
    }
}

fn check_refined(case: &Case, lines: &[VotingLine], rule: &RefineRule) {
    let expect = &case.expect["refined"];
    let start = numbers(&case.input["start"]);
    let mut inliers = Vec::new();
    let refined = refine(lines, Vector2::new(start[0], start[1]), rule, &mut inliers);
    match expect["status"].as_str().unwrap() {
        "ok" => {
            let refined = refined.unwrap_or_else(|e| panic!("{}: {e}", case.id));
            let expected: Vec<usize> = numbers(&expect["inliers"]).iter().map(|&i| i as usize).collect();
            assert_eq!(inliers, expected, "{}", case.id);
            let vp = numbers(&expect["vp"]);
            case.close("vp", refined.pixel.x, vp[0]);
            case.close("vp", refined.pixel.y, vp[1]);
            for (row, expected) in expect["cov"].as_array().unwrap().iter().enumerate() {
                for (column, expected) in numbers(expected).into_iter().enumerate() {
                    case.close("cov", refined.covariance[(row, column)], expected);
                }
            }
            case.close("chi2", refined.chi2, expect["chi2"].as_f64().unwrap());
            case.close("eig_ratio", refined.eigen_ratio, expect["eig_ratio"].as_f64().unwrap());
        }
        "too_few" => {
            assert!(matches!(refined, Err(VanishingPointError::TooFewSegments { .. })), "{}", case.id);
        }
        "degenerate" => assert_eq!(refined, Err(VanishingPointError::Degenerate), "{}", case.id),
        other => panic!("{}: unknown status {other}", case.id),
    }
}

struct Case<'a> {
    id: &'a str,
    input: &'a Value,
    expect: &'a Value,
    tol: &'a Value,
    file_tolerance: f64,
}

impl Case<'_> {
    fn tolerance(&self, field: &str) -> f64 {
        self.tol.as_f64().or_else(|| self.tol[field].as_f64()).unwrap_or(self.file_tolerance)
    }

    fn close(&self, field: &str, ours: f64, expected: f64) {
        let limit = self.tolerance(field) * expected.abs().max(1.0);
        assert!((ours - expected).abs() <= limit, "{}: {field} is {ours}, not {expected}", self.id);
    }

    fn check(&self, field: &str, ours: &[f64]) {
        let expected = numbers(&self.expect[field]);
        assert_eq!(ours.len(), expected.len(), "{}: {field}", self.id);
        for (ours, expected) in ours.iter().zip(expected) {
            self.close(field, *ours, expected);
        }
    }
}

fn for_each_case(name: &str, check: impl Fn(&Case)) {
    let file = perspective(name);
    let cases = file["cases"].as_array().unwrap();
    assert!(!cases.is_empty(), "{name} has no cases");
    for case in cases {
        check(&Case {
            id: case["id"].as_str().unwrap(),
            input: &case["input"],
            expect: &case["expect"],
            tol: &case["tol"],
            file_tolerance: file["tolerance"].as_f64().unwrap(),
        });
    }
}

/// A number, or a list of numbers.
fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(list) => list.iter().map(|x| x.as_f64().unwrap()).collect(),
        _ => vec![value.as_f64().unwrap()],
    }
}

fn pairs(value: &Value) -> Vec<Vector2<f64>> {
    value.as_array().unwrap().iter().map(|p| Vector2::from_column_slice(&numbers(p))).collect()
}

fn image_of(value: &Value) -> (Vec<u8>, usize, usize) {
    let rows: Vec<Vec<f64>> = value.as_array().unwrap().iter().map(numbers).collect();
    let (width, height) = (rows[0].len(), rows.len());
    (rows.into_iter().flatten().map(|x| x as u8).collect(), width, height)
}
