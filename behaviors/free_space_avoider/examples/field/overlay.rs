//! A picture of what polar cells saw.

use std::path::Path;

use image::ImageEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use nalgebra::Vector2;
use yamabico_core::message::Proposal;
use yamabico_drawing::{Canvas, Color};
use yamabico_free_space_avoider::polar_cells::RingSight;

/// Writes the picture, twice as large: free cells outlined green, the first blocked cell of each direction red, and a line from
/// the center, as long as the robot drives in a second, magenta.
pub fn draw(pixels: &[u8], sight: &RingSight, proposal: &Proposal, path: &Path) -> Result<(), String> {
    const SCALE: usize = 2;
    let (columns, rows) = (sight.image().width as usize, sight.image().height as usize);
    let (width, height) = (SCALE * columns, SCALE * rows);
    let mut data = Vec::with_capacity(3 * width * height);
    for v in 0..height {
        for u in 0..width {
            let pixel = &pixels[3 * (v / SCALE * columns + u / SCALE)..][..3];
            // Thirteen levels are enough to look at, and make small files.
            data.extend(pixel.iter().map(|level| level / 20 * 20));
        }
    }
    let mut canvas = Canvas::new(&mut data, width, height).ok_or("a canvas of the wrong size")?;
    let at = |radius_px: f64, azimuth: f64| {
        let half = Vector2::repeat(0.5 * (SCALE as f64 - 1.0));
        sight.image().pixel_from_polar(radius_px, azimuth) * SCALE as f64 + half
    };
    let distances = sight.distances();
    let cell = |canvas: &mut Canvas, ring: usize, sector: usize, color: Color| {
        let (right, left) = distances.borders(sector);
        let (right, left) = (right + 0.015, left - 0.015);
        let (inner, outer) = (sight.edges_px()[ring] + 0.7, sight.edges_px()[ring + 1] - 0.7);
        let corners = [(inner, right), (outer, right), (outer, left), (inner, left), (inner, right)];
        for pair in corners.windows(2) {
            canvas.line(at(pair[0].0, pair[0].1), at(pair[1].0, pair[1].1), color);
        }
    };
    for (sector, &free) in sight.free().rings().iter().enumerate() {
        for ring in 0..free {
            cell(&mut canvas, ring, sector, [70, 230, 90]);
        }
        if free + 1 < sight.edges_px().len() {
            cell(&mut canvas, free, sector, [255, 50, 30]);
        }
    }
    let velocity = Vector2::new(proposal.twist.linear, proposal.twist.lateral);
    if velocity.norm() > 0.0 {
        let azimuth = velocity.y.atan2(velocity.x);
        let reach = sight.edges_m().iter().filter(|&&edge| edge <= velocity.norm()).count();
        let radius_px = sight.edges_px()[reach.clamp(1, sight.edges_px().len() - 1)];
        let aside = Vector2::new(-azimuth.sin(), azimuth.cos());
        for side in -4..=4 {
            let shift =
                sight.image().pixel_from_mirror(aside * (0.3 * f64::from(side))) - sight.image().center();
            canvas.line(at(4.0, azimuth) + shift * 3.0, at(radius_px, azimuth) + shift * 3.0, [255, 0, 255]);
        }
    }
    let cannot = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
    let file = std::fs::File::create(path).map_err(|e| cannot(&e))?;
    PngEncoder::new_with_quality(file, CompressionType::Best, FilterType::NoFilter)
        .write_image(&data, width as u32, height as u32, image::ExtendedColorType::Rgb8)
        .map_err(|e| cannot(&e))
}
