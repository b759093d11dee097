//! Overlay: the edges expected from the map, matched or not, and the segments of the image.

use nalgebra::Vector2;
use yamabico_core::overlay::{BLUE, Color, GRAY, GREEN, Overlay, YELLOW};

use super::fixer::Fixer;

/// Draws the last image's segments and the edges expected in it.
pub fn draw(overlay: &mut Overlay, fixer: &Fixer) {
    if fixer.segments().is_empty() {
        return;
    }
    let is_matched = |expected: usize| fixer.used().iter().any(|pair| pair.expected == expected);
    let is_used = |segment: usize| fixer.used().iter().any(|pair| pair.segment == segment);
    let segments = || fixer.segments().iter().enumerate();
    let expected = || fixer.expected().iter().enumerate();
    let mut layer = |name: &str, color: Color, lines: &mut dyn Iterator<Item = [Vector2<f64>; 2]>| {
        let mut layer = overlay.image(name, color);
        for [from, to] in lines {
            let ends = [from, to].map(|undistorted| fixer.pinhole().distort_pixel(undistorted));
            if let [Some(from), Some(to)] = ends {
                layer.line(from, to);
            }
        }
    };
    let unused = segments().filter(|(index, _)| !is_used(*index));
    layer("other segments", GRAY, &mut unused.map(|(_, segment)| [segment.p0, segment.p1]));
    let unmatched = expected().filter(|(index, _)| !is_matched(*index));
    layer("expected, not matched", YELLOW, &mut unmatched.map(|(_, edge)| [edge.from, edge.to]));
    let matched = expected().filter(|(index, _)| is_matched(*index));
    layer("expected, matched", BLUE, &mut matched.map(|(_, edge)| [edge.from, edge.to]));
    let used = segments().filter(|(index, _)| is_used(*index));
    layer("matched segments", GREEN, &mut used.map(|(_, segment)| [segment.p0, segment.p1]));
}
