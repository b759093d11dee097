//! Writes a picture of a world: `render_view WORLD.toml OUT.png [X Y HEADING_DEG [TIME_S [WIDTH HEIGHT]]]`.

use std::error::Error;

use image::{ExtendedColorType, save_buffer};
use yamabico_core::camera::{Intrinsics, Mount};
use yamabico_core::geometry::Pose2;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World, random};

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let (Some(world), Some(out)) = (args.next(), args.next()) else {
        return Err("usage: render_view WORLD.toml OUT.png [X Y HEADING_DEG [TIME_S [WIDTH HEIGHT]]]".into());
    };
    let numbers = args.map(|a| a.parse::<f64>()).collect::<Result<Vec<_>, _>>()?;
    let number = |i: usize, default: f64| numbers.get(i).copied().unwrap_or(default);

    let world = World::from_toml(&std::fs::read_to_string(world)?)?;
    let mut scene = Scene::new(&world, 1)?;
    scene.set_time(number(3, 0.0))?;
    let (width, height) = (number(4, 640.0) as u32, number(5, 480.0) as u32);
    let view = CameraView {
        intrinsics: Intrinsics::from_horizontal_fov(width, height, 60_f64.to_radians()),
        mount: Mount::tilted(0.6, 5_f64.to_radians()),
        robot: Pose2::new(number(0, 0.0), number(1, 0.0), number(2, 0.0).to_radians()),
    };
    let mut pixels = vec![0; 3 * (width * height) as usize];
    let mut renderer = Renderer::new(Photometry::default(), random::stream(1, "render_view"));
    renderer.render_rgb(&scene, &view, &mut pixels)?;
    save_buffer(&out, &pixels, width, height, ExtendedColorType::Rgb8)?;
    Ok(())
}
