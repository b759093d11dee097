//! Times during which one behavior drove an axis.

use yamabico_core::message::{Axis, DecisionHeader, Mode, Name};
use yamabico_core::time::Time;

/// Number of spans of an axis above which every second one is joined to the one before.
pub(super) const MAX_SPANS: usize = 4000;

/// A time during which one behavior drove an axis, or a halt or no behavior did.
#[derive(Clone, Debug, PartialEq)]
pub(in super::super) struct Span {
    /// Begin.
    pub begin: Time,
    /// End.
    pub end: Time,
    /// Holder of the control.
    pub holder: Holder,
}

/// Holder of an axis.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in super::super) enum Holder {
    /// Behavior that drives it.
    Behavior(String),
    /// Stopped by this behavior, or by the mode.
    Halt(String),
    /// No behavior drives it.
    NoBehavior,
}

impl Holder {
    /// Holder of an axis by a decision.
    pub fn of(header: &DecisionHeader, axis: Axis) -> Holder {
        let name = |names: &[Name; 3]| names[axis as usize].as_str().to_owned();
        let stops = [Mode::CriticalSilent, Mode::EmergencyStop];
        match header.mode() {
            Some(mode) if stops.contains(&mode) => Holder::Halt(mode.as_str().to_owned()),
            _ if header.halted.contains(axis) => Holder::Halt(name(&header.halter)),
            _ => match name(&header.source) {
                source if source.is_empty() => Holder::NoBehavior,
                source => Holder::Behavior(source),
            },
        }
    }
}

/// Adds the holder of an axis at a time: the span before lasts until then.
pub(super) fn extend(spans: &mut Vec<Span>, at: Time, holder: Holder) {
    match spans.last_mut() {
        Some(span) if span.holder == holder => span.end = at,
        last => {
            if let Some(span) = last {
                span.end = at;
            }
            spans.push(Span { begin: at, end: at, holder });
            if spans.len() > MAX_SPANS {
                thin(spans);
            }
        }
    }
}

/// Joins every second span to the one before it.
fn thin(spans: &mut Vec<Span>) {
    let mut index = 0;
    let ends: Vec<Time> = spans.iter().map(|span| span.end).collect();
    spans.retain_mut(|span| {
        let is_kept = index % 2 == 0;
        if let Some(end) = ends.get(index + 1).filter(|_| is_kept) {
            span.end = *end;
        }
        index += 1;
        is_kept
    });
}
