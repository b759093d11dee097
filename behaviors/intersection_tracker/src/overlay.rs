//! Overlay: the corridor's lines, the ends of its walls, and the tracked edges with the middle between them.

use nalgebra::{Point3, Vector2};
use yamabico_core::camera::Pinhole;
use yamabico_core::geometry::Pose2;
use yamabico_core::overlay::{BLUE, CYAN, MAGENTA, Overlay, RED, YELLOW};
use yamabico_vision::corridor::observer::CorridorObserver;

use crate::finder::{Side, WallEnd};
use crate::landmarks::Ahead;
use crate::track::IntersectionTrack;

/// Half the size of the frame around a tracked edge, px.
const FRAME_PX: [f64; 2] = [10.0, 20.0];
/// Height to which a tracked edge is drawn above the floor, m.
const EDGE_M: f64 = 2.0;

/// Draws the ends of the walls, found in the corridor's lines of the same image.
pub fn draw_ends(overlay: &mut Overlay, observer: &CorridorObserver, ends: &[WallEnd]) {
    let pinhole = &observer.camera().pinhole;
    let mut along = overlay.image("segments along the corridor", BLUE);
    for segment in observer.along_corridor() {
        line(&mut along, pinhole, segment.p0, segment.p1);
    }
    let mut layer = overlay.image("ends of walls", YELLOW);
    for end in ends {
        line(&mut layer, pinhole, end.base, end.base - Vector2::new(0.0, end.length_px));
        if let Some(base) = pinhole.distort_pixel(end.base) {
            layer.text(base + Vector2::new(4.0, -14.0), format_args!("{:.1} m", end.ahead_m));
        }
    }
}

/// Draws the edges tracked by a robot at `pose` and the intersection ahead.
pub fn draw_track(
    overlay: &mut Overlay,
    observer: &CorridorObserver,
    track: &IntersectionTrack,
    pose: &Pose2,
    ahead: Option<&Ahead>,
) {
    let camera = observer.camera();
    let mut seen = overlay.image("tracked edges", RED);
    for side in Side::BOTH {
        if let Some(at) = track.observed_at(side).and_then(|at| camera.pinhole.distort_pixel(at)) {
            let half = Vector2::from(FRAME_PX);
            seen.frame(at - half, at + half);
        }
    }
    let Some(landmarks) = track.landmarks() else { return };
    let robot_from_odometry = pose.inverse();
    let edges = Side::BOTH.map(|side| robot_from_odometry.transform_point(landmarks.point(side)));
    let mut predicted = overlay.image("predicted edges", CYAN);
    for edge in &edges {
        let ends = [0.0, EDGE_M]
            .map(|z| camera.pinhole.project_from_body(&camera.mount, &Point3::new(edge.x, edge.y, z)));
        if let [Some(foot), Some(top)] = ends {
            predicted.line(foot, top);
        }
    }
    let mut from_above = overlay.robot("edges of the intersection", RED);
    for edge in &edges {
        from_above.circle(edge.coords, 0.1);
    }
    if let Some(Ahead { bearing, distance_m, sigma_m }) = ahead {
        let middle = 0.5 * (edges[0].coords + edges[1].coords);
        overlay
            .robot("intersection", MAGENTA)
            .line(Vector2::zeros(), middle)
            .text(middle, format_args!("{distance_m:.2} ± {sigma_m:.2} m"))
            .text(0.5 * middle, format_args!("{:+.1}°", bearing.to_degrees()));
    }
}

/// Draws a line between undistorted pixels.
fn line(
    layer: &mut yamabico_core::overlay::Layer<'_>,
    pinhole: &Pinhole,
    from: Vector2<f64>,
    to: Vector2<f64>,
) {
    if let (Some(from), Some(to)) = (pinhole.distort_pixel(from), pinhole.distort_pixel(to)) {
        layer.line(from, to);
    }
}
