//! Parameters of the scan up the columns.

use super::lab::Lab;

/// Parameters of the scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColumnRules {
    /// Largest difference of floor from the followed color: lightness (0 to 255), and each of the other two channels.
    pub tolerance: Lab,
    /// Spread of the floor's lightness in front of the robot (half of what lies between its dark and bright parts) from which the floor is
    /// cloudy: its spread then counts as tolerance, where it is larger (0 to 255).
    pub min_spread: f32,
    /// Largest spread that counts (0 to 255).
    pub max_spread: f32,
    /// Share of the difference that the followed color takes over from a pixel of floor, one row up at 240 rows.
    pub follow: f32,
    /// Height from which something is an obstacle, m.
    pub min_height_m: f64,
    /// Share of the rows of that height that must differ.
    pub min_share: f32,
    /// Distance up to which the columns are scanned, m.
    pub max_range_m: f64,
}

impl Default for ColumnRules {
    fn default() -> Self {
        Self {
            tolerance: [8.0, 5.0, 5.0],
            min_spread: 10.0,
            max_spread: 16.0,
            follow: 0.2,
            min_height_m: 0.14,
            min_share: 0.7,
            max_range_m: 5.0,
        }
    }
}
