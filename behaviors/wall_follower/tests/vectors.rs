//! Known answers of the corridor's geometry.

use nalgebra::{Vector2, Vector3};
use serde_json::Value;
use yamabico_core::camera::{Intrinsics, Mount};
use yamabico_core::geometry::Pose2;
use yamabico_testkit::vectors::perspective;
use yamabico_vision::corridor::heading::{CameraAttitude, RobotHeading, vanishing_point_homogeneous};
use yamabico_vision::corridor::wall_distance::{
    CorridorView, distance_from_slope, inverse_slope, line_through, width_from_slopes,
};
use yamabico_wall_follower::centering::{Centering, Walls};

struct Case<'a> {
    id: &'a str,
    input: &'a Value,
    expect: &'a Value,
    tolerance: &'a Value,
    default_tolerance: f64,
}

impl Case<'_> {
    fn close(&self, field: &str, actual: f64, expected: &Value) {
        let expected = expected.as_f64().unwrap_or_else(|| panic!("{} {field}: no number expected", self.id));
        let tolerance =
            self.tolerance.as_f64().or(self.tolerance[field].as_f64()).unwrap_or(self.default_tolerance);
        let bound = tolerance * expected.abs().max(1.0);
        assert!((actual - expected).abs() <= bound, "{} {field}: {actual}, expected {expected}", self.id);
    }

    fn if_given(&self, field: &str, actual: f64) {
        if !self.expect[field].is_null() {
            self.close(field, actual, &self.expect[field]);
        }
    }

    fn number(&self, field: &str) -> f64 {
        self.input[field].as_f64().unwrap_or_else(|| panic!("{} has no {field}", self.id))
    }
}

fn for_each_case(name: &str, check: impl Fn(&Value, &Case<'_>)) {
    let file = perspective(name);
    let cases = file["cases"].as_array().expect("cases");
    assert!(!cases.is_empty(), "{name} holds no case");
    for case in cases {
        check(
            &file,
            &Case {
                id: case["id"].as_str().unwrap_or("?"),
                input: &case["input"],
                expect: &case["expect"],
                tolerance: &case["tol"],
                default_tolerance: file["tolerance"].as_f64().expect("tolerance"),
            },
        );
    }
}

fn f(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

fn point(value: &Value) -> Vector2<f64> {
    Vector2::new(f(&value[0]), f(&value[1]))
}

/// Returns the pixel of a point of the corridor (x along it, y to the left, z up).
fn pixel_of(point: Vector3<f64>, robot: Pose2, mount: &Mount, intrinsics: &Intrinsics) -> Vector2<f64> {
    let (sin, cos) = robot.theta.sin_cos();
    let (along, across) = (point.x - robot.x, point.y - robot.y);
    let in_robot = Vector3::new(cos * along + sin * across, cos * across - sin * along, point.z);
    let in_body = in_robot - Vector3::new(mount.x, mount.y, mount.z);
    let in_camera = mount.rotation_body_from_camera().transpose() * in_body;
    intrinsics.pixel_from_normalized(in_camera.xy() / in_camera.z)
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::new(f(&value[0]), f(&value[1]), f(&value[2]))
}

#[test]
fn corridor_pose() {
    for_each_case("corridor_pose", |_, case| {
        let (c, m) = (&case.input["camera"], &case.input["mount"]);
        let intrinsics = Intrinsics {
            fx: f(&c["fx"]),
            fy: f(&c["fy"]),
            cx: f(&c["cx"]),
            cy: f(&c["cy"]),
            width: f(&c["w"]) as u32,
            height: f(&c["h"]) as u32,
        };
        let mount = Mount {
            x: f(&m["x"]),
            y: f(&m["y"]),
            z: f(&m["z"]),
            pan: f(&m["pan"]),
            tilt: f(&m["tilt"]),
            roll: f(&m["roll"]),
        };
        let robot_heading = case.number("robot_heading");
        let homogeneous = vanishing_point_homogeneous(robot_heading, &mount, &intrinsics);
        let vp = homogeneous.xy() / homogeneous.z;
        let behind = homogeneous.z < 0.0;
        if !case.expect["vp"].is_null() {
            case.close("vp", vp.x, &case.expect["vp"][0]);
            case.close("vp", vp.y, &case.expect["vp"][1]);
        }
        if let Some(expected) = case.expect["vp_behind"].as_bool() {
            assert_eq!(behind, expected, "{} vp_behind", case.id);
        }

        let side = if behind { -1.0 } else { 1.0 };
        let axis = intrinsics.normalized_from_pixel(vp).push(1.0) * side;
        let attitude = CameraAttitude::from_axis(axis, mount.roll);
        let robot = RobotHeading::from_axis(axis, &mount);
        case.if_given("camera_heading", attitude.heading);
        case.if_given("tilt", attitude.tilt);
        case.if_given("robot_heading", robot.heading);
        assert!(robot.elevation.abs() < 1e-9, "{} elevation", case.id);
        if !behind {
            let simple =
                CameraAttitude::from_vanishing_point(intrinsics.normalized_from_pixel(vp), mount.roll);
            assert!((simple.heading - attitude.heading).abs() < 1e-9, "{} simple form", case.id);
        }
        let jacobian = &case.expect["jac_heading_tilt_wrt_normalised_vp"];
        if !jacobian.is_null() {
            for row in 0..2 {
                for column in 0..2 {
                    case.close("jac", attitude.jacobian()[(row, column)], &jacobian[row][column]);
                }
            }
        }

        let view = CorridorView::new(attitude, mount.roll, mount.z, intrinsics);
        let mut distances = [None, None];
        let mut slopes = [None, None];
        for (index, name) in ["left", "right"].into_iter().enumerate() {
            let wall = &case.expect["walls"][name];
            if wall.is_null() {
                continue;
            }
            let robot = Pose2::new(0.0, case.number("robot_y"), robot_heading);
            let wall_y = case.number(&format!("wall_{name}_y"));
            let seen = |x_m: f64| pixel_of(Vector3::new(x_m, wall_y, 0.0), robot, &mount, &intrinsics);
            let line = line_through(seen(4.0), seen(9.0));
            let expected_line = vector(&wall["line_abc"]);
            let line = if line.dot(&expected_line) < 0.0 { -line } else { line };
            for axis in 0..3 {
                case.close("line_abc", line[axis], &wall["line_abc"][axis]);
                let normal = view.plane_normal(expected_line);
                case.close("plane_normal_corridor", normal[axis], &wall["plane_normal_corridor"][axis]);
            }
            let distance = view.wall_distance(expected_line).expect("a wall");
            case.close("camera_to_wall_left_positive", distance, &wall["camera_to_wall_left_positive"]);
            let tied = view.lateral_distance(point(&wall["image_points"][0])).expect("a floor point");
            case.close("camera_to_wall_left_positive", tied, &wall["camera_to_wall_left_positive"]);
            distances[index] = Some(distance);
            if mount.roll == 0.0 {
                let slope = inverse_slope(expected_line, &intrinsics);
                if !wall["s_dx_dy"].is_null() {
                    case.close("s_dx_dy", slope, &wall["s_dx_dy"]);
                }
                let by_slope = distance_from_slope(slope, attitude, mount.z);
                case.close("camera_to_wall_left_positive", by_slope, &wall["camera_to_wall_left_positive"]);
                slopes[index] = Some(slope);
            }
        }
        let offset = mount.x * robot.heading.sin() + mount.y * robot.heading.cos();
        case.if_given("camera_lateral_offset_from_robot", offset);
        let walls =
            Walls { left_m: distances[0].map(|d| d + offset), right_m: distances[1].map(|d| d + offset) };
        if let Some(width) = walls.width_m() {
            case.if_given("width", width);
            case.if_given("robot_left_of_centre", walls.lateral_left_of_target(None, 0.6));
        }
        if let [Some(left), Some(right)] = slopes {
            case.if_given("width", width_from_slopes(left, right, attitude, mount.z));
        }
    });
}

#[test]
fn centering() {
    for_each_case("centring", |file, case| {
        let params = &file["params"];
        let law = Centering {
            length_m: f(&params["length"]),
            damping: f(&params["zeta"]),
            largest_offset_m: f(&params["y_sat"]),
            largest_turn_radps: f(&params["omega_max"]),
        };
        let walls = Walls { left_m: case.input["d_left"].as_f64(), right_m: case.input["d_right"].as_f64() };
        let memory = case.input["width_memory"].as_f64();
        let lateral = walls.lateral_left_of_target(memory, f(&params["single_wall_target"]));
        case.close("lateral_left_of_target", lateral, &case.expect["lateral_left_of_target"]);
        let omega = law.turn_rate(case.number("v"), case.number("robot_heading"), lateral);
        case.close("omega", omega, &case.expect["omega"]);
    });
}
