//! Localization and mapping with rendered images of a conic mirror camera.

use nalgebra::Point2;
use yamabico_core::camera::{ConicMirror, Mirror, MirrorCamera, MirrorImage, Mount};
use yamabico_core::geometry::{Pose2, wrap_angle};
use yamabico_core::image::GrayImage;
use yamabico_map_localizer::azimuth::{
    AzimuthLocalizer, AzimuthRule, EdgeLandmark, LeverArm, PanSearch, SeenBearing,
};
use yamabico_map_localizer::belief::Belief;
use yamabico_sim::world::Wall;
use yamabico_sim::{MirrorRenderer, MirrorView, Photometry, Scene, World, random};
use yamabico_vision::azimuth_map::{LocusRule, LocusTracker, ObservedEdge};
use yamabico_vision::azimuth_profile::{AzimuthEdge, EdgeSign, ProfileRule};
use yamabico_vision::radial_edges::{RadialEdgeRule, RadialEdges};

/// Panels around a room of 4 x 4 m, counterclockwise: start (x, y) in m, and gray level.
const PANELS: [(f64, f64, f32); 11] = [
    (-2.0, -2.0, 0.25),
    (-0.7, -2.0, 0.7),
    (1.1, -2.0, 0.3),
    (2.0, -2.0, 0.65),
    (2.0, 0.4, 0.2),
    (2.0, 2.0, 0.75),
    (0.9, 2.0, 0.3),
    (-1.2, 2.0, 0.6),
    (-2.0, 2.0, 0.2),
    (-2.0, 0.9, 0.7),
    (-2.0, -0.8, 0.4),
];

fn room() -> (World, Vec<EdgeLandmark>) {
    let mut world = World { ambient: Some(0.8), ..World::default() };
    world.floor.gloss = 0.0;
    let mut landmarks = Vec::new();
    for (i, &(x, y, level)) in PANELS.iter().enumerate() {
        let next = PANELS[(i + 1) % PANELS.len()];
        world.walls.push(Wall {
            from_m: [x, y],
            to_m: [next.0, next.1],
            height_m: 2.4,
            thickness_m: 0.05,
            color: [level; 3],
            ..Wall::default()
        });
        let sign = if next.2 > level { EdgeSign::Brighter } else { EdgeSign::Darker };
        landmarks.push(EdgeLandmark {
            position: Point2::new(next.0, next.1),
            sign: Some(sign),
            sigma_m: 0.003,
        });
    }
    (world, landmarks)
}

struct MirrorRig {
    renderer: MirrorRenderer,
    scene: Scene,
    image: GrayImage,
    edges: RadialEdges,
}

impl MirrorRig {
    fn new(world: &World) -> Self {
        let image = MirrorImage::centered(512, 480).with_ring(16.0, 240.0).unwrap();
        let cone = ConicMirror::new(112.6_f64.to_radians(), 0.11, 576.563).unwrap();
        let camera = MirrorCamera::new(image, Mirror::Conic(cone)).unwrap();
        Self {
            renderer: MirrorRenderer::new(camera, Photometry::default(), random::stream(4, "mirror")),
            scene: Scene::new(world, 0).unwrap(),
            image: GrayImage::new(512, 480),
            edges: RadialEdges::new(&image, &RadialEdgeRule::within(&image), ProfileRule::default()),
        }
    }

    fn observe(&mut self, robot: Pose2) -> &[AzimuthEdge] {
        let view = MirrorView { mount: Mount::level(0.3), robot };
        self.renderer.render(&self.scene, &view, self.image.pixels_mut()).unwrap();
        self.edges.find(self.image.view().unwrap()).unwrap()
    }
}

#[test]
fn the_pose_is_accurate_to_3_mm() {
    let (world, landmarks) = room();
    let mut rig = MirrorRig::new(&world);
    let mut localizer =
        AzimuthLocalizer::new(landmarks, Vec::new(), LeverArm::zeros(), AzimuthRule::default());
    let (mut worst, mut mean, mut pan_search_mean) = (0.0_f64, 0.0, 0.0);
    const POSES: u32 = 12;
    for number in 0..POSES {
        let t = f64::from(number);
        let truth = Pose2::new(0.7 * (0.9 * t).cos(), 0.6 * (0.7 * t).sin(), 0.55 * t);
        let seen: Vec<_> = rig
            .observe(truth)
            .iter()
            .map(|edge| SeenBearing {
                azimuth_rad: edge.azimuth_rad,
                sign: Some(edge.sign),
                sigma_rad: edge.sigma_rad(0.3, 0.05_f64.to_radians()),
            })
            .collect();
        let off = |k: f64| (3.1 * t + k).sin();
        let pose =
            Pose2::new(truth.x + 0.03 * off(0.0), truth.y + 0.03 * off(2.0), truth.theta + 0.025 * off(4.0));
        let predicted = Belief::new(pose, 0.03, 0.025);
        let fix = localizer.locate(&predicted, &seen).unwrap();
        let error = fix.belief.pose.distance(&truth);
        assert!(fix.pairs >= 8, "pose {number}: {} pairs of {} edges", fix.pairs, seen.len());
        assert!(wrap_angle(fix.belief.pose.theta - truth.theta).abs() < 0.3_f64.to_radians());
        let pan_search = PanSearch::default().find(localizer.pairs(), pose.theta).unwrap();
        pan_search_mean += pan_search.pose.distance(&truth) / f64::from(POSES);
        mean += error / f64::from(POSES);
        worst = worst.max(error);
    }
    println!(
        "mean {:.2} mm, maximum {:.2} mm; mean of the search over the heading {:.2} mm",
        1e3 * mean,
        1e3 * worst,
        1e3 * pan_search_mean
    );
    assert!(mean < 0.001 && worst < 0.003, "mean {mean} m, maximum {worst} m");
}

#[test]
fn edges_are_located_along_a_known_path() {
    let (world, landmarks) = room();
    let mut rig = MirrorRig::new(&world);
    let rule = LocusRule { sigma_rad: 0.15_f64.to_radians(), ..LocusRule::default() };
    let mut tracker = LocusTracker::new(rule);
    let mut robot = Pose2::new(-0.8, -0.3, 0.0);
    for frame in 0..40 {
        let seen: Vec<_> = rig
            .observe(robot)
            .iter()
            .map(|edge| ObservedEdge {
                azimuth_rad: edge.azimuth_rad,
                sign: edge.sign,
                length_px: edge.length_px,
            })
            .collect();
        tracker.update(&seen, &robot);
        // Straight, an arc to the right, and straight again.
        let turn = if (13..27).contains(&frame) { -0.06 } else { 0.0 };
        robot = robot.compose(&Pose2::new(0.04, 0.0, turn));
    }
    let (mut errors, mut found) = (Vec::new(), vec![false; landmarks.len()]);
    for locus in tracker.loci().iter().filter(|locus| locus.seen > 15) {
        let Some(position) = locus.position else { continue };
        let nearest = (0..landmarks.len())
            .min_by(|&a, &b| {
                let off = |i: usize| (landmarks[i].position - position.position).norm();
                off(a).total_cmp(&off(b))
            })
            .unwrap();
        errors.push((landmarks[nearest].position - position.position).norm());
        found[nearest] |= landmarks[nearest].sign == Some(locus.sign);
    }
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    let right = found.iter().filter(|found| **found).count();
    println!(
        "{} edges seen in more than 15 images, {right} of {} true ones, mean error {:.1} mm",
        errors.len(),
        found.len(),
        1e3 * mean
    );
    assert!(right >= 9, "{right} of {} edges", found.len());
    assert!(mean < 0.004, "mean {mean} m");
}
