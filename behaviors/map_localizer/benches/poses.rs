//! Time to find a pose from the azimuths of edges and from the outline of the floor, on one core.
//!
//! With `YAMABICO_FRAMES=DIR` (an absolute path) the problems are saved there for peer programs.

use std::fmt::Write as _;
use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant;

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{Matrix3, Point2, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use yamabico_core::camera::{FloorFormula, HyperboloidalMirror, Mirror, MirrorCamera, MirrorImage};
use yamabico_core::geometry::Pose2;
use yamabico_map_localizer::azimuth::{
    AzimuthLocalizer, AzimuthRule, BearingPair, EdgeLandmark, JointCompatibility, JointRule, LeverArm,
    PanSearch, SeenBearing, SolverRule, filter, most_likely_pose, predict,
};
use yamabico_map_localizer::belief::Belief;
use yamabico_map_localizer::floor_outline::{
    FitRule, FloorLocalizer, FloorOutline, FloorPlan, FloorRule, OutlineFitter, OutlineRule,
};
use yamabico_vision::azimuth_profile::EdgeSign;
use yamabico_vision::bit_image::BitImage;
use yamabico_vision::polygon::{contains, convex_hull};

const EDGES: usize = 40;

fn folder() -> Option<PathBuf> {
    std::env::var_os("YAMABICO_FRAMES").map(PathBuf::from)
}

/// Prints the median of many single runs, which other load on the machine affects less than the mean.
fn median<R>(name: &str, mut run: impl FnMut() -> R) {
    let mut times: Vec<f64> = (0..3000)
        .map(|_| {
            let begin = Instant::now();
            black_box(run());
            1e6 * begin.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_unstable_by(f64::total_cmp);
    println!("{name}: median of single runs {:.1} us", times[times.len() / 2]);
}

/// Returns an approximately normal sample with unit variance.
fn normal(random: &mut rand_pcg::Pcg64) -> f64 {
    (0..12).map(|_| random.random_range(-0.5..0.5)).sum()
}

struct Problem {
    name: &'static str,
    landmarks: Vec<EdgeLandmark>,
    seen: Vec<SeenBearing>,
    truth: Pose2,
    predicted: Belief,
}

/// Creates 40 edges around a robot, observed in random order.
fn problem(name: &'static str, half_m: f64, sigma_rad: f64, predicted: &Belief, has_signs: bool) -> Problem {
    let mut random = rand_pcg::Pcg64::seed_from_u64(3);
    let factor = predicted.covariance.cholesky().map_or_else(Matrix3::zeros, |factor| factor.l());
    let off = factor * Vector3::from_fn(|_, _| normal(&mut random));
    let truth = Pose2::new(predicted.pose.x + off.x, predicted.pose.y + off.y, predicted.pose.theta + off.z);
    let landmarks: Vec<_> = (0..EDGES)
        .map(|i| EdgeLandmark {
            position: Point2::new(random.random_range(-half_m..half_m), random.random_range(-half_m..half_m)),
            sign: has_signs.then_some(EdgeSign::ALL[i % 2]),
            sigma_m: 0.0,
        })
        .collect();
    let mut seen: Vec<_> = landmarks
        .iter()
        .map(|edge| SeenBearing {
            azimuth_rad: predict(edge, &truth, LeverArm::zeros()).azimuth_rad
                + sigma_rad * normal(&mut random),
            sign: edge.sign,
            sigma_rad,
        })
        .collect();
    for i in (1..seen.len()).rev() {
        let j = random.random_range(0..=i);
        seen.swap(i, j);
    }
    Problem { name, landmarks, seen, truth, predicted: *predicted }
}

fn save(problem: &Problem) -> std::io::Result<()> {
    let Some(folder) = folder() else { return Ok(()) };
    std::fs::create_dir_all(&folder)?;
    let mut text = String::new();
    let (pose, truth) = (problem.predicted.pose, problem.truth);
    let deviations = [0, 1, 2].map(|i| problem.predicted.covariance[(i, i)].sqrt());
    let _ = writeln!(text, "{} {} {}", pose.x, pose.y, pose.theta);
    let _ = writeln!(text, "{} {} {}", deviations[0], deviations[1], deviations[2]);
    let _ = writeln!(text, "{} {} {}", truth.x, truth.y, truth.theta);
    for (edge, seen) in problem.landmarks.iter().zip(&problem.seen) {
        let (at, sign) = (edge.position, |sign: Option<EdgeSign>| sign.map_or(0, EdgeSign::value));
        let (azimuth, sigma) = (seen.azimuth_rad, seen.sigma_rad);
        let _ = writeln!(text, "{} {} {} {azimuth} {} {sigma}", at.x, at.y, sign(edge.sign), sign(seen.sign));
    }
    std::fs::write(folder.join(format!("bearings_{}.txt", problem.name)), text)
}

fn azimuths(criterion: &mut Criterion) {
    let tracked = Belief::new(Pose2::new(0.3, -0.2, 0.1), 0.03, 1.5_f64.to_radians());
    let wide = Belief::new(Pose2::new(0.3, -0.2, 0.1), 0.2, 0.004_f64.sqrt());
    for problem in [
        problem("tracked", 5.0, 0.2_f64.to_radians(), &tracked, true),
        problem("wide", 10.0, 0.01, &wide, false),
    ] {
        if let Err(error) = save(&problem) {
            println!("could not write the problem: {error}");
        }
        let name = problem.name;
        let rule = AzimuthRule { probability: 0.999_999, max_correction_m: 1.0, ..AzimuthRule::default() };
        let mut localizer =
            AzimuthLocalizer::new(problem.landmarks.clone(), Vec::new(), LeverArm::zeros(), rule);
        match localizer.locate(&problem.predicted, &problem.seen) {
            Ok(fix) => println!(
                "{name}: {} of {EDGES} paired, error {:.1} mm, error of the prediction {:.1} mm",
                fix.pairs,
                1e3 * fix.belief.pose.distance(&problem.truth),
                1e3 * problem.predicted.pose.distance(&problem.truth)
            ),
            Err(error) => println!("{name}: {error}"),
        }
        median(&format!("azimuth pose of 40 edges, {name}"), || {
            localizer.locate(black_box(&problem.predicted), &problem.seen).is_ok()
        });
        criterion.bench_function(&format!("azimuth pose of 40 edges, {name}"), |b| {
            b.iter(|| localizer.locate(black_box(&problem.predicted), &problem.seen).is_ok());
        });
        let mut joint = JointCompatibility::new(JointRule::default(), EDGES as u32);
        criterion.bench_function(&format!("joint compatibility alone, {name}"), |b| {
            b.iter(|| {
                let lever = LeverArm::zeros();
                joint.pair(black_box(&problem.predicted), lever, &problem.landmarks, &problem.seen).pairs
            });
        });
        let pairs: Vec<BearingPair> = localizer.pairs().to_vec();
        criterion.bench_function(&format!("Gauss-Newton alone, {name}"), |b| {
            b.iter(|| {
                let (known, lever) = (&problem.predicted, LeverArm::zeros());
                most_likely_pose(black_box(&pairs), &known.pose, Some(known), &SolverRule::default(), lever)
                    .is_ok()
            });
        });
        criterion.bench_function(&format!("extended Kalman filter alone, {name}"), |b| {
            b.iter(|| {
                let mut belief = problem.predicted;
                filter(&mut belief, black_box(&pairs), 16.0, LeverArm::zeros())
            });
        });
        criterion.bench_function(&format!("pan search of the paper alone, {name}"), |b| {
            b.iter(|| PanSearch::default().find(black_box(&pairs), problem.predicted.pose.theta).is_ok());
        });
    }
}

/// Returns the mask of a football field's floor seen by a robot, with a box of 130 mm on it.
fn mask(camera: &MirrorCamera, outline: &OutlineRule, robot: &Pose2) -> BitImage {
    let (a, b, w, g) = (1.37, 1.55, 0.7625, 0.25);
    let half = [(b, -g), (b, g), (a, g), (a, w), (-a, w), (-a, g)];
    let field: Vec<_> =
        half.into_iter().chain(half.map(|(x, y)| (-x, -y))).map(|(x, y)| Point2::new(x, y)).collect();
    let at = Pose2::new(0.9, 0.3, 0.2);
    let mut corners: Vec<_> = [(-0.065, -0.065), (0.065, -0.065), (0.065, 0.065), (-0.065, 0.065)]
        .map(|(x, y)| at.transform_point(Point2::new(x, y)))
        .to_vec();
    let foot = robot.position();
    corners.extend(corners.clone().iter().map(|corner| foot + (corner - foot) * 2.73));
    let mut shadow = Vec::new();
    convex_hull(&mut corners, &mut shadow);
    let image = camera.image();
    let mut mask = BitImage::new(image.width as usize, image.height as usize);
    for v in 0..mask.height() {
        for u in 0..mask.width() {
            let seen = image.mirror_from_pixel(Vector2::new(u as f64, v as f64));
            let radius = seen.norm().max(1.0);
            if let Some(floor) = camera.floor_radius_m(radius, outline.height_m) {
                let point = robot.transform_point(Point2::from(seen * (floor / radius)));
                if radius < outline.max_radius_px && contains(&field, point) && !contains(&shadow, point) {
                    mask.set(u, v);
                }
            }
        }
    }
    mask
}

fn save_mask(mask: &BitImage) -> image::ImageResult<()> {
    let Some(folder) = folder() else { return Ok(()) };
    std::fs::create_dir_all(&folder)?;
    let (width, height) = (mask.width(), mask.height());
    let pixels: Vec<u8> =
        (0..width * height).map(|i| 255 * u8::from(mask.get(i % width, i / width))).collect();
    let path = folder.join("floor_256x220.png");
    image::save_buffer(path, &pixels, width as u32, height as u32, image::ColorType::L8)
}

fn floor(criterion: &mut Criterion) {
    let outline = OutlineRule { height_m: 0.165, max_radius_px: 108.0 };
    let formula = FloorFormula { a: 10_120.0, b: 20.54, c: 2.298e5 };
    let mirror = HyperboloidalMirror::from_floor_formula(formula, outline.height_m).expect("a mirror");
    let image = MirrorImage::centered(256, 220).with_ring(1.0, 113.5).expect("a ring");
    let camera = MirrorCamera::new(image, Mirror::Hyperboloidal(mirror)).expect("a camera");
    let plan = FloorPlan::football_field(1.37, 1.55, 0.7625, 0.25).expect("a plan");
    let robot = Pose2::new(0.5, 0.2, 0.5);
    let mask = mask(&camera, &outline, &robot);
    if let Err(error) = save_mask(&mask) {
        println!("could not write the mask: {error}");
    }
    let mut localizer = FloorLocalizer::new(plan.clone(), camera.clone(), FloorRule::new(outline));
    let predicted = Belief::new(Pose2::new(0.52, 0.19, 0.52), 0.05, 0.05);
    for (name, known) in [("from the moments", None), ("from a prediction", Some(&predicted))] {
        match localizer.locate(&mask, known) {
            Ok(fix) => println!(
                "{name}: {} corners, {} iterations, error {:.1} mm",
                fix.corners,
                fix.iterations,
                1e3 * fix.belief.pose.distance(&robot)
            ),
            Err(error) => println!("{name}: {error}"),
        }
        median(&format!("floor outline, mask to pose 256x220, {name}"), || {
            localizer.locate(black_box(&mask), known).is_ok()
        });
        criterion.bench_function(&format!("floor outline, mask to pose 256x220, {name}"), |b| {
            b.iter(|| localizer.locate(black_box(&mask), known).is_ok());
        });
    }
    let mut seen = FloorOutline::default();
    criterion.bench_function("floor outline, mask to corners alone", |b| {
        b.iter(|| seen.take_mask(black_box(&mask), &camera, &outline).is_ok());
    });
    let mut fitter = OutlineFitter::default();
    median("floor outline, corners to pose alone", || {
        let start = fitter.initial_placement(&seen)?;
        fitter.fit(&mut seen, black_box(&plan), start, &FitRule::default(), (&camera, &outline))
    });
    criterion.bench_function("floor outline, corners to pose alone", |b| {
        b.iter(|| {
            let start = fitter.initial_placement(&seen)?;
            fitter.fit(&mut seen, black_box(&plan), start, &FitRule::default(), (&camera, &outline))
        });
    });
    let shifted = FitRule { shift_sigma_px: Some(2.0), ..FitRule::default() };
    criterion.bench_function("floor outline, corners to pose and common shift alone", |b| {
        b.iter(|| {
            let start = fitter.initial_placement(&seen)?;
            let fit = fitter.fit(&mut seen, black_box(&plan), start, &shifted, (&camera, &outline));
            seen.project_shifted(&camera, &outline, 0.0);
            fit
        });
    });
}

criterion_group!(benches, azimuths, floor);
criterion_main!(benches);
