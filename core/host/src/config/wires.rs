//! Checks of wires between behaviors.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use super::task::{InputSource, Wire};
use yamabico_core::behavior::BehaviorFactory;
use yamabico_parameters::{Node, Problem, Span, Table, Value, instead};

/// Wire with its source spans.
#[derive(Clone, Debug)]
pub(crate) struct WrittenWire {
    pub wire: Wire,
    pub verb: &'static str,
    pub span: Span,
    by_span: Span,
    what_span: Span,
    hold_span: Span,
}

/// Properties of a behavior for the checks of wires.
#[derive(Clone, Debug)]
pub(crate) struct Wired {
    pub name: String,
    pub span: Span,
    pub critical: bool,
    pub plugin: Option<Arc<dyn BehaviorFactory>>,
}

/// Reads `[[inhibit]]` or `[[suppress]]`, without wires whose errors are already reported.
pub(crate) fn read_wires(tree: &Table, verb: &'static str) -> Vec<WrittenWire> {
    let Some(Node { value: Value::List(items), .. }) = tree.entry(verb).map(|entry| &entry.node) else {
        return Vec::new();
    };
    let read = |item: &Node| {
        let table = item.as_table()?;
        let by = table.entry("by")?;
        let what = table.entry("what")?;
        let hold = table.entry("hold_ms");
        let hold_ms = match hold.map(|hold| &hold.node.value) {
            None => 0.0,
            Some(Value::Whole(number)) => *number as f64,
            Some(Value::Number(number)) => *number,
            Some(_) => return None,
        };
        let hold_s = Duration::try_from_secs_f64(hold_ms * 1e-3).ok()?;
        Some(WrittenWire {
            wire: Wire {
                by: by.node.as_text()?.to_owned(),
                what: what.node.as_text()?.to_owned(),
                hold: hold_s,
            },
            verb,
            span: item.span,
            by_span: by.node.span,
            what_span: what.node.span,
            hold_span: hold.map_or(item.span, |hold| hold.node.span),
        })
    };
    items.iter().filter_map(read).collect()
}

/// Checks all wires of a task; `duration` is the maximum duration of the run.
pub(crate) fn check_wires(
    wires: &[WrittenWire],
    behaviors: &[Wired],
    duration: Option<Duration>,
    problems: &mut Vec<Problem>,
) {
    for (index, written) in wires.iter().enumerate() {
        let wire = &written.wire;
        let names = || behaviors.iter().map(|behavior| behavior.name.as_str());
        for (name, span) in [(&wire.by, written.by_span), (&wire.what, written.what_span)] {
            if !names().any(|known| known == name) {
                problems.push(
                    Problem::new(span, format!("this task has no behavior `{name}`"))
                        .label("unknown")
                        .help(instead(name, names(), "behavior")),
                );
            }
        }
        let same = |other: &&WrittenWire| {
            other.verb == written.verb && (&other.wire.by, &other.wire.what) == (&wire.by, &wire.what)
        };
        if let Some(first) = wires[..index].iter().find(same) {
            problems.push(
                Problem::new(
                    written.span,
                    format!("the wire from `{}` onto `{}` is defined twice", wire.by, wire.what),
                )
                .label("second definition")
                .also(first.span, "first definition")
                .help("remove the one with the wrong hold_ms"),
            );
        }
        if let Some(target) = behaviors.iter().find(|behavior| behavior.name == wire.what) {
            check_target(written, target, duration, problems);
        }
    }
    let edges: Vec<Edge<'_>> = wires
        .iter()
        .map(|written| Edge { from: &written.wire.by, to: &written.wire.what, span: written.what_span })
        .collect();
    for cycle in cycles(&edges) {
        let path = cycle.path.join(" -> ");
        problems.push(
            Problem::new(cycle.span, format!("these wires form a cycle: {path}"))
                .label("closes the cycle")
                .help("behaviors in a cycle silence each other in random order: remove one wire"),
        );
    }
}

fn check_target(
    written: &WrittenWire,
    target: &Wired,
    duration: Option<Duration>,
    problems: &mut Vec<Problem>,
) {
    let wire = &written.wire;
    if target.critical {
        problems.push(
            Problem::new(written.what_span, format!("`{}` is critical and must not be silenced", wire.what))
                .label(format!("`{}` would {} it", wire.by, written.verb))
                .also(target.span, "critical = true here")
                .help("remove the wire, or remove `critical` if the robot is safe without this behavior"),
        );
        return;
    }
    let Some(plugin) = &target.plugin else { return };
    if plugin.info().claims.is_empty() {
        problems.push(
            Problem::new(written.what_span, format!("a wire onto `{}` has no effect", wire.what))
                .label("the behavior never drives, and halts and limits cannot be silenced")
                .help("remove the wire"),
        );
        return;
    }
    if let Some(duration) = duration.filter(|duration| wire.hold >= *duration && !wire.hold.is_zero()) {
        problems.push(
            Problem::new(written.hold_span, format!("`{}` can never win again", wire.what))
                .label(format!(
                    "after `{}` was active, it is silenced for {} s, and the run lasts at most {} s",
                    wire.by,
                    yamabico_parameters::number(wire.hold.as_secs_f64()),
                    yamabico_parameters::number(duration.as_secs_f64()),
                ))
                .help("lower hold_ms; it is in milliseconds, and 1000 to 2000 are typical"),
        );
    }
}

/// Finds cycles of behaviors that wait for each other's outputs.
pub(crate) fn check_input_cycles(inputs: &[(String, InputSource, Span)], problems: &mut Vec<Problem>) {
    let edge = |(name, source, span): &'_ (String, InputSource, Span)| match source {
        InputSource::Output { behavior, .. } => Some((behavior.clone(), name.clone(), *span)),
        InputSource::Sensor(_) | InputSource::Operator | InputSource::Arbiter => None,
    };
    let owned: Vec<(String, String, Span)> = inputs.iter().filter_map(edge).collect();
    let edges: Vec<Edge<'_>> = owned.iter().map(|(from, to, span)| Edge { from, to, span: *span }).collect();
    for cycle in cycles(&edges) {
        let path = cycle.path.join(" -> ");
        problems.push(
            Problem::new(cycle.span, format!("these inputs form a cycle: {path}"))
                .label("closes the cycle")
                .help("no behavior in the cycle would receive a first message: remove one input"),
        );
    }
}

struct Edge<'a> {
    from: &'a str,
    to: &'a str,
    span: Span,
}

struct Cycle<'a> {
    path: Vec<&'a str>,
    span: Span,
}

/// Returns each cycle once; its path begins and ends with the first name in alphabetical order.
fn cycles<'a>(edges: &[Edge<'a>]) -> Vec<Cycle<'a>> {
    let mut reported = BTreeSet::new();
    let mut found = Vec::new();
    for edge in edges {
        let Some(mut ring) = shortest_path(edges, edge.to, edge.from) else { continue };
        let first = ring.iter().enumerate().min_by_key(|(_, name)| **name).map_or(0, |(index, _)| index);
        ring.rotate_left(first);
        let last = ring.last().copied().unwrap_or(edge.from);
        let closing = edges.iter().find(|other| other.from == last && other.to == ring[0]);
        let span = closing.map_or(edge.span, |closing| closing.span);
        if reported.insert(ring.clone()) {
            let mut path = ring;
            path.push(path[0]);
            found.push(Cycle { path, span });
        }
    }
    found
}

/// Returns the names from `start` to `end`, inclusive, along the fewest edges.
fn shortest_path<'a>(edges: &[Edge<'a>], start: &'a str, end: &str) -> Option<Vec<&'a str>> {
    let mut paths = std::collections::VecDeque::from([vec![start]]);
    let mut seen = BTreeSet::from([start]);
    while let Some(path) = paths.pop_front() {
        let here = *path.last()?;
        if here == end {
            return Some(path);
        }
        for edge in edges.iter().filter(|edge| edge.from == here) {
            if seen.insert(edge.to) {
                paths.push_back([path.as_slice(), &[edge.to]].concat());
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_cycle_is_reported_once() {
        let edge = |from, to| Edge { from, to, span: Span::default() };
        let edges = [edge("b", "c"), edge("c", "a"), edge("a", "b"), edge("a", "d"), edge("e", "e")];
        let found = cycles(&edges);
        let paths: Vec<String> = found.iter().map(|cycle| cycle.path.join(">")).collect();
        assert_eq!(paths, ["a>b>c>a", "e>e"]);
    }
}
