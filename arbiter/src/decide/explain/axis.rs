//! Explains one axis, from the proposed to the commanded speed.

use yamabico_core::message::{Axis, DecisionHeader, Mode, Twist};

use super::AxisExplanation;

/// Speeds closer than this print alike, m/s or rad/s.
const SAME: f64 = 0.005;

pub(super) fn explain_axis(header: &DecisionHeader, axis: Axis) -> AxisExplanation {
    let of = |twist: &Twist| twist.get(axis);
    let (wanted, feasible) = (of(&header.wanted), of(&header.feasible));
    let (allowed, commanded) = (of(&header.allowed), of(&header.commanded));
    let mut why = vec![match header.source[axis as usize] {
        source if source.is_empty() => "no behavior drives it".to_owned(),
        source => format!("{source} asks for {}", speed(wanted)),
    }];
    if (wanted - feasible).abs() > SAME {
        why.push(format!("the drive reaches {}", speed(feasible)));
    }
    why.extend(restraint(header, axis, feasible, allowed));
    if (commanded - allowed).abs() > SAME {
        let how = match commanded.abs() > allowed.abs() {
            true if header.emergency != 0 => "braking hard",
            true => "slowing down",
            false => "speeding up",
        };
        why.push(format!("{how} to {}", speed(allowed)));
    }
    let unit = if axis == Axis::Angular { "rad/s" } else { "m/s" };
    AxisExplanation { axis: axis.as_str(), commanded, wanted, unit, why }
}

/// Formats a speed with two decimals, never as `-0.00`.
pub(super) fn speed(speed: f64) -> String {
    let text = format!("{speed:.2}");
    if text == "-0.00" { "0.00".to_owned() } else { text }
}

/// Explains the step from the feasible to the allowed speed.
fn restraint(header: &DecisionHeader, axis: Axis, feasible: f64, allowed: f64) -> Option<String> {
    let (limiter, limit) = (header.limiter[axis as usize], header.limit.get(axis));
    let halter = header.halter[axis as usize];
    match header.mode() {
        Some(Mode::EmergencyStop | Mode::CriticalSilent | Mode::ShuttingDown) => {
            (feasible.abs() > SAME).then(|| "the whole robot is stopped".to_owned())
        }
        _ if !halter.is_empty() => Some(format!("{halter} halts it")),
        _ if !limiter.is_empty() && feasible.abs() > limit => {
            Some(format!("{limiter} limits it to {limit:.2}"))
        }
        _ if (feasible - allowed).abs() > SAME => {
            Some(format!("slowed to {allowed:.2} to keep the direction of translation"))
        }
        _ => None,
    }
}
