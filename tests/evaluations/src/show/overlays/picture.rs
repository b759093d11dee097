//! The picture: overlays in pixels, those in the robot frame projected to the floor, and a text below.

use image::{Rgb, RgbImage};
use nalgebra::{Point2, Point3, Vector2};
use yamabico_core::camera::Pinhole;
use yamabico_core::message::{MarkKind, OverlayMark};
use yamabico_core::overlay::{Space, layers};
use yamabico_drawing::{Canvas, Color};
use yamabico_runtime::overlay_painter::with_overlays;
use yamabico_sim::building::Building;

use super::snapshot::Snapshot;

/// Height of a line of text, px.
const LINE_PX: u32 = 22;
/// Color of what stands on the floor.
const TRUE_COLOR: Color = [255; 3];
/// Color of the text.
const TEXT_COLOR: Color = [235; 3];
/// Number of parts of a line on the floor, which a lens may bend and the image border may cut.
const PARTS: usize = 12;

/// Draws the snapshot with lines of text below.
pub fn draw(building: &Building, snapshot: &Snapshot, text: &[String]) -> Result<RgbImage, String> {
    let frame = &snapshot.frame;
    let (width, height) = (frame.width() as u32, frame.height() as u32);
    let gray = |u: u32, v: u32| Rgb([frame.pixels()[(v * width + u) as usize]; 3]);
    let picture = RgbImage::from_fn(width, height, gray);
    let marks: Vec<&[OverlayMark]> = snapshot.overlays.values().map(Vec::as_slice).collect();
    let drawn = with_overlays(&picture, &marks, &|_| true);
    let factor = f64::from(drawn.width() / width);
    let (intrinsics, mount) = building.camera();
    let pinhole = Pinhole::ideal(intrinsics);
    let mut image = RgbImage::new(drawn.width(), drawn.height() + LINE_PX * text.len() as u32 + 6);
    image::imageops::replace(&mut image, &drawn, 0, 0);
    let (wide, high) = (image.width() as usize, image.height() as usize);
    let below = f64::from(drawn.height());
    let mut canvas = Canvas::new(&mut image, wide, high).ok_or("an image without pixels")?;
    let pixel = |at: Point2<f64>| {
        let pixel = pinhole.project_from_body(&mount, &Point3::new(at.x, at.y, 0.0))?;
        let pixel = pixel * factor + Vector2::repeat(0.5 * (factor - 1.0));
        (pixel.y < below && pixel.y > 0.0 && pixel.x > 0.0 && pixel.x < wide as f64).then_some(pixel)
    };
    let mut on_floor = |from: Point2<f64>, to: Point2<f64>, color: Color| {
        let at = |i: usize| pixel(from + (to - from) * (i as f64 / PARTS as f64));
        for i in 0..PARTS {
            if let (Some(a), Some(b)) = (at(i), at(i + 1)) {
                canvas.stroke(a, b, 1.6, color);
            }
        }
    };
    let from_world = snapshot.robot.inverse();
    for item in &building.world.boxes {
        let corner = |i: usize| {
            let signs = [[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0]][i % 4];
            let (sin, cos) = item.yaw_deg.to_radians().sin_cos();
            let [x, y] = [0.5 * signs[0] * item.size_m[0], 0.5 * signs[1] * item.size_m[1]];
            let at = Point2::new(item.at_m[0] + cos * x - sin * y, item.at_m[1] + sin * x + cos * y);
            from_world.transform_point(at)
        };
        (0..4).for_each(|i| on_floor(corner(i), corner(i + 1), TRUE_COLOR));
    }
    for marks in snapshot.overlays.values() {
        for layer in layers(marks).filter(|layer| layer.space == Space::Robot) {
            for mark in layer.marks.iter().filter(|mark| mark.kind() == Some(MarkKind::Line)) {
                on_floor(Point2::new(mark.x, mark.y), Point2::new(mark.x2, mark.y2), layer.color);
            }
        }
    }
    for (i, line) in text.iter().enumerate() {
        canvas.text(Vector2::new(6.0, below + 6.0 + f64::from(LINE_PX) * i as f64), line, TEXT_COLOR);
    }
    Ok(image)
}
