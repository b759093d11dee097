//! Mirror cameras: duration of a ray from a pixel and of a pixel from a point.

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{Point3, Vector2};
use std::hint::black_box;
use yamabico_geometry::camera::{
    ConicMirror, HyperboloidalMirror, Mirror, MirrorCamera, MirrorImage, RadialModel, RadialProfile,
};

fn mirrors(c: &mut Criterion) {
    let image = MirrorImage::centered(512, 480).with_ring(16.0, 240.0).expect("a ring");
    let cone = ConicMirror::new(112.6_f64.to_radians(), 0.11, 576.563).expect("a cone");
    let hyperboloid = HyperboloidalMirror::new(520.0, 1.45, 0.08).expect("a hyperboloid");
    let profile = RadialProfile::Tangent { range_m: 1.788, rad_per_px: 0.0077, height_m: 0.6 };
    let radial = RadialModel::new(profile, 16.0, 240.0).expect("a profile that grows");
    let angles = RadialProfile::AnglePolynomial { coefficients: vec![0.0, 6e-3, 4e-6] };
    let polynomial = RadialModel::new(angles, 16.0, 240.0).expect("a profile that grows");
    let mirrors = [
        ("conic", Mirror::Conic(cone)),
        ("hyperboloidal", Mirror::Hyperboloidal(hyperboloid)),
        ("radial-tangent", Mirror::Radial(radial)),
        ("radial-polynomial", Mirror::Radial(polynomial)),
    ];
    let (pixel, point) = (Vector2::new(180.0, 95.0), Point3::new(2.0, 0.9, -0.2));
    for (name, mirror) in mirrors {
        let camera = MirrorCamera::new(image, mirror).expect("all of the ring is mirror");
        let mut group = c.benchmark_group(name);
        group.bench_function("ray from pixel", |b| b.iter(|| camera.ray_from_pixel(black_box(pixel))));
        group.bench_function("pixel from point", |b| b.iter(|| camera.pixel_from_point(black_box(&point))));
        group.finish();
    }
}

criterion_group!(benches, mirrors);
criterion_main!(benches);
