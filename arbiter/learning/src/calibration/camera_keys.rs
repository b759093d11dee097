//! Keys of a camera in a robot file, written between comments and other keys.

use toml_edit::{InlineTable, Item, TableLike, Value, value};
use yamabico_core::camera::{Distortion, Pinhole};

use super::robot_camera::{Findings, RobotCamera};

/// Sets the keys of the findings in the table of the sensor `camera`.
pub(super) fn write_findings(camera: &RobotCamera, sensor: &mut dyn TableLike, findings: &Findings) {
    if let Some(lens) = &findings.lens
        && let Some(table) = group(sensor, "intrinsics")
    {
        set_lens(table, lens);
    }
    if let Some(row) = findings.principal_row
        && let Some(table) = group(sensor, "intrinsics")
    {
        if table.is_empty() {
            set(table, "width", Value::from(i64::from(camera.intrinsics.width)));
            set(table, "height", Value::from(i64::from(camera.intrinsics.height)));
            set(table, "fov_deg", rounded(camera.intrinsics.fov_deg, 2));
        }
        set(table, "cy", rounded(row, 1));
    }
    let Findings { height_m, tilt_deg, roll_deg, pan_deg, .. } = *findings;
    for (key, number, decimals) in
        [("z_m", height_m, 3), ("tilt_deg", tilt_deg, 2), ("roll_deg", roll_deg, 2), ("pan_deg", pan_deg, 2)]
    {
        if let Some(number) = number
            && let Some(table) = group(sensor, "mount")
        {
            set(table, key, rounded(number, decimals));
        }
    }
    if let Some(latency_ms) = findings.latency_ms {
        set(sensor, "latency_ms", rounded(latency_ms, 1));
    }
    if findings.is_complete && camera.has_class {
        set(sensor, "calibration", Value::from("measured"));
    }
}

fn set_lens(table: &mut dyn TableLike, lens: &Pinhole) {
    let (at, distortion) = (lens.intrinsics(), lens.distortion());
    table.remove("fov_deg");
    for (key, pixels) in [("width", at.width), ("height", at.height)] {
        set(table, key, Value::from(i64::from(pixels)));
    }
    for (key, pixels) in [("fx", at.fx), ("fy", at.fy), ("cx", at.cx), ("cy", at.cy)] {
        set(table, key, rounded(pixels, 2));
    }
    let Some(table) = group(table, "distortion") else { return };
    let Distortion { k1, k2, p1, p2, k3 } = *distortion;
    for (key, coefficient) in [("k1", k1), ("k2", k2), ("p1", p1), ("p2", p2), ("k3", k3)] {
        if coefficient != 0.0 {
            set(table, key, rounded(coefficient, 5));
        } else {
            table.remove(key);
        }
    }
}

/// Returns the table `key`, an inline one if it is new.
fn group<'a>(table: &'a mut dyn TableLike, key: &str) -> Option<&'a mut dyn TableLike> {
    if !table.get(key).is_some_and(Item::is_table_like) {
        table.insert(key, value(InlineTable::new()));
    }
    table.get_mut(key)?.as_table_like_mut()
}

/// Sets a key, and keeps the spaces and the comment around its value.
fn set(table: &mut dyn TableLike, key: &str, new: Value) {
    match table.get_mut(key).and_then(Item::as_value_mut) {
        Some(old) => {
            let decor = old.decor().clone();
            *old = new;
            *old.decor_mut() = decor;
        }
        None => {
            // The space before the closing brace of an inline table belongs to its last value.
            let last =
                table.iter_mut().last().and_then(|(_, item)| item.as_value_mut().map(Value::decor_mut));
            if let Some(decor) = last
                && decor
                    .suffix()
                    .and_then(|suffix| suffix.as_str())
                    .is_some_and(|suffix| suffix.trim().is_empty())
            {
                decor.set_suffix("");
            }
            table.insert(key, value(new));
        }
    }
}

fn rounded(number: f64, decimals: i32) -> Value {
    let scale = 10_f64.powi(decimals);
    // Adding zero turns a negative zero into a positive one.
    Value::from((number * scale).round() / scale + 0.0)
}
