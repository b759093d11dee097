//! Contact sheet of buildings drawn from seeds.

use std::time::Instant;

use clap::Args;
use nalgebra::Vector2;
use yamabico_core::geometry::Pose2;
use yamabico_drawing::Canvas;
use yamabico_sim::building::Building;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, random};

use super::require_output;
use crate::arguments::Seeds;
use crate::images::Output;
use crate::report::{Cell, Report, Table, number};

/// Number of images in a row.
const COLUMNS: usize = 5;
/// Number of timed images of each building.
const IMAGES: u32 = 20;
/// Distance from the robot to a person or a box that the image shows, m.
const AHEAD_M: f64 = 2.6;

/// Render buildings drawn from seeds, each as its robot's camera shows it, as `DIR/buildings.png`; measure the time per image.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    seeds: Seeds,
    /// Property of all buildings, such as `floor = "mirror"`; may be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    building: Vec<String>,
    /// World x of the robot [default: before the first box], m.
    #[arg(long, value_name = "M")]
    x: Option<f64>,
    /// Gray images with the camera's noise, blur, glare and gain, as a robot sees them.
    #[arg(long)]
    gray: bool,
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        require_output(out)?;
        let seeds = self.seeds.or(1..21);
        let buildings: Result<Vec<Building>, String> = seeds
            .map(|seed| Building::new(seed, &self.building).map_err(|problems| problems.to_string()))
            .collect();
        let buildings = buildings?;
        let [width, height] = buildings.first().map_or([1, 1], |b| [b.camera().0.width, b.camera().0.height]);
        let (columns, rows) = (COLUMNS.min(buildings.len()), buildings.len().div_ceil(COLUMNS));
        let (sheet_width, line) = (columns * width as usize, 3 * width as usize);
        let mut sheet = vec![0; 3 * sheet_width * rows * height as usize];
        let mut table =
            Table::new("Time per gray image, fastest of 20", &["seed", "floor", "surfaces", "ms"]);
        for (i, building) in buildings.iter().enumerate() {
            let (pixels, row) = self.image(building)?;
            table.row(row);
            let corner = (i / COLUMNS * height as usize * sheet_width + i % COLUMNS * width as usize) * 3;
            for (y, from) in pixels.chunks_exact(line).enumerate() {
                sheet[corner + 3 * y * sheet_width..][..line].copy_from_slice(from);
            }
        }
        out.rgb("buildings", &sheet, sheet_width as u32, rows as u32 * height)?;
        Ok(Report::new([table]))
    }

    fn image(&self, building: &Building) -> Result<(Vec<u8>, [Cell; 4]), String> {
        let mut scene = Scene::new(&building.world, building.seed).map_err(|error| error.to_string())?;
        let first = building.world.boxes.iter().map(|item| item.at_m[0]).fold(f64::INFINITY, f64::min);
        let before = if first.is_finite() { first - AHEAD_M } else { 0.0 };
        let robot = Pose2::new(self.x.unwrap_or(before.max(0.0)), 0.0, 0.0);
        scene.set_time(robot.x / 0.4).map_err(|error| error.to_string())?;
        let (intrinsics, mount) = building.camera();
        let view = CameraView { intrinsics, mount, robot };
        let count = (intrinsics.width * intrinsics.height) as usize;
        let (mut gray, mut rgb) = (vec![0; count], vec![0; 3 * count]);
        let mut renderer = Renderer::new(building.photometry(), random::stream(building.seed, "front"));
        let mut fastest_ms = f64::INFINITY;
        for _ in 0..IMAGES {
            let start = Instant::now();
            renderer.render(&scene, &view, &mut gray).map_err(|error| error.to_string())?;
            fastest_ms = fastest_ms.min(start.elapsed().as_secs_f64() * 1e3);
        }
        if self.gray {
            rgb = gray.iter().flat_map(|level| [*level; 3]).collect();
        } else {
            let clean = Photometry { noise_sigma: 0.0, flicker: 0.0, ..building.photometry() };
            let mut clean = Renderer::new(clean, random::stream(building.seed, "front"));
            clean.render_rgb(&scene, &view, &mut rgb).map_err(|error| error.to_string())?;
        }
        let mut canvas = Canvas::new(&mut rgb, intrinsics.width as usize, intrinsics.height as usize)
            .ok_or("an image without pixels")?;
        canvas.text(Vector2::new(4.0, 4.0), &building.seed.to_string(), [255, 220, 0]);
        let floor = serde_json::to_value(building.properties.floor).map_err(|error| error.to_string())?;
        let floor = floor.as_str().unwrap_or_default().to_owned();
        Ok((rgb, [building.seed.into(), floor.into(), scene.surfaces().len().into(), number(fastest_ms, 2)]))
    }
}
