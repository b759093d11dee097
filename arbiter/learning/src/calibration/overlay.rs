//! Pictures with what was measured drawn into them: corners of a board, horizon, plumb lines and ground.

use std::path::Path;

use nalgebra::{Point3, Vector2, Vector3};
use yamabico_core::camera::{Mount, Pinhole};
use yamabico_drawing::{Canvas, Color};
use yamabico_vision::calibration::Board;

use super::pictures::Picture;
use crate::LearningError;
use crate::error::write_png;

const HORIZON: Color = [255, 60, 60];
const GROUND: Color = [0, 230, 80];
const PLUMB: Color = [0, 200, 255];
const AGREES: Color = [255, 220, 0];
const DISAGREES: Color = [255, 0, 255];
/// Distance to the ends of the ground grid ahead, and to each side, in squares.
const AHEAD: i32 = 12;
const ASIDE: i32 = 3;
/// Side of a square of the grid where the height is known, m; where it is not, it is the height.
const SQUARE_M: f64 = 0.5;
/// Left and upper margin of the text, and distance between its lines, px. Its lines fit pictures of 256 px.
const TEXT_PX: f64 = 6.0;
const LINE_PX: f64 = 14.0;
/// Number of pieces that a line is drawn in, since a lens bends it.
const PIECES: usize = 60;

/// Horizon, plumb lines and ground as the camera should see them.
pub(super) struct GroundOverlay {
    /// Camera.
    pub pinhole: Pinhole,
    /// Attitude; the pan is not drawn.
    pub mount: Mount,
    /// Height, m, if known.
    pub height_m: Option<f64>,
    /// Vanishing points of all pictures, distorted pixels, and whether they agree with the horizon.
    pub points: Vec<(Vector2<f64>, bool)>,
}

/// Draws the ground over a picture, with the corners of a board if there is one, and writes a PNG.
pub(super) fn ground(
    file: &Path,
    picture: &Picture,
    overlay: &GroundOverlay,
    corners: Option<&[Vector2<f64>]>,
) -> Result<(), LearningError> {
    draw(file, picture, |canvas| {
        let camera_from_level = Mount { pan: 0.0, ..overlay.mount }.rotation_body_from_camera().transpose();
        let pixel = |direction: Vector3<f64>| {
            // Scaled beyond the near plane of the camera.
            overlay.pinhole.project(&Point3::from(camera_from_level * direction * 1e3)).ok()
        };
        let mut polyline = |from: Vector3<f64>, to: Vector3<f64>, thickness: f64, color: Color| {
            let at = |i: usize| pixel(from + (to - from) * (i as f64 / PIECES as f64));
            for i in 0..PIECES {
                if let (Some(a), Some(b)) = (at(i), at(i + 1)) {
                    canvas.stroke(a, b, thickness, color);
                }
            }
        };
        let (side, height) = overlay.height_m.map_or((1.0, 1.0), |height| (SQUARE_M, height));
        let floor = |x: f64, y: f64| Vector3::new(x * side, y * side, -height);
        let (first, last, aside) = (0.2, f64::from(AHEAD), f64::from(ASIDE));
        for column in -ASIDE..=ASIDE {
            let y = f64::from(column);
            polyline(floor(first, y), floor(2.0, y), 1.0, GROUND);
            polyline(floor(2.0, y), floor(last, y), 1.0, GROUND);
        }
        for row in 1..=AHEAD {
            polyline(floor(f64::from(row), -aside), floor(f64::from(row), aside), 1.0, GROUND);
        }
        for azimuth in [-0.4_f64, -0.2, 0.2, 0.4] {
            let foot = |z: f64| Vector3::new(azimuth.cos(), -azimuth.sin(), z);
            polyline(foot(-0.15), foot(0.45), 1.0, PLUMB);
        }
        let far = |azimuth: f64| Vector3::new(azimuth.cos(), azimuth.sin(), 0.0);
        for step in -12..12 {
            polyline(far(0.1 * f64::from(step)), far(0.1 * f64::from(step + 1)), 2.0, HORIZON);
        }
        for (point, agrees) in &overlay.points {
            canvas.cross(*point, 5.0, if *agrees { AGREES } else { DISAGREES });
        }
        for corner in corners.unwrap_or_default() {
            canvas.ring(*corner, 4.0, 1.5, AGREES);
        }
        let degrees = |angle: f64| angle.to_degrees() + 0.0;
        let height = overlay.height_m.map_or_else(
            || "height unknown, squares of 1 height".to_owned(),
            |height| format!("height {height:.3} m, squares of {SQUARE_M} m"),
        );
        let attitude =
            format!("tilt {:.2}°, roll {:.2}°", degrees(overlay.mount.tilt), degrees(overlay.mount.roll));
        for (top, text) in [(TEXT_PX, attitude), (TEXT_PX + LINE_PX, height)] {
            for (dx, dy) in [(-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0), (1.0, 1.0)] {
                canvas.text(Vector2::new(TEXT_PX + dx, top + dy), &text, [0, 0, 0]);
            }
            canvas.text(Vector2::new(TEXT_PX, top), &text, [255, 255, 255]);
        }
    })
}

/// Draws the corners of a board, joined row by row, and writes a PNG with the name of the picture into `folder`.
pub(super) fn corners(
    folder: &Path,
    picture: &Picture,
    board: &Board,
    corners: &[Vector2<f64>],
) -> Result<(), LearningError> {
    let stem = Path::new(&picture.name).file_stem().unwrap_or_default().to_string_lossy().into_owned();
    draw(&folder.join(format!("{stem}-corners.png")), picture, |canvas| {
        for row in corners.chunks(board.columns) {
            row.windows(2).for_each(|pair| canvas.stroke(pair[0], pair[1], 1.0, PLUMB));
        }
        for corner in corners {
            canvas.ring(*corner, 4.0, 1.5, AGREES);
        }
        if let Some(first) = corners.first() {
            canvas.ring(*first, 8.0, 2.0, HORIZON);
        }
    })
}

fn draw(file: &Path, picture: &Picture, draw: impl FnOnce(&mut Canvas<'_>)) -> Result<(), LearningError> {
    let (width, height) = (picture.gray.width(), picture.gray.height());
    let mut pixels = vec![0; 3 * width * height];
    if let (Some(mut canvas), Ok(view)) = (Canvas::new(&mut pixels, width, height), picture.gray.view()) {
        canvas.copy_gray(view);
        draw(&mut canvas);
    }
    write_png(file, &pixels, (width, height))
}
