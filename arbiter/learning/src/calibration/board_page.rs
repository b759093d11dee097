//! The checkerboard as a PDF page to print at true scale, with a bar to check the scale by.

use std::fmt::Write as _;
use std::path::Path;

use serde::Serialize;
use yamabico_vision::calibration::Board;

use crate::LearningError;

/// Points of PDF per meter.
const PT_PER_M: f64 = 72.0 / 0.0254;
/// Smallest white margin around the board, m, and height of the lines of text below it, m.
const MARGIN_M: f64 = 0.006;
const TEXT_M: f64 = 0.010;
/// Length of the bar, m.
const BAR_M: f64 = 0.1;

/// Size of paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Paper {
    /// 210 x 297 mm.
    A4,
    /// 8.5 x 11 inches.
    Letter,
    /// 297 x 420 mm.
    A3,
}

impl Paper {
    /// Shorter and longer side, m.
    #[must_use]
    pub fn sides_m(self) -> [f64; 2] {
        match self {
            Self::A4 => [0.210, 0.297],
            Self::Letter => [0.2159, 0.2794],
            Self::A3 => [0.297, 0.420],
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::A4 => "A4",
            Self::Letter => "Letter",
            Self::A3 => "A3",
        }
    }
}

/// Writes the page of a board to `file`.
///
/// # Errors
/// [`LearningError`]: the board does not fit the paper, or the file cannot be written.
pub fn write(file: &Path, board: &Board, paper: Paper) -> Result<(), LearningError> {
    let page = page(board, paper).map_err(LearningError::Unsuitable)?;
    std::fs::write(file, page).map_err(|error| LearningError::write(file, error))
}

/// Returns the PDF.
///
/// # Errors
/// The board does not fit; says which squares would.
pub fn page(board: &Board, paper: Paper) -> Result<Vec<u8>, String> {
    let [short, long] = paper.sides_m();
    let room = [long - 2.0 * MARGIN_M, short - 2.0 * MARGIN_M - TEXT_M];
    let [width, height] = board.size_m();
    if width > room[0] || height > room[1] {
        let squares = [board.columns + 1, board.rows + 1].map(|count| count as f64);
        let largest_mm = (1e3 * (room[0] / squares[0]).min(room[1] / squares[1])).floor();
        return Err(format!(
            "a board of {:.0} x {:.0} mm does not fit {}: squares of at most {largest_mm:.0} mm do (--square-mm {largest_mm:.0}), or larger paper (--paper a3)",
            1e3 * width,
            1e3 * height,
            paper.name()
        ));
    }
    Ok(document([long * PT_PER_M, short * PT_PER_M], &content(board, [long, short])))
}

/// Returns the drawing operators of the page: black squares, the bar and the text.
fn content(board: &Board, [page_width, page_height]: [f64; 2]) -> String {
    let [width, height] = board.size_m();
    let left = 0.5 * (page_width - width);
    let bottom = TEXT_M + 0.5 * (page_height - TEXT_M - height);
    let mut text = String::from("0 g\n");
    // Writing to a `String` cannot fail.
    let mut rectangle = |x: f64, y: f64, w: f64, h: f64| {
        let _ = writeln!(
            text,
            "{:.4} {:.4} {:.4} {:.4} re",
            x * PT_PER_M,
            y * PT_PER_M,
            w * PT_PER_M,
            h * PT_PER_M
        );
    };
    for row in 0..=board.rows {
        for column in (row % 2..=board.columns).step_by(2) {
            let (x, y) =
                (left + column as f64 * board.square_m, bottom + height - (row + 1) as f64 * board.square_m);
            rectangle(x, y, board.square_m, board.square_m);
        }
    }
    let bar_y = 0.5 * MARGIN_M + 0.004;
    rectangle(left, bar_y, BAR_M, 0.0004);
    for end in [0.0, BAR_M - 0.0004] {
        rectangle(left + end, bar_y - 0.0015, 0.0004, 0.0034);
    }
    text.push_str("f\n");
    let words = format!(
        "{:.0} mm. Print at 100 % (no scaling) and measure: {}x{} inner corners, squares of {} mm. Glue it to a flat plate.",
        1e3 * BAR_M,
        board.columns,
        board.rows,
        1e3 * board.square_m
    );
    let (x, y) = ((left + BAR_M + 0.003) * PT_PER_M, (bar_y - 0.001) * PT_PER_M);
    let _ = writeln!(text, "BT /F1 6.5 Tf {x:.3} {y:.3} Td ({words}) Tj ET");
    text
}

/// Returns a PDF of one page of this size, points.
fn document([width, height]: [f64; 2], content: &str) -> Vec<u8> {
    let objects = [
        "<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>".to_owned(),
        "<< /Type /Pages /Kids [3 0 R] /Count 1 >>".to_owned(),
        format!(
            "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width:.3} {height:.3}] /Contents 4 0 R \
             /Resources << /Font << /F1 5 0 R >> >> >>"
        ),
        format!("<< /Length {} >>\nstream\n{content}endstream", content.len()),
        "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>".to_owned(),
    ];
    let mut text = String::from("%PDF-1.4\n");
    let mut offsets = Vec::new();
    for (index, object) in objects.iter().enumerate() {
        offsets.push(text.len());
        let _ = write!(text, "{} 0 obj\n{object}\nendobj\n", index + 1);
    }
    let start = text.len();
    let _ = write!(text, "xref\n0 {}\n0000000000 65535 f \n", objects.len() + 1);
    for offset in offsets {
        let _ = writeln!(text, "{offset:010} 00000 n ");
    }
    let _ =
        write!(text, "trailer\n<< /Size {} /Root 1 0 R >>\nstartxref\n{start}\n%%EOF\n", objects.len() + 1);
    text.into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_has_true_scale_and_a_board_that_is_too_large_is_refused() {
        let board = Board::new("9x6", 0.025).unwrap();
        for (paper, box_pt) in
            [(Paper::A4, "[0 0 841.890 595.276]"), (Paper::Letter, "[0 0 792.000 612.000]")]
        {
            let text = String::from_utf8(page(&board, paper).unwrap()).unwrap();
            assert!(text.contains(box_pt), "{text}");
            assert_eq!(text.matches(" 70.8661 70.8661 re").count(), 35, "black squares of 25 mm");
            let start: usize =
                text.rsplit("startxref\n").next().unwrap().split('\n').next().unwrap().parse().unwrap();
            assert!(text[start..].starts_with("xref"), "the table is where it is said to be");
        }
        let error = page(&Board::new("9x6", 0.03).unwrap(), Paper::A4).unwrap_err();
        assert!(error.contains("--square-mm 26"), "{error}");
    }
}
