//! A wall of the floor's color beside the robot: columns from a side of the picture on that show no floor.

/// Number of columns next to each other that end elsewhere in a wall that looks like the floor: a stain, or a bit of its foot.
const MAX_BETWEEN: usize = 2;

/// Number of columns from a side of the picture on that show no floor, where a few between them may.
pub(super) fn columns_from_side(
    columns: impl Iterator<Item = usize>,
    shows_nothing: impl Fn(usize) -> bool,
) -> usize {
    let mut length = 0;
    for (i, column) in columns.enumerate() {
        if shows_nothing(column) {
            length = i + 1;
        } else if i - length >= MAX_BETWEEN {
            break;
        }
    }
    length
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_reaches_across_two_columns_that_show_floor_and_not_across_three() {
        for (columns, length) in
            [("", 0), ("w", 1), ("www..", 3), ("ww..w", 5), ("ww...w", 2), ("..w", 3), ("...w", 0)]
        {
            let is_wall = |column: usize| columns.as_bytes()[column] == b'w';
            assert_eq!(columns_from_side(0..columns.len(), is_wall), length, "{columns}");
        }
    }
}
