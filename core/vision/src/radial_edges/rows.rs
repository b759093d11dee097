use nalgebra::Vector2;

/// Range of columns `start..end`.
pub(super) type Columns = [usize; 2];

/// Columns of a row to be examined: edges nearer to vertical in the image are thinned along the row, others along the
/// column.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Row {
    pub(super) vertical: Columns,
    pub(super) horizontal: [Columns; 2],
    /// Columns whose derivative along v is needed by this row or an adjacent one.
    pub(super) slopes: [Columns; 2],
}

pub(super) fn rows([width, height]: [usize; 2], center: Vector2<f64>, radius_px: f64) -> Vec<Row> {
    // Two columns and rows at the border lack neighbors for comparison.
    let inside = |from: f64, to: f64| -> Columns {
        let last = width.saturating_sub(3) as f64;
        let (from, to) = (from.ceil().max(2.0), to.floor().min(last));
        if from <= to { [from as usize, to as usize + 1] } else { [0, 0] }
    };
    let mut rows = vec![Row::default(); height];
    for (v, row) in rows.iter_mut().enumerate().take(height.saturating_sub(2)).skip(2) {
        let down = v as f64 - center.y;
        let half = (radius_px * radius_px - down * down).max(0.0).sqrt();
        let vertical = half.min(down.abs());
        row.vertical = inside(center.x - vertical, center.x + vertical);
        if half > down.abs() {
            let next = f64::MIN_POSITIVE + down.abs();
            let left = inside(center.x - half, (center.x - next).ceil() - 1.0);
            let right = inside((center.x + next).floor() + 1.0, center.x + half);
            row.horizontal = [left, right];
        }
    }
    for v in 1..height.saturating_sub(1) {
        for side in 0..2 {
            let near = [v - 1, v, v + 1].map(|v| rows[v].horizontal[side]);
            let filled = || near.iter().filter(|columns| columns[0] < columns[1]);
            let start = filled().map(|columns| columns[0]).min();
            let end = filled().map(|columns| columns[1]).max();
            rows[v].slopes[side] = [start.unwrap_or(0), end.unwrap_or(0)];
        }
    }
    rows
}
