//! Colors that all plots share.

use crate::Color;

/// Text and axes.
pub const INK: Color = [40; 3];
/// Grid lines.
pub const GRID: Color = [228; 3];
/// Walls of a map.
pub const WALL: Color = [90; 3];
