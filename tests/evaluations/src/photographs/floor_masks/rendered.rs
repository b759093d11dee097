//! Pictures of buildings drawn from seeds, with masks of their floor.

use rand::RngExt;
use yamabico_core::camera::Pinhole;
use yamabico_core::geometry::Pose2;
use yamabico_core::image::GrayImage;
use yamabico_sim::building::Building;
use yamabico_sim::random::stream;
use yamabico_sim::world::{Floor, World};
use yamabico_sim::{CameraView, Photometry, Renderer, Scene};
use yamabico_vision::floor_appearance::FloorPlace;

use super::Frame;

/// Distance to the first box that the picture shows, m.
const AHEAD_M: (f64, f64) = (1.2, 2.6);
/// Maximum heading of the robot to either side of the hallway, rad.
const HEADING_RAD: f64 = 0.5;
/// Difference in gray level between the pictures with a white and with a black floor above which a pixel is floor.
const MIN_DIFFERENCE: u8 = 20;

/// Renders what the robot's camera shows in the building of a seed, before its first box, in color, with noise and blur.
pub fn frame(seed: u64) -> Result<Frame, String> {
    let building = Building::new(seed, &[]).map_err(|problems| problems.to_string())?;
    let mut rng = stream(seed, "floor masks");
    let first_m = building.world.boxes.iter().map(|item| item.at_m[0]).fold(f64::INFINITY, f64::min);
    let x_m = if first_m.is_finite() { first_m } else { 4.0 } - rng.random_range(AHEAD_M.0..AHEAD_M.1);
    let robot = Pose2::new(x_m, 0.0, rng.random_range(-HEADING_RAD..HEADING_RAD));
    let (intrinsics, mount) = building.camera();
    let view = CameraView { intrinsics, mount, robot };
    let [width, height] = [intrinsics.width as usize, intrinsics.height as usize];
    let render = |world: &World, photometry: Photometry| {
        let mut scene = Scene::new(world, seed).map_err(|error| error.to_string())?;
        scene.set_time(robot.x / 0.4).map_err(|error| error.to_string())?;
        let mut rgb = vec![0; 3 * width * height];
        let mut renderer = Renderer::new(photometry, stream(seed, "front"));
        renderer.render_rgb(&scene, &view, &mut rgb).map_err(|error| error.to_string())?;
        Ok::<_, String>(rgb)
    };
    let rgb = render(&building.world, building.photometry())?;
    // What changes with the color of the floor is floor.
    let [black, white] = [0.0, 1.0].map(|tone| {
        let floor = Floor {
            color: [tone; 3],
            gloss: 0.0,
            speckle: 0.0,
            joint_spacing_m: [0.0; 2],
            ..Floor::default()
        };
        let world = World { floor, patches: Vec::new(), ..building.world.clone() };
        let clean = Photometry { noise_sigma: 0.0, ..Photometry::default() };
        render(&world, clean)
    });
    let (black, white) = (black?, white?);
    let mut mask = GrayImage::new(width, height);
    for (pixel, (black, white)) in
        mask.pixels_mut().iter_mut().zip(black.chunks_exact(3).zip(white.chunks_exact(3)))
    {
        *pixel = if white[1].saturating_sub(black[1]) > MIN_DIFFERENCE { 255 } else { 0 };
    }
    let mut gray = GrayImage::default();
    gray.copy_from_rgb8(&rgb, width, height, 3 * width).map_err(|error| error.to_string())?;
    let kind = serde_json::to_value(building.properties.floor).map_err(|error| error.to_string())?;
    Ok(Frame {
        name: format!("{}_f{seed:04}", kind.as_str().unwrap_or_default()),
        color: image::RgbImage::from_raw(intrinsics.width, intrinsics.height, rgb)
            .ok_or("an image without pixels")?,
        gray,
        mask,
        ignore: None,
        place: FloorPlace::of_camera(&Pinhole::ideal(intrinsics), &mount),
    })
}
