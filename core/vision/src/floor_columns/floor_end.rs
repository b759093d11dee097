//! Results of the scan of a column: floor, and where it ends.

use nalgebra::Point2;

/// Stretch of a column that does not look like the floor before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloorEnd {
    /// Place on the floor where it ends, robot frame, m.
    pub place: Point2<f64>,
    /// Middle of the column, pixels.
    pub u: f64,
    /// Rows from the first that looks like the floor again, or the highest scanned, to the last of the floor, pixels.
    pub rows: [f64; 2],
    /// True if the floor goes on in the columns to both sides: a speck rather than a thing.
    pub is_lone: bool,
    /// True if it is darker than the floor before it: light and paper on the floor are brighter.
    pub is_darker: bool,
}

/// Place of floor before its end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeFloor {
    /// Robot frame, m.
    pub place: Point2<f64>,
    /// True if its column looks like floor up to above the horizon: a wall of the floor's color may stand there.
    pub is_boundless: bool,
}
