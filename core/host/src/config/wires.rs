//! Wires between behaviors, and behaviors that can never win.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use super::task::{InputSource, Wire};
use yamabico_core::behavior::BehaviorFactory;
use yamabico_parameters::{Node, Problem, Span, Table, Value, instead};

/// A wire, and where it is written.
#[derive(Clone, Debug)]
pub(crate) struct WrittenWire {
    pub wire: Wire,
    pub verb: &'static str,
    pub span: Span,
    by_span: Span,
    what_span: Span,
    hold_span: Span,
}

/// What the checks of wires know of a behavior.
#[derive(Clone, Debug)]
pub(crate) struct Wired {
    pub name: String,
    pub span: Span,
    pub critical: bool,
    pub plugin: Option<Arc<dyn BehaviorFactory>>,
}

/// Reads `[[inhibit]]` or `[[suppress]]`; wires with mistakes that are already told are left out.
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

/// Checks all wires of a task together; `duration` is the run's, where it has one.
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
                    Problem::new(span, format!("there is no behavior `{name}` in this task"))
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
                Problem::new(written.span, format!("`{}` is wired onto `{}` twice", wire.by, wire.what))
                    .label("a second time here")
                    .also(first.span, "first here")
                    .help("keep the one with the right hold_ms"),
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
                .help("behaviors that silence each other in a ring take turns at random; take one wire away"),
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
            Problem::new(written.what_span, format!("`{}` is critical and cannot be silenced", wire.what))
                .label(format!("`{}` would {} it", wire.by, written.verb))
                .also(target.span, "critical = true here")
                .help("take the wire away, or `critical` if the robot is safe without it"),
        );
        return;
    }
    let Some(plugin) = &target.plugin else { return };
    if plugin.info().claims.is_empty() {
        problems.push(
            Problem::new(written.what_span, format!("a wire onto `{}` does nothing", wire.what))
                .label("it never drives, and halts and limits cannot be silenced")
                .help("take the wire away"),
        );
        return;
    }
    if let Some(duration) = duration.filter(|duration| wire.hold >= *duration && !wire.hold.is_zero()) {
        problems.push(
            Problem::new(written.hold_span, format!("`{}` can never win again", wire.what))
                .label(format!(
                    "once `{}` was active, it is silenced for {} s, and the run takes {} s",
                    wire.by,
                    yamabico_parameters::number(wire.hold.as_secs_f64()),
                    yamabico_parameters::number(duration.as_secs_f64()),
                ))
                .help("hold_ms is in milliseconds; a second or two is usual"),
        );
    }
}

/// Finds behaviors that wait for each other's outputs in a ring.
pub(crate) fn check_input_cycles(inputs: &[(String, InputSource, Span)], problems: &mut Vec<Problem>) {
    let edge = |(name, source, span): &'_ (String, InputSource, Span)| match source {
        InputSource::Output { behavior, .. } => Some((behavior.clone(), name.clone(), *span)),
        InputSource::Sensor(_) | InputSource::Operator => None,
    };
    let owned: Vec<(String, String, Span)> = inputs.iter().filter_map(edge).collect();
    let edges: Vec<Edge<'_>> = owned.iter().map(|(from, to, span)| Edge { from, to, span: *span }).collect();
    for cycle in cycles(&edges) {
        let path = cycle.path.join(" -> ");
        problems.push(
            Problem::new(cycle.span, format!("these inputs form a cycle: {path}"))
                .label("closes the cycle")
                .help("nobody in the ring would ever get a first message; take one input away"),
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

/// One cycle for each edge that leads back, each ring told once; the path begins and ends with its first name in the alphabet.
fn cycles<'a>(edges: &[Edge<'a>]) -> Vec<Cycle<'a>> {
    let mut told = BTreeSet::new();
    let mut found = Vec::new();
    for edge in edges {
        let Some(mut ring) = shortest_path(edges, edge.to, edge.from) else { continue };
        let least = ring.iter().enumerate().min_by_key(|(_, name)| **name).map_or(0, |(index, _)| index);
        ring.rotate_left(least);
        let last = ring.last().copied().unwrap_or(edge.from);
        let closing = edges.iter().find(|other| other.from == last && other.to == ring[0]);
        let span = closing.map_or(edge.span, |closing| closing.span);
        if told.insert(ring.clone()) {
            let mut path = ring;
            path.push(path[0]);
            found.push(Cycle { path, span });
        }
    }
    found
}

/// The names from `start` to `end` along the fewest edges, both included.
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
    fn each_ring_is_told_once() {
        let edge = |from, to| Edge { from, to, span: Span::default() };
        let edges = [edge("b", "c"), edge("c", "a"), edge("a", "b"), edge("a", "d"), edge("e", "e")];
        let found = cycles(&edges);
        let paths: Vec<String> = found.iter().map(|cycle| cycle.path.join(">")).collect();
        assert_eq!(paths, ["a>b>c>a", "e>e"]);
    }
}
