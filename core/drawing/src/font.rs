//! The font of plots and pictures: DejaVu Sans, embedded, so that a machine needs no fonts.

use std::sync::OnceLock;

use ab_glyph::{Font as _, FontRef, PxScale, PxScaleFont, ScaleFont as _, point};

/// Size of a text in a picture (its em), px.
pub const TEXT_PX: f64 = 11.0;
/// Height of a capital above the baseline, as a fraction of the size.
pub const CAPITAL: f64 = 0.73;

/// The file of the font, TrueType: ASCII and a few signs.
const FILE: &[u8] = include_bytes!("../font/DejaVuSans-subset.ttf");

/// Returns the width of `text` at this size, px.
#[must_use]
pub fn width(text: &str, size_px: f64) -> f64 {
    let Some(font) = scaled(size_px) else { return 0.0 };
    text.chars().map(|letter| f64::from(font.h_advance(font.glyph_id(letter)))).sum()
}

/// Calls `draw` with each pixel (right, down) of `text` and its coverage, 0 to 1. The text begins at `upper_left` of its
/// capitals; characters that the font lacks are boxes.
pub fn pixels(text: &str, size_px: f64, upper_left: [f64; 2], mut draw: impl FnMut(i32, i32, f64)) {
    let Some(font) = scaled(size_px) else { return };
    let [mut right, down] = upper_left;
    let baseline = (down + CAPITAL * size_px).round();
    for letter in text.chars() {
        let glyph = font.glyph_id(letter);
        let placed = glyph.with_scale_and_position(font.scale(), point(right as f32, baseline as f32));
        if let Some(outline) = font.outline_glyph(placed) {
            let corner = outline.px_bounds().min;
            outline.draw(|x, y, coverage| {
                draw(corner.x as i32 + x as i32, corner.y as i32 + y as i32, f64::from(coverage).min(1.0));
            });
        }
        right += f64::from(font.h_advance(glyph));
    }
}

/// Returns the font at this size; `None` only if the embedded file were broken.
fn scaled(size_px: f64) -> Option<PxScaleFont<&'static FontRef<'static>>> {
    static FONT: OnceLock<Option<FontRef<'static>>> = OnceLock::new();
    let font = FONT.get_or_init(|| FontRef::try_from_slice(FILE).ok()).as_ref()?;
    let lines_per_em = font.height_unscaled() / font.units_per_em()?;
    Some(font.as_scaled(PxScale::from(size_px as f32 * lines_per_em)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(text: &str) -> Vec<(i32, i32)> {
        let mut drawn = Vec::new();
        pixels(text, 20.0, [3.0, 4.0], |x, y, coverage| {
            if coverage > 0.5 {
                drawn.push((x, y));
            }
        });
        drawn
    }

    #[test]
    fn a_capital_fills_its_height_from_the_upper_left_corner() {
        let letter = drawn("H");
        let rows: Vec<i32> = letter.iter().map(|(_, y)| *y).collect();
        assert_eq!((rows.iter().min(), rows.iter().max()), (Some(&4), Some(&18)), "15 px high");
        assert!(letter.iter().all(|(x, _)| (3..3 + width("H", 20.0) as i32).contains(x)));
    }

    #[test]
    fn widths_add_up_and_signs_are_there() {
        assert!((width("il", 20.0) - width("i", 20.0) - width("l", 20.0)).abs() < 1e-4);
        assert!(width("m", 20.0) > 2.0 * width("i", 20.0) && width("", 20.0) == 0.0);
        for sign in ["\u{b0}", "\u{b1}", "\u{d7}", "g"] {
            assert_ne!(drawn(sign), drawn("\u{2603}"), "{sign}");
        }
        assert!(drawn(" ").is_empty());
    }
}
