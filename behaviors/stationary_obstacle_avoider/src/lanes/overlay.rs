//! Overlay of the method `lanes`: the floor's end in each column, upright edges, and from above the occupied cells and the lanes.

use nalgebra::{Point2, Vector2};
use yamabico_core::overlay::{BLUE, Color, GRAY, GREEN, MAGENTA, Overlay, RED, YELLOW};
use yamabico_vision::floor_columns::FloorColumns;

use super::drive::AIM_STATION;
use super::lane::Lane;
use super::occupancy::CELL_M;
use super::planner::Plan;
use super::stations::PathAhead;
use super::upright_edges::UprightEdge;

/// Maximum number of occupied cells that are drawn.
const MAX_DRAWN_CELLS: usize = 1200;

/// Draws the ends of the floor in the last picture.
pub(super) fn draw_columns(overlay: &mut Overlay, columns: &FloorColumns) {
    let mut pixels = overlay.image("floor ends", YELLOW);
    for pixel in columns.end_pixels() {
        pixels.point(Vector2::from(pixel));
    }
    let mut places = overlay.robot("floor ends", YELLOW);
    for place in columns.ends().map(|end| end.place) {
        places.line(
            place.coords - Vector2::new(0.0, 0.5 * CELL_M),
            place.coords + Vector2::new(0.0, 0.5 * CELL_M),
        );
    }
}

/// Draws the upright edges of the last picture.
pub(super) fn draw_edges(overlay: &mut Overlay, edges: &[UprightEdge]) {
    let mut lines = overlay.image("upright edges", MAGENTA);
    for edge in edges {
        lines.line(edge.pixel, Vector2::new(edge.pixel.x, edge.top_row));
    }
}

/// Draws the occupied cells, those that are occupied by geometry alone apart.
pub(super) fn draw_cells(
    overlay: &mut Overlay,
    occupied: &[Point2<f32>],
    is_upright: impl Fn(&Point2<f32>) -> bool,
) {
    for (layer, color, upright) in [("occupied cells", RED, false), ("occupied, upright", MAGENTA, true)] {
        let mut cells = overlay.robot(layer, color);
        for cell in occupied.iter().filter(|cell| is_upright(cell) == upright).take(MAX_DRAWN_CELLS) {
            let (middle, half) = (cell.coords.cast::<f64>(), Vector2::new(0.5 * CELL_M, 0.0));
            cells.line(middle - half, middle + half);
        }
    }
}

/// Draws the path, and the lanes that a robot of this clearance (m to each side) may take.
pub(super) fn draw_lanes(overlay: &mut Overlay, path: &PathAhead, plan: &Plan, clearance_m: f64) {
    let beside = |offset_m: f64| path.stations.iter().map(move |station| station.beside(offset_m).coords);
    overlay.robot("path", GRAY).path(beside(0.0));
    let mut lane = |name: &str, color: Color, lane: &Lane| {
        let mut layer = overlay.robot(name, color);
        for side in [1.0, -1.0] {
            layer.path(beside(lane.offset_m + side * clearance_m));
        }
        if let Some(end) = beside(lane.offset_m).next_back() {
            layer.text(end, format_args!("free {:.1} m, gap {:.2} m", lane.free_m, lane.gap_m));
        }
    };
    lane("lane of the path", BLUE, &plan.nominal);
    lane("best lane", GREEN, &plan.best);
    let aim = path.stations[AIM_STATION].beside(plan.best.offset_m);
    overlay.robot("aim", MAGENTA).circle(aim.coords, 0.06).line(Vector2::zeros(), aim.coords);
}
