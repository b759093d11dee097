//! Known answers of mirror cameras: copis_projection, sek_projection.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use nalgebra::{Point3, Vector2, Vector3};
use serde_json::Value;
use yamabico_geometry::Hypotenuse;
use yamabico_geometry::camera::{
    ConicMirror, FloorFormula, HyperboloidalMirror, Meridian, Mirror, MirrorCamera, MirrorImage,
    MirrorProjectionError,
};
use yamabico_testkit::vectors::omni;

const MM: f64 = 1e-3;

#[test]
fn copis_projection() {
    let file = omni("copis_projection");
    let number = |key: &str| file["schema"]["params"][key].as_f64().unwrap();
    let (width, height) = (2.0 * number("cu") + 1.0, 2.0 * number("cv") + 1.0);
    let image = MirrorImage::centered(width as u32, height as u32).with_ring(0.0, number("R_max")).unwrap();
    let cone = ConicMirror::new(number("delta_deg").to_radians(), number("l"), number("f_px")).unwrap();
    let camera = MirrorCamera::new(image, Mirror::Conic(cone)).unwrap();
    let lens = Vector3::new(0.0, 0.0, number("lens_height"));
    near("viewpoint", -cone.viewpoint().x, number("virtual_radius"));
    near("viewpoint", cone.viewpoint().y + lens.z, number("virtual_height"));

    let cases = file["cases"].as_array().unwrap();
    assert!(!cases.is_empty(), "no case");
    for case in cases {
        let id = case["id"].as_str().unwrap();
        match case["kind"].as_str().unwrap() {
            "project" => {
                let point: Point3<f64> = numbers::<3>(&case["P"]).into();
                let way = Vector2::new(point.x.hypotenuse(point.y), point.z - lens.z) - cone.viewpoint();
                let view_angle = way.x.atan2(way.y);
                near(id, view_angle, case["view_angle"].as_f64().unwrap());
                near(id, number("delta_deg").to_radians() - view_angle, case["eta"].as_f64().unwrap());
                match camera.pixel_from_point(&(point - lens)) {
                    Ok(pixel) => {
                        assert!(case["visible"].as_bool().unwrap(), "{id}");
                        let [u, v] = numbers(&case["uv"]);
                        near(id, pixel.x, u);
                        near(id, pixel.y, v);
                        near(id, camera.image().mirror_from_pixel(pixel).norm(), case["R"].as_f64().unwrap());
                        let azimuth = camera.azimuth_from_pixel(pixel).unwrap();
                        let turn = azimuth - case["azimuth"].as_f64().unwrap();
                        assert!(turn.sin().abs() < 1e-9 && turn.cos() > 0.0, "{id}");
                    }
                    Err(why) => {
                        assert!(!case["visible"].as_bool().unwrap(), "{id}: {why}");
                        assert!(
                            matches!(
                                why,
                                MirrorProjectionError::OutOfView | MirrorProjectionError::BeyondRim
                            ),
                            "{id}: {why}"
                        );
                    }
                }
            }
            "ray" => {
                let pixel = Vector2::from(numbers::<2>(&case["uv"]));
                let radius_px = image.mirror_from_pixel(pixel).norm();
                let way = cone.direction(radius_px).unwrap();
                near(id, way.x.atan2(way.y), case["view_angle"].as_f64().unwrap());
                let Some(ray) = camera.ray_from_pixel(pixel) else {
                    assert!(radius_px < 1e-9 || !image.is_in_ring(radius_px), "{id}");
                    continue;
                };
                let (origin, direction) = (ray.origin + lens, ray.direction);
                near_all(id, origin.coords.as_slice(), &numbers::<3>(&case["origin"]));
                near_all(id, direction.as_slice(), &numbers::<3>(&case["direction"]));
                if !case["floor"].is_null() {
                    let floor = origin - direction * (origin.z / direction.z);
                    near_all(id, &[floor.x, floor.y], &numbers::<2>(&case["floor"]));
                    near(id, camera.floor_radius_m(radius_px, lens.z).unwrap(), floor.x.hypotenuse(floor.y));
                }
            }
            other => panic!("{id}: {other}"),
        }
    }
}

#[test]
fn sek_projection() {
    let file = omni("sek_projection");
    let number = |key: &str| file["schema"]["consts"][key].as_f64().unwrap();
    // The formula in the file gives millimeters.
    let formula = FloorFormula { a: number("A"), b: number("B"), c: number("C") };
    let measured = FloorFormula { a: formula.a / MM, b: formula.b / MM, ..formula };
    let lens_height_m = 0.165;
    let mirror = HyperboloidalMirror::from_floor_formula(measured, lens_height_m).unwrap();
    let focus_height_m = lens_height_m + mirror.viewpoint().y;
    near("focus", focus_height_m, number("focus_height_mm") * MM);
    near("horizon", mirror.horizon_px(), number("R_horizon"));
    let (width, height) = (2.0 * number("cu") + 1.0, 2.0 * number("cv") + 1.0);
    let image = MirrorImage::centered(width as u32, height as u32).with_ring(0.0, 200.0).unwrap();
    let camera = MirrorCamera::new(image, Mirror::Hyperboloidal(mirror)).unwrap();
    let on_floor = |x: f64, y: f64| Point3::new(x * MM, y * MM, -lens_height_m);

    let cases = file["cases"].as_array().unwrap();
    assert!(!cases.is_empty(), "no case");
    for case in cases {
        let id = case["id"].as_str().unwrap();
        match case["kind"].as_str().unwrap() {
            "forward" => {
                let radius_px = case["R"].as_f64().unwrap();
                let pair = formula.floor_radius_m(radius_px).zip(formula.slope_m_per_px(radius_px));
                let Some((r, slope)) = pair else {
                    assert_eq!(case["visible"], false, "{id}");
                    assert_eq!(camera.floor_radius_m(radius_px, lens_height_m), None, "{id}");
                    continue;
                };
                near(id, r, case["r"].as_f64().unwrap());
                near(id, slope, case["df"].as_f64().unwrap());
                near(id, 1.0 / (slope * slope), case["w"].as_f64().unwrap());
                // Close to the horizon the result is ill-conditioned: widen the tolerance by the condition number.
                let condition = if r > 0.0 { slope * radius_px / r } else { 1.0 };
                let share = 1e-9 + 64.0 * f64::EPSILON * condition;
                let in_mm = |value: Option<f64>| value.unwrap() / MM;
                let ours = in_mm(camera.floor_radius_m(radius_px, lens_height_m));
                assert!((ours - r).abs() <= share * (1.0 + r), "{id}: {ours}, not {r}");
                let ours = in_mm(camera.floor_slope_m_per_px(radius_px, lens_height_m));
                assert!((ours / slope - 1.0).abs() <= 2.0 * share, "{id}: {ours}, not {slope}");
            }
            "inverse" => {
                let r = case["r"].as_f64().unwrap();
                near(id, formula.radius_px(r), case["R"].as_f64().unwrap());
                near(id, camera.radius_px(r * MM, -lens_height_m).unwrap(), case["R"].as_f64().unwrap());
            }
            "floor_to_pixel" => {
                let [x, y] = numbers(&case["xy"]);
                let pixel = camera.pixel_from_point(&on_floor(x, y)).unwrap();
                near_all(id, pixel.as_slice(), &numbers::<2>(&case["uv"]));
            }
            "pixel_to_floor" => {
                let pixel = Vector2::new(case["u"].as_f64().unwrap(), case["v"].as_f64().unwrap());
                let radius_px = image.mirror_from_pixel(pixel).norm();
                let Some(r) = camera.floor_radius_m(radius_px, lens_height_m) else {
                    assert_eq!(case["visible"], false, "{id}");
                    continue;
                };
                assert_eq!(case["visible"], true, "{id}");
                let (sin, cos) = camera.azimuth_from_pixel(pixel).unwrap_or(0.0).sin_cos();
                let [x, y] = numbers(&case["xy"]);
                near_all(id, &[r * cos, r * sin], &[x * MM, y * MM]);
                if let Some(ray) = camera.ray_from_pixel(pixel) {
                    let down = (ray.origin.z + lens_height_m) / -ray.direction.z;
                    near_all(id, &[ray.direction.x * down, ray.direction.y * down], &[x * MM, y * MM]);
                }
            }
            other => panic!("{id}: {other}"),
        }
    }
}

fn near(id: &str, ours: f64, theirs: f64) {
    assert!((ours - theirs).abs() <= 1e-9 * (1.0 + theirs.abs()), "{id}: {ours}, not {theirs}");
}

fn near_all(id: &str, ours: &[f64], theirs: &[f64]) {
    assert_eq!(ours.len(), theirs.len(), "{id}");
    ours.iter().zip(theirs).for_each(|(ours, theirs)| near(id, *ours, *theirs));
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    let list: Vec<f64> = value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    list.try_into().unwrap()
}
