//! Grid of floor and obstacle cells, and the number of free cells in each column.

use std::ops::Range;

/// Size of a grid of square cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GridSize {
    /// Number of columns.
    pub columns: usize,
    /// Number of rows.
    pub rows: usize,
    /// Side of a cell, pixels of the image scaled to the grid.
    pub cell_px: usize,
}

impl GridSize {
    /// Grid of Abdelfatah et al.: 17 x 9 cells of 20 x 20 pixels.
    pub const PAPER: Self = Self { columns: 17, rows: 9, cell_px: 20 };

    /// Returns the width of the image that the grid covers, pixels.
    #[must_use]
    pub const fn width_px(&self) -> usize {
        self.columns * self.cell_px
    }

    /// Returns the height of the image that the grid covers, pixels.
    #[must_use]
    pub const fn height_px(&self) -> usize {
        self.rows * self.cell_px
    }

    /// Returns the number of cells.
    #[must_use]
    pub const fn cells(&self) -> usize {
        self.columns * self.rows
    }
}

/// Grid in which each cell is floor or an obstacle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cells {
    size: GridSize,
    /// Row by row from the top, left to right.
    is_obstacle: Vec<bool>,
}

impl Cells {
    /// Creates a grid without obstacles.
    #[must_use]
    pub fn new(size: GridSize) -> Self {
        Self { size, is_obstacle: vec![false; size.cells()] }
    }

    /// Returns the size of the grid.
    #[must_use]
    pub fn size(&self) -> GridSize {
        self.size
    }

    /// Marks as obstacles the cells in which more than a quarter of the pixels are not floor. `obstacle_px` yields the
    /// number of such pixels, row by row from the top; cells after its end stay unchanged.
    pub fn mark(&mut self, obstacle_px: impl Iterator<Item = u32>) {
        let pixels = self.size.cell_px * self.size.cell_px;
        for (cell, count) in self.is_obstacle.iter_mut().zip(obstacle_px) {
            *cell = 4 * count as usize > pixels;
        }
    }

    /// Returns true if the cell in this column (from the left) and row (from the bottom) is an obstacle. Cells outside
    /// the grid are not.
    #[must_use]
    pub fn is_obstacle(&self, column: usize, row: usize) -> bool {
        let GridSize { columns, rows, .. } = self.size;
        column < columns && row < rows && self.is_obstacle[(rows - 1 - row) * columns + column]
    }

    /// Writes the navigation profile to `free`: for each column from the left, the number of free cells below its
    /// lowest obstacle.
    pub fn profile(&self, free: &mut Vec<u32>) {
        free.clear();
        free.extend((0..self.size.columns).map(|column| {
            let obstacle = (0..self.size.rows).find(|&row| self.is_obstacle(column, row));
            obstacle.unwrap_or(self.size.rows) as u32
        }));
    }

    /// Returns the share of obstacles, 0 to 1, among the lowest cells: `among` is the number of cells of each column
    /// from the left. 0 if it selects no cell.
    #[must_use]
    pub fn obstacle_share(&self, among: &[u32]) -> f64 {
        let (mut cells, mut obstacles) = (0, 0);
        for (column, &height) in among.iter().enumerate().take(self.size.columns) {
            let rows = 0..(height as usize).min(self.size.rows);
            cells += rows.len();
            obstacles += rows.filter(|&row| self.is_obstacle(column, row)).count();
        }
        obstacles as f64 / cells.max(1) as f64
    }

    /// Returns true if the foreground is free: 3 x 2 cells in the middle of the lowest rows of 17 x 9 cells, and the
    /// same part of other grids. It lies directly in front of the robot, so that at the start it must be floor.
    #[must_use]
    pub fn is_foreground_free(&self) -> bool {
        let (mut across, up) = foreground(self.size.columns, self.size.rows);
        across.all(|column| up.clone().all(|row| !self.is_obstacle(column, row)))
    }
}

/// Returns the columns (from the left) and rows (from the bottom) of the foreground: 3 x 2 cells of 17 x 9, and the
/// same part of other grids.
pub(super) fn foreground(columns: usize, rows: usize) -> (Range<usize>, Range<usize>) {
    let half = (3 * columns).div_ceil(2 * 17);
    let begin = (columns / 2).saturating_sub(half - columns % 2);
    (begin..(columns / 2 + half).min(columns), 0..(2 * rows).div_ceil(9))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells(rows: &[&str]) -> Cells {
        let size = GridSize { columns: rows[0].len(), rows: rows.len(), cell_px: 2 };
        let mut cells = Cells::new(size);
        cells.mark(rows.iter().flat_map(|row| row.bytes()).map(|cell| u32::from(cell - b'0')));
        cells
    }

    #[test]
    fn more_than_a_quarter_is_an_obstacle() {
        let cells = cells(&["0123", "4000"]);
        let marked: Vec<bool> = (0..4).map(|column| cells.is_obstacle(column, 1)).collect();
        assert_eq!(marked, [false, false, true, true], "one of four pixels is not enough");
        assert!(cells.is_obstacle(0, 0) && !cells.is_obstacle(4, 0) && !cells.is_obstacle(0, 2));
        assert_eq!(cells.obstacle_share(&[2; 4]), 3.0 / 8.0);
        assert_eq!(cells.obstacle_share(&[1, 0, 0, 2]), 2.0 / 3.0);
        assert_eq!(cells.obstacle_share(&[0; 4]), 0.0);
    }

    #[test]
    fn the_profile_counts_free_cells_from_the_bottom() {
        let mut free = vec![99; 7];
        cells(&["0400", "0040", "0440", "0004"]).profile(&mut free);
        assert_eq!(free, [4, 1, 1, 0]);
    }

    #[test]
    fn the_foreground_is_three_by_two_of_the_paper_s_grid() {
        for (column, row, is_in) in
            [(7, 0, true), (9, 1, true), (8, 0, true), (6, 0, false), (10, 1, false), (8, 2, false)]
        {
            let mut cells = Cells::new(GridSize::PAPER);
            let index = (8 - row) * 17 + column;
            cells.mark((0..=index).map(|i| if i == index { 400 } else { 0 }));
            assert_eq!(cells.is_foreground_free(), !is_in, "column {column}, row {row}");
        }
        let mut fine = Cells::new(GridSize { columns: 34, rows: 18, cell_px: 1 });
        for (column, is_in) in [(13, false), (14, true), (19, true), (20, false)] {
            fine.mark((0..34 * 18).map(|i| u32::from(i == 14 * 34 + column)));
            assert_eq!(fine.is_foreground_free(), !is_in, "column {column}");
        }
    }
}
