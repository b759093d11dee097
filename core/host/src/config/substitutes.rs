//! Inputs of a task on another robot than the one that the task names: a sensor of the same kind in place of the named one.

use yamabico_core::behavior::SlotInfo;
use yamabico_core::message::MessageType;
use yamabico_parameters::{Problem, Span, quoted};

use super::inputs::Sources;
use super::task::{ARBITER, InputSource, OPERATOR};

/// Returns true if `text` at `span`, the source of `slot`, names a sensor of another robot: the task file was written for one, and
/// this robot has no sensor of that name and kind.
pub(super) fn is_replaced(text: &str, span: Span, slot: &SlotInfo, sources: &Sources<'_>) -> bool {
    let Some(robot) = sources.robot else { return false };
    let is_here = robot.sensors.iter().any(|sensor| {
        sensor.name == text && sensor.message.as_ref().is_none_or(|message| *message == slot.message)
    });
    sources.task_of_another_robot == Some(span.source)
        && !is_here
        && ![OPERATOR, ARBITER, "truth"].contains(&text)
        && !text.contains('.')
        && sources.behaviors.iter().all(|(name, _)| name != text)
        && robot.sensors.iter().all(|sensor| sensor.message.is_some())
}

/// Returns the only sensor of this robot for `slot` of the behavior `behavior`, in place of `text` at `span`, with a note for people;
/// `None` if it has none and the behavior works without.
///
/// # Errors
/// Several sensors fit, or none fits a required slot.
pub(super) fn substitute(
    text: &str,
    span: Span,
    behavior: &str,
    slot: &SlotInfo,
    sources: &Sources<'_>,
) -> Result<(Option<InputSource>, String), Box<Problem>> {
    let file = robot_file(sources);
    let fitting = sources.sensors_giving(&slot.message);
    let kind = kind(&slot.message);
    match fitting.as_slice() {
        [only] => {
            let note = format!(
                "input `{}` takes `{only}`, the only {kind} of {file}, which has no {kind} `{text}`",
                slot.name
            );
            Ok((Some(InputSource::Sensor((*only).to_owned())), note))
        }
        [] if !slot.required => {
            let summary = slot.summary.trim_end_matches('.');
            Ok((None, format!("works without input `{}` ({summary}): {file} has no {kind}", slot.name)))
        }
        [] => Err(Box::new(
            Problem::new(span, format!("input `{}` of `{behavior}` is not connected", slot.name))
                .label(format!("{file} has no {kind}, which `{behavior}` requires"))
                .help(no_source(slot, sources)),
        )),
        [first, ..] => {
            let help = format!(
                "choose one of {}: --set behaviors.{behavior}.inputs.{}={first}",
                quoted(&fitting),
                slot.name
            );
            Err(Box::new(
                Problem::new(span, format!("several sensors fit input `{}` of `{behavior}`", slot.name))
                    .label(format!("{file} has no {kind} of this name"))
                    .help(help),
            ))
        }
    }
}

/// Returns the remedy where nothing gives the messages of `slot`, with the sensors that the robot has.
pub(super) fn no_source(slot: &SlotInfo, sources: &Sources<'_>) -> String {
    let message = slot.message.name;
    let Some(robot) = sources.robot else { return format!("no behavior publishes {message}") };
    let has: Vec<String> = robot
        .sensors
        .iter()
        .map(|sensor| match &sensor.message {
            Some(message) => format!("`{}` ({})", sensor.name, kind(message)),
            None => format!("`{}`", sensor.name),
        })
        .collect();
    let has = if has.is_empty() { "no sensors".to_owned() } else { has.join(", ") };
    format!(
        "{} has {has}: add a sensor that publishes {message}, or remove the behavior",
        robot.path.display()
    )
}

/// Kind of a message in a few letters, such as `RangeScan`.
fn kind(message: &MessageType) -> &str {
    let name = message.name;
    let name = name.rsplit_once('.').map_or(name, |(family, _)| family);
    let name = name.strip_prefix("yamabico.").unwrap_or(name);
    name.strip_suffix("Header").unwrap_or(name)
}

fn robot_file(sources: &Sources<'_>) -> String {
    sources.robot.map_or_else(|| "the robot".to_owned(), |robot| robot.path.display().to_string())
}
