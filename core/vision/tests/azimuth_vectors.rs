//! Known answers of azimuths: profile, matching, triangulation, map, and paths around obstacles.

use nalgebra::{Matrix2, Point2};
use serde_json::Value;
use yamabico_geometry::{Pose2, wrap_angle};
use yamabico_testkit::vectors::{for_each_case, list, number, omni};
use yamabico_vision::azimuth_map::{
    AdjacencyTable, CyclicMatcher, Inflation, LocatedEdge, MatchingRule, ObservedEdge, ObstacleClusters,
    PathError, PredictedEdge, RangeReading, ReadingClass, RelinkRule, Sighting, SurfaceCheck,
    SurfaceCheckRule, SurfaceState, TriangulationError, VisibilityGraph, inflate, least_squares_crossing,
    most_likely_crossing, parallax_rad, relink, star_polygon, table_polygon,
};
use yamabico_vision::azimuth_profile::{AzimuthProfile, EdgePoint, EdgeSign, ProfileRule};
use yamabico_vision::polygon::{PolygonMoments, convex_hull, sides, signed_area};

fn sign(value: &Value) -> EdgeSign {
    if number(value) > 0.0 { EdgeSign::Brighter } else { EdgeSign::Darker }
}

/// Asserts that `actual` equals `expected` within the tolerance, relative above 1.
fn close(actual: f64, expected: &Value, tolerance: f64, what: &str) {
    let expected = number(expected);
    let error = (actual - expected).abs();
    assert!(error <= tolerance * (1.0 + expected.abs()), "{what}: {actual}, not {expected}");
}

#[test]
fn copis_azimuth() {
    for_each_case(&omni("copis_azimuth"), |case, id| {
        let rule = ProfileRule { min_length_px: 8.0, ..ProfileRule::default() };
        let mut profile = AzimuthProfile::new(rule);
        for pixel in list(&case["pixels"]) {
            let weight = number(&pixel[2]);
            profile.add(&EdgePoint {
                azimuth_rad: number(&pixel[0]),
                sign: sign(&pixel[1]),
                length_px: weight,
                weight,
            });
        }
        let edges = profile.find();
        let expected = list(&case["segments"]);
        assert_eq!(edges.len(), expected.len(), "{id}");
        for (edge, expected) in edges.iter().zip(expected) {
            let error = wrap_angle(edge.azimuth_rad - number(&expected["azimuth"]));
            assert!(error.abs() < 1e-9, "{id}: off by {error}");
            close(edge.weight, &expected["weight"], 1e-9, id);
            close(edge.length_px, &expected["weight"], 1e-9, id);
            assert_eq!(edge.sign, sign(&expected["sign"]), "{id}");
            assert_eq!(edge.bins as u64, expected["bins"].as_u64().unwrap(), "{id}");
        }
    });
}

fn point(value: &Value) -> Point2<f64> {
    Point2::new(number(&value[0]), number(&value[1]))
}

fn points(value: &Value) -> Vec<Point2<f64>> {
    list(value).iter().map(point).collect()
}

fn matrix(value: &Value) -> Matrix2<f64> {
    Matrix2::from_fn(|i, j| number(&value[i][j]))
}

fn pose(value: &Value) -> Pose2 {
    Pose2::new(number(&value[0]), number(&value[1]), number(&value[2]))
}

fn close_point(actual: Point2<f64>, expected: &Value, tolerance: f64, what: &str) {
    close(actual.x, &expected[0], tolerance, what);
    close(actual.y, &expected[1], tolerance, what);
}

fn close_matrix(actual: &Matrix2<f64>, expected: &Value, tolerance: f64, what: &str) {
    for i in 0..2 {
        for j in 0..2 {
            close(actual[(i, j)], &expected[i][j], tolerance, what);
        }
    }
}

fn indices(value: &Value) -> Vec<i64> {
    list(value).iter().map(|v| v.as_i64().unwrap()).collect()
}

#[test]
fn sek_hull() {
    for_each_case(&omni("sek_hull"), |case, id| {
        let mut hull = Vec::new();
        convex_hull(&mut points(&case["points"]), &mut hull);
        assert_eq!(hull, points(&case["hull"]), "{id}");
    });
}

#[test]
fn sek_moments() {
    for_each_case(&omni("sek_moments"), |case, id| {
        let polygon = points(&case["polygon"]);
        let moments = PolygonMoments::of(&polygon).unwrap();
        // Sums over large coordinates cancel: the accuracy is relative to the largest of them.
        let size = polygon.iter().map(|corner| corner.coords.amax()).fold(0.0, f64::max);
        for (actual, key, scale) in [
            (moments.area, "m00", moments.area),
            (moments.m10, "m10", moments.area * size),
            (moments.m01, "m01", moments.area * size),
            (moments.m20, "m20", moments.area * size * size),
            (moments.m02, "m02", moments.area * size * size),
            (moments.m11, "m11", moments.area * size * size),
            (moments.center().x, "xg", size),
            (moments.center().y, "yg", size),
            (moments.principal()[0], "I_min", moments.area * size * size),
            (moments.principal()[1], "I_max", moments.area * size * size),
        ] {
            let error = (actual - number(&case[key])).abs();
            assert!(error <= 1e-9 * scale.max(1e-3), "{id}: {key} is off by {error}");
        }
        assert_eq!(moments.has_axis(), case["psi_defined"].as_bool().unwrap(), "{id}");
        if moments.has_axis() {
            let off = moments.long_axis_rad() - number(&case["psi"]);
            assert!(off.sin().abs() < 1e-9, "{id}: axis off by {off}");
        }
    });
}

#[test]
fn copis_locus() {
    for_each_case(&omni("copis_locus"), |case, id| {
        let expected: Vec<_> = list(&case["tracks"])
            .iter()
            .map(|track| PredictedEdge {
                azimuth_rad: number(&track[0]),
                length_px: number(&track[1]),
                sign: (number(&track[2]) != 0.0).then(|| sign(&track[2])),
                gate_rad: number(&track[3]),
            })
            .collect();
        let seen: Vec<_> = list(&case["detections"])
            .iter()
            .map(|edge| ObservedEdge {
                azimuth_rad: number(&edge[0]),
                length_px: number(&edge[1]),
                sign: sign(&edge[2]),
            })
            .collect();
        let mut matcher = CyclicMatcher::default();
        let (assignment, cost) = matcher.assign(&expected, &seen, &MatchingRule::default());
        close(cost, &case["cost"], 1e-9, id);
        let assignment: Vec<_> = assignment.iter().map(|edge| edge.map_or(-1, |edge| edge as i64)).collect();
        assert_eq!(assignment, indices(&case["assignment"]), "{id}");
    });
}

#[test]
fn copis_relink() {
    for_each_case(&omni("copis_relink"), |case, id| {
        let edge = |name: &str| LocatedEdge {
            position: point(&case[name]),
            covariance: matrix(&case[format!("cov_{name}")]),
            sign: Some(sign(&case[format!("sign_{name}")])),
        };
        let fused = relink(&edge("a"), &edge("b"), &RelinkRule::default());
        assert_eq!(fused.is_some(), case["link"].as_bool().unwrap(), "{id}");
        if let Some(fused) = fused {
            close_point(fused.position, &case["fused"], 1e-9, id);
            close_matrix(&fused.covariance, &case["fused_cov"], 1e-9, id);
        }
    });
}

#[test]
fn copis_triangulation() {
    for_each_case(&omni("copis_triangulation"), |case, id| {
        let sightings: Vec<_> = list(&case["obs"])
            .iter()
            .map(|seen| Sighting { sensor: pose(seen), azimuth_rad: number(&seen[3]) })
            .collect();
        close(parallax_rad(&sightings), &case["parallax"], 1e-9, id);
        let found = least_squares_crossing(&sightings);
        match case["reason"].as_str() {
            Some("parallel_bearings") => assert_eq!(found, Err(TriangulationError::ParallelBearings)),
            Some("behind_all_cameras") => assert_eq!(found, Err(TriangulationError::Behind)),
            Some(other) => panic!("{id}: {other}"),
            None => {
                close_point(found.unwrap(), &case["lin"], 1e-9, id);
                let likely =
                    most_likely_crossing(&sightings, found.unwrap(), number(&case["sigma"])).unwrap();
                close_point(likely.position, &case["gn"], 1e-8, id);
                close_matrix(&likely.covariance, &case["cov"], 1e-8, id);
                close(likely.chi_squared, &case["chi2"], 1e-8, id);
            }
        }
    });
}

#[test]
fn copis_surface() {
    for_each_case(&omni("copis_surface"), |case, id| {
        let ends = [point(&case["a"]), point(&case["b"])];
        let mut check = SurfaceCheck::new(ends, SurfaceCheckRule::ray());
        let mut decided_at = -1;
        for (i, reading) in list(&case["readings"]).iter().enumerate() {
            let reading = RangeReading {
                sensor: pose(reading),
                range_m: reading[3].as_f64(),
                sigma_m: number(&reading[4]),
            };
            let (class, distance) = check.update(&reading);
            let name = match class {
                ReadingClass::Untestable => "untestable",
                ReadingClass::At => "at",
                ReadingClass::Beyond => "beyond",
                ReadingClass::Nearer => "nearer",
            };
            assert_eq!(Some(name), case["classes"][i].as_str(), "{id}: reading {i}");
            if let Some(expected) = case["L"][i].as_f64() {
                assert!((distance.unwrap() - expected).abs() < 1e-9, "{id}: distance of reading {i}");
            }
            if decided_at < 0 && check.state() != SurfaceState::Unknown {
                decided_at = i as i64;
            }
        }
        let state = match check.state() {
            SurfaceState::Unknown => "unknown",
            SurfaceState::Solid => "solid",
            SurfaceState::Empty => "empty",
            SurfaceState::Nearer => "nearer",
        };
        assert_eq!(Some(state), case["state"].as_str(), "{id}");
        assert_eq!(Some(decided_at), case["decided_at"].as_i64(), "{id}");
    });
}

#[test]
fn copis_freespace() {
    for_each_case(&omni("copis_freespace"), |case, id| {
        let mut table = AdjacencyTable::default();
        for frame in list(&case["frames"]) {
            table.update(list(frame).iter().map(|edge| (number(&edge[0]) as u32, number(&edge[1]))));
        }
        let rows: Vec<_> = table.rows().iter().map(|row| i64::from(*row)).collect();
        assert_eq!(rows, indices(&case["row_order"]), "{id}");
        let expected = list(&case["adjacency"]);
        assert_eq!(table.pairs().len(), expected.len(), "{id}");
        for pair in expected {
            let [right, left] = [0, 1].map(|i| number(&pair["pair"][i]) as u32);
            let found = table.pair(right, left).unwrap_or_else(|| panic!("{id}: {right} {left}"));
            assert_eq!(u64::from(found.frames), pair["frames"].as_u64().unwrap(), "{id}: {right} {left}");
            assert_eq!(Some(found.is_broken), pair["broken"].as_bool(), "{id}: {right} {left}");
        }
        let position = |number: u32| case["points"].get(number.to_string()).map(point);
        let mut polygon = Vec::new();
        table_polygon(&table, position, &mut polygon);
        close(signed_area(&polygon).abs(), &case["table_polygon_area"], 1e-9, id);
        let last = list(&case["frames"]).last().unwrap();
        let mut visible: Vec<_> =
            list(last).iter().filter_map(|edge| position(number(&edge[0]) as u32)).collect();
        let robot = point(list(&case["path"]).last().unwrap());
        star_polygon(robot, &mut visible, &mut polygon);
        polygon.retain(|corner| *corner != robot);
        let star: Vec<_> =
            list(&case["last_star"]).iter().map(|n| position(number(n) as u32).unwrap()).collect();
        assert_eq!(polygon.len(), star.len(), "{id}");
        assert!(star.iter().all(|corner| polygon.contains(corner)), "{id}");
        close(signed_area(&polygon).abs(), &case["last_star_area"], 1e-9, id);
    });
}

#[test]
fn copis_replan() {
    for_each_case(&omni("copis_replan"), |case, id| {
        let edges = points(&case["edges"]);
        let mut clusters = ObstacleClusters::default();
        let labels = clusters.label(&edges, 0.35, |_, _| false).to_vec();
        let as_numbers: Vec<_> = labels.iter().map(|label| *label as i64).collect();
        assert_eq!(as_numbers, indices(&case["labels"]), "{id}");
        let (mut obstacles, mut corners) = (Vec::new(), Vec::new());
        for first in 0..edges.len() {
            let of_obstacle = edges.iter().zip(&labels).filter(|(_, label)| **label == first);
            let mut polygon = Vec::new();
            let inflation = Inflation { radius_m: 0.3, sides: 16 };
            inflate(of_obstacle.map(|(edge, _)| *edge), &inflation, &mut corners, &mut polygon);
            if !polygon.is_empty() {
                obstacles.push(polygon);
            }
        }
        let expected = list(&case["inflated"]);
        assert_eq!(obstacles.len(), expected.len(), "{id}");
        for (polygon, expected) in obstacles.iter().zip(expected) {
            let expected = points(expected);
            // Rounding may keep or drop a corner on a side.
            let is_near = |corner: &Point2<f64>, of: &[Point2<f64>]| {
                sides(of).any(|side| {
                    (yamabico_vision::polygon::nearest_on_segment(side, *corner) - corner).norm() < 1e-9
                })
            };
            assert!(polygon.iter().all(|corner| is_near(corner, &expected)), "{id}");
            assert!(expected.iter().all(|corner| is_near(corner, polygon)), "{id}");
        }
        let mut graph = VisibilityGraph::default();
        let found = graph.shortest(point(&case["start"]), point(&case["goal"]), &obstacles);
        match case["path_length"].as_f64() {
            Some(length) => {
                let (path, found) = found.unwrap();
                assert!((found - length).abs() < 1e-6, "{id}: {found}, not {length}");
                let sum: f64 = path.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
                assert!((sum - found).abs() < 1e-9, "{id}");
            }
            None => {
                assert!(
                    matches!(found, Err(PathError::StartInside | PathError::Enclosed)),
                    "{id}: {found:?}"
                );
            }
        }
    });
}
