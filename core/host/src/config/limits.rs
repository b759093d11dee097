//! Limits of the drive, from the keys of `[limits]`.

use super::robot::DriveFile;
use super::tables::LimitsKeys;
use yamabico_core::message::{Axes, Axis};
use yamabico_core::sensor::MotionLimits;
use yamabico_parameters::{Problem, Table, number};

/// Returns the limits of a drive with `axes`.
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

/// Checks that a halt brakes at least as hard as normal driving.
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
            Problem::new(
                span,
                format!("a halt must brake at least as hard as normal driving ({})", axis.as_str()),
            )
            .label(format!("{} in a halt, {} in normal driving", number(emergency), number(normal)))
            .help(format!(
                "make {} at least as large as {}",
                key("emergency"),
                key("deceleration")
            )),
        );
    }
}

/// Checks that the wheels suit the drive and reach the maximum speed of each axis.
pub(crate) fn check_wheels(
    drive: &DriveFile,
    limits: &MotionLimits,
    tree: &Table,
    problems: &mut Vec<Problem>,
) {
    let Some((wheels, entry)) = drive.wheels.zip(tree.table("drive").and_then(|table| table.entry("wheels")))
    else {
        return;
    };
    let written = |table: Option<&Table>, key: &str| {
        table.and_then(|table| table.entry(key)).map_or(entry.key_span, |entry| entry.node.span)
    };
    let (fits, right) = match drive.axes {
        Axes::PLANAR => (wheels.count == 2, "2"),
        Axes::ALL => (wheels.count > 2, "3 or 4"),
        _ => (false, "no"),
    };
    if !fits {
        problems.push(
            Problem::new(
                written(entry.node.as_table(), "count"),
                format!("a drive of kind `{}` must have {right} wheels", drive.part.kind),
            )
            .label(format!("the drive moves along {}", drive.axes))
            .help(format!("write {right}, or remove `wheels`")),
        );
    }
    let rim_mps = wheels.max_radps * wheels.radius_m;
    let max = [rim_mps, rim_mps, rim_mps / wheels.from_center_m];
    let keys = ["max_linear_mps", "max_lateral_mps", "max_angular_radps"];
    for (axis, (key, max)) in Axis::ALL.into_iter().zip(keys.into_iter().zip(max)) {
        let limit = limits.speed[axis as usize];
        if drive.axes.contains(axis) && limit > max {
            problems.push(
                Problem::new(
                    written(tree.table("limits"), key),
                    format!("the wheels are too slow for `{key}`"),
                )
                .label(format!(
                    "{} requires {} rad/s of the wheels",
                    number(limit),
                    number(limit / max * wheels.max_radps)
                ))
                .help(format!(
                    "with these wheels, limits.{key} must be at most {}",
                    number((max * 1e3).floor() * 1e-3)
                )),
            );
        }
    }
}
