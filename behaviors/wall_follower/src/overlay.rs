//! Overlay: the segments by vanishing point, the point with its sigma, the floor lines of the walls, and the walls from above.

use nalgebra::{Point3, Vector2};
use yamabico_core::overlay::{BLUE, CYAN, GRAY, GREEN, MAGENTA, Overlay};
use yamabico_vision::corridor::floor_lines::WallEstimate;
use yamabico_vision::corridor::observer::CorridorCamera;

use crate::ahead::SeenWall;
use crate::sight::{Seen, Sight};

/// Begin and end of a drawn wall along the corridor, m.
const WALL_M: [f64; 2] = [0.3, 12.0];
/// Number of points of a drawn wall.
const WALL_POINTS: u32 = 12;
/// Minimum radius of the ring around the vanishing point, px.
const MIN_RING_PX: f64 = 3.0;

/// Draws what was seen in the last frame.
pub fn draw(overlay: &mut Overlay, sight: &Sight, seen: &Seen) {
    let observer = sight.observer();
    let camera = observer.camera();
    let pixel = |undistorted| camera.pinhole.distort_pixel(undistorted);
    let line = |p0, p1| Some((pixel(p0)?, pixel(p1)?));
    let mut others = overlay.image("other segments", GRAY);
    for segment in observer.segments() {
        if let Some((from, to)) = line(segment.p0, segment.p1) {
            others.line(from, to);
        }
    }
    let mut along = overlay.image("segments along the corridor", BLUE);
    for segment in observer.along_corridor() {
        if let Some((from, to)) = line(segment.p0, segment.p1) {
            along.line(from, to);
        }
    }
    let mut point = overlay.image("vanishing point", MAGENTA);
    if let Ok(observation) = &seen.observation
        && let Some(at) = pixel(observation.vanishing_point)
    {
        let sigma_px = observation.heading_sigma * camera.pinhole.intrinsics().fx;
        point.circle(at, sigma_px.max(MIN_RING_PX));
        point.line(at - Vector2::new(10.0, 0.0), at + Vector2::new(10.0, 0.0));
        point.line(at - Vector2::new(0.0, 10.0), at + Vector2::new(0.0, 10.0));
        let [heading, sigma] = [observation.heading, observation.heading_sigma].map(f64::to_degrees);
        let label = at + Vector2::new(12.0, -14.0);
        match seen.probability {
            Some(p) => point.text(label, format_args!("{heading:+.1} ± {sigma:.1}°, p {p:.2}")),
            None => point.text(label, format_args!("{heading:+.1} ± {sigma:.1}°")),
        };
    }
    draw_walls(overlay, camera, seen);
    if let Some(SeenWall { range_m, .. }) = seen.wall {
        overlay
            .robot("wall ahead", CYAN)
            .line(Vector2::new(range_m, -0.6), Vector2::new(range_m, 0.6))
            .text(Vector2::new(range_m, 0.0), format_args!("wall at {range_m:.1} m"));
    }
}

/// Draws the floor lines of the walls into the image, and the walls from above.
fn draw_walls(overlay: &mut Overlay, camera: &CorridorCamera, seen: &Seen) {
    let Ok(observation) = &seen.observation else { return };
    let walls = [observation.left, observation.right];
    let (sin, cos) = observation.heading.sin_cos();
    let on_wall = |wall: &WallEstimate, i: u32| {
        let [near, far] = WALL_M;
        let along = near * (far / near).powf(f64::from(i) / f64::from(WALL_POINTS));
        Vector2::new(along * cos + wall.distance_m * sin, wall.distance_m * cos - along * sin)
    };
    let mut floor_lines = overlay.image("floor lines", GREEN);
    for wall in walls.iter().flatten() {
        let on_floor = (0..=WALL_POINTS).map(|i| on_wall(wall, i));
        floor_lines.path(on_floor.filter_map(|point| {
            camera.pinhole.project_from_body(&camera.mount, &Point3::new(point.x, point.y, 0.0))
        }));
    }
    let mut from_above = overlay.robot("walls", GREEN);
    for wall in walls.iter().flatten() {
        let WallEstimate { distance_m, sigma_m } = *wall;
        from_above.line(on_wall(wall, 0), on_wall(wall, WALL_POINTS));
        from_above
            .text(on_wall(wall, WALL_POINTS / 2), format_args!("{:.2} ± {sigma_m:.2} m", distance_m.abs()));
    }
}
