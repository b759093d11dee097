//! Boxes in the rendered hallway, images of them, and what the detector reports.

use rand::RngExt;
use rand_distr::StandardNormal;
use yamabico_core::camera::{Intrinsics, Mount, Pinhole};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::ImageView;
use yamabico_core::overlay::Overlay;
use yamabico_rigs::camera::{forward_camera, world};
use yamabico_sim::random::{Stream, stream};
use yamabico_sim::world::{BoxItem, Color};
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World};
use yamabico_stationary_obstacle_avoider::detector::{Detector, DetectorRules};
use yamabico_stationary_obstacle_avoider::overlay;
use yamabico_stationary_obstacle_avoider::regions::Regions;
use yamabico_stationary_obstacle_avoider::threshold_learning::{PlaceLearner, Validity};
use yamabico_stationary_obstacle_avoider::threshold_table::{Place, ThresholdTable};
use yamabico_vision::map::{MapView, WireFrame};

use crate::images::{Output, view};

/// Width and height of the images, px.
pub const SIZE: (u32, u32) = (256, 240);
/// Number of regions of an image.
pub const REGIONS: usize = 5;
/// Color of a white box.
pub const WHITE: Color = [0.85, 0.85, 0.83];
/// Color of a brown box.
pub const BROWN: Color = [0.30, 0.19, 0.10];

/// The hallway without boxes, the camera and the detector.
pub struct Hallway<'a> {
    world: World,
    /// Scene without boxes.
    pub empty: Scene,
    intrinsics: Intrinsics,
    mount: Mount,
    camera: Renderer,
    noiseless: Renderer,
    /// Random numbers for boxes and poses.
    pub rng: Stream,
    detector: Detector,
    /// Learned thresholds.
    pub table: ThresholdTable,
    /// Number of images that the detector refused.
    pub refused: u32,
    out: &'a Output,
}

/// Result of one image of a box.
pub struct Observation {
    /// Region that shows the center of the box.
    pub region: usize,
    /// Distance of the box ahead of the robot, m.
    pub distance_m: f64,
    /// True if a region that shows a part of the box is reported as an obstacle.
    pub is_found: bool,
}

impl<'a> Hallway<'a> {
    /// Reads the hallway; `out` receives the images that are evaluated wrongly.
    pub fn new(seed: u64, out: &'a Output) -> Self {
        let mut world = world("hallway");
        world.people.clear();
        world.boxes.clear();
        let map = WireFrame::read(&yamabico_testkit::config("maps/hallway.toml")).unwrap();
        let (intrinsics, mount) = forward_camera(SIZE.0, SIZE.1, 60.0, 6.0);
        let rules = DetectorRules::for_size(SIZE.0, SIZE.1);
        let photometry = Photometry::default();
        Self {
            empty: Scene::new(&world, 1).unwrap(),
            world,
            intrinsics,
            mount,
            camera: Renderer::new(photometry, stream(seed, "film")),
            noiseless: Renderer::new(Photometry { noise_sigma: 0.0, ..photometry }, stream(seed, "quiet")),
            rng: stream(seed, "boxes"),
            out,
            detector: Detector::new(Pinhole::ideal(intrinsics), mount, map, rules),
            refused: 0,
            table: ThresholdTable {
                width: SIZE.0,
                height: SIZE.1,
                regions: REGIONS as u32,
                exposure: 1.0,
                places: Vec::new(),
            },
        }
    }

    /// Renders an image with the noise of the camera.
    pub fn image(&mut self, scene: &Scene, robot: Pose2) -> Vec<u8> {
        let view = CameraView { intrinsics: self.intrinsics, mount: self.mount, robot };
        let mut pixels = vec![0; (SIZE.0 * SIZE.1) as usize];
        self.camera.render(scene, &view, &mut pixels).unwrap();
        pixels
    }

    /// Renders an image without noise.
    pub fn noiseless_image(&mut self, scene: &Scene, robot: Pose2) -> Vec<u8> {
        let view = CameraView { intrinsics: self.intrinsics, mount: self.mount, robot };
        let mut pixels = vec![0; (SIZE.0 * SIZE.1) as usize];
        self.noiseless.render(scene, &view, &mut pixels).unwrap();
        pixels
    }

    /// Learns the thresholds along the center line of the empty hallway.
    pub fn learn(&mut self) {
        let empty = self.empty.clone();
        for step in 0..25 {
            let mut learner = PlaceLearner::default();
            for image in 0..12 {
                let x = 0.5 * f64::from(step) + 0.04 * f64::from(image);
                let robot = Pose2::new(x, 0.15 * (3.0 * x).sin(), 0.1 * (2.0 * x).cos());
                let pixels = self.image(&empty, robot);
                let (rows, evidence) = self.detector.measure(image_of(&pixels), &robot).unwrap();
                learner.add(&rows, evidence);
            }
            let learned = learner.learned().unwrap();
            let (x_m, recall) = (0.5 * f64::from(step) + 0.22, learned.recall.unwrap_or(0.0));
            if learned.validity != Validity::Valid {
                eprintln!("x = {x_m:.2} m: thresholds rejected, recall {recall:.2}");
                continue;
            }
            self.table.places.push(Place {
                x_m,
                y_m: 0.0,
                heading_deg: 0.0,
                t0: learned.t0,
                n0: learned.n0,
                n0_extra: learned.n0_extra,
                contrast: learner.evidence().contrast,
                level: learner.evidence().level,
                recall,
            });
        }
    }

    /// Returns true for each region reported as an obstacle, from an estimate of the pose with small errors.
    pub fn flagged(&mut self, pixels: &[u8], robot: Pose2) -> [bool; REGIONS] {
        let estimate = Pose2::new(
            robot.x + 0.05 * self.normal(),
            robot.y + 0.02 * self.normal(),
            robot.theta + 0.2_f64.to_radians() * self.normal(),
        );
        let Some(place) = self.table.at(&estimate, 1.0) else {
            panic!("no thresholds were learned near {estimate:?}")
        };
        match self.detector.detect(image_of(pixels), &estimate, 0.2_f64.to_radians(), &place) {
            Ok(sights) => std::array::from_fn(|region| sights[region].is_obstacle),
            Err(_) => {
                self.refused += 1;
                [false; REGIONS]
            }
        }
    }

    /// Writes an image with the detections as `NAME.png`.
    pub fn draw(&self, pixels: &[u8], name: &str) {
        let image = image_of(pixels);
        let detector = &self.detector;
        let mut evidence = Overlay::default();
        overlay::draw_evidence(&mut evidence, detector);
        self.out.layers(name, image, Some(&evidence)).unwrap();
    }

    /// Draws from the standard normal distribution.
    pub fn normal(&mut self) -> f64 {
        self.rng.sample(StandardNormal)
    }

    /// Draws a pose with x in this range, near the center line.
    pub fn random_pose(&mut self, x_m: std::ops::Range<f64>) -> Pose2 {
        let turn = self.rng.random_range(-8.0_f64..8.0).to_radians();
        Pose2::new(self.rng.random_range(x_m), self.rng.random_range(-0.3..0.3), turn)
    }

    /// Returns the hallway with a box of this color.
    pub fn scene(&self, item: &BoxItem, color: Color) -> Scene {
        let mut world = self.world.clone();
        world.boxes.push(BoxItem { color, ..item.clone() });
        Scene::new(&world, 1).unwrap()
    }

    /// Draws the position of a box.
    pub fn random_box(&mut self) -> BoxItem {
        BoxItem {
            at_m: [self.rng.random_range(1.5..13.5), self.rng.random_range(-0.8..0.8)],
            yaw_deg: self.rng.random_range(-45.0..45.0),
            ..BoxItem::default()
        }
    }

    /// Evaluates a random box from up to five poses, its center in each region that still needs images (`missing`); white, or brown with
    /// a contrast to the floor in the range `faint`, gray levels.
    pub fn try_box(
        &mut self,
        missing: &mut [usize; REGIONS],
        faint: Option<(f64, f64)>,
        observations: &mut Vec<Observation>,
    ) {
        let item = self.random_box();
        let poses: Vec<(usize, Pose2)> = (0..REGIONS).filter_map(|r| self.pose_for(&item, r)).collect();
        let Some(&(_, first)) = poses.first() else { return };
        let black = self.scene(&item, [0.0; 3]);
        let mut color = WHITE;
        if let Some((min, max)) = faint {
            let probe = self.scene(&item, BROWN.map(|c| 2.8 * c));
            let Some((contrast, floor)) = self.contrast(&probe, &black, first) else { return };
            let target = floor - self.rng.random_range(min..max);
            let scale = (2.8 * (target / (floor + contrast)).powi(2)) as f32;
            color = BROWN.map(|c| (scale * c).min(1.0));
        }
        let scene = self.scene(&item, color);
        for (region, robot) in poses {
            let Some((contrast, _)) = self.contrast(&scene, &black, robot) else { continue };
            let is_outside = faint.is_some_and(|(min, max)| !(min..max).contains(&contrast.abs()));
            if missing[region] == 0 || is_outside {
                continue;
            }
            missing[region] -= 1;
            let pixels = self.image(&scene, robot);
            let flagged = self.flagged(&pixels, robot);
            let covered = self.covered(&item, robot);
            let is_found = (0..REGIONS).any(|r| flagged[r] && covered[r]);
            let distance_m = robot.inverse().transform_point(item.at_m.into()).x;
            if !is_found {
                let [x, y] = item.at_m;
                eprintln!(
                    "missed: box at {x:.3} {y:.3}, yaw {:.1} deg, contrast {contrast:.0}, region {region}, from {:.3} {:.3} {:.1} deg",
                    item.yaw_deg,
                    robot.x,
                    robot.y,
                    robot.theta.to_degrees()
                );
                for sight in self.detector.results() {
                    eprintln!(
                        "  extra edges {} (limit {:.0}), level edges {}, step {:.1}",
                        sight.extra, sight.limit, sight.level, sight.step.contrast
                    );
                }
                self.draw(&pixels, &format!("missed_{:.0}_{}", contrast, observations.len()));
            }
            observations.push(Observation { region, distance_m, is_found });
        }
    }

    /// Returns a pose that shows the center of the box in a region, 1 to 3 m ahead (2 m in the outer regions).
    pub fn pose_for(&mut self, item: &BoxItem, region: usize) -> Option<(usize, Pose2)> {
        let half_view = (0.5 * self.intrinsics.horizontal_fov()).tan();
        let max_m = if region == 0 || region == REGIONS - 1 { 2.0 } else { 3.0 };
        for _ in 0..100 {
            let ahead_m = self.rng.random_range(1.0..max_m);
            let x = item.at_m[0] - ahead_m;
            let robot = Pose2 { x, ..self.random_pose(0.0..1.0) };
            let at = robot.inverse().transform_point(item.at_m.into());
            let position = 0.5 * REGIONS as f64 * (1.0 - at.y / at.x / half_view);
            if x >= 0.0 && (1.0..=max_m).contains(&at.x) && position.floor() == region as f64 {
                return Some((region, robot));
            }
        }
        None
    }

    /// Returns the median difference between the box and the floor that it hides, and the mean level of that floor, gray levels.
    fn contrast(&mut self, scene: &Scene, black: &Scene, robot: Pose2) -> Option<(f64, f64)> {
        let empty = self.empty.clone();
        let [with, without, shape] =
            [scene, &empty, black].map(|scene| self.noiseless_image(scene, robot).into_iter().map(f64::from));
        let body_from_camera = self.mount.rotation_body_from_camera();
        let intrinsics = self.intrinsics;
        let is_floor = |i: usize| {
            let pixel = [(i % SIZE.0 as usize) as f64, (i / SIZE.0 as usize) as f64].into();
            let ray = body_from_camera * intrinsics.normalized_from_pixel(pixel).push(1.0);
            let scale = self.mount.z / -ray.z;
            ray.z < -0.01 && robot.transform_point((ray.xy() * scale).into()).y.abs() < 0.98
        };
        let hidden = with.zip(without).zip(shape).enumerate();
        let hidden = hidden.filter(|&(i, ((_, without), shape))| without - shape > 25.0 && is_floor(i));
        let (mut steps, mut floor) = (Vec::new(), 0.0);
        for (_, ((with, without), _)) in hidden {
            steps.push(with - without);
            floor += without;
        }
        steps.sort_by(f64::total_cmp);
        let middle = steps.get(steps.len() / 2)?;
        (steps.len() > 50).then(|| (*middle, floor / steps.len() as f64))
    }

    /// Returns true for each region that shows a part of the box.
    pub fn covered(&self, item: &BoxItem, robot: Pose2) -> [bool; REGIONS] {
        let view = MapView::new(&self.intrinsics, &self.mount, &robot);
        let turn = Pose2::new(item.at_m[0], item.at_m[1], item.yaw_deg.to_radians());
        let half = 0.5 * item.size_m[0];
        let columns = [[-half, -half], [-half, half], [half, -half], [half, half]].map(|corner| {
            let at = turn.transform_point(corner.into());
            let point = view.point_in_camera(&[at.x, at.y, 0.0].into());
            (self.intrinsics.cx + self.intrinsics.fx * point.x / point.z).clamp(0.0, f64::from(SIZE.0) - 1.0)
        });
        let regions = Regions::new(SIZE.0 as usize, REGIONS);
        let first = regions.of_column(columns.iter().copied().fold(f64::MAX, f64::min) as usize);
        let last = regions.of_column(columns.iter().copied().fold(0.0, f64::max) as usize);
        std::array::from_fn(|region| (first..=last).contains(&region))
    }
}

fn image_of(pixels: &[u8]) -> ImageView<'_> {
    view(pixels, SIZE.0, SIZE.1).unwrap()
}
