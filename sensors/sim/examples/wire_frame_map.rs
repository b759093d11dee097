//! Writes the wire-frame map of a world's building: `wire_frame_map WORLD.toml OUT.toml [PICTURE.png [X Y HEADING_DEG]]`. The
//! picture shows what a camera should see of it from a pose, over what it sees.

use std::error::Error;
use std::path::Path;

use image::{Rgb, RgbImage};
use nalgebra::Vector2;
use yamabico_core::camera::{Intrinsics, Mount, Pinhole};
use yamabico_core::geometry::Pose2;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World, random};
use yamabico_vision::map::{EdgeRole, ExpectationMap, ExpectationRules, WireFrame};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [world_file, out, picture @ ..] = arguments.as_slice() else {
        return Err("usage: wire_frame_map WORLD.toml OUT.toml [PICTURE.png [X Y HEADING_DEG]]".into());
    };
    let world = World::from_toml(&std::fs::read_to_string(world_file)?)?;
    let map = world.wire_frame();
    let name = Path::new(world_file).file_stem().unwrap_or_default().to_string_lossy();
    let head = format!(
        "# The edges and walls of the building of worlds/{name}.toml, written from it:\n\
         #\n\
         #     cargo run -p yamabico-sim --example wire_frame_map WORLD.toml MAP.toml\n\
         #\n\
         # Meters, each -1000000 to 1000000; map frame: that of the world, z up from the floor. A detail runs beside an\n\
         # outline and from afar cannot be told from it.\n\n\
         name = \"{name}\"\n"
    );
    std::fs::write(out, head + &map.to_toml())?;
    println!("{} edges, {} walls", map.edges().len(), map.walls().len());
    if let [file, pose @ ..] = picture {
        let numbers = pose.iter().map(|text| text.parse()).collect::<Result<Vec<f64>, _>>()?;
        let number = |i: usize| numbers.get(i).copied().unwrap_or(0.0);
        draw(&world, &map, Pose2::new(number(0), number(1), number(2).to_radians()))?.save(file)?;
    }
    Ok(())
}

fn draw(world: &World, map: &WireFrame, robot: Pose2) -> Result<RgbImage, Box<dyn Error>> {
    let scene = Scene::new(world, 1)?;
    let intrinsics = Intrinsics::from_horizontal_fov(640, 480, 60_f64.to_radians());
    let mount = Mount::tilted(0.6, 6_f64.to_radians());
    let mut pixels = vec![0; 3 * 640 * 480];
    let mut renderer = Renderer::new(Photometry::default(), random::stream(1, "wire_frame_map"));
    renderer.render_rgb(&scene, &CameraView { intrinsics, mount, robot }, &mut pixels)?;
    let mut image = RgbImage::from_raw(640, 480, pixels).ok_or("a picture of another size")?;
    let mut expectation = ExpectationMap::new(ExpectationRules::everything());
    for edge in expectation.compute(map, &Pinhole::ideal(intrinsics), &mount, &robot) {
        let color = if edge.role == EdgeRole::Detail { Rgb([255, 160, 0]) } else { Rgb([255, 0, 80]) };
        line(&mut image, edge.from, edge.to, color);
    }
    Ok(image)
}

fn line(image: &mut RgbImage, from: Vector2<f64>, to: Vector2<f64>, color: Rgb<u8>) {
    let steps = (to - from).amax().ceil().max(1.0);
    for i in 0..=steps as u32 {
        let place = from + (to - from) * (f64::from(i) / steps);
        if let Some(pixel) = image.get_pixel_mut_checked(place.x.round() as u32, place.y.round() as u32) {
            *pixel = color;
        }
    }
}
