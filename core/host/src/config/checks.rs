//! Checks of a task against its robot and its map.

use serde_json::Value as Json;

use super::read_robot::RobotDraft;
use yamabico_core::message::Axis;
use yamabico_parameters::{Entry, Node, Problem, Shape, Span, Table, Value, number};

/// Rate of the arbiter if the task file has none, Hz.
const DEFAULT_RATE_HZ: f64 = 50.0;
/// Maximum distance of a goal from the origin, in multiples of the extent of map and world.
const MAX_GOAL_EXTENTS: f64 = 5.0;
/// Additional distance of a goal from the origin, for small maps, m.
const GOAL_MARGIN_M: f64 = 10.0;

fn value(node: &Node) -> Option<f64> {
    match node.value {
        Value::Whole(whole) => Some(whole as f64),
        Value::Number(value) => Some(value),
        _ => None,
    }
}

fn entry<'a>(tree: &'a Table, group: &str, key: &str) -> Option<&'a Entry> {
    tree.table(group)?.entry(key)
}

/// Checks that the watchdog of the drive is longer than the period of the arbiter.
pub(crate) fn check_watchdog(task: &Table, robot: &Table, draft: &RobotDraft, problems: &mut Vec<Problem>) {
    let Some(drive) = &draft.drive else { return };
    let Some(device) = draft.devices.iter().find(|device| device.name == drive.device) else { return };
    let Some(offer) = device.driver.info().drive(&drive.part.kind) else { return };
    let written = entry(robot, "drive", "watchdog_ms");
    let schema = Shape::new(&offer.parameters).properties();
    let default =
        schema.iter().find(|(key, _)| *key == "watchdog_ms").and_then(|(_, shape)| shape.bound("default"));
    let Some(watchdog_ms) = written.map_or(default, |entry| value(&entry.node)) else { return };
    let rate = entry(task, "arbiter", "rate_hz");
    let rate_hz = rate.map_or(Some(DEFAULT_RATE_HZ), |entry| value(&entry.node)).unwrap_or(0.0);
    let period_ms = 1e3 / rate_hz;
    if !(rate_hz > 0.0 && watchdog_ms > 0.0) || watchdog_ms > period_ms {
        return;
    }
    let (watchdog, period) = (number(watchdog_ms), number(period_ms));
    let header = robot.entry("drive").map(|entry| entry.node.span).unwrap_or_default();
    let mut problem = Problem::new(
        written.map_or(header, |entry| entry.node.span),
        format!("`watchdog_ms` = {watchdog} ms must be longer than the arbiter's period of {period} ms"),
    )
    .label("the drive would brake between two commands")
    .help(format!("raise watchdog_ms above {period} ms, or raise arbiter.rate_hz"));
    if let Some(rate) = rate {
        problem = problem.also(rate.node.span, format!("one command every {period} ms"));
    }
    problems.push(problem);
}

/// Speed written for a behavior that exceeds the maximum speed of the robot.
pub(crate) struct TooFast {
    /// Name of the behavior.
    pub behavior: String,
    key_span: Span,
    problem: Problem,
}

/// Returns the speeds written for behaviors that exceed the maximum speed of the robot.
pub(crate) fn find_too_fast(task: &Table, robot: &Table, draft: &RobotDraft) -> Vec<TooFast> {
    let mut too_fast = Vec::new();
    if !draft.drive.as_ref().is_some_and(|drive| drive.axes.contains(Axis::Linear)) {
        return too_fast;
    }
    let max_mps = draft.robot.limits.speed[Axis::Linear as usize];
    let limit = entry(robot, "limits", "max_linear_mps").map(|entry| entry.node.span);
    for behavior in task.table("behaviors").map_or(&[][..], |table| table.entries.as_slice()) {
        let Some(table) = behavior.node.as_table() else { continue };
        let fast = table.entries.iter().filter_map(|entry| {
            let speed_mps =
                value(&entry.node).filter(|speed| speed.is_finite() && entry.key.ends_with("_mps"))?;
            (speed_mps > max_mps).then_some((entry, speed_mps))
        });
        for (entry, speed_mps) in fast {
            let (key, max) = (&entry.key, number(max_mps));
            let mut problem = Problem::new(
                entry.node.span,
                format!("`{key}` = {} m/s exceeds the robot's maximum of {max} m/s", number(speed_mps)),
            )
            .label(format!("must be at most {max} m/s"))
            .help("lower it, or raise limits.max_linear_mps if the drive allows it");
            if let Some(limit) = limit {
                problem = problem.also(limit, "maximum speed of the robot");
            }
            too_fast.push(TooFast { behavior: behavior.key.clone(), key_span: entry.key_span, problem });
        }
    }
    too_fast
}

/// Reports speeds that are too high for the robot, in place of errors about the range of the same key, which is wider.
/// Unknown keys are already reported.
pub(crate) fn report_too_fast(too_fast: Vec<TooFast>, problems: &mut Vec<Problem>) {
    for TooFast { key_span, problem, .. } in too_fast {
        if problems.iter().all(|other| other.span != key_span) {
            problems.retain(|other| other.span != problem.span);
            problems.push(problem);
        }
    }
}

/// Returns the maximum absolute coordinate of a goal if map and world extend to `extent_m`; `None` without them, m.
pub(crate) fn max_goal_m(extent_m: f64) -> Option<f64> {
    (extent_m > 0.0).then_some(MAX_GOAL_EXTENTS * extent_m + GOAL_MARGIN_M)
}

/// Checks that the goal of the run does not lie far outside the map and the world, which extend to `extent_m`.
pub(crate) fn check_goal(task: &Table, extent_m: f64, problems: &mut Vec<Problem>) {
    let Some(table) = entry(task, "run", "goal").and_then(|entry| entry.node.as_table()) else { return };
    for key in ["x_m", "y_m"] {
        if let Some(entry) = table.entry(key) {
            check_coordinate(&entry.node, &format!("the goal at {key} ="), extent_m, problems);
        }
    }
}

/// Checks that the positions of a behavior's parameters with `"format": "map-positions"`, lists of x and y, do not lie far
/// outside the map and the world, which extend to `extent_m`.
pub(crate) fn check_positions(table: &Table, schema: &Json, extent_m: f64, problems: &mut Vec<Problem>) {
    for (key, shape) in Shape::new(schema).resolved().properties() {
        let is_positions = shape.text("format") == Some("map-positions");
        let Some(entry) = table.entry(key).filter(|_| is_positions) else { continue };
        let Value::List(positions) = &entry.node.value else { continue };
        for (index, position) in positions.iter().enumerate() {
            let Value::List(coordinates) = &position.value else { continue };
            for (axis, coordinate) in ["x", "y"].iter().zip(coordinates) {
                let what = format!("position {} of `{key}` at {axis} =", index + 1);
                check_coordinate(coordinate, &what, extent_m, problems);
            }
        }
    }
}

/// Checks one coordinate of a position, unless its value is already reported.
fn check_coordinate(node: &Node, what: &str, extent_m: f64, problems: &mut Vec<Problem>) {
    let is_far = |at_m: &f64| max_goal_m(extent_m).is_some_and(|max_m| at_m.abs() > max_m);
    let Some(at_m) = value(node).filter(is_far) else { return };
    if problems.iter().any(|problem| problem.span == node.span) {
        return;
    }
    problems.push(
        Problem::new(node.span, format!("{what} {} m is far outside the map", number(at_m)))
            .label(format!("map and world extend to {} m", number(extent_m)))
            .help("write it in meters, in the frame of the map"),
    );
}

/// Returns the maximum absolute value of all lengths and coordinates (keys that end with `_m`) in a file, m.
pub(crate) fn extent_m(tree: &Table) -> f64 {
    fn of_numbers(node: &Node) -> f64 {
        match &node.value {
            Value::List(items) => items.iter().map(of_numbers).fold(0.0, f64::max),
            _ => value(node).map_or(0.0, f64::abs),
        }
    }
    fn of_tables(node: &Node) -> f64 {
        match &node.value {
            Value::Table(table) => extent_m(table),
            Value::List(items) => items.iter().map(of_tables).fold(0.0, f64::max),
            _ => 0.0,
        }
    }
    let of_entry = |entry: &Entry| {
        let own = if entry.key.ends_with("_m") { of_numbers(&entry.node) } else { 0.0 };
        own.max(of_tables(&entry.node))
    };
    tree.entries.iter().map(of_entry).filter(|extent| extent.is_finite()).fold(0.0, f64::max)
}
