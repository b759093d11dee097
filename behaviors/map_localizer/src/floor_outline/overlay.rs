//! Overlay: the outline of the floor in the mirror's image, and the floor plan seen from the pose found in it.

use nalgebra::Point3;
use yamabico_core::geometry::Pose2;
use yamabico_core::overlay::{BLUE, GREEN, Overlay};
use yamabico_vision::map::WireFrame;

use super::localizer::FloorLocalizer;

/// Number of lines of a drawn side of the plan.
const SIDE_LINES: u32 = 20;

/// Draws the outline of the last image, and `walls` from the pose `camera`.
pub fn draw(overlay: &mut Overlay, localizer: &FloorLocalizer, walls: &WireFrame, camera: Option<&Pose2>) {
    let (mirror, height_m) = (localizer.camera(), localizer.height_m());
    let hull = localizer.outline().hull().iter();
    overlay
        .image("outline of the floor", GREEN)
        .polygon(hull.map(|corner| mirror.image().pixel_from_mirror(corner.coords)));
    let Some(camera) = camera else { return };
    let camera_from_map = camera.inverse();
    let mut plan = overlay.image("floor plan", BLUE);
    for wall in walls.walls() {
        plan.path((0..=SIDE_LINES).filter_map(|i| {
            let share = f64::from(i) / f64::from(SIDE_LINES);
            let point = camera_from_map.transform_point(wall.from + (wall.to - wall.from) * share);
            mirror.pixel_from_point(&Point3::new(point.x, point.y, -height_m)).ok()
        }));
    }
}
