//! Overlay: the navel grid with its digits, and the free floor from above.

use nalgebra::Vector2;
use yamabico_core::camera::Intrinsics;
use yamabico_core::message::FreeDirection;
use yamabico_core::overlay::{BLUE, CYAN, Color, GREEN, MAGENTA, Overlay, RED, YELLOW};

use super::PathObserver;
use crate::direction::HeadingChoice;

/// Margin between a cell and its frame, px.
const MARGIN_PX: f64 = 1.0;
/// Time for which the chosen motion is drawn ahead, s.
const PREVIEW_S: f64 = 2.0;

/// Draws what `observer` saw in the last image, and the motion chosen from it.
pub fn draw(
    overlay: &mut Overlay,
    observer: &PathObserver,
    camera: &Intrinsics,
    heading: Option<&HeadingChoice>,
) {
    let size = observer.size();
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    let cell = Vector2::new(width / size.columns as f64, height / size.rows as f64);
    let corner =
        |column: usize, row: usize| Vector2::new(column as f64 * cell.x, height - row as f64 * cell.y);
    let free = |column: usize| observer.free().get(column).map_or(0, |&free| free as usize);
    let (path, weighted) = observer.covered();
    let is_before = |rows: &[u32], column: usize, row: usize| row < rows[column] as usize;
    let mut layer = |name: &str, color: Color, shows: &dyn Fn(usize, usize) -> bool| {
        let mut frames = overlay.image(name, color);
        let margin = Vector2::new(MARGIN_PX, -MARGIN_PX);
        for (column, row) in (0..size.columns).flat_map(|column| (0..size.rows).map(move |row| (column, row)))
        {
            if shows(column, row) {
                frames.frame(corner(column, row) + margin, corner(column + 1, row + 1) - margin);
            }
        }
    };
    let is_free = |column: usize, row: usize| row < free(column);
    layer("obstacle cells", RED, &|column, row| observer.cells().is_obstacle(column, row));
    layer("free cells of the path", BLUE, &|column, row| {
        is_free(column, row) && is_before(path, column, row)
    });
    layer("free weighted cells", CYAN, &|column, row| {
        is_free(column, row) && !is_before(path, column, row) && is_before(weighted, column, row)
    });
    let mut digits = overlay.image("free cells by column", YELLOW);
    for column in 0..size.columns {
        let end = corner(column, free(column));
        digits.line(end, end + Vector2::new(cell.x, 0.0));
        digits.text(end + Vector2::new(0.25 * cell.x, -0.9 * cell.y), format_args!("{}", free(column)));
    }
    draw_free_space(overlay, Some(Vector2::zeros()), observer.directions().iter().copied());
    if let Some(heading) = heading {
        draw_motion(overlay, heading);
    }
}

/// Draws the outline of the free floor: the end in each direction, and the robot's center if it is seen from there ahead only.
pub(crate) fn draw_free_space(
    overlay: &mut Overlay,
    center: Option<Vector2<f64>>,
    ends: impl Iterator<Item = FreeDirection>,
) {
    let ends = ends.map(|end| {
        let (sin, cos) = end.azimuth_rad.sin_cos();
        Vector2::new(end.distance_m * cos, end.distance_m * sin)
    });
    overlay.robot("free space", GREEN).polygon(center.into_iter().chain(ends));
}

fn draw_motion(overlay: &mut Overlay, heading: &HeadingChoice) {
    let pose = |share: f64| {
        let pose = yamabico_core::geometry::Pose2::IDENTITY.integrate(&heading.twist, share * PREVIEW_S);
        Vector2::new(pose.x, pose.y)
    };
    overlay.robot("chosen motion", MAGENTA).path((0..=10).map(|i| pose(0.1 * f64::from(i))));
}
