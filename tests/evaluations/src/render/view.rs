//! A world as a camera shows it.

use std::path::PathBuf;

use clap::Args;
use yamabico_rigs::camera::forward_camera;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, random};

use super::{read_world, require_output};
use crate::arguments::{At, Size};
use crate::images::Output;
use crate::report::Report;

/// Render a world file from the forward camera of a robot, in color, as `DIR/view.png`.
#[derive(Args)]
pub struct Arguments {
    /// World file, such as configs/worlds/hallway.toml.
    world: PathBuf,
    #[command(flatten)]
    at: At,
    #[command(flatten)]
    size: Size,
    /// Time since the start, which moves people, s.
    #[arg(long, default_value_t = 0.0)]
    time_s: f64,
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        require_output(out)?;
        let mut scene = Scene::new(&read_world(&self.world)?, 1).map_err(|error| error.to_string())?;
        scene.set_time(self.time_s).map_err(|error| error.to_string())?;
        let (width, height) = self.size.or((640, 480));
        let (intrinsics, mount) = forward_camera(width, height, 60.0, 5.0);
        let mut pixels = vec![0; 3 * (width * height) as usize];
        Renderer::new(Photometry::default(), random::stream(1, "render_view"))
            .render_rgb(&scene, &CameraView { intrinsics, mount, robot: self.at.or([0.0; 3]) }, &mut pixels)
            .map_err(|error| error.to_string())?;
        out.rgb("view", &pixels, width, height)?;
        Ok(Report::default())
    }
}
