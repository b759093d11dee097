//! Pictures of a printed checkerboard by a camera with a distorted lens, with blur, noise and uneven light.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector2, Vector3};
use rand::RngExt;
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64;
use yamabico_core::camera::Pinhole;
use yamabico_core::image::GrayImage;
use yamabico_vision::calibration::Board;

/// Faults of a picture.
#[derive(Clone, Copy, Debug)]
pub struct Exposure {
    /// Standard deviation of the noise, gray levels.
    pub noise: f64,
    /// Standard deviation of the blur, px.
    pub blur_px: f64,
    /// Share of the light that is missing at the dark edge of the picture.
    pub shade: f64,
}

/// Typical faults of a cheap camera indoors.
pub const INDOORS: Exposure = Exposure { noise: 3.0, blur_px: 0.8, shade: 0.4 };

/// Gray levels of white, black and of the room behind the board.
const WHITE: f64 = 210.0;
const BLACK: f64 = 35.0;
const ROOM: f64 = 110.0;
/// Samples along each side of a pixel.
const SAMPLES: usize = 4;
/// Width of the board's white margin, squares.
const MARGIN: f64 = 0.8;

/// Renders a board at `pose` (camera from board) with its corners at x and y from 0 on.
#[must_use]
pub fn render_board(
    board: &Board,
    pinhole: &Pinhole,
    pose: &Isometry3<f64>,
    exposure: Exposure,
    rng: &mut Pcg64,
) -> GrayImage {
    let [width, height] = pinhole.intrinsics().size().map(|size| size as usize);
    let board_from_camera = pose.inverse();
    let eye = board_from_camera * Point3::origin();
    let shade_angle: f64 = rng.random_range(0.0..std::f64::consts::TAU);
    let light = |at: Vector2<f64>| {
        let across = Vector2::new(at.x / width as f64 - 0.5, at.y / height as f64 - 0.5);
        let along = across.dot(&Vector2::new(shade_angle.cos(), shade_angle.sin())) + 0.5;
        1.0 - exposure.shade * along.clamp(0.0, 1.0)
    };
    // The lens is smooth over a pixel: rays are interpolated between its corners.
    let at_corner = |index: usize| {
        let (u, v) = (index % (width + 1), index / (width + 1));
        pinhole.normalized_from_pixel(Vector2::new(u as f64 - 0.5, v as f64 - 0.5))
    };
    let rays: Vec<Option<Vector2<f64>>> = (0..(width + 1) * (height + 1)).map(at_corner).collect();
    let ray_at = |index: usize, part: Vector2<f64>| -> Option<Vector3<f64>> {
        let first = index + index / width;
        let across = |start: usize| Some(rays[start]? * (1.0 - part.x) + rays[start + 1]? * part.x);
        Some((across(first)? * (1.0 - part.y) + across(first + width + 1)? * part.y).push(1.0))
    };
    let level = |at: Vector2<f64>, ray: Option<Vector3<f64>>| -> f64 {
        let Some(ray) = ray else { return ROOM };
        let ray = board_from_camera.rotation * ray;
        let range = -eye.z / ray.z;
        if !(range.is_finite() && range > 0.0) {
            return ROOM;
        }
        let on_board = (eye + ray * range).xy().coords / board.square_m;
        let (x, y) = (on_board.x + 1.0, on_board.y + 1.0);
        let (columns, rows) = (board.columns as f64 + 1.0, board.rows as f64 + 1.0);
        if x < -MARGIN || y < -MARGIN || x > columns + MARGIN || y > rows + MARGIN {
            // A room with some structure.
            ROOM + 25.0 * ((0.05 * at.x).sin() * (0.03 * at.y).cos()).signum()
        } else if x < 0.0 || y < 0.0 || x >= columns || y >= rows || (x.floor() + y.floor()) % 2.0 != 0.0 {
            WHITE
        } else {
            BLACK
        }
    };
    let mut exposed = vec![0.0; width * height];
    for (index, out) in exposed.iter_mut().enumerate() {
        let pixel = Vector2::new((index % width) as f64, (index / width) as f64);
        let mut sum = 0.0;
        for sample in 0..SAMPLES * SAMPLES {
            let part = |i: usize| (i as f64 + 0.5) / SAMPLES as f64;
            sum += level(pixel, ray_at(index, Vector2::new(part(sample % SAMPLES), part(sample / SAMPLES))));
        }
        *out = light(pixel) * sum / (SAMPLES * SAMPLES) as f64;
    }
    for step in [1, width] {
        exposed = blurred(&exposed, width, step, exposure.blur_px);
    }
    let noise = Normal::new(0.0, exposure.noise.max(1e-9)).expect("a finite deviation");
    let mut image = GrayImage::new(width, height);
    for (out, level) in image.pixels_mut().iter_mut().zip(exposed) {
        *out = (level + noise.sample(rng)).round().clamp(0.0, 255.0) as u8;
    }
    image
}

/// Draws a pose (camera from board) of a board that is held before the camera, wholly in view.
#[must_use]
pub fn held_board(board: &Board, pinhole: &Pinhole, rng: &mut Pcg64) -> Isometry3<f64> {
    let [width, height] = board.size_m();
    let center = Point3::new(0.5 * width - board.square_m, 0.5 * height - board.square_m, 0.0);
    loop {
        let turn = UnitQuaternion::from_euler_angles(
            rng.random_range(-0.7..0.7),
            rng.random_range(-0.7..0.7),
            rng.random_range(-0.5..0.5),
        );
        let distance = width * rng.random_range(1.0..2.4);
        let aside = Vector3::new(rng.random_range(-0.5..0.5), rng.random_range(-0.4..0.4), 1.0) * distance;
        let pose = Isometry3::from_parts((aside - turn * center.coords).into(), turn);
        let is_seen = |corner: &Vector2<f64>| {
            let pixel = pinhole.project(&(pose * Point3::new(corner.x, corner.y, 0.0)));
            pixel.is_ok_and(|pixel| {
                let size = pinhole.intrinsics().size().map(f64::from);
                (0..2).all(|axis| pixel[axis] > 4.0 && pixel[axis] < size[axis] - 5.0)
            })
        };
        let outer = [-1.0, 1.0].map(|side| {
            [-1.0, 1.0].map(|end| Vector2::new(center.x + 0.5 * side * width, center.y + 0.5 * end * height))
        });
        if outer.iter().flatten().all(is_seen) {
            return pose;
        }
    }
}

fn blurred(levels: &[f64], width: usize, step: usize, sigma_px: f64) -> Vec<f64> {
    if sigma_px <= 0.0 {
        return levels.to_vec();
    }
    let reach = (3.0 * sigma_px).ceil() as isize;
    let weights: Vec<f64> = (-reach..=reach).map(|i| (-0.5 * (i as f64 / sigma_px).powi(2)).exp()).collect();
    let sum: f64 = weights.iter().sum();
    let height = levels.len() / width;
    let at = |index: usize| {
        let (place, count) = if step == 1 { (index % width, width) } else { (index / width, height) };
        let start = index - place * step;
        let level = |(i, weight): (usize, &f64)| {
            let there = (place as isize + i as isize - reach).clamp(0, count as isize - 1) as usize;
            weight * levels[start + there * step]
        };
        weights.iter().enumerate().map(level).sum::<f64>() / sum
    };
    (0..levels.len()).map(at).collect()
}
