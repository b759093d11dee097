//! A world as each kind of mirror camera shows it.

use std::time::Instant;

use clap::Args;
use serde::Deserialize;
use yamabico_core::camera::mirror_camera::mirror_camera;
use yamabico_core::camera::{MirrorConfig, MirrorImageConfig, Mount};
use yamabico_sim::{MirrorRenderer, MirrorView, Photometry, random};

use super::{SceneFile, require_output};
use crate::images::Output;
use crate::report::{Report, Table, number};

/// Name, height of the lens or the viewpoint (m), and tables of a robot file.
const CAMERAS: [(&str, f64, &str); 3] = [
    (
        "conic",
        0.30,
        "picture = { width = 512, height = 480, blind_radius_px = 12 }
         mirror = { kind = 'conic', vertex_angle_deg = 112.6, lens_to_vertex_m = 0.11, focal_px = 576.563 }",
    ),
    (
        "hyperboloidal",
        0.60,
        "picture = { width = 512, height = 480, blind_radius_px = 30 }
         mirror = { kind = 'hyperboloidal', focal_px = 520, eccentricity = 1.45, foci_m = 0.08 }",
    ),
    (
        "radial",
        0.60,
        "picture = { width = 512, height = 480, blind_radius_px = 36 }
         mirror = { kind = 'radial', profile = { form = 'tangent', range_m = 1.788, deg_per_px = 0.44, \
          height_m = 0.6 } }",
    ),
];
/// Number of timed images.
const IMAGES: u32 = 20;

#[derive(Deserialize)]
struct Tables {
    picture: MirrorImageConfig,
    mirror: MirrorConfig,
}

/// Render a world file with each kind of mirror camera, and measure the time per image.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    file: SceneFile,
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        require_output(out)?;
        let scene = self.file.scene()?;
        let robot = self.file.at.or([0.0; 3]);
        let mut table = Table::new("Time per color image", &["mirror", "width", "height", "ms"]);
        for (name, height_m, tables) in CAMERAS {
            let tables: Tables = toml::from_str(tables).map_err(|error| error.to_string())?;
            let camera = mirror_camera(&tables.picture, &tables.mirror).map_err(|error| error.to_string())?;
            let (width, height) = (camera.image().width, camera.image().height);
            let mut renderer = MirrorRenderer::new(camera, Photometry::default(), random::stream(1, name));
            let view = MirrorView { mount: Mount::level(height_m), robot };
            let mut pixels = vec![0; 3 * (width * height) as usize];
            let mut render =
                || renderer.render_rgb(&scene, &view, &mut pixels).map_err(|error| error.to_string());
            render()?;
            let start = Instant::now();
            for _ in 0..IMAGES {
                render()?;
            }
            let each_ms = start.elapsed().as_secs_f64() * 1e3 / f64::from(IMAGES);
            out.rgb(name, &pixels, width, height)?;
            table.row([name.into(), width.into(), height.into(), number(each_ms, 1)]);
        }
        Ok(Report::new([table]))
    }
}
