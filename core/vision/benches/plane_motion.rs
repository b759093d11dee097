//! Speed of plane motion on one core: `cargo bench -p yamabico-vision --bench plane_motion`.
//!
//! Times are those of the thread on its core, so that other programs on the machine do not count. With
//! `YAMABICO_FRAMES=DIR` (an absolute path) pairs of pictures with known motion, our alignments and the times of single
//! runs are saved there for the peer of `tests/peers`.

use criterion::measurement::{Measurement, ValueFormatter};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use std::path::PathBuf;
use yamabico_geometry::Pose2;
use yamabico_geometry::image::ImageView;
use yamabico_vision::plane_motion::PlaneMotion;
use yamabico_vision::plane_motion::direct_alignment::{AlignmentPrior, DirectAligner};
use yamabico_vision::plane_motion::floor_view::FloorView;
use yamabico_vision::plane_motion::look_history::LookHistory;
use yamabico_vision::plane_motion::motion_prior::motion_prior;
use yamabico_vision::plane_motion::wheel_lag::WheelLag;

#[path = "plane_motion/peer_pairs.rs"]
mod peer_pairs;
#[path = "../tests/rendered_floor.rs"]
mod rendered_floor;

use rendered_floor::{Scene, camera};

/// Time from one picture to the next, s.
const STEP_S: f64 = 0.1;
/// Distance from the origin of the odometry frame to the box, m: beyond the aligned floor, and on it.
const BOXES_M: [(&str, f64); 2] = [("far_box", 3.5), ("near_box", 2.0)];

/// Time of this thread on a core, ns.
struct ThreadTime;

fn thread_ns() -> i64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    now.tv_sec * 1_000_000_000 + now.tv_nsec
}

impl Measurement for ThreadTime {
    type Intermediate = i64;
    type Value = i64;

    fn start(&self) -> i64 {
        thread_ns()
    }

    fn end(&self, start: i64) -> i64 {
        thread_ns() - start
    }

    fn add(&self, a: &i64, b: &i64) -> i64 {
        a + b
    }

    fn zero(&self) -> i64 {
        0
    }

    fn to_f64(&self, value: &i64) -> f64 {
        *value as f64
    }

    fn formatter(&self) -> &dyn ValueFormatter {
        self
    }
}

impl ValueFormatter for ThreadTime {
    fn scale_values(&self, _: f64, values: &mut [f64]) -> &'static str {
        values.iter_mut().for_each(|value| *value *= 1e-6);
        "ms"
    }

    fn scale_throughputs(&self, _: f64, _: &Throughput, _: &mut [f64]) -> &'static str {
        "1/s"
    }

    fn scale_for_machines(&self, _: &mut [f64]) -> &'static str {
        "ns"
    }
}

/// A drive on tiles towards a box.
struct Drive {
    name: &'static str,
    width: u32,
    height: u32,
    /// Pictures 4 cm apart, with the true poses.
    pictures: Vec<(Pose2, Vec<u8>)>,
}

impl Drive {
    fn new((name, box_m): (&'static str, f64), width: u32, height: u32) -> Self {
        let thing = Some((nalgebra::Point2::new(box_m, 0.1), 0.24));
        let scene = Scene { thing, has_joints: true, mirror: 0.0 };
        let pictures = (0..20_u32).map(|i| {
            let robot = Pose2::new(0.04 * f64::from(i), 0.0, 0.0);
            (robot, scene.render(width, height, &robot, u64::from(i)))
        });
        Self { name, width, height, pictures: pictures.collect() }
    }
}

/// Order of `count` pictures forward and back again, so that every one has its baselines.
fn there_and_back(count: usize) -> impl Iterator<Item = usize> + Clone {
    (0..count).chain((1..count.saturating_sub(1)).rev())
}

fn judge(criterion: &mut Criterion<ThreadTime>) {
    for (width, height) in [(256, 240), (640, 480)] {
        let drives = BOXES_M.map(|scene| Drive::new(scene, width, height));
        if let Some(folder) = std::env::var_os("YAMABICO_FRAMES").map(PathBuf::from)
            && let Err(error) = peer_pairs::write(&folder, &drives)
        {
            // The peer must not measure files of another run.
            eprintln!("{}: {error}: name a folder that can be written in YAMABICO_FRAMES", folder.display());
            std::process::exit(1);
        }
        let pictures = &drives[0].pictures;
        let (intrinsics, mount) = camera(width, height);
        let view_of = |data| ImageView::new(data, width as usize, height as usize, width as usize);
        let mut history = LookHistory::new(
            width as usize,
            height as usize,
            DirectAligner::top_row(&FloorView::new(intrinsics, mount)) / 2,
        );
        for (i, (robot, data)) in pictures.iter().enumerate() {
            if let Ok(view) = view_of(data) {
                history.push(view, *robot, STEP_S * i as f64, &WheelLag::default());
            }
        }
        let mut aligner = DirectAligner::new(FloorView::new(intrinsics, mount));
        let (Some(number), Some(newest)) = (history.at_baseline(0.16), history.newest()) else { return };
        let previous = history.look(number);
        let motion = previous.odometry.relative(&newest.odometry) * Pose2::new(0.0, 0.0, 0.003);
        let prior =
            AlignmentPrior { motion, covariance: motion_prior(motion.x, 0.0, 1.0), tilt: 0.0, roll: 0.0 };
        let aligned = aligner.align(&newest.bands, &previous.bands, &prior);
        println!("{width}x{height}: {} of {} pixels aligned", aligned.inliers, aligned.pixels);
        criterion.bench_function(&format!("alignment {width}x{height}"), |b| {
            b.iter(|| aligner.align(black_box(&newest.bands), &previous.bands, &prior));
        });
        let mut motion = PlaneMotion::new(intrinsics, mount);
        let order: Vec<usize> = there_and_back(pictures.len()).collect();
        let (mut turn, mut points) = (0, 0);
        criterion.bench_function(&format!("picture judged {width}x{height}"), |b| {
            b.iter(|| {
                let (robot, data) = &pictures[order[turn % order.len()]];
                let Ok(view) = view_of(data) else { return };
                points = motion.look(view, *robot, STEP_S * turn as f64).map_or(0, <[_]>::len).max(points);
                motion.obstacles(robot, |_| true);
                turn += 1;
            });
        });
        println!("{width}x{height}: {points} points");
    }
}

criterion_group! {
    name = plane_motion;
    config = Criterion::default().with_measurement(ThreadTime);
    targets = judge
}
criterion_main!(plane_motion);
