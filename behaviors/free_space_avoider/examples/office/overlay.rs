//! A picture of what the navel grid saw.

use std::path::Path;

use nalgebra::Vector2;
use yamabico_core::image::{GrayImage, ImageView};
use yamabico_core::message::Proposal;
use yamabico_drawing::{Canvas, Color};
use yamabico_free_space_avoider::navel_grid::Sight;
use yamabico_vision::area_average::AreaAverage;

/// Writes the picture, twice as large, with the grid on it: obstacles red, the floor below them green, and what the robot's way covers
/// blue, what else is weighed light blue; a bar at the lower edge tells speed (its length) and turn (its lean).
pub fn draw(image: ImageView, sight: &Sight, proposal: &Proposal, path: &Path) -> Result<(), String> {
    let (width, height) = (2 * image.width(), 2 * image.height());
    let mut larger = GrayImage::new(width, height);
    AreaAverage::default().scale(image, &mut larger);
    // Sixteen levels are enough to look at, and make small files.
    larger.pixels_mut().iter_mut().for_each(|pixel| *pixel = *pixel / 17 * 17);
    let mut data = vec![0; 3 * width * height];
    let mut canvas = Canvas::new(&mut data, width, height).ok_or("a canvas of the wrong size")?;
    canvas.copy_gray(larger.view().map_err(|e| e.to_string())?);
    let size = sight.size();
    let (cell_u, cell_v) = (width as f64 / size.columns as f64, height as f64 / size.rows as f64);
    let (way, weighed) = sight.covered();
    let corner =
        |column: usize, row: usize| Vector2::new(column as f64 * cell_u, height as f64 - row as f64 * cell_v);
    let frame = |canvas: &mut Canvas, column: usize, row: usize, color: Color| {
        let by = Vector2::new(2.0, -2.0);
        canvas.outline(corner(column, row) + by, corner(column + 1, row + 1) - by, color);
    };
    for column in 0..size.columns {
        let free = sight.free().get(column).map_or(0, |&free| free as usize);
        for row in 0..size.rows {
            if sight.cells().is_obstacle(column, row) {
                frame(&mut canvas, column, row, [235, 60, 40]);
            } else if row < free {
                let is_way = row < way[column] as usize;
                let is_weighed = row < weighed[column] as usize;
                let color = match (is_way, is_weighed) {
                    (true, _) => [40, 120, 255],
                    (false, true) => [40, 200, 220],
                    (false, false) => [60, 170, 60],
                };
                frame(&mut canvas, column, row, color);
            }
        }
        let end = corner(column, free);
        for line in 0..4 {
            let down = Vector2::new(0.0, f64::from(line));
            canvas.line(end + down, end + down + Vector2::new(cell_u, 0.0), [255, 220, 0]);
        }
    }
    let foot = Vector2::new(0.5 * width as f64, height as f64 - 2.0);
    let head = foot
        - Vector2::new(
            0.6 * height as f64 * proposal.twist.angular,
            height as f64 * proposal.twist.linear.max(0.05),
        );
    for side in -3..=3 {
        let aside = Vector2::new(f64::from(side), 0.0);
        canvas.line(foot + aside, head + aside, [255, 0, 255]);
    }
    image::save_buffer(path, &data, width as u32, height as u32, image::ExtendedColorType::Rgb8)
        .map_err(|e| format!("{}: {e}", path.display()))
}
