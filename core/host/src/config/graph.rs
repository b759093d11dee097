//! Data flow of a task, as text for drawing tools.

use std::fmt::Write;

use serde::Serialize;

use super::task::{ARBITER, InputSource, OPERATOR, Task};
use yamabico_core::message::Axes;

/// Graph of sensors, behaviors, arbiter and drive.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Graph {
    /// Nodes in the order of the data flow.
    pub nodes: Vec<GraphNode>,
    /// Edges.
    pub edges: Vec<GraphEdge>,
}

/// Node of a [`Graph`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GraphNode {
    /// Unique name.
    pub id: String,
    /// Type of the node.
    pub what: GraphPart,
    /// Label, in lines.
    pub lines: Vec<String>,
}

/// Type of a node of a [`Graph`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum GraphPart {
    /// Sensor.
    Sensor,
    /// Operator, the source of goals and stick messages.
    Operator,
    /// Behavior.
    Behavior,
    /// Arbiter.
    Arbiter,
    /// Drive.
    Drive,
}

/// Edge of a [`Graph`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GraphEdge {
    /// Id of the source node.
    pub from: String,
    /// Id of the target node.
    pub to: String,
    /// Label.
    pub label: String,
    /// Type of the edge.
    pub what: GraphLine,
}

/// Type of an edge of a [`Graph`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum GraphLine {
    /// Messages.
    Data,
    /// Wire that silences a behavior.
    Wire,
}

/// Returns the graph of a task.
pub fn graph(task: &Task) -> Graph {
    let mut nodes = Vec::new();
    let mut edges = Vec::new();
    let mut edge = |from: String, to: String, label: String, what| {
        edges.push(GraphEdge { from, to, label, what });
    };
    for sensor in &task.robot.sensors {
        nodes.push(GraphNode {
            id: format!("sensor/{}", sensor.part.name),
            what: GraphPart::Sensor,
            lines: vec![sensor.part.name.clone(), format!("{}/{}", sensor.device, sensor.part.kind)],
        });
    }
    if task.behaviors.iter().flat_map(|behavior| &behavior.inputs).any(|i| i.source == InputSource::Operator)
    {
        let id = OPERATOR.to_owned();
        nodes.push(GraphNode { id: id.clone(), what: GraphPart::Operator, lines: vec![id] });
    }
    for behavior in &task.behaviors {
        let id = format!("behavior/{}", behavior.name);
        let mut lines = vec![behavior.name.clone(), format!("priority {}", behavior.settings.priority)];
        if behavior.name != behavior.factory.info().name {
            lines.insert(1, behavior.factory.info().name.clone());
        }
        if behavior.settings.critical {
            lines.push("critical".to_owned());
        }
        if !behavior.settings.enabled {
            lines.push("disabled".to_owned());
        }
        nodes.push(GraphNode { id: id.clone(), what: GraphPart::Behavior, lines });
        for input in &behavior.inputs {
            let (from, label) = match &input.source {
                InputSource::Sensor(name) => (format!("sensor/{name}"), input.slot.clone()),
                InputSource::Operator => (OPERATOR.to_owned(), input.slot.clone()),
                InputSource::Arbiter => (ARBITER.to_owned(), input.slot.clone()),
                InputSource::Output { behavior, output } if *output == input.slot => {
                    (format!("behavior/{behavior}"), output.clone())
                }
                InputSource::Output { behavior, output } => {
                    (format!("behavior/{behavior}"), format!("{output} as {}", input.slot))
                }
            };
            edge(from, id.clone(), label, GraphLine::Data);
        }
        let proposes = match behavior.factory.info().claims {
            Axes::NONE => "halts, limits".to_owned(),
            claims => claims.to_string(),
        };
        edge(id, ARBITER.to_owned(), proposes, GraphLine::Data);
    }
    for (verb, wires) in [("inhibits", &task.inhibit), ("suppresses", &task.suppress)] {
        for wire in wires {
            let hold = match wire.hold.as_millis() {
                0 => String::new(),
                hold => format!(" +{hold} ms"),
            };
            let (from, to) = (format!("behavior/{}", wire.by), format!("behavior/{}", wire.what));
            edge(from, to, format!("{verb}{hold}"), GraphLine::Wire);
        }
    }
    let rate = yamabico_parameters::number(1.0 / task.arbiter.period.as_secs_f64().max(1e-9));
    nodes.push(GraphNode {
        id: ARBITER.to_owned(),
        what: GraphPart::Arbiter,
        lines: vec![ARBITER.to_owned(), format!("{rate} Hz")],
    });
    let drive = &task.robot.drive;
    nodes.push(GraphNode {
        id: "drive".to_owned(),
        what: GraphPart::Drive,
        lines: vec![task.robot.robot.name.clone(), format!("{}/{}", drive.device, drive.part.kind)],
    });
    edge(ARBITER.to_owned(), "drive".to_owned(), drive.axes.to_string(), GraphLine::Data);
    Graph { nodes, edges }
}

impl Graph {
    /// Renders the graph for Mermaid.
    pub fn mermaid(&self) -> String {
        let mut text = String::from("flowchart LR\n");
        for (index, node) in self.nodes.iter().enumerate() {
            let label = escaped(&node.lines.join("<br>"), "#quot;");
            let (open, close) = match node.what {
                GraphPart::Sensor | GraphPart::Operator => ("([", "])"),
                GraphPart::Behavior => ("[", "]"),
                GraphPart::Arbiter => ("{{", "}}"),
                GraphPart::Drive => ("[/", "/]"),
            };
            let _ = writeln!(text, "    n{index}{open}\"{label}\"{close}");
        }
        for edge in &self.edges {
            let (from, to) = (self.index(&edge.from), self.index(&edge.to));
            let arrow = match edge.what {
                GraphLine::Data => "-->",
                GraphLine::Wire => "-.->",
            };
            let _ = writeln!(text, "    n{from} {arrow}|\"{}\"| n{to}", escaped(&edge.label, "#quot;"));
        }
        text
    }

    /// Renders the graph for Graphviz.
    pub fn dot(&self) -> String {
        let mut text = String::from("digraph task {\n    rankdir=LR;\n    node [fontname=\"sans-serif\"];\n");
        for (index, node) in self.nodes.iter().enumerate() {
            let lines: Vec<String> = node.lines.iter().map(|line| escaped(line, "\\\"")).collect();
            let shape = match node.what {
                GraphPart::Sensor | GraphPart::Operator => "ellipse",
                GraphPart::Behavior => "box",
                GraphPart::Arbiter => "hexagon",
                GraphPart::Drive => "parallelogram",
            };
            let _ = writeln!(text, "    n{index} [shape={shape}, label=\"{}\"];", lines.join("\\n"));
        }
        for edge in &self.edges {
            let (from, to) = (self.index(&edge.from), self.index(&edge.to));
            let style = match edge.what {
                GraphLine::Data => "solid",
                GraphLine::Wire => "dashed",
            };
            let label = escaped(&edge.label, "\\\"");
            let _ = writeln!(text, "    n{from} -> n{to} [style={style}, label=\"{label}\"];");
        }
        text.push_str("}\n");
        text
    }

    fn index(&self, id: &str) -> usize {
        self.nodes.iter().position(|node| node.id == id).unwrap_or(0)
    }
}

fn escaped(text: &str, quote: &str) -> String {
    text.replace('"', quote).replace(['\n', '\r'], " ")
}
