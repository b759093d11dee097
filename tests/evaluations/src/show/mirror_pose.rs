//! The map-localizer on one image of a mirror camera.

use clap::{Args, ValueEnum};
use image::{Rgb, RgbImage};
use yamabico_core::geometry::Pose2;
use yamabico_core::testing::Bench;
use yamabico_map_localizer::MapLocalizer;
use yamabico_rigs::mirror_robot::{MirrorRobot, localizer_parameters};

use crate::arguments::At;
use crate::images::Output;
use crate::report::{Report, Table, number};

/// Robot and world of the configurations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum World {
    /// A room with a conic mirror: azimuths of vertical edges.
    Room,
    /// A soccer field with a hyperboloidal mirror: outline of the floor.
    Field,
}

/// Pose that the map-localizer finds in one rendered image of a mirror camera, from an estimate 4 cm and 2 degrees off.
///
/// Image of the room: edges matched with the map green, others yellow, expected ones blue. Image of the field: detected outline of the floor
/// green, plan from the pose that was found blue.
#[derive(Args)]
pub struct Arguments {
    /// Robot and world.
    world: World,
    #[command(flatten)]
    at: At,
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        let (name, default) = match self.world {
            World::Room => ("room", [-0.9, -0.7, 40.0]),
            World::Field => ("field", [-0.4, 0.05, 20.0]),
        };
        let truth = self.at.or(default);
        let estimate = Pose2::new(truth.x + 0.03, truth.y - 0.03, truth.theta + 0.035);
        let mut robot = MirrorRobot::new(name);
        let pixels = robot.render(truth, 1);
        let mut bench =
            Bench::<MapLocalizer>::new(&localizer_parameters(name, &estimate), robot.setup.clone())
                .map_err(|error| error.to_string())?;
        robot.feed(&mut bench, 0.0, &pixels);
        bench.draw().propose();
        let localizer = &bench.behavior;
        let (status, reason) = localizer.status();
        let pose = localizer.belief().ok_or("the localizer has no pose")?.pose;
        let mut table = Table::new("Pose error", &["status", "reason", "before, mm", "after, mm"]);
        table.row([
            status.as_str().into(),
            reason.as_str().into(),
            number(1e3 * estimate.distance(&truth), 1),
            number(1e3 * pose.distance(&truth), 1),
        ]);
        let [width, height] = robot.camera.image().size();
        let channels = pixels.len() / (width * height) as usize;
        let pixel = |u: u32, v: u32| {
            let first = channels * (v * width + u) as usize;
            Rgb([0, 1, 2].map(|channel: usize| pixels[first + channel.min(channels - 1)]))
        };
        let picture = RgbImage::from_fn(width, height, pixel);
        out.rgb_layers(&format!("mirror_pose_{name}"), picture, bench.overlay())?;
        Ok(Report::new([table]))
    }
}
