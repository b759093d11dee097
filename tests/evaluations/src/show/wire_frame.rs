//! The map-localizer's wire-frame method on one image.

use clap::Args;
use yamabico_core::behavior::Setup;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{FrameHeader, Odometry};
use yamabico_core::sensor::Robot;
use yamabico_core::testing::{Bench, camera_setup};
use yamabico_map_localizer::{CAMERA, MapLocalizer, ODOMETRY};
use yamabico_rigs::camera::{forward_camera, render, world};
use yamabico_sim::random::stream;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene};

use super::ImageFile;
use super::navel_grid::proposal_table;
use crate::images::{Output, load_gray, view};
use crate::report::{Cell, Report, Table, number};

/// Pose that the map-localizer finds by its wire-frame map in one image of the hallway, and its proposal.
///
/// The image must be of a camera 60 degrees wide, 0.6 m above the floor, 6 degrees down; by default one is rendered 5 cm and 1 degree
/// from the estimate `--at`. Image: expected edges blue if matched, else yellow; matched segments green, others gray.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    file: ImageFile,
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        let estimate = self.file.at.or([2.6, 0.1, 3.0]);
        let (pixels, width, height) = match &self.file.image {
            Some(path) => {
                let image = load_gray(path)?;
                (image.pixels().to_vec(), image.width() as u32, image.height() as u32)
            }
            None => {
                let truth = Pose2::new(estimate.x + 0.05, estimate.y - 0.05, estimate.theta + 0.0175);
                let (intrinsics, mount) = forward_camera(640, 480, 60.0, 6.0);
                let scene = Scene::new(&world("hallway"), 1).map_err(|error| error.to_string())?;
                let mut renderer = Renderer::new(Photometry::default(), stream(1, "picture"));
                let view = CameraView { intrinsics, mount, robot: truth };
                (render(&mut renderer, &scene, &view), 640, 480)
            }
        };
        let (intrinsics, mount) = forward_camera(width, height, 60.0, 6.0);
        let parameters = format!(
            "map = \"maps/hallway.toml\"\nroute = [[12.5, 0.0]]\n\
             start = {{ x_m = {:?}, y_m = {:?}, heading_deg = {:?}, sigma_m = 0.06, sigma_deg = 1.2 }}",
            estimate.x,
            estimate.y,
            estimate.theta.to_degrees()
        );
        let setup = Setup {
            folder: yamabico_testkit::configs(),
            robot: Robot { radius_m: 0.2, ..Robot::default() },
            ..camera_setup(intrinsics, mount)
        };
        let mut bench = Bench::<MapLocalizer>::new(&parameters, setup).map_err(|error| error.to_string())?;
        let frame = FrameHeader::gray(width, height, 0);
        bench.feed(&ODOMETRY, &Odometry::default(), &[]).feed(&CAMERA, &frame, &pixels);
        let proposal = bench.draw().propose();
        let localizer = &bench.behavior;
        let (status, reason) = localizer.status();
        let mut poses = Table::new(
            format!("Pose: {} ({})", status.as_str(), reason.as_str()),
            &["pose", "x, m", "y, m", "heading, deg"],
        );
        poses.row(pose_row("before", &estimate));
        let mut matches = Table::new("Matches", &["expected edges", "matched", "verdict"]);
        if let (Some(fix), Some(belief)) = (localizer.last_fix(), localizer.belief()) {
            poses.row(pose_row("after", &belief.pose));
            matches.row([fix.expected.into(), fix.lines.into(), format!("{:?}", fix.verdict).into()]);
        }
        out.layers("wire_frame", view(&pixels, width, height)?, bench.overlay())?;
        Ok(Report::new([poses, matches, proposal_table(&proposal)]))
    }
}

fn pose_row(name: &str, pose: &Pose2) -> [Cell; 4] {
    [name.into(), number(pose.x, 3), number(pose.y, 3), number(pose.theta.to_degrees(), 2)]
}
