//! The intersection tracker on one image.

use std::path::PathBuf;

use clap::Args;
use yamabico_core::camera::{Calibration, Intrinsics, Mount, Pinhole};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{FrameHeader, Odometry, Proposal};
use yamabico_core::testing::{Bench, camera_setup};
use yamabico_core::time::Time;
use yamabico_intersection_tracker::finder::{EndFinder, FinderRule};
use yamabico_intersection_tracker::{CAMERA, IntersectionTracker, ODOMETRY};
use yamabico_sim::random::stream;
use yamabico_sim::world::{Branch, Side as WallSide};
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World};
use yamabico_vision::corridor::floor_lines::FloorLineRule;
use yamabico_vision::corridor::observer::{CorridorCamera, CorridorObserver};

use super::navel_grid::proposal_table;
use crate::images::{Output, load_gray, view};
use crate::report::{Report, Table, number};

/// Proposal of the intersection tracker on one image of a camera that looks along a corridor, of a robot at rest.
///
/// By default a rendered image, `--distance` before a crossing. Image: edges along the corridor blue, wall ends yellow, floor lines of
/// both walls green, tracked edges and their center red.
#[derive(Args)]
pub struct Arguments {
    /// Image of the robot's camera [default: rendered].
    image: Option<PathBuf>,
    /// Horizontal field of view, degrees.
    #[arg(long, default_value_t = 60.0)]
    fov_deg: f64,
    /// Height of the camera above the floor, m.
    #[arg(long, default_value_t = 0.6)]
    height_m: f64,
    /// Downward tilt of the camera, degrees.
    #[arg(long, default_value_t = 6.0)]
    tilt_deg: f64,
    /// Distance before the crossing, m.
    #[arg(long, default_value_t = 6.0)]
    distance_m: f64,
}

/// A gray image and its camera.
struct Shot {
    pixels: Vec<u8>,
    intrinsics: Intrinsics,
    mount: Mount,
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        let shot = match &self.image {
            Some(path) => {
                let image = load_gray(path)?;
                let (intrinsics, mount) = self.camera(image.width() as u32, image.height() as u32);
                Shot { pixels: image.pixels().to_vec(), intrinsics, mount }
            }
            None => self.render()?,
        };
        let (bench, proposal) = propose(&shot)?;
        let mut ends = Table::new("Wall ends", &["side", "ahead, m", "to the left, m"]);
        let image = view(&shot.pixels, shot.intrinsics.width, shot.intrinsics.height)?;
        let mut observer = CorridorObserver::new(
            CorridorCamera {
                pinhole: Pinhole::ideal(shot.intrinsics),
                mount: shot.mount,
                calibration: Calibration::Measured,
                horizon_sigma_rad: 1_f64.to_radians(),
            },
            FloorLineRule::default(),
        );
        let observation = observer.observe(image, None);
        let rule = FinderRule { range_m: [1.5, 12.0], border_px: 25.0, pair_m: 0.3 };
        let mut finder = EndFinder::default();
        let found = match &observation {
            Ok(observation) => finder.find(image, &observer, observation, &rule).to_vec(),
            Err(reason) => {
                eprintln!("no corridor: {reason}");
                Vec::new()
            }
        };
        for end in &found {
            ends.row([
                format!("{:?}", end.side).into(),
                number(end.ahead_m, 2),
                number(end.point_in_robot.y, 2),
            ]);
        }
        out.layers("intersection", image, bench.overlay())?;
        Ok(Report::new([proposal_table(&proposal), ends]))
    }

    fn camera(&self, width: u32, height: u32) -> (Intrinsics, Mount) {
        (
            Intrinsics::from_horizontal_fov(width, height, self.fov_deg.to_radians()),
            Mount::tilted(self.height_m, self.tilt_deg.to_radians()),
        )
    }

    fn render(&self) -> Result<Shot, String> {
        let mut world = World::corridor(23.0, 2.0);
        if let Some(corridor) = &mut world.corridor {
            let branch = |side| Branch { side, at_m: 13.2, width_m: 2.4, depth_m: 5.0 };
            corridor.branches = vec![branch(WallSide::Left), branch(WallSide::Right)];
        }
        let scene = Scene::new(&world, 0).map_err(|error| error.to_string())?;
        let (intrinsics, mount) = self.camera(640, 480);
        let robot = Pose2::new(12.0 - self.distance_m, 0.1, 0.03);
        let mut renderer = Renderer::new(Photometry::default(), stream(1, "propose_on_image"));
        let view = CameraView { intrinsics, mount, robot };
        Ok(Shot { pixels: yamabico_rigs::camera::render(&mut renderer, &scene, &view), intrinsics, mount })
    }
}

/// Feeds the same image several times, from a robot at rest.
fn propose(shot: &Shot) -> Result<(Bench<IntersectionTracker>, Proposal), String> {
    let (intrinsics, mount) = (shot.intrinsics, shot.mount);
    let mut bench = Bench::<IntersectionTracker>::new("", camera_setup(intrinsics, mount))
        .map_err(|error| error.to_string())?;
    let mut proposal = Proposal::default();
    bench.draw();
    for call in 1..=4 {
        let seconds = 0.1 * f64::from(call);
        let stamp_ns = Time::from_secs_f64(seconds).0;
        let header = FrameHeader::gray(intrinsics.width, intrinsics.height, stamp_ns);
        bench.at(seconds).feed(&ODOMETRY, &Odometry { stamp_ns, ..Odometry::default() }, &[]);
        proposal = bench.feed(&CAMERA, &header, &shot.pixels).propose();
    }
    Ok((bench, proposal))
}
