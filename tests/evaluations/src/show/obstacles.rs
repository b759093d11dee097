//! The stationary-obstacle avoider on one image.

use clap::Args;
use yamabico_core::camera::Pinhole;
use yamabico_core::overlay::Overlay;
use yamabico_rigs::camera::{forward_camera, render, world};
use yamabico_sim::world::BoxItem;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, random};
use yamabico_stationary_obstacle_avoider::detector::{Detector, DetectorRules};
use yamabico_stationary_obstacle_avoider::overlay;
use yamabico_stationary_obstacle_avoider::safe_passage::{Interval, SafePassage, region_on_plane};
use yamabico_stationary_obstacle_avoider::threshold_table::ThresholdTable;
use yamabico_vision::map::WireFrame;

use super::ImageFile;
use crate::images::{Output, load_gray, view};
use crate::report::{Report, Table, number};

const SIZE: (u32, u32) = (256, 240);
/// Half the width that the robot needs, m.
const HALF_WIDTH_M: f64 = 0.23;

/// Obstacles that the stationary-obstacle avoider detects in one image of the hallway robot (256 x 240, 60 degrees).
///
/// The image must be taken at the given pose of the map; by default the hallway is rendered with a box in it. Image: edges explained by
/// the map green, edges that it lets expect blue, edges that it does not contain red, obstacles yellow, with counts and limits.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    file: ImageFile,
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        let robot = self.file.at.or([3.0, 0.0, 0.0]);
        let (intrinsics, mount) = forward_camera(SIZE.0, SIZE.1, 60.0, 6.0);
        let pixels = match &self.file.image {
            Some(path) => load_gray(path)?.pixels().to_vec(),
            None => {
                let mut world = world("hallway");
                world.people.clear();
                let item = BoxItem { at_m: [robot.x + 1.9, 0.15], yaw_deg: 20.0, ..BoxItem::default() };
                world.boxes = vec![item];
                let scene = Scene::new(&world, 1).map_err(|error| error.to_string())?;
                let mut renderer =
                    Renderer::new(Photometry::default(), random::stream(1, "propose_on_image"));
                render(&mut renderer, &scene, &CameraView { intrinsics, mount, robot })
            }
        };
        let image = view(&pixels, SIZE.0, SIZE.1)?;
        let file = |name: &str| yamabico_testkit::config(name);
        let map = WireFrame::read(&file("maps/hallway.toml")).map_err(|error| error.to_string())?;
        let table =
            ThresholdTable::read(&file("maps/hallway-thresholds.toml")).map_err(|error| error.to_string())?;
        let place = table.at(&robot, table.exposure).ok_or("no thresholds were learned near this pose")?;
        let rules = DetectorRules::for_size(SIZE.0, SIZE.1);
        let mut detector = Detector::new(Pinhole::ideal(intrinsics), mount, map, rules);
        let sights = match detector.detect(image, &robot, 1e-3, &place) {
            Ok(sights) => sights.to_vec(),
            Err(reason) => return Err(format!("the detector refuses the image: {reason}")),
        };
        let half_view = (0.5 * intrinsics.horizontal_fov()).tan();
        let mut passage = SafePassage::default();
        passage.begin(Interval::new(-half_view, half_view).widened(-HALF_WIDTH_M));
        let mut regions = Table::new(
            format!("Regions, T0 {}", place.t0),
            &["region", "extra edges", "limit", "level edges", "faint step", "result"],
        );
        for (region, sight) in sights.iter().enumerate() {
            regions.row([
                region.into(),
                sight.extra.into(),
                number(sight.limit, 0),
                sight.level.into(),
                number(sight.step.contrast, 1),
                if sight.is_obstacle { "obstacle" } else { "free" }.into(),
            ]);
            if sight.is_obstacle {
                passage.block(region_on_plane(region, sights.len(), half_view).widened(HALF_WIDTH_M));
            }
        }
        let mut result = Table::new("Passage", &["passage"]);
        result.row([match passage.choose(0.0, 0.05) {
            Some(aim) if aim.deviates => format!("at {:+.0} degrees", aim.bearing().to_degrees()).into(),
            Some(_) => "straight on".into(),
            None => "none in view: the robot looks around".into(),
        }]);
        let mut evidence = Overlay::default();
        overlay::draw_evidence(&mut evidence, &detector);
        out.layers("obstacles", image, Some(&evidence))?;
        Ok(Report::new([regions, result]))
    }
}
