//! Results of an evaluation: tables, printed as aligned text or as JSON.

use std::fmt::Write as _;

use serde_json::{Map, Value, json};

/// Results of an evaluation.
#[derive(Default)]
pub struct Report {
    tables: Vec<Table>,
    failure: Option<String>,
}

/// A table of results.
pub struct Table {
    title: String,
    columns: Vec<&'static str>,
    rows: Vec<Vec<Cell>>,
}

/// A value in a table.
#[derive(Clone, Debug)]
pub enum Cell {
    /// A text.
    Text(String),
    /// A whole number.
    Count(u64),
    /// A number, and the number of its decimals in text.
    Number(f64, usize),
    /// No value.
    None,
}

/// Returns a cell with a number; NaN is no value.
pub fn number(value: f64, decimals: usize) -> Cell {
    if value.is_nan() { Cell::None } else { Cell::Number(value, decimals) }
}

/// Returns a cell with a number or without a value.
pub fn optional(value: Option<f64>, decimals: usize) -> Cell {
    value.map_or(Cell::None, |value| number(value, decimals))
}

/// Returns a cell with the share of `part` in `whole`, percent.
pub fn percent(part: f64, whole: f64) -> Cell {
    number(100.0 * part / whole, 1)
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<u32> for Cell {
    fn from(count: u32) -> Self {
        Self::Count(u64::from(count))
    }
}

impl From<u64> for Cell {
    fn from(count: u64) -> Self {
        Self::Count(count)
    }
}

impl From<usize> for Cell {
    fn from(count: usize) -> Self {
        Self::Count(count as u64)
    }
}

impl Cell {
    fn text(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Count(count) => count.to_string(),
            Self::Number(value, decimals) => format!("{value:.decimals$}"),
            Self::None => "-".to_owned(),
        }
    }

    fn json(&self) -> Value {
        match self {
            Self::Text(text) => json!(text),
            Self::Count(count) => json!(count),
            Self::Number(value, _) => json!(value),
            Self::None => Value::Null,
        }
    }
}

impl Table {
    /// An empty table.
    pub fn new(title: impl Into<String>, columns: &[&'static str]) -> Self {
        Self { title: title.into(), columns: columns.to_vec(), rows: Vec::new() }
    }

    /// Adds a row with a cell for each column.
    pub fn row<const N: usize>(&mut self, cells: [Cell; N]) {
        debug_assert_eq!(N, self.columns.len(), "{}", self.title);
        self.rows.push(cells.into());
    }

    fn text(&self) -> String {
        let rows: Vec<Vec<String>> =
            self.rows.iter().map(|row| row.iter().map(Cell::text).collect()).collect();
        let width = |i: usize| {
            let cells = rows.iter().map(|row| row[i].chars().count());
            cells.chain([self.columns[i].chars().count()]).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..self.columns.len()).map(width).collect();
        let is_text = |i: usize| self.rows.iter().any(|row| matches!(row[i], Cell::Text(_)));
        let line = |cells: &[String]| {
            let mut line = String::new();
            for (i, cell) in cells.iter().enumerate() {
                let width = widths[i];
                let _ = if is_text(i) {
                    write!(line, "{cell:<width$}  ")
                } else {
                    write!(line, "{cell:>width$}  ")
                };
            }
            line.trim_end().to_owned()
        };
        let head: Vec<String> = self.columns.iter().map(ToString::to_string).collect();
        let body = rows.iter().map(|row| line(row));
        let lines: Vec<String> = [self.title.clone(), line(&head)].into_iter().chain(body).collect();
        lines.join("\n")
    }

    fn json(&self) -> Value {
        let object = |row: &Vec<Cell>| -> Value {
            let cells =
                self.columns.iter().zip(row).map(|(column, cell)| ((*column).to_owned(), cell.json()));
            Value::Object(cells.collect::<Map<_, _>>())
        };
        json!({"title": self.title, "rows": self.rows.iter().map(object).collect::<Vec<_>>()})
    }
}

impl Report {
    /// A report with these tables.
    pub fn new(tables: impl IntoIterator<Item = Table>) -> Self {
        Self { tables: tables.into_iter().collect(), failure: None }
    }

    /// Marks the evaluation as failed unless `passed`.
    #[must_use]
    pub fn require(mut self, passed: bool, problem: impl Into<String>) -> Self {
        if !passed {
            self.failure = Some(problem.into());
        }
        self
    }

    /// Returns the problem that the evaluation revealed, if any.
    pub fn failure(&self) -> Option<&str> {
        self.failure.as_deref()
    }

    /// Prints the tables.
    pub fn print(&self, is_json: bool) {
        if is_json {
            println!("{}", json!(self.tables.iter().map(Table::json).collect::<Vec<_>>()));
            return;
        }
        let texts: Vec<String> = self.tables.iter().map(Table::text).collect();
        if !texts.is_empty() {
            println!("{}", texts.join("\n\n"));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_aligned_to_the_right_and_texts_to_the_left() {
        let mut table = Table::new("errors", &["image", "px"]);
        table.row(["a".into(), number(1.25, 1)]);
        table.row(["corridor".into(), number(f64::NAN, 1)]);
        assert_eq!(table.text(), "errors\nimage      px\na         1.2\ncorridor    -");
        assert_eq!(table.json()["rows"][0]["px"], json!(1.25));
        assert_eq!(table.json()["rows"][1]["px"], Value::Null);
    }
}
