//! Training images for `yamabico learn floor`.

use clap::Args;
use nalgebra::Vector2;
use yamabico_core::camera::{HyperboloidalMirror, Mirror, MirrorCamera, MirrorImage, Mount};
use yamabico_core::geometry::Pose2;
use yamabico_rigs::camera::world;
use yamabico_rigs::field::{LENS_M, SIZE};
use yamabico_sim::{MirrorRenderer, MirrorView, Photometry, Scene, random};

use super::require_output;
use crate::arguments::Samples;
use crate::images::Output;
use crate::report::Report;

/// Half the length and width of the field less the robot, m.
const REACH_M: [f64; 2] = [1.2, 0.6];
/// Difference in color above which a pixel shows floor, levels.
const FLOOR_DIFFERENCE: i32 = 12;

/// Render images of the simulated soccer field with floor masks, for `yamabico learn floor`.
///
/// The mask comes from a second image of each scene, in which only the floor has another color.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    samples: Samples,
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        require_output(out)?;
        let [width, height] = SIZE;
        let world = world("field");
        let mut recolored = world.clone();
        recolored.floor.color = [0.6, 0.1, 0.6];
        let image = MirrorImage::centered(width, height).with_ring(22.0, 112.0).map_err(|e| e.to_string())?;
        let mirror = HyperboloidalMirror::new(479.374_593, 1.265_184_85, 0.040_083_7)
            .map_err(|error| error.to_string())?;
        let camera =
            MirrorCamera::new(image, Mirror::Hyperboloidal(mirror)).map_err(|error| error.to_string())?;
        for index in 0..self.samples.count_or(12) as u64 {
            let turn = 2.4 * index as f64;
            let robot = Pose2::new(REACH_M[0] * turn.sin(), REACH_M[1] * (1.7 * turn).sin(), turn);
            let view = MirrorView { mount: Mount::level(LENS_M), robot };
            let mut images = [&world, &recolored].map(|_| vec![0; (3 * width * height) as usize]);
            for (world, pixels) in [&world, &recolored].into_iter().zip(&mut images) {
                let noise = random::stream(index, "floor");
                let mut renderer = MirrorRenderer::new(camera.clone(), Photometry::default(), noise);
                let scene = Scene::new(world, 100 + index).map_err(|error| error.to_string())?;
                renderer.render_rgb(&scene, &view, pixels).map_err(|error| error.to_string())?;
            }
            let [original, recolored] = images;
            let mask: Vec<u8> = (0..width * height)
                .map(|i| {
                    let pixel = Vector2::new(f64::from(i % width), f64::from(i / width));
                    let radius = image.mirror_from_pixel(pixel).norm();
                    let colors = original[3 * i as usize..].iter().zip(&recolored[3 * i as usize..]);
                    let difference = colors.take(3).map(|(&a, &b)| (i32::from(a) - i32::from(b)).abs()).max();
                    match difference {
                        // The robot and the outside of the mirror are ignored.
                        _ if !image.is_in_ring(radius) || radius > 108.0 => 128,
                        Some(0..=2) => 0,
                        Some(FLOOR_DIFFERENCE..) => 255,
                        _ => 128,
                    }
                })
                .collect();
            out.rgb(&format!("field-{index:02}"), &original, width, height)?;
            out.gray(&format!("field-{index:02}.mask"), &mask, width, height)?;
        }
        Ok(Report::default())
    }
}
