//! Text in plots.

use plotters::coord::Shift;
use plotters::prelude::{BitMapBackend, DrawingArea};
use plotters::style::RGBColor;
use yamabico_drawing::font::{ADVANCE, ASCENT, pixels, width};

/// Pixel coordinates.
pub(super) type Pixel = (i32, i32);
/// Picture that is drawn.
pub(super) type Area<'a> = DrawingArea<BitMapBackend<'a>, Shift>;
/// Result of drawing; the drawing library fails.
pub(super) type DrawResult = Result<(), Box<dyn std::error::Error>>;

/// Enlargement of letters.
const LETTER_SCALE: i32 = 4;
/// Height of a letter above its baseline, px.
pub(super) const LETTER_HEIGHT_PX: i32 = LETTER_SCALE * ASCENT;

/// Returns the width of a text, px.
pub(super) fn text_width(text: &str) -> i32 {
    LETTER_SCALE * (width(text) - (ADVANCE - 5))
}

/// Draws a text.
pub(super) fn draw_text(area: &Area<'_>, text: &str, upper_left: Pixel, color: RGBColor) -> DrawResult {
    for (x, y) in pixels(text) {
        let corner = (upper_left.0 + LETTER_SCALE * x, upper_left.1 + LETTER_SCALE * y);
        for (right, down) in (0..LETTER_SCALE * LETTER_SCALE).map(|i| (i % LETTER_SCALE, i / LETTER_SCALE)) {
            area.draw_pixel((corner.0 + right, corner.1 + down), &color)?;
        }
    }
    Ok(())
}
