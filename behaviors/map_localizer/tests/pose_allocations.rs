//! Localization by azimuths and by the outline of the floor allocates nothing after the first call.

use nalgebra::{Point2, Vector2};
use yamabico_core::camera::{FloorFormula, HyperboloidalMirror, Mirror, MirrorCamera, MirrorImage};
use yamabico_core::geometry::Pose2;
use yamabico_core::testing::{Allocations, allocations};
use yamabico_map_localizer::azimuth::{
    AzimuthLocalizer, AzimuthRule, EdgeLandmark, LeverArm, SeenBearing, predict,
};
use yamabico_map_localizer::belief::Belief;
use yamabico_map_localizer::floor_outline::{FitRule, FloorLocalizer, FloorPlan, FloorRule, OutlineRule};
use yamabico_vision::bit_image::BitImage;

#[test]
fn azimuths() {
    let map: Vec<_> = (0..30)
        .map(|i| {
            let (sin, cos) = (0.7 * f64::from(i)).sin_cos();
            let far = 1.0 + 0.1 * f64::from(i);
            EdgeLandmark { position: Point2::new(far * cos, far * sin), sign: None, sigma_m: 0.01 }
        })
        .collect();
    let observations: Vec<(Pose2, Vec<SeenBearing>)> = (0..6)
        .map(|step| {
            let pose = Pose2::new(0.02 * f64::from(step), 0.01, 0.03 * f64::from(step));
            let bearing = |edge: &EdgeLandmark| SeenBearing {
                azimuth_rad: predict(edge, &pose, LeverArm::zeros()).azimuth_rad,
                sign: None,
                sigma_rad: 0.005,
            };
            (pose, map.iter().map(bearing).collect())
        })
        .collect();
    let wall = [Point2::new(1.5, 1.0), Point2::new(1.5, 3.0)];
    let mut localizer =
        AzimuthLocalizer::new(map.clone(), vec![wall], LeverArm::zeros(), AzimuthRule::default());
    let mut run = || {
        observations
            .iter()
            .filter(|(pose, seen)| {
                let predicted =
                    Belief::new(Pose2::new(pose.x + 0.01, pose.y, pose.theta + 0.005), 0.02, 0.01);
                let fix = localizer.locate(&predicted, seen);
                fix.is_ok_and(|fix| fix.belief.pose.distance(pose) < 0.01)
            })
            .count()
    };
    assert_eq!(run(), observations.len());
    let (found, made) = allocations(run);
    assert_eq!((found, made), (observations.len(), Allocations::default()));
}

#[test]
fn outlines() {
    let outline = OutlineRule { height_m: 0.165, max_radius_px: 108.0 };
    let formula = FloorFormula { a: 10_120.0, b: 20.54, c: 2.298e5 };
    let mirror = HyperboloidalMirror::from_floor_formula(formula, outline.height_m).unwrap();
    let image = MirrorImage::centered(256, 220).with_ring(1.0, 113.5).unwrap();
    let camera = MirrorCamera::new(image, Mirror::Hyperboloidal(mirror)).unwrap();
    let corners =
        [(1.37, 0.7625), (-1.37, 0.7625), (-1.37, -0.7625), (1.37, -0.7625)].map(|(x, y)| Point2::new(x, y));
    let plan = FloorPlan::from_polygon(&corners).unwrap();
    let mut rule = FloorRule::new(outline);
    rule.fit = FitRule { shift_sigma_px: Some(2.0), ..FitRule::default() };
    let robots = [Pose2::new(0.3, 0.1, 0.2), Pose2::new(-0.5, -0.2, 2.0), Pose2::new(0.0, 0.3, -1.0)];
    let masks: Vec<_> = robots
        .iter()
        .map(|robot| {
            let mut mask = BitImage::new(256, 220);
            for (u, v) in (0..220).flat_map(|v| (0..256).map(move |u| (u, v))) {
                let seen = image.mirror_from_pixel(Vector2::new(f64::from(u), f64::from(v)));
                let radius = seen.norm().max(1.0);
                if let Some(floor) = camera.floor_radius_m(radius, outline.height_m) {
                    let point = robot.transform_point(Point2::from(seen * (floor / radius)));
                    if radius < 108.0 && point.x.abs() < 1.37 && point.y.abs() < 0.7625 {
                        mask.set(u as usize, v as usize);
                    }
                }
            }
            mask
        })
        .collect();
    let mut localizer = FloorLocalizer::new(plan, camera.clone(), rule);
    let mut run = || {
        masks
            .iter()
            .zip(&robots)
            .filter(|(mask, robot)| {
                let near =
                    Belief::new(Pose2::new(robot.x + 0.02, robot.y - 0.02, robot.theta + 0.02), 0.05, 0.05);
                [None, Some(&near)].into_iter().all(|known| {
                    let fix = localizer.locate(mask, known).unwrap();
                    known.is_none() || fix.belief.pose.distance(robot) < 0.01
                })
            })
            .count()
    };
    assert_eq!(run(), robots.len());
    let (found, made) = allocations(run);
    assert_eq!((found, made), (robots.len(), Allocations::default()));
}
