//! Rendering rate in frames per second, including noise: a pinhole camera with two image sizes, one above a floor with an exact
//! mirror image, one with blur and glare, and mirror cameras.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use yamabico_core::camera::{
    ConicMirror, HyperboloidalMirror, Intrinsics, Mirror, MirrorCamera, MirrorImage, Mount, RadialModel,
    RadialProfile,
};
use yamabico_core::geometry::Pose2;
use yamabico_sim::world::Reflection;
use yamabico_sim::{CameraView, MirrorRenderer, MirrorView, Photometry, Renderer, Scene, World, random};

const HALLWAY: &str = include_str!("../../../configs/worlds/hallway.toml");

fn render(c: &mut Criterion) {
    let world = World::from_toml(HALLWAY).expect("the hallway is a valid world");
    let mut scene = Scene::new(&world, 1).expect("the hallway can be built");
    let mut polished = world.clone();
    (polished.floor.gloss, polished.floor.reflection) = (1.0, Reflection::Sharp);
    let mut polished = Scene::new(&polished, 1).expect("the hallway can be built");
    let lens = Photometry { blur_px: 0.8, glare: 0.03, ..Photometry::default() };
    let cases = [
        ("", (256, 240), &mut scene.clone(), Photometry::default()),
        ("", (640, 480), &mut scene.clone(), Photometry::default()),
        (" mirror floor", (256, 240), &mut polished, Photometry::default()),
        (" blur and glare", (256, 240), &mut scene, lens),
    ];
    let mut group = c.benchmark_group("render");
    for (name, (width, height), scene, photometry) in cases {
        let mut pixels = vec![0; (width * height) as usize];
        let mut renderer = Renderer::new(photometry, random::stream(1, "bench"));
        let mut step = 0;
        group.throughput(Throughput::Elements(1));
        group.bench_function(format!("{width}x{height}{name}"), |b| {
            b.iter(|| {
                step = (step + 1) % 120;
                let along = 0.1 * f64::from(step);
                scene.set_time(along / 0.4).expect("figures are well formed");
                let view = CameraView {
                    intrinsics: Intrinsics::from_horizontal_fov(width, height, 60_f64.to_radians()),
                    mount: Mount::tilted(0.6, 5_f64.to_radians()),
                    robot: Pose2::new(along, 0.1 * along.sin(), 0.1 * along.cos()),
                };
                renderer.render(scene, &view, &mut pixels).expect("the view is valid");
                pixels[0]
            });
        });
    }
    group.finish();
}

fn mirrors(c: &mut Criterion) {
    let world = World::from_toml(HALLWAY).expect("the hallway is a valid world");
    let mut scene = Scene::new(&world, 1).expect("the hallway can be built");
    let image = MirrorImage::centered(512, 480).with_ring(16.0, 240.0).expect("a ring");
    let cone = ConicMirror::new(112.6_f64.to_radians(), 0.11, 576.563).expect("a cone");
    let hyperboloid = HyperboloidalMirror::new(520.0, 1.45, 0.08).expect("a hyperboloid");
    let profile = RadialProfile::Tangent { range_m: 1.788, rad_per_px: 0.0077, height_m: 0.6 };
    let radial = RadialModel::new(profile, 16.0, 240.0).expect("a profile that grows");
    let mirrors = [
        ("conic", 0.3, Mirror::Conic(cone)),
        ("hyperboloidal", 0.6, Mirror::Hyperboloidal(hyperboloid)),
        ("radial", 0.6, Mirror::Radial(radial)),
    ];
    let mut group = c.benchmark_group("mirror-512x480-rgb");
    for (name, height_m, mirror) in mirrors {
        let camera = MirrorCamera::new(image, mirror).expect("all of the ring is mirror");
        let mut pixels = vec![0; 3 * 512 * 480];
        let mut renderer = MirrorRenderer::new(camera, Photometry::default(), random::stream(1, "bench"));
        let mut step = 0;
        group.throughput(Throughput::Elements(1));
        group.bench_function(name, |b| {
            b.iter(|| {
                step = (step + 1) % 120;
                let along = 0.1 * f64::from(step);
                scene.set_time(along / 0.4).expect("figures are well formed");
                let robot = Pose2::new(along, 0.1 * along.sin(), 0.1 * along.cos());
                let view = MirrorView { mount: Mount::level(height_m), robot };
                renderer.render_rgb(&scene, &view, &mut pixels).expect("the view is valid");
                pixels[0]
            });
        });
    }
    group.finish();
}

criterion_group!(benches, render, mirrors);
criterion_main!(benches);
