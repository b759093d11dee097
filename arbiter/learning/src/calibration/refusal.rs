//! Text of a refusal of pictures: the cause, and what was wrong with each of them.

use yamabico_vision::calibration::{Board, NotFound};

use super::lens::PictureReport;

/// Text for pictures of which none shows the board, or too few do, for the `cause`. `missing` are the reasons of those without it.
pub(super) fn refusal(cause: &str, board: &Board, reports: &[PictureReport], missing: &[NotFound]) -> String {
    let refused: Vec<&PictureReport> = reports.iter().filter(|report| report.refused.is_some()).collect();
    let mut text = if refused.len() == reports.len() {
        format!("no picture shows the board of {}x{} inner corners", board.columns, board.rows)
    } else {
        cause.to_owned()
    };
    let others: Vec<[usize; 2]> = missing.iter().filter_map(NotFound::other_board).collect();
    let count = |of: &[usize; 2]| others.iter().filter(|other| *other == of).count();
    if let Some([columns, rows]) = others.iter().find(|other| 2 * count(other) > reports.len()) {
        text += &format!(
            "\n{} of {} pictures show a grid of {columns}x{rows}: if that is your board, use --corners {columns}x{rows}",
            count(&[*columns, *rows]),
            reports.len()
        );
    }
    text + &lines(&refused)
}

/// One line for each reason, with the pictures that it holds for.
fn lines(refused: &[&PictureReport]) -> String {
    let reason = |report: &PictureReport| report.refused.clone().unwrap_or_default();
    let mut groups: Vec<(String, Vec<&str>)> = Vec::new();
    for report in refused {
        match groups.iter_mut().find(|(other, _)| *other == reason(report)) {
            Some((_, names)) => names.push(&report.name),
            None => groups.push((reason(report), vec![&report.name])),
        }
    }
    let line = |(reason, names): &(String, Vec<&str>)| match names.as_slice() {
        [first, second, .., last] => {
            format!("\n  {first}, {second} ... {last} ({} pictures): {reason}", names.len())
        }
        names => format!("\n  {}: {reason}", names.join(", ")),
    };
    groups.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(index: usize, refused: Option<&str>) -> PictureReport {
        PictureReport { name: format!("{index}.png"), rms_px: None, refused: refused.map(str::to_owned) }
    }

    #[test]
    fn pictures_with_one_reason_share_a_line() {
        let board = Board::new("9x6", 0.025).unwrap();
        let reasons = ["dark", "dark", "cut off", "dark", "dark", "cut off", "empty"];
        let reports: Vec<_> =
            reasons.iter().enumerate().map(|(index, reason)| report(index, Some(reason))).collect();
        assert_eq!(
            refusal("", &board, &reports, &[]),
            "no picture shows the board of 9x6 inner corners\n  0.png, 1.png ... 4.png (4 pictures): dark\n  \
             2.png, 5.png: cut off\n  6.png: empty"
        );
        let used = [report(0, None), report(1, Some("dark"))];
        assert_eq!(refusal("one is too few", &board, &used, &[]), "one is too few\n  1.png: dark");
    }

    #[test]
    fn another_board_is_named_where_most_pictures_show_it() {
        let board = Board::new("8x5", 0.025).unwrap();
        let reports: Vec<_> = (0..3).map(|index| report(index, Some("larger"))).collect();
        let larger = NotFound::Larger { columns: 9, rows: 6 };
        let text = refusal("", &board, &reports, &[larger, NotFound::NoBoard, larger]);
        assert!(text.contains("2 of 3 pictures show a grid of 9x6"), "{text}");
        let text = refusal("", &board, &reports, &[larger, NotFound::NoBoard, NotFound::NoBoard]);
        assert!(!text.contains("9x6"), "{text}");
    }
}
