//! Values and bands of the properties of buildings, by which results are grouped.

use serde_json::Value;
use yamabico_sim::building::{FloorKind, Properties};

/// Names of the properties, in the order of the table, with the limits between bands; none for kinds and counts.
const GROUPS: [(&str, &[f64]); 19] = [
    ("floor", &[]),
    ("width_m", &[1.7, 2.3]),
    ("baseboard", &[]),
    ("walls", &[]),
    ("lamps", &[]),
    ("glare", &[]),
    ("joint_contrast", &[0.3]),
    ("papers", &[0.5]),
    ("open_doors", &[0.3]),
    ("boxes", &[]),
    ("person", &[]),
    ("camera_m", &[0.5, 0.7]),
    ("tilt_deg", &[5.0, 10.0]),
    ("view_deg", &[60.0, 70.0]),
    ("blur_px", &[0.4, 0.8]),
    ("noise", &[2.0, 3.5]),
    ("gain", &[0.85, 1.18]),
    ("flicker", &[0.005]),
    ("lost_frames", &[0.005]),
];

/// Returns the names and values of all properties.
pub fn values(properties: &Properties) -> Vec<(String, String)> {
    let Ok(Value::Object(map)) = serde_json::to_value(properties) else { return Vec::new() };
    map.into_iter().map(|(name, value)| (name, text(&value))).collect()
}

/// Returns each property of a building with its value or band, in the order of the table.
pub fn bands(properties: &Properties) -> Vec<(&'static str, String)> {
    let map = serde_json::to_value(properties).unwrap_or_default();
    let has_joints = matches!(properties.floor, FloorKind::Tiles | FloorKind::Planks);
    let groups = GROUPS.iter().filter(|(name, _)| has_joints || *name != "joint_contrast");
    groups.map(|(name, limits)| (*name, band(&map[*name], limits))).collect()
}

/// Returns the place of a property in the table.
pub fn rank(name: &str) -> usize {
    GROUPS.iter().position(|(group, _)| *group == name).unwrap_or(GROUPS.len())
}

fn band(value: &Value, limits: &[f64]) -> String {
    let Some(number) = value.as_f64().filter(|_| !limits.is_empty()) else { return text(value) };
    let above = limits.iter().rposition(|limit| number >= *limit);
    match (above, above.map_or(0, |i| i + 1)) {
        (None, _) => format!("< {}", limits[0]),
        (Some(i), next) if next < limits.len() => format!("{} to {}", limits[i], limits[next]),
        (Some(i), _) => format!(">= {}", limits[i]),
    }
}

fn text(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        // Single precision shows as many digits as were drawn.
        Value::Number(number) if number.is_f64() => {
            format!("{}", (number.as_f64().unwrap_or_default() * 1e4).round() / 1e4)
        }
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_property_has_a_band() {
        let drawn: Vec<Properties> = (0..200).map(Properties::draw).collect();
        for (name, limits) in GROUPS {
            let found: std::collections::BTreeSet<String> = drawn
                .iter()
                .flat_map(bands)
                .filter_map(|(group, band)| (group == name).then_some(band))
                .collect();
            assert!(!found.contains("null") && found.len() > limits.len().max(1), "{name}: {found:?}");
        }
        assert_eq!(band(&Value::from(2.0), &[1.0, 3.0]), "1 to 3");
        assert_eq!(band(&Value::from(0.5), &[1.0, 3.0]), "< 1");
        assert_eq!(band(&Value::from(3.0), &[1.0, 3.0]), ">= 3");
    }
}
