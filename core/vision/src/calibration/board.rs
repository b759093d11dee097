//! Printed checkerboard: numbers of inner corners, size of its squares.

use nalgebra::Vector2;
use thiserror::Error;

/// Numbers of inner corners that a board may have along a side.
pub const CORNERS: std::ops::RangeInclusive<usize> = 3..=40;
/// Sides of a square that a board may have, m.
pub const SQUARE_M: std::ops::RangeInclusive<f64> = 0.002..=1.0;

/// Checkerboard, described by its inner corners: those where four squares meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Board {
    /// Number of inner corners along the longer side.
    pub columns: usize,
    /// Number of inner corners along the shorter side.
    pub rows: usize,
    /// Side of a square, m.
    pub square_m: f64,
}

/// Reason why a description is no board.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum BoardError {
    /// The text is not two numbers.
    #[error("`{0}` is no number of corners: write columns x rows of inner corners, such as 9x6")]
    Corners(String),
    /// A number of corners out of range.
    #[error("a board has {min} to {max} inner corners along each side, not {given}", min = CORNERS.start(), max = CORNERS.end())]
    Count {
        /// Number.
        given: usize,
    },
    /// A side of the squares out of range.
    #[error("squares have sides of {min} to {max} mm, not {given_mm} mm", min = 1e3 * SQUARE_M.start(), max = 1e3 * SQUARE_M.end())]
    Square {
        /// Side, mm.
        given_mm: f64,
    },
}

impl Board {
    /// Creates a board from the text of its corners, such as `9x6`, and the side of its squares, m. The longer side becomes that of
    /// the columns.
    ///
    /// # Errors
    /// [`BoardError`].
    pub fn new(corners: &str, square_m: f64) -> Result<Self, BoardError> {
        let malformed = || BoardError::Corners(corners.to_owned());
        let (a, b) = corners.split_once(['x', 'X', '×']).ok_or_else(malformed)?;
        let number = |text: &str| text.trim().parse::<usize>().map_err(|_| malformed());
        let (a, b) = (number(a)?, number(b)?);
        if let Some(given) = [a, b].into_iter().find(|count| !CORNERS.contains(count)) {
            return Err(BoardError::Count { given });
        }
        if !SQUARE_M.contains(&square_m) {
            return Err(BoardError::Square { given_mm: 1e3 * square_m });
        }
        Ok(Self { columns: a.max(b), rows: a.min(b), square_m })
    }

    /// Number of inner corners.
    #[must_use]
    pub fn count(&self) -> usize {
        self.columns * self.rows
    }

    /// Inner corners on the board, m, row by row: x along the columns, y along the rows.
    #[must_use]
    pub fn corners(&self) -> Vec<Vector2<f64>> {
        let corner =
            |index: usize| Vector2::new((index % self.columns) as f64, (index / self.columns) as f64);
        (0..self.count()).map(|index| corner(index) * self.square_m).collect()
    }

    /// Whole board, m: width and height with the outer squares.
    #[must_use]
    pub fn size_m(&self) -> [f64; 2] {
        [self.columns + 1, self.rows + 1].map(|squares| squares as f64 * self.square_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_board_is_read_from_text() {
        let board = Board::new("6x9", 0.025).unwrap();
        assert_eq!((board.columns, board.rows, board.count()), (9, 6, 54));
        assert_eq!(board.corners()[10], Vector2::new(0.025, 0.025));
        assert!((board.size_m()[0] - 0.25).abs() < 1e-12 && (board.size_m()[1] - 0.175).abs() < 1e-12);
        for (corners, square_m, part) in
            [("9", 0.025, "such as 9x6"), ("9x2", 0.025, "not 2"), ("9x6", 25.0, "25000 mm")]
        {
            let error = Board::new(corners, square_m).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
    }
}
