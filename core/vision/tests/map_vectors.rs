//! Known answers of map projection and visibility.

use nalgebra::{Point2, Point3};
use serde_json::Value;
use yamabico_geometry::Pose2;
use yamabico_geometry::camera::{Intrinsics, Mount};
use yamabico_testkit::vectors::{number, perspective};
use yamabico_vision::map::{Edge, EdgeKind, MapView, Wall};

fn point<const N: usize>(value: &Value) -> [f64; N] {
    std::array::from_fn(|i| number(&value[i]))
}

#[test]
fn expectation_map() {
    let file = perspective("expectation_map");
    let edges: Vec<Edge> = file["wireframe"]
        .as_array()
        .unwrap()
        .iter()
        .map(|ends| Edge::between(Point3::from(point(&ends[0])), Point3::from(point(&ends[1]))))
        .collect();
    let walls: Vec<Wall> = file["walls_2d"]
        .as_array()
        .unwrap()
        .iter()
        .map(|ends| Wall { from: Point2::from(point(&ends[0])), to: Point2::from(point(&ends[1])) })
        .collect();
    let tolerance = number(&file["tolerance"]);
    let mut segments = 0;
    for case in file["cases"].as_array().unwrap() {
        let (camera, mount, id) = (&case["input"]["camera"], &case["input"]["mount"], &case["id"]);
        let of = |name: &str| number(&camera[name]);
        let intrinsics = Intrinsics {
            fx: of("fx"),
            fy: of("fy"),
            cx: of("cx"),
            cy: of("cy"),
            width: of("w") as u32,
            height: of("h") as u32,
        };
        let on = |name: &str| number(&mount[name]);
        let mount =
            Mount { x: on("x"), y: on("y"), z: on("z"), pan: on("pan"), tilt: on("tilt"), roll: on("roll") };
        let [x, y, theta] = point(&case["input"]["pose"]);
        let view = MapView::new(&intrinsics, &mount, &Pose2::new(x, y, theta));
        for expect in case["expect"]["segments"].as_array().unwrap() {
            let index = expect["index"].as_u64().unwrap() as usize;
            let edge = &edges[index];
            let clipped = view.clip(edge);
            assert_eq!(clipped.is_none(), expect["clipped"].is_null(), "{id}, edge {index}");
            if let Some(clipped) = clipped {
                for (pixel, answer) in clipped.pixels.iter().zip(expect["clipped"].as_array().unwrap()) {
                    let [u, v] = point(answer);
                    let error = (pixel.x - u).abs().max((pixel.y - v).abs());
                    assert!(error <= tolerance, "{id}, edge {index}: {pixel} for {u}, {v}");
                }
            }
            assert_eq!(edge.kind == EdgeKind::Vertical, expect["vertical"].as_bool().unwrap());
            if let Some(is_visible) = expect["vertical_visible"].as_bool() {
                assert_eq!(view.is_visible(edge.from.xy(), &walls), is_visible, "{id}, edge {index}");
            }
            segments += 1;
        }
    }
    assert!(segments > 0);
}
