//! Boxes in the rendered hallway, and what the detector makes of pictures of them.

use std::path::{Path, PathBuf};

use rand::RngExt;
use rand_distr::StandardNormal;
use yamabico_core::camera::{Intrinsics, Mount, Pinhole};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::ImageView;
use yamabico_drawing::Canvas;
use yamabico_sim::random::{Stream, stream};
use yamabico_sim::world::{BoxItem, Color};
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World};
use yamabico_stationary_obstacle_avoider::detector::{Detector, DetectorRules};
use yamabico_stationary_obstacle_avoider::threshold_learning::{PlaceLearner, Validity};
use yamabico_stationary_obstacle_avoider::threshold_table::{Place, ThresholdTable};
use yamabico_vision::map::{MapView, WireFrame};
use yamabico_vision::vertical_edges::Regions;

/// Of the pictures, pixels.
pub const SIZE: (u32, u32) = (256, 240);
/// Regions of a picture.
pub const REGIONS: usize = 5;
/// Color of a white box.
pub const WHITE: Color = [0.85, 0.85, 0.83];
/// Color of a brown box.
pub const BROWN: Color = [0.30, 0.19, 0.10];

/// The hallway, the camera and the detector.
pub struct Course {
    world: World,
    pub empty: Scene,
    intrinsics: Intrinsics,
    mount: Mount,
    film: Renderer,
    quiet: Renderer,
    pub rng: Stream,
    detector: Detector,
    pub table: ThresholdTable,
    /// Pictures that the detector refused to judge: they show no obstacle, and are no proof of a clear way either.
    pub unjudged: u32,
    pub show: Option<PathBuf>,
}

/// A picture of a box and what became of it.
pub struct Seen {
    pub region: usize,
    pub distance_m: f64,
    pub is_found: bool,
}

impl Course {
    pub fn new(seed: u64, show: Option<PathBuf>) -> Self {
        let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs");
        let mut world =
            World::from_toml(&std::fs::read_to_string(configs.join("worlds/hallway.toml")).unwrap()).unwrap();
        world.people.clear();
        world.boxes.clear();
        let map = WireFrame::read(&configs.join("maps/hallway.toml")).unwrap();
        let intrinsics = Intrinsics::from_horizontal_fov(SIZE.0, SIZE.1, 60_f64.to_radians());
        let mount = Mount::tilted(0.6, 6_f64.to_radians());
        let rules = DetectorRules::for_size(SIZE.0, SIZE.1);
        let photometry = Photometry::default();
        Self {
            empty: Scene::new(&world, 1).unwrap(),
            world,
            intrinsics,
            mount,
            film: Renderer::new(photometry, stream(seed, "film")),
            quiet: Renderer::new(Photometry { noise_sigma: 0.0, ..photometry }, stream(seed, "quiet")),
            rng: stream(seed, "boxes"),
            show,
            detector: Detector::new(Pinhole::ideal(intrinsics), mount, map, rules),
            unjudged: 0,
            table: ThresholdTable {
                width: SIZE.0,
                height: SIZE.1,
                regions: REGIONS as u32,
                exposure: 1.0,
                places: Vec::new(),
            },
        }
    }

    pub fn picture(&mut self, scene: &Scene, robot: Pose2) -> Vec<u8> {
        let view = CameraView { intrinsics: self.intrinsics, mount: self.mount, robot };
        let mut pixels = vec![0; (SIZE.0 * SIZE.1) as usize];
        self.film.render(scene, &view, &mut pixels).unwrap();
        pixels
    }

    pub fn quiet_picture(&mut self, scene: &Scene, robot: Pose2) -> Vec<u8> {
        let view = CameraView { intrinsics: self.intrinsics, mount: self.mount, robot };
        let mut pixels = vec![0; (SIZE.0 * SIZE.1) as usize];
        self.quiet.render(scene, &view, &mut pixels).unwrap();
        pixels
    }

    /// Learns along the middle of the empty hallway.
    pub fn learn(&mut self) {
        let empty = self.empty.clone();
        for step in 0..25 {
            let mut learner = PlaceLearner::default();
            for picture in 0..12 {
                let x = 0.5 * f64::from(step) + 0.04 * f64::from(picture);
                let robot = Pose2::new(x, 0.15 * (3.0 * x).sin(), 0.1 * (2.0 * x).cos());
                let pixels = self.picture(&empty, robot);
                let (rows, look) = self.detector.learn(view(&pixels), &robot).unwrap();
                learner.take(&rows, look);
            }
            let learned = learner.learned().unwrap();
            let (x_m, recall) = (0.5 * f64::from(step) + 0.22, learned.recall.unwrap_or(0.0));
            if learned.validity != Validity::Valid {
                println!("x = {x_m:.2} m: refused, recall {recall:.2}");
                continue;
            }
            self.table.places.push(Place {
                x_m,
                y_m: 0.0,
                heading_deg: 0.0,
                t0: learned.t0,
                n0: learned.n0,
                n0_extra: learned.n0_extra,
                contrast: learner.look().contrast,
                level: learner.look().level,
                recall,
            });
        }
    }

    /// Regions that are flagged in a picture; the detector is told a slightly wrong pose.
    pub fn flagged(&mut self, pixels: &[u8], robot: Pose2) -> [bool; REGIONS] {
        let told = Pose2::new(
            robot.x + 0.05 * self.normal(),
            robot.y + 0.02 * self.normal(),
            robot.theta + 0.2_f64.to_radians() * self.normal(),
        );
        let Some(place) = self.table.at(&told, 1.0) else { panic!("nothing was learned near {told:?}") };
        match self.detector.look(view(pixels), &told, 0.2_f64.to_radians(), &place) {
            Ok(sights) => std::array::from_fn(|region| sights[region].is_obstacle),
            Err(_) => {
                self.unjudged += 1;
                [false; REGIONS]
            }
        }
    }

    /// Keeps a picture with what was seen in it, where that was asked for.
    pub fn show(&self, pixels: &[u8], name: &str) {
        let Some(folder) = &self.show else { return };
        let mut rgb = vec![0; 3 * pixels.len()];
        let mut canvas = Canvas::new(&mut rgb, SIZE.0 as usize, SIZE.1 as usize).unwrap();
        yamabico_stationary_obstacle_avoider::overlay::draw(&self.detector, view(pixels), &mut canvas);
        let path = folder.join(format!("{name}.png"));
        image::save_buffer(path, &rgb, SIZE.0, SIZE.1, image::ExtendedColorType::Rgb8).unwrap();
    }

    pub fn normal(&mut self) -> f64 {
        self.rng.sample(StandardNormal)
    }

    pub fn somewhere(&mut self, x_m: std::ops::Range<f64>) -> Pose2 {
        let turn = self.rng.random_range(-8.0_f64..8.0).to_radians();
        Pose2::new(self.rng.random_range(x_m), self.rng.random_range(-0.3..0.3), turn)
    }

    pub fn scene(&self, item: &BoxItem, color: Color) -> Scene {
        let mut world = self.world.clone();
        world.boxes.push(BoxItem { color, ..item.clone() });
        Scene::new(&world, 1).unwrap()
    }

    /// A box somewhere.
    pub fn item(&mut self) -> BoxItem {
        BoxItem {
            at_m: [self.rng.random_range(1.5..13.5), self.rng.random_range(-0.8..0.8)],
            yaw_deg: self.rng.random_range(-45.0..45.0),
            ..BoxItem::default()
        }
    }

    /// A box somewhere, painted by `paint`, seen from up to five poses with its middle in a region where `wanted` is left.
    pub fn try_box(
        &mut self,
        wanted: &mut [usize; REGIONS],
        faint: Option<(f64, f64)>,
        seen: &mut Vec<Seen>,
    ) {
        let item = self.item();
        let poses: Vec<(usize, Pose2)> = (0..REGIONS).filter_map(|r| self.pose_for(&item, r)).collect();
        let Some(&(_, first)) = poses.first() else { return };
        let black = self.scene(&item, [0.0; 3]);
        let mut color = WHITE;
        if let Some((least, most)) = faint {
            let probe = self.scene(&item, BROWN.map(|c| 2.8 * c));
            let Some((contrast, floor)) = self.contrast(&probe, &black, first) else { return };
            let target = floor - self.rng.random_range(least..most);
            let scale = (2.8 * (target / (floor + contrast)).powi(2)) as f32;
            color = BROWN.map(|c| (scale * c).min(1.0));
        }
        let scene = self.scene(&item, color);
        for (region, robot) in poses {
            let Some((contrast, _)) = self.contrast(&scene, &black, robot) else { continue };
            let is_outside = faint.is_some_and(|(least, most)| !(least..most).contains(&contrast.abs()));
            if wanted[region] == 0 || is_outside {
                continue;
            }
            wanted[region] -= 1;
            let pixels = self.picture(&scene, robot);
            let flagged = self.flagged(&pixels, robot);
            let covered = self.covered(&item, robot);
            let is_found = (0..REGIONS).any(|r| flagged[r] && covered[r]);
            let distance_m = robot.inverse().transform_point(item.at_m.into()).x;
            if !is_found {
                let [x, y] = item.at_m;
                println!(
                    "missed: box at {x:.3} {y:.3}, turned {:.1} deg, contrast {contrast:.0}, region {region}, from {:.3} {:.3} {:.1} deg",
                    item.yaw_deg,
                    robot.x,
                    robot.y,
                    robot.theta.to_degrees()
                );
                for sight in self.detector.sights() {
                    println!(
                        "  extra {} (at most {:.0}), level {}, step {:.1}",
                        sight.extra, sight.limit, sight.level, sight.upright.contrast
                    );
                }
                self.show(&pixels, &format!("missed_{:.0}_{}", contrast, seen.len()));
            }
            seen.push(Seen { region, distance_m, is_found });
        }
    }

    /// A pose that has the box's middle in a region, 1 to 3 m ahead.
    pub fn pose_for(&mut self, item: &BoxItem, region: usize) -> Option<(usize, Pose2)> {
        let half_view = (0.5 * self.intrinsics.horizontal_fov()).tan();
        let farthest = if region == 0 || region == REGIONS - 1 { 2.0 } else { 3.0 };
        for _ in 0..100 {
            let ahead_m = self.rng.random_range(1.0..farthest);
            let x = item.at_m[0] - ahead_m;
            let robot = Pose2 { x, ..self.somewhere(0.0..1.0) };
            let at = robot.inverse().transform_point(item.at_m.into());
            let place = 0.5 * REGIONS as f64 * (1.0 - at.y / at.x / half_view);
            if x >= 0.0 && (1.0..=farthest).contains(&at.x) && place.floor() == region as f64 {
                return Some((region, robot));
            }
        }
        None
    }

    /// The median difference to the floor and the mean level of the floor that the box hides.
    fn contrast(&mut self, scene: &Scene, black: &Scene, robot: Pose2) -> Option<(f64, f64)> {
        let empty = self.empty.clone();
        let [with, without, shape] =
            [scene, &empty, black].map(|scene| self.quiet_picture(scene, robot).into_iter().map(f64::from));
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

    /// The regions that the box covers columns of.
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

/// The pixels as a picture.
pub fn view(pixels: &[u8]) -> ImageView<'_> {
    ImageView::new(pixels, SIZE.0 as usize, SIZE.1 as usize, SIZE.0 as usize).unwrap()
}
