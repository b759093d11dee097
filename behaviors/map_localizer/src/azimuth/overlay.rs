//! Overlay: the vertical edges in the mirror's image, matched with the map or not, and the azimuths that the map lets expect.

use nalgebra::Point2;
use yamabico_core::camera::MirrorCamera;
use yamabico_core::geometry::Pose2;
use yamabico_core::overlay::{BLUE, GREEN, Overlay, YELLOW};
use yamabico_vision::azimuth_profile::AzimuthEdge;

/// Length of the mark of an expected azimuth inside the mirror's rim, px.
const MARK_PX: f64 = 12.0;

/// Draws the edges `seen` in the last image, each with whether an edge of the map explains it, and the azimuths of `expected` map
/// edges from the camera's pose.
pub fn draw<'a>(
    overlay: &mut Overlay,
    mirror: &MirrorCamera,
    seen: impl Iterator<Item = (&'a AzimuthEdge, bool)> + Clone,
    expected: impl Iterator<Item = Point2<f64>>,
    camera: Option<&Pose2>,
) {
    let image = mirror.image();
    let rim_px = image.rim_radius_px() - 2.0;
    for (name, color, wanted) in [("not matched", YELLOW, false), ("matched", GREEN, true)] {
        let mut layer = overlay.image(name, color);
        for (edge, _) in seen.clone().filter(|(_, is_matched)| *is_matched == wanted) {
            let inner_px = edge.inner_radius_px().unwrap_or(rim_px - edge.length_px);
            let at = |radius_px| image.pixel_from_polar(radius_px, edge.azimuth_rad);
            layer.line(at(inner_px), at(rim_px));
        }
    }
    let Some(camera) = camera else { return };
    let camera_from_map = camera.inverse();
    let mut marks = overlay.image("expected", BLUE);
    for point in expected {
        let point = camera_from_map.transform_point(point);
        let azimuth = point.y.atan2(point.x);
        marks
            .line(image.pixel_from_polar(rim_px - MARK_PX, azimuth), image.pixel_from_polar(rim_px, azimuth));
    }
}
