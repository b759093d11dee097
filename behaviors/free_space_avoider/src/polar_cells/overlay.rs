//! Overlay: the cells around the robot in the mirror's image, and the free floor from above.

use yamabico_core::overlay::{GRAY, GREEN, Layer, Overlay, RED};

use super::ring_observer::RingObserver;
use crate::navel_grid::overlay::draw_free_space;

/// Margin between a cell and its frame, px.
const MARGIN_PX: f64 = 0.7;
/// Margin between a cell and its frame, rad.
const MARGIN_RAD: f64 = 0.015;

/// Draws what `observer` saw in the last image.
pub fn draw(overlay: &mut Overlay, observer: &RingObserver) {
    let mut rings = overlay.image("rings", GRAY);
    for &radius_px in observer.edges_px() {
        rings.circle(observer.mirror().center(), radius_px);
    }
    let free = || observer.free().rings().iter().copied().enumerate();
    let mut green = overlay.image("free cells", GREEN);
    for (sector, free) in free().filter(|(_, free)| *free > 0) {
        cells(&mut green, observer, sector, 0..free);
    }
    let mut red = overlay.image("first obstacle cells", RED);
    for (sector, free) in free().filter(|(_, free)| free + 1 < observer.edges_px().len()) {
        cells(&mut red, observer, sector, free..free + 1);
    }
    draw_free_space(overlay, None, observer.distances().ends());
}

/// Draws the frame of the cells of one sector from the first ring to the last.
fn cells(layer: &mut Layer<'_>, observer: &RingObserver, sector: usize, rings: std::ops::Range<usize>) {
    let (right, left) = observer.distances().borders(sector);
    let (right, left) = (right + MARGIN_RAD, left - MARGIN_RAD);
    let edge = |ring: usize| observer.edges_px().get(ring).copied().unwrap_or(f64::NAN);
    let (inner, outer) = (edge(rings.start) + MARGIN_PX, edge(rings.end) - MARGIN_PX);
    let corners = [(inner, right), (outer, right), (outer, left), (inner, left)];
    layer.polygon(corners.map(|(radius_px, azimuth)| observer.mirror().pixel_from_polar(radius_px, azimuth)));
}
