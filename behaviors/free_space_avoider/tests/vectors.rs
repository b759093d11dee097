//! Known answers of method navel-grid.

use serde_json::Value;
use yamabico_free_space_avoider::navel_grid::cells::GridSize;
use yamabico_free_space_avoider::navel_grid::decision::{AHEAD_LIMIT, SIDE_LIMIT};
use yamabico_free_space_avoider::navel_grid::{Cells, Decision, Passage, Side, WeightSets, Weights, decide};
use yamabico_testkit::vectors::perspective;

fn numbers(value: &Value) -> Vec<f64> {
    let list = value.as_array().unwrap_or_else(|| panic!("no list: {value}"));
    list.iter().map(|number| number.as_f64().expect("a number")).collect()
}

fn whole(value: &Value) -> Vec<u32> {
    numbers(value).into_iter().map(|number| number as u32).collect()
}

fn previous(value: &Value) -> Option<Side> {
    match value.as_str() {
        Some("TurnLeft") => Some(Side::Left),
        Some("TurnRight") => Some(Side::Right),
        None => None,
        Some(other) => panic!("unknown turn {other}"),
    }
}

fn cells(value: &Value) -> Cells {
    let rows: Vec<&str> =
        value.as_array().expect("cells").iter().map(|row| row.as_str().expect("a row")).collect();
    let size = GridSize { columns: rows[0].len(), rows: rows.len(), cell_px: 1 };
    let mut cells = Cells::new(size);
    cells.mark(rows.iter().flat_map(|row| row.bytes()).map(|cell| u32::from(cell == b'1')));
    cells
}

/// Decides by the printed rules, which drive into obstacles and turn on free floor.
fn as_printed(weights: &Weights) -> &'static str {
    if weights.ahead >= AHEAD_LIMIT {
        "Forward"
    } else if weights.right.min(weights.left) >= SIDE_LIMIT {
        "Stop"
    } else if weights.left < weights.right {
        "TurnLeft"
    } else if weights.right < weights.left {
        "TurnRight"
    } else {
        "TurnEither"
    }
}

#[test]
fn navel_grid() {
    let file = perspective("navel_grid");
    let params = &file["params"];
    let sets = WeightSets {
        profile: whole(&params["PP"]),
        right: numbers(&params["R_set"]),
        left: numbers(&params["L_set"]),
        ahead: numbers(&params["S_set"]),
    };
    assert_eq!(sets, WeightSets::paper());
    assert_eq!(params["stop_threshold"].as_f64(), Some(AHEAD_LIMIT));
    assert_eq!(params["side_threshold"].as_f64(), Some(SIDE_LIMIT));
    let cases = file["cases"].as_array().expect("cases");
    assert!(!cases.is_empty(), "no case");
    for case in cases {
        let (id, expect) = (&case["id"], &case["expect"]);
        let mut free = Vec::new();
        cells(&case["input"]["cells"]).profile(&mut free);
        assert_eq!(free, whole(&expect["np"]), "{id}");
        let intrusion: Vec<u32> =
            (0..).zip(&free).map(|(column, &free)| sets.intrusion(column, free)).collect();
        assert_eq!(intrusion, whole(&expect["intrusion"]), "{id}");
        let weights = sets.weigh(&free);
        let expected = ["R", "L", "S"].map(|key| expect[key].as_f64().expect("a weight"));
        assert_eq!([weights.right, weights.left, weights.ahead], expected, "{id}");
        let previous = previous(&case["input"]["previous_turn"]);
        let decision = decide(&weights, Passage::Open, previous);
        let word = match decision {
            Decision::Forward => "Forward",
            Decision::Turn(Side::Left) => "TurnLeft",
            Decision::Turn(Side::Right) => "TurnRight",
            Decision::Stop => "Stop",
        };
        assert_eq!(Some(word), expect["decision"].as_str(), "{id}");
        assert_eq!(Some(decision == Decision::Forward), expect["forward_allowed"].as_bool(), "{id}");
        assert_ne!(decide(&weights, Passage::Obstructed, previous), Decision::Forward, "{id}");
        if let Some(rejected) = expect["paper_literal_decision_rejected"].as_str() {
            assert_eq!(as_printed(&weights), rejected, "{id}");
        }
    }
}
