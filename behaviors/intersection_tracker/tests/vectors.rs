//! Known answers of the pair of edges.

use nalgebra::Vector2;
use serde_json::Value;
use yamabico_core::camera::{Intrinsics, Mount};
use yamabico_intersection_tracker::pair::{across_in_camera, bearing, level_slope, partner, slope};
use yamabico_testkit::vectors::{number, perspective};
use yamabico_vision::corridor::heading::CameraAttitude;
use yamabico_vision::corridor::wall_distance::{CorridorView, line_through};

#[test]
fn intersection_pair() {
    let file = perspective("intersection_pair");
    let tolerance = number(&file["tolerance"]);
    let cases = file["cases"].as_array().expect("cases");
    assert!(!cases.is_empty(), "no case");
    for case in cases {
        let (id, input, expect) = (&case["id"], &case["input"], &case["expect"]);
        let close = |field: &str, ours: f64, expected: &Value| {
            let expected = number(expected);
            let limit = tolerance * expected.abs().max(1.0);
            assert!((ours - expected).abs() <= limit, "{id} {field}: {ours}, expected {expected}");
        };
        let intrinsics = intrinsics(&input["camera"]);
        let (heading, tilt) = (number(&input["camera_heading"]), number(&input["tilt"]));
        let height_m = number(&input["camera_height"]);
        let view = CorridorView::new(CameraAttitude { heading, tilt }, 0.0, height_m, intrinsics);
        let left = point(&input["left_base"]);
        let right_wall = line_through(point(&input["vp"]), point(&input["right_wall_line_point"]));

        let across = across_in_camera(&view);
        for (ours, expected) in across.iter().zip(expect["lateral_vp_homogeneous_dir"].as_array().expect("3"))
        {
            close("lateral_vp_homogeneous_dir", *ours, expected);
        }
        let right = partner(left, right_wall, &view).expect("a partner");
        close("right_base u", right.x, &expect["right_base"][0]);
        close("right_base v", right.y, &expect["right_base"][1]);
        close("slope_exact", slope(left, right, &intrinsics), &expect["slope_exact"]);
        let normalized = intrinsics.normalized_from_pixel(left);
        if !expect["slope_closed_form"].is_null() {
            close("slope_closed_form", level_slope(normalized, heading), &expect["slope_closed_form"]);
        }
        close("paper_eq20_slope", normalized.y * heading.sin(), &expect["paper_eq20_slope"]);

        let mount = Mount::tilted(height_m, tilt);
        let [by_left, by_right] = [left, right].map(|base| bearing(base, &intrinsics, &mount));
        close("bearing_left", by_left, &expect["bearing_left"]);
        close("bearing_right", by_right, &expect["bearing_right"]);
        close("steer_mean_bearing", 0.5 * (by_left + by_right), &expect["steer_mean_bearing"]);
        let column = -intrinsics.normalized_from_pixel(0.5 * (left + right)).x.atan();
        close("steer_mean_column_level", column, &expect["steer_mean_column_level"]);
        close("range_forward", view.floor_point(left).expect("floor").x, &expect["range_forward"]);
    }
}

fn intrinsics(camera: &Value) -> Intrinsics {
    let whole = |key: &str| camera[key].as_u64().expect("a whole number") as u32;
    Intrinsics {
        width: whole("w"),
        height: whole("h"),
        fx: number(&camera["fx"]),
        fy: number(&camera["fy"]),
        cx: number(&camera["cx"]),
        cy: number(&camera["cy"]),
    }
}

fn point(value: &Value) -> Vector2<f64> {
    Vector2::new(number(&value[0]), number(&value[1]))
}
