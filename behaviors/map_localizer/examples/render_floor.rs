//! Pictures of the simulated football field with the floor marked in them, for `yamabico learn floor`: `render_floor FOLDER [N]`.
//!
//! What is floor is told by a second picture of each scene, in which the floor alone has another color.

use std::error::Error;
use std::path::PathBuf;

use nalgebra::Vector2;
use yamabico_core::camera::{HyperboloidalMirror, Mirror, MirrorCamera, MirrorImage, Mount};
use yamabico_core::geometry::Pose2;
use yamabico_sim::{MirrorRenderer, MirrorView, Photometry, Scene, World, random};

/// Half the field's length and width less the robot, meters.
const REACH_M: [f64; 2] = [1.2, 0.6];
/// Levels by which a pixel differs where the floor's color shows.
const DIFFERENT: i32 = 12;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().ok_or("render_floor FOLDER [N]")?);
    let count: u64 = arguments.next().map_or(Ok(12), |text| text.parse())?;
    std::fs::create_dir_all(&folder)?;
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/worlds/field.toml");
    let world = World::from_toml(&std::fs::read_to_string(path)?).map_err(|error| error.to_string())?;
    let mut other = world.clone();
    other.floor.color = [0.6, 0.1, 0.6];
    let image = MirrorImage::centered(256, 220).with_ring(22.0, 112.0)?;
    let mirror = HyperboloidalMirror::new(479.374_593, 1.265_184_85, 0.040_083_7)?;
    let camera = MirrorCamera::new(image, Mirror::Hyperboloidal(mirror))?;
    for number in 0..count {
        let turn = 2.4 * number as f64;
        let robot = Pose2::new(REACH_M[0] * turn.sin(), REACH_M[1] * (1.7 * turn).sin(), turn);
        let view = MirrorView { mount: Mount::level(0.165), robot };
        let mut pictures = [&world, &other].map(|_| vec![0; 3 * 256 * 220]);
        for (world, pixels) in [&world, &other].into_iter().zip(&mut pictures) {
            let noise = random::stream(number, "floor");
            let mut renderer = MirrorRenderer::new(camera.clone(), Photometry::default(), noise);
            let scene = Scene::new(world, 100 + number).map_err(|error| error.to_string())?;
            renderer.render_rgb(&scene, &view, pixels).map_err(|error| error.to_string())?;
        }
        let [picture, marked] = pictures;
        let mask: Vec<u8> = (0..256 * 220)
            .map(|i| {
                let pixel = Vector2::new(f64::from(i % 256), f64::from(i / 256));
                let radius = image.mirror_from_pixel(pixel).norm();
                let colors = picture[3 * i as usize..].iter().zip(&marked[3 * i as usize..]);
                let most = colors.take(3).map(|(&a, &b)| (i32::from(a) - i32::from(b)).abs()).max();
                match most {
                    // The robot, and what lies outside the mirror, is neither.
                    _ if !image.is_in_ring(radius) || radius > 108.0 => 128,
                    Some(0..=2) => 0,
                    Some(DIFFERENT..) => 255,
                    _ => 128,
                }
            })
            .collect();
        let name = |end: &str| folder.join(format!("field-{number:02}{end}"));
        image::save_buffer(name(".png"), &picture, 256, 220, image::ExtendedColorType::Rgb8)?;
        image::save_buffer(name(".mask.png"), &mask, 256, 220, image::ExtendedColorType::L8)?;
    }
    println!("{count} pictures with masks in {}", folder.display());
    Ok(())
}
