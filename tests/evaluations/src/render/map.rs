//! The wire-frame map of a world's building.

use std::path::PathBuf;

use clap::Args;
use yamabico_core::camera::Pinhole;
use yamabico_drawing::Canvas;
use yamabico_rigs::camera::forward_camera;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World, random};
use yamabico_vision::map::{EdgeRole, ExpectationMap, ExpectationRules, WIRE_FRAME_FILE, WireFrame};

use super::read_world;
use crate::arguments::At;
use crate::images::Output;
use crate::report::{Report, Table};

const SIZE: (u32, u32) = (640, 480);

/// Write the wire-frame map of the building of a world file.
///
/// Image: the view from `--at` with the edges that the map lets expect; outlines pink, details orange.
#[derive(Args)]
pub struct Arguments {
    /// World file, such as configs/worlds/hallway.toml.
    world: PathBuf,
    /// Map file to write.
    map: PathBuf,
    #[command(flatten)]
    at: At,
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        let world = read_world(&self.world)?;
        let map = world.wire_frame();
        let key = WIRE_FRAME_FILE.key;
        let name = self.world.file_stem().unwrap_or_default().to_string_lossy();
        let head = format!(
            "#:schema ../schemas/{key}.json\n# Edges and walls of the building of worlds/{name}.toml, written from it:\n\
             #\n\
             #     cargo run --release -p yamabico-evaluations -- render map WORLD.toml MAP.toml\n\
             #\n\
             # Meters, each -1000000 to 1000000; map frame: that of the world, z up from the floor. A detail runs beside an\n\
             # outline and cannot be distinguished from it at a distance.\n\n\
             name = \"{name}\"\n"
        );
        std::fs::write(&self.map, head + &map.to_toml())
            .map_err(|error| format!("{}: {error}", self.map.display()))?;
        if out.is_on() {
            self.draw(out, &world, &map)?;
        }
        let mut table = Table::new("Map", &["edges", "walls"]);
        table.row([map.edges().len().into(), map.walls().len().into()]);
        Ok(Report::new([table]))
    }

    fn draw(&self, out: &Output, world: &World, map: &WireFrame) -> Result<(), String> {
        let scene = Scene::new(world, 1).map_err(|error| error.to_string())?;
        let (intrinsics, mount) = forward_camera(SIZE.0, SIZE.1, 60.0, 6.0);
        let robot = self.at.or([0.0; 3]);
        let mut pixels = vec![0; (3 * SIZE.0 * SIZE.1) as usize];
        Renderer::new(Photometry::default(), random::stream(1, "wire_frame_map"))
            .render_rgb(&scene, &CameraView { intrinsics, mount, robot }, &mut pixels)
            .map_err(|error| error.to_string())?;
        let mut canvas =
            Canvas::new(&mut pixels, SIZE.0 as usize, SIZE.1 as usize).ok_or("an image without pixels")?;
        let mut expectation = ExpectationMap::new(ExpectationRules::everything());
        for edge in expectation.compute(map, &Pinhole::ideal(intrinsics), &mount, &robot) {
            let color = if edge.role == EdgeRole::Detail { [255, 160, 0] } else { [255, 0, 80] };
            canvas.line(edge.from, edge.to, color);
        }
        out.rgb("map", &pixels, SIZE.0, SIZE.1)
    }
}
