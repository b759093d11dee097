//! Inputs of behaviors.

use super::read_robot::RobotDraft;
use super::substitutes::{is_replaced, no_source, substitute};
use super::task::{ARBITER, Input, InputSource, OPERATOR};
use std::sync::Arc;
use yamabico_core::behavior::{BehaviorFactory, BehaviorInfo, SlotInfo};
use yamabico_core::message::{DecisionHeader, Goal, Message, MessageType, Stick, Truth};
use yamabico_parameters::{Entry, Problem, Span, Table, instead, nearest, quoted};

/// All sources of inputs.
pub(crate) struct Sources<'a> {
    /// Robot; `None` if its file could not be read.
    pub robot: Option<&'a RobotDraft>,
    /// Behaviors of the task by name, with their plugins if known.
    pub behaviors: &'a [(String, Option<Arc<dyn BehaviorFactory>>)],
    /// Source number of the task file if the robot is not the one that it names: names of sensors in it are then of another robot.
    pub task_of_another_robot: Option<usize>,
}

/// Inputs of a behavior.
#[derive(Default)]
pub(crate) struct Inputs {
    /// Connected inputs, in the order of the slots.
    pub connected: Vec<Input>,
    /// Number of inputs in the task file that this robot has no sensor for, and that the behavior works without.
    pub left_out: usize,
    /// Notes for people.
    pub notes: Vec<String>,
}

impl Sources<'_> {
    /// Returns all sources of messages of this type.
    fn giving(&self, message: &MessageType) -> Vec<String> {
        let mut names: Vec<String> = self.sensors_giving(message).into_iter().map(str::to_owned).collect();
        for (name, plugin) in self.behaviors {
            let outputs = plugin.iter().flat_map(|plugin| &plugin.info().outputs);
            let right = outputs.filter(|output| output.message == *message);
            names.extend(right.map(|output| format!("{name}.{}", output.name)));
        }
        if operators().contains(message) {
            names.push(OPERATOR.to_owned());
        }
        if *message == MessageType::of::<DecisionHeader>() {
            names.push(ARBITER.to_owned());
        }
        names
    }

    /// Returns the sensors that publish messages of this type.
    pub fn sensors_giving(&self, message: &MessageType) -> Vec<&str> {
        let sensors = self.robot.iter().flat_map(|robot| &robot.sensors);
        let giving = sensors.filter(|sensor| sensor.message.as_ref() == Some(message));
        giving.map(|sensor| sensor.name.as_str()).collect()
    }

    /// Returns true if the messages of all sensors and behaviors are known; otherwise an error is already reported.
    fn are_known(&self) -> bool {
        self.robot.is_some_and(|robot| robot.sensors.iter().all(|sensor| sensor.message.is_some()))
            && self.behaviors.iter().all(|(_, plugin)| plugin.is_some())
    }

    fn sensor_names(&self) -> Vec<&str> {
        self.robot.iter().flat_map(|robot| &robot.sensors).map(|sensor| sensor.name.as_str()).collect()
    }
}

/// Checks the `inputs` of the behavior described by `entry`, and reads the valid ones in the order of its slots. A required
/// or preferred slot without an entry is connected to the only source of its type; so is an entry that names a sensor of another robot.
pub(crate) fn read_inputs(
    entry: &Entry,
    behavior: &BehaviorInfo,
    sources: &Sources<'_>,
    problems: &mut Vec<Problem>,
) -> Inputs {
    let none = Table::default();
    let table = entry.node.as_table().unwrap_or(&none);
    let inputs = table.table("inputs").unwrap_or(&none);
    let mut suggested = Vec::new();
    for input in &inputs.entries {
        if !behavior.inputs.iter().any(|slot| slot.name == input.key) {
            let slots = behavior.inputs.iter().map(|slot| &*slot.name);
            suggested.extend(nearest(&input.key, slots.clone()));

            problems.push(
                Problem::new(input.key_span, format!("`{}` has no input `{}`", behavior.name, input.key))
                    .label("unknown")
                    .help(instead(&input.key, slots, "input")),
            );
        }
    }
    let header = table.entry("inputs").map_or(entry.node.span, |inputs| inputs.node.span);
    let mut read = Inputs::default();
    for slot in &behavior.inputs {
        let connection = |source| Input { slot: slot.name.to_string(), source };
        match inputs.entry(&slot.name) {
            Some(input) => {
                let Some(text) = input.node.as_text() else { continue };
                if is_replaced(text, input.node.span, slot, sources) {
                    match substitute(text, input.node.span, &entry.key, slot, sources) {
                        Ok((source, note)) => {
                            read.left_out += usize::from(source.is_none());
                            read.connected.extend(source.map(connection));
                            read.notes.push(note);
                        }
                        Err(problem) => problems.push(*problem),
                    }
                    continue;
                }
                match find_source(text, input.node.span, entry, slot, sources) {
                    Ok(Some(source)) => read.connected.push(connection(source)),
                    Ok(None) => {}
                    Err(problem) => problems.push(*problem),
                }
            }
            None if slot.required && !suggested.contains(&&*slot.name) => {
                match only_source(&entry.key, slot, sources) {
                    Some(source) => read.connected.push(connection(source)),
                    None if !sources.are_known() => {}
                    None => problems.push(missing(header, entry, slot, sources)),
                }
            }
            None if slot.preferred => {
                read.connected.extend(only_source(&entry.key, slot, sources).map(connection));
                read.notes.extend(undecided(&entry.key, slot, sources));
            }
            None => {}
        }
    }
    read
}

/// Message types that an operator publishes.
fn operators() -> [MessageType; 2] {
    [MessageType::of::<Goal>(), MessageType::of::<Stick>()]
}

/// Returns the only source of the messages that `slot` of the behavior `name` takes.
fn only_source(name: &str, slot: &SlotInfo, sources: &Sources<'_>) -> Option<InputSource> {
    let candidates = candidates(name, slot, sources);
    let [only] = candidates.as_slice() else { return None };
    if !sources.are_known() {
        return None;
    }
    Some(match only.split_once('.') {
        Some((behavior, output)) => {
            InputSource::Output { behavior: behavior.to_owned(), output: output.to_owned() }
        }
        None if only == OPERATOR => InputSource::Operator,
        None if only == ARBITER => InputSource::Arbiter,
        None => InputSource::Sensor(only.clone()),
    })
}

/// Returns the sources that fit `slot` of the behavior `name`, other than its own outputs.
fn candidates(name: &str, slot: &SlotInfo, sources: &Sources<'_>) -> Vec<String> {
    let own = format!("{name}.");
    let mut candidates = sources.giving(&slot.message);
    candidates.retain(|source| !source.starts_with(&own) && slot.message.name != Truth::NAME);
    candidates
}

/// Returns a note if several sources fit a preferred slot without an entry, so that it is not connected.
fn undecided(name: &str, slot: &SlotInfo, sources: &Sources<'_>) -> Option<String> {
    let candidates = candidates(name, slot, sources);
    let several: Vec<&str> = candidates.iter().map(String::as_str).collect();
    (several.len() > 1).then(|| {
        let (input, fitting, first) = (&slot.name, quoted(&several), several[0]);
        format!("input `{input}` is not connected, since {fitting} fit: name one, inputs = {{ {input} = \"{first}\" }}")
    })
}

fn missing(header: Span, entry: &Entry, slot: &SlotInfo, sources: &Sources<'_>) -> Problem {
    let candidates = candidates(&entry.key, slot, sources);
    let candidates: Vec<&str> = candidates.iter().map(String::as_str).collect();
    let help = match candidates.as_slice() {
        [] => no_source(slot, sources),
        [only] => format!("inputs = {{ {} = \"{only}\" }}", slot.name),
        [first, ..] => {
            format!("choose one of {}: inputs = {{ {} = \"{first}\" }}", quoted(&candidates), slot.name)
        }
    };
    Problem::new(header, format!("input `{}` of `{}` is not connected", slot.name, entry.key))
        .label(format!("{} is required: {}", slot.name, slot.summary.trim_end_matches('.')))
        .help(help)
}

/// Returns the source named by `text`, or `None` if the named part is itself invalid.
fn find_source(
    text: &str,
    span: Span,
    entry: &Entry,
    slot: &SlotInfo,
    sources: &Sources<'_>,
) -> Result<Option<InputSource>, Box<Problem>> {
    let (message, source, place) = match text.split_once('.') {
        Some((behavior, output)) => {
            let Some((name, plugin)) = sources.behaviors.iter().find(|(name, _)| name == behavior) else {
                let names = sources.behaviors.iter().map(|(name, _)| name.as_str());
                return Err(Box::new(
                    Problem::new(span, format!("this task has no behavior `{behavior}`"))
                        .label("unknown")
                        .help(instead(behavior, names, "behavior")),
                ));
            };
            let Some(plugin) = plugin else { return Ok(None) };
            let outputs = &plugin.info().outputs;
            let Some(found) = outputs.iter().find(|found| found.name == output) else {
                let outputs = outputs.iter().map(|output| &*output.name);
                return Err(Box::new(
                    Problem::new(span, format!("`{behavior}` has no output `{output}`"))
                        .label("unknown")
                        .help(instead(output, outputs, "output")),
                ));
            };
            let source = InputSource::Output { behavior: name.clone(), output: output.to_owned() };
            (found.message, source, None)
        }
        None => {
            let Some(robot) = sources.robot else { return Ok(None) };
            match robot.sensors.iter().find(|sensor| sensor.name == text) {
                Some(sensor) => {
                    let Some(message) = sensor.message else { return Ok(None) };
                    (message, InputSource::Sensor(text.to_owned()), Some(sensor.span))
                }
                None if text == OPERATOR => {
                    let expected = operators().into_iter().find(|message| *message == slot.message);
                    (expected.unwrap_or(MessageType::of::<Goal>()), InputSource::Operator, None)
                }
                None if text == ARBITER => (MessageType::of::<DecisionHeader>(), InputSource::Arbiter, None),
                None => return Err(Box::new(no_sensor(text, span, entry, slot, sources))),
            }
        }
    };
    if message.name == Truth::NAME {
        return Err(Box::new(truth(text, span)));
    }
    if message != slot.message {
        let right = sources.giving(&slot.message);
        let right: Vec<&str> = right.iter().map(String::as_str).collect();
        let mut problem = Problem::new(span, format!("`{text}` does not fit input `{}`", slot.name))
            .label(format!("publishes {}, but `{}` takes {}", message.name, slot.name, slot.message.name));
        if let Some(place) = place {
            problem = problem.also(place, format!("`{text}` is defined here"));
        }
        return Err(Box::new(match right.as_slice() {
            [] => problem.help(no_source(slot, sources)),
            names => problem.help(format!("available: {}", quoted(names))),
        }));
    }
    Ok(Some(source))
}

fn truth(text: &str, span: Span) -> Problem {
    Problem::new(span, format!("`{text}` must not be an input"))
        .label("the ground truth is for evaluation only")
        .help("use a sensor: odometry, ranges or frames")
}

fn no_sensor(text: &str, span: Span, entry: &Entry, slot: &SlotInfo, sources: &Sources<'_>) -> Problem {
    if text == "truth" {
        return truth(text, span);
    }
    let problem = Problem::new(span, format!("this robot has no sensor `{text}`")).label("unknown");
    if let Some((_, plugin)) = sources.behaviors.iter().find(|(name, _)| name == text) {
        let outputs = plugin.iter().flat_map(|plugin| &plugin.info().outputs);
        let outputs: Vec<String> = outputs.map(|output| format!("{text}.{}", output.name)).collect();
        return match outputs.first() {
            Some(output) if text != entry.key => {
                problem.help(format!("`{text}` is a behavior; use one of its outputs: \"{output}\""))
            }
            _ => problem.help(format!("`{text}` is a behavior without outputs")),
        };
    }
    let names = sources.sensor_names();
    let fitting = sources.giving(&slot.message);
    let fitting: Vec<&str> = fitting.iter().map(String::as_str).collect();
    if let Some(name) = nearest(text, fitting.iter().copied()) {
        return problem.help(format!("did you mean `{name}`?"));
    }
    match (nearest(text, names.iter().copied()), fitting.is_empty()) {
        (None, false) => problem.help(format!("available for `{}`: {}", slot.name, quoted(&fitting))),

        _ => problem.help(instead(text, names, "sensor")),
    }
}
