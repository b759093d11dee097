//! Writes a world as each mirror camera sees it: `render_mirrors WORLD.toml FOLDER [X Y HEADING_DEG [TIME_S]]` writes
//! `conic.png`, `hyperboloidal.png` and `radial.png` into the folder, and tells how long each picture took.

use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;

use image::{ExtendedColorType, save_buffer};
use serde::Deserialize;
use yamabico_core::camera::mirror_camera::mirror_camera;
use yamabico_core::camera::{MirrorConfig, MirrorImageConfig, Mount};
use yamabico_core::geometry::Pose2;
use yamabico_sim::{MirrorRenderer, MirrorView, Photometry, Scene, World, random};

/// Name, height of the lens or the viewpoint (m), and the tables of a robot file.
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

#[derive(Deserialize)]
struct Tables {
    picture: MirrorImageConfig,
    mirror: MirrorConfig,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let (Some(world), Some(folder)) = (args.next(), args.next().map(PathBuf::from)) else {
        return Err("usage: render_mirrors WORLD.toml FOLDER [X Y HEADING_DEG [TIME_S]]".into());
    };
    let numbers = args.map(|a| a.parse::<f64>()).collect::<Result<Vec<_>, _>>()?;
    let number = |i: usize| numbers.get(i).copied().unwrap_or(0.0);

    let mut scene = Scene::new(&World::from_toml(&std::fs::read_to_string(world)?)?, 1)?;
    scene.set_time(number(3))?;
    let robot = Pose2::new(number(0), number(1), number(2).to_radians());
    for (name, height_m, tables) in CAMERAS {
        let tables: Tables = toml::from_str(tables)?;
        let camera = mirror_camera(&tables.picture, &tables.mirror)?;
        let (width, height) = (camera.image().width, camera.image().height);
        let mut renderer = MirrorRenderer::new(camera, Photometry::default(), random::stream(1, name));
        let view = MirrorView { mount: Mount::level(height_m), robot };
        let mut pixels = vec![0; 3 * (width * height) as usize];
        renderer.render_rgb(&scene, &view, &mut pixels)?;
        let (start, pictures) = (Instant::now(), 20);
        for _ in 0..pictures {
            renderer.render_rgb(&scene, &view, &mut pixels)?;
        }
        let each_ms = start.elapsed().as_secs_f64() * 1e3 / f64::from(pictures);
        save_buffer(
            folder.join(name).with_extension("png"),
            &pixels,
            width,
            height,
            ExtendedColorType::Rgb8,
        )?;
        println!("{name}: {width} x {height} color in {each_ms:.1} ms");
    }
    Ok(())
}
