//! Known answers of the evidence from motion: floor warp, heights, mirror images, alignment and decisions over time.

use nalgebra::{DMatrix, Matrix3, Vector2, Vector3};
use serde_json::Value;
use yamabico_geometry::Pose2;
use yamabico_geometry::camera::{Intrinsics, Mount};
use yamabico_testkit::vectors::{cases, evidence};
use yamabico_vision::plane_motion::floor_view::FloorView;
use yamabico_vision::plane_motion::log_odds::CellRules;
use yamabico_vision::plane_motion::motion_prior::CommonCovariance;
use yamabico_vision::plane_motion::parallax::{Parallax, foot_ratio, height_m, mirrored};
use yamabico_vision::plane_motion::point_height::{Sighting, fit_point, linear_point};
use yamabico_vision::plane_motion::sequential_test::{
    ClassCosts, PointClass, SequentialRules, SequentialTest,
};
use yamabico_vision::plane_motion::sparse_alignment::{PixelPair, align_features};

#[test]
fn floor_homography() {
    for_each_case("floor_homography", |case| {
        let (view, motion) = (case.view(), case.motion());
        let height = case.input["plane_height"].as_f64().unwrap();
        let homography = view.homography(&motion, height);
        let scaled = homography / homography[(2, 2)];
        case.matrix("homography_current_to_previous", &scaled, 1.0);
        for (i, pixel) in case.pixels("pixels_current").into_iter().enumerate() {
            let warped = view.warp(&motion, height, pixel);
            case.maybe(warped, &case.expect["pixels_previous"][i], "pixels_previous");
        }
    });
}

#[test]
fn floor_jacobian() {
    for_each_case("floor_jacobian", |case| {
        let (view, motion) = (case.view(), case.motion());
        for (i, pixel) in case.pixels("pixels_current").into_iter().enumerate() {
            let warped = view.warp_jacobian(&motion, pixel).unwrap();
            case.maybe(Some(warped.pixel), &case.expect["pixels_previous"][i], "pixels_previous");
            for (row, expected) in case.expect["jacobians"][i].as_array().unwrap().iter().enumerate() {
                for (column, expected) in numbers(expected).into_iter().enumerate() {
                    case.close("jacobians", warped.jacobian[(row, column)], expected);
                }
            }
        }
    });
}

#[test]
fn mirror_image() {
    for_each_case("mirror_image", |case| {
        let (view, motion) = (case.view(), case.motion());
        let point = Vector3::from_column_slice(&numbers(&case.input["point_in_current_robot"]));
        let camera_height = view.position().z;
        for (name, point) in [("direct", point), ("mirrored", mirrored(point))] {
            let expect = &case.expect[name];
            let ratio = foot_ratio(camera_height, point.z);
            case.close("height", point.z, expect["height"].as_f64().unwrap());
            case.close("height from w", height_m(camera_height, ratio), point.z);
            case.close("s", 1.0 / ratio, expect["s"].as_f64().unwrap());
            case.close("w", ratio, expect["w"].as_f64().unwrap());
            let parallax = Parallax::of_point(&view, &motion, &point).unwrap();
            case.maybe(Some(parallax.current), &expect["pixel_current"], "pixel_current");
            case.maybe(Some(parallax.previous), &expect["pixel_previous"], "pixel_previous");
            case.maybe(parallax.floor, &expect["floor_prediction_previous"], "floor_prediction_previous");
            case.maybe(parallax.deviation(), &expect["parallax"], "parallax");
            case.maybe(parallax.foot_shift, &expect["floor_shift_previous_frame"], "floor_shift");
        }
    });
}

#[test]
fn point_height() {
    for_each_case("point_height", |case| {
        let view = case.view();
        let poses = case.input["robot_poses_in_reference"].as_array().unwrap();
        let pixels = case.pixels("pixels");
        let sightings: Vec<Sighting> = poses
            .iter()
            .zip(&pixels)
            .enumerate()
            .map(|(i, (pose, &pixel))| {
                let [x, y, theta] = numbers(pose)[..] else { panic!("{}: a pose of three", case.id) };
                let normal = &case.input["normals"][i];
                Sighting {
                    robot: Pose2::new(x, y, theta),
                    pixel,
                    normal: (!normal.is_null()).then(|| Vector2::from_column_slice(&numbers(normal))),
                    covariance: square::<3>(&case.input["motion_covariances"][i]),
                }
            })
            .collect();
        let linear = linear_point(&view, &sightings).unwrap();
        case.numbers("linear_point", linear.coords.as_slice());
        let mount_covariance = square::<3>(&case.input["mount_covariance_tilt_roll_height"]);
        let sigma_px = case.input["sigma_px"].as_f64().unwrap();
        let fit = fit_point(&view, &sightings, sigma_px, &mount_covariance).unwrap();
        case.numbers("bearing_distance_height", fit.values.as_slice());
        for (name, ours) in [
            ("covariance_pixel", fit.pixel_covariance),
            ("covariance_common", fit.common_covariance),
            ("covariance", fit.covariance()),
            ("sensitivity_to_tilt_roll_height", fit.mount_sensitivity),
        ] {
            case.matrix(name, &ours, largest(&case.expect[name]));
        }
    });
}

#[test]
fn common_mode() {
    for_each_case("common_mode", |case| {
        let prior: CommonCovariance = square::<5>(&case.input["prior_covariance"]);
        let (current, previous) = (case.pixels("pixels_current"), case.pixels("pixels_previous"));
        let mut pairs: Vec<PixelPair> = current
            .into_iter()
            .zip(previous)
            .map(|(current, previous)| PixelPair { current, previous, is_inlier: false })
            .collect();
        let sigma_px = case.input["sigma_px"].as_f64().unwrap();
        let found = align_features(&case.view(), &case.motion(), &prior, sigma_px, &mut pairs).unwrap();
        case.numbers("correction_x_y_theta_tilt_roll", found.offset.as_slice());
        let expected = square::<5>(&case.expect["covariance"]);
        let worst = (found.covariance - expected).amax();
        assert!(worst <= case.tolerance * expected.amax(), "{}: covariance by {worst}", case.id);
        let inliers: Vec<bool> = pairs.iter().map(|pair| pair.is_inlier).collect();
        assert_eq!(serde_json::to_value(inliers).unwrap(), case.expect["inliers"], "{}", case.id);
    });
}

#[test]
fn sequential_test() {
    let params = evidence("sequential_test")["params"].clone();
    let param = |key: &str| params[key].as_f64().unwrap();
    let rules = SequentialRules {
        cap: param("cap"),
        decay: param("decay"),
        accept: param("accept"),
        forget: param("forget"),
        fit_limit: param("fit_limit"),
    };
    assert_eq!(rules, SequentialRules::default());
    for_each_case("sequential_test", |case| {
        let mut test = SequentialTest::default();
        for (i, picture) in case.input["pictures"].as_array().unwrap().iter().enumerate() {
            let cost = |key: &str| picture[key].as_f64().unwrap();
            let costs = ClassCosts {
                floor: cost("floor"),
                above: cost("above"),
                below: cost("below"),
                expected: cost("expected"),
            };
            if picture["baseline_ok"].as_bool().unwrap() {
                test.add(&costs, &rules);
            }
            let expected: PointClass =
                serde_json::from_value(case.expect["states"][i].clone()).expect("a class");
            assert_eq!(test.class(), expected, "{}: picture {i}", case.id);
            for (ours, expected) in
                test.log_likelihood().into_iter().zip(numbers(&case.expect["log_likelihood"][i]))
            {
                case.close("log_likelihood", ours, expected);
            }
        }
    });
}

#[test]
fn grid_cell() {
    let params = evidence("grid_cell")["params"].clone();
    let param = |key: &str| params[key].as_f64().unwrap();
    let rules = CellRules {
        tau_s: param("tau"),
        min: param("lo"),
        max: param("hi"),
        hit_cap: param("hit_cap"),
        free_cap: param("free_cap"),
        above: param("p_above"),
        floor: param("p_floor"),
        below: param("p_below"),
        full_ratio: param("llr_full"),
    };
    assert_eq!(rules, CellRules::default());
    for_each_case("grid_cell", |case| {
        let mut log_odds = case.input["start"].as_f64().unwrap();
        for (i, picture) in case.input["pictures"].as_array().unwrap().iter().enumerate() {
            let above = picture["above"].as_array().unwrap().iter().map(numbers);
            let hit: f64 = above.map(|point| rules.evidence(rules.above, point[0]) * point[1]).sum();
            let free = |key: &str, weight| {
                numbers(&picture[key]).into_iter().map(|ratio| rules.evidence(weight, ratio)).sum::<f64>()
            };
            log_odds *= rules.decay(picture["dt"].as_f64().unwrap());
            log_odds = rules.add(log_odds, hit, free("floor", rules.floor) + free("below", rules.below));
            case.close("log_odds", log_odds, case.expect["log_odds"][i].as_f64().unwrap());
        }
    });
}

struct Case<'a> {
    id: &'a str,
    input: &'a Value,
    expect: &'a Value,
    tolerance: f64,
}

impl Case<'_> {
    fn view(&self) -> FloorView {
        let camera = |key: &str| self.input["camera"][key].as_f64().unwrap();
        let mount = |key: &str| self.input["mount"][key].as_f64().unwrap();
        let intrinsics = Intrinsics {
            fx: camera("fx"),
            fy: camera("fy"),
            cx: camera("cx"),
            cy: camera("cy"),
            width: camera("w") as u32,
            height: camera("h") as u32,
        };
        let mount = Mount {
            x: mount("x"),
            y: mount("y"),
            z: mount("z"),
            pan: mount("pan"),
            tilt: mount("tilt"),
            roll: mount("roll"),
        };
        FloorView::new(intrinsics, mount)
    }

    fn motion(&self) -> Pose2 {
        let value = |key: &str| self.input["motion"][key].as_f64().unwrap();
        Pose2::new(value("x"), value("y"), value("theta"))
    }

    fn pixels(&self, key: &str) -> Vec<Vector2<f64>> {
        let list = self.input[key].as_array().unwrap();
        list.iter().map(|pixel| Vector2::from_column_slice(&numbers(pixel))).collect()
    }

    fn close(&self, field: &str, ours: f64, expected: f64) {
        let limit = self.tolerance * (1.0 + expected.abs());
        assert!((ours - expected).abs() <= limit, "{}: {field} is {ours}, not {expected}", self.id);
    }

    fn numbers(&self, field: &str, ours: &[f64]) {
        let expected = numbers(&self.expect[field]);
        assert_eq!(ours.len(), expected.len(), "{}: {field}", self.id);
        for (ours, expected) in ours.iter().zip(expected) {
            self.close(field, *ours, expected);
        }
    }

    /// Compares a matrix, relative to `scale`.
    fn matrix(&self, field: &str, ours: &Matrix3<f64>, scale: f64) {
        let expected = square::<3>(&self.expect[field]);
        for (ours, expected) in ours.iter().zip(&expected) {
            let limit = self.tolerance * scale * (1.0 + expected.abs() / scale);
            assert!((ours - expected).abs() <= limit, "{}: {field} is {ours}, not {expected}", self.id);
        }
    }

    fn maybe(&self, ours: Option<Vector2<f64>>, expected: &Value, field: &str) {
        assert_eq!(ours.is_none(), expected.is_null(), "{}: {field} {ours:?}", self.id);
        for (ours, expected) in ours.iter().flat_map(|p| [p.x, p.y]).zip(numbers(expected)) {
            self.close(field, ours, expected);
        }
    }
}

fn for_each_case(name: &str, check: impl Fn(&Case)) {
    let file = evidence(name);
    for case in cases(&file) {
        check(&Case {
            id: case["id"].as_str().unwrap(),
            input: &case["input"],
            expect: &case["expect"],
            tolerance: file["tolerance"].as_f64().unwrap(),
        });
    }
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().into_iter().flatten().map(|x| x.as_f64().unwrap()).collect()
}

fn square<const N: usize>(value: &Value) -> nalgebra::SMatrix<f64, N, N> {
    let rows: Vec<f64> = value.as_array().unwrap().iter().flat_map(numbers).collect();
    let matrix = DMatrix::from_row_slice(N, N, &rows);
    nalgebra::SMatrix::from_fn(|row, column| matrix[(row, column)])
}

/// Largest entry of a matrix of the known answers.
fn largest(value: &Value) -> f64 {
    square::<3>(value).amax()
}
