//! Pictures a second, noise included, at the two usual sizes.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use yamabico_core::camera::{Intrinsics, Mount};
use yamabico_core::geometry::Pose2;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World, random};

const HALLWAY: &str = include_str!("../../../configs/worlds/hallway.toml");

fn render(c: &mut Criterion) {
    let world = World::from_toml(HALLWAY).expect("the hallway is a valid world");
    let mut scene = Scene::new(&world, 1).expect("the hallway can be built");
    let mut group = c.benchmark_group("render");
    for (width, height) in [(256, 240), (640, 480)] {
        let mut pixels = vec![0; (width * height) as usize];
        let mut renderer = Renderer::new(Photometry::default(), random::stream(1, "bench"));
        let mut step = 0;
        group.throughput(Throughput::Elements(1));
        group.bench_function(format!("{width}x{height}"), |b| {
            b.iter(|| {
                step = (step + 1) % 120;
                let along = 0.1 * f64::from(step);
                scene.set_time(along / 0.4).expect("figures are well formed");
                let view = CameraView {
                    intrinsics: Intrinsics::from_horizontal_fov(width, height, 60_f64.to_radians()),
                    mount: Mount::tilted(0.6, 5_f64.to_radians()),
                    robot: Pose2::new(along, 0.1 * along.sin(), 0.1 * along.cos()),
                };
                renderer.render(&scene, &view, &mut pixels).expect("the view is valid");
                pixels[0]
            });
        });
    }
    group.finish();
}

criterion_group!(benches, render);
criterion_main!(benches);
