//! Lines of a map file, as people look at it from above.

use toml::{Table, Value};

/// Maximum number of lines that are read from one map.
const MAX_LINES: usize = 20_000;

/// Returns the walls of a map file (or, without walls, its edges) and the outline of a floor plan: lines on the floor, m. A file
/// that is no map has none.
#[must_use]
pub fn map_lines(map: &Table) -> Vec<[[f64; 2]; 2]> {
    let walls: Vec<_> = entries(map, "wall").filter_map(line).take(MAX_LINES).collect();
    let outline = corners(map);
    if walls.is_empty() && outline.is_empty() {
        return entries(map, "edge").filter_map(line).filter(|[a, b]| a != b).take(MAX_LINES).collect();
    }
    walls.into_iter().chain(outline).collect()
}

fn entries<'a>(map: &'a Table, key: &str) -> impl Iterator<Item = &'a Table> {
    map.get(key).and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_table)
}

fn line(entry: &Table) -> Option<[[f64; 2]; 2]> {
    let is_detail = entry.get("role").and_then(Value::as_str) == Some("detail");
    Some([point(entry.get("from_m")?)?, point(entry.get("to_m")?)?]).filter(|_| !is_detail)
}

/// Closed polygon of `corners_m`.
fn corners(map: &Table) -> Vec<[[f64; 2]; 2]> {
    let corners = map.get("corners_m").and_then(Value::as_array).into_iter().flatten();
    let corners: Vec<[f64; 2]> = corners.filter_map(point).take(MAX_LINES).collect();
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(|(a, b)| [*a, *b]).collect()
}

fn point(value: &Value) -> Option<[f64; 2]> {
    let number = |index: usize| {
        let value = value.get(index)?;
        value
            .as_float()
            .or(value.as_integer().map(|integer| integer as f64))
            .filter(|number| number.is_finite())
    };
    Some([number(0)?, number(1)?])
}

#[cfg(test)]
mod tests {
    #[test]
    fn walls_come_before_edges_and_an_outline_is_closed() {
        let lines = |text: &str| super::map_lines(&text.parse().unwrap());
        let walls = "wall = [{ from_m = [0, 0], to_m = [1.5, 0] }]\nedge = [{ from_m = [9, 9, 0], to_m = [9, 8, 0] }]";
        assert_eq!(lines(walls), [[[0.0, 0.0], [1.5, 0.0]]]);
        let edges =
            "edge = [{ from_m = [1, 2, 0], to_m = [1, 2, 3] }, { from_m = [1, 2, 0], to_m = [3, 2, 0] }]";
        assert_eq!(lines(edges), [[[1.0, 2.0], [3.0, 2.0]]]);
        assert_eq!(lines("corners_m = [[0, 0], [1, 0], [1, 1]]").len(), 3);
        assert!(lines("speed = 1").is_empty());
        assert!(lines("wall = [{ from_m = [nan, 0], to_m = [1, 0] }]").is_empty());
    }
}
