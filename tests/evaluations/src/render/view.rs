//! A world as a camera shows it.

use clap::Args;
use yamabico_rigs::camera::forward_camera;
use yamabico_sim::{CameraView, Photometry, Renderer, random};

use super::{SceneFile, require_output};
use crate::arguments::Size;
use crate::images::Output;
use crate::report::Report;

/// Render a world file from the forward camera of a robot, in color, as `DIR/view.png`.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    file: SceneFile,
    #[command(flatten)]
    size: Size,
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        require_output(out)?;
        let (width, height) = self.size.or((640, 480));
        let (intrinsics, mount) = forward_camera(width, height, 60.0, 5.0);
        let mut pixels = vec![0; 3 * (width * height) as usize];
        Renderer::new(Photometry::default(), random::stream(1, "render_view"))
            .render_rgb(
                &self.file.scene()?,
                &CameraView { intrinsics, mount, robot: self.file.at.or([0.0; 3]) },
                &mut pixels,
            )
            .map_err(|error| error.to_string())?;
        out.rgb("view", &pixels, width, height)?;
        Ok(Report::default())
    }
}
