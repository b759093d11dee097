//! What the drive can do, from the keys of `[limits]`.

use super::document::Table;
use super::problem::Problem;
use super::tables::LimitsKeys;
use super::units::number;
use crate::message::{Axes, Axis};
use crate::sensor::MotionLimits;

/// The limits of a drive with `axes`.
pub(crate) fn motion_limits(keys: &LimitsKeys, axes: Axes) -> MotionLimits {
    let lateral = if axes.contains(Axis::Lateral) { keys.max_linear_mps } else { 0.0 };
    let triple =
        |linear: f64, lateral: Option<f64>, angular: f64| [linear, lateral.unwrap_or(linear), angular];
    MotionLimits {
        speed: [keys.max_linear_mps, keys.max_lateral_mps.unwrap_or(lateral), keys.max_angular_radps],
        acceleration: triple(
            keys.linear_acceleration_mps2,
            keys.lateral_acceleration_mps2,
            keys.angular_acceleration_radps2,
        ),
        deceleration: triple(
            keys.linear_deceleration_mps2,
            keys.lateral_deceleration_mps2,
            keys.angular_deceleration_radps2,
        ),
        emergency: triple(
            keys.linear_emergency_mps2,
            keys.lateral_emergency_mps2,
            keys.angular_emergency_radps2,
        ),
        jerk: triple(keys.linear_jerk_mps3, keys.lateral_jerk_mps3, keys.angular_jerk_radps3),
    }
}

/// A halt must brake at least as hard as normal driving.
pub(crate) fn check_braking(keys: &LimitsKeys, tree: &Table, problems: &mut Vec<Problem>) {
    let limits = motion_limits(keys, Axes::ALL);
    for (axis, unit) in [(Axis::Linear, "mps2"), (Axis::Lateral, "mps2"), (Axis::Angular, "radps2")] {
        let (normal, emergency) = (limits.deceleration[axis as usize], limits.emergency[axis as usize]);
        if emergency >= normal {
            continue;
        }
        let key = |what: &str| format!("limits.{}_{what}_{unit}", axis.as_str());
        let written = |what: &str| {
            let table = tree.table("limits")?;
            table.entry(key(what).trim_start_matches("limits.")).map(|entry| entry.node.span)
        };
        let Some(span) = written("emergency").or(written("deceleration")) else { continue };
        problems.push(
            Problem::new(span, format!("a halt would brake softer than normal driving ({})", axis.as_str()))
                .label(format!("{} in a halt, {} in normal driving", number(emergency), number(normal)))
                .help(format!("make {} at least as large as {}", key("emergency"), key("deceleration"))),
        );
    }
}
