//! Description of the robot: its plugins, their parameters and the map.

use std::collections::BTreeSet;
use std::path::Path;

use serde::Serialize;
use yamabico_core::message::{RetuneHeader, RetuneStep};
use yamabico_runtime::execution::{ParameterEntry, RobotManifest};
use yamabico_runtime::record::map_lines;

/// Maximum size of a map file, bytes.
const MAX_MAP_BYTES: u64 = 16 << 20;

/// Parameters of one behavior.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BehaviorParameters {
    /// Name of the behavior.
    pub behavior: String,
    /// Parameters with their current values.
    pub parameters: Vec<ParameterEntry>,
}

/// Everything about the robot that changes rarely.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Setup {
    /// Name of the robot.
    pub robot: String,
    /// Radius of its footprint, m.
    pub radius_m: f64,
    /// Topics: name and message type.
    pub topics: Vec<[String; 2]>,
    /// Parameters of the behaviors.
    pub parameters: Vec<BehaviorParameters>,
    /// Lines of the map, m.
    pub map: Vec<[[f64; 2]; 2]>,
    /// Walls of the simulated world: polylines, m.
    pub walls: Vec<Vec<[f64; 2]>>,
}

impl Setup {
    /// Description of a running robot, with the maps that its parameters name.
    pub(super) fn of(manifest: &RobotManifest) -> Setup {
        let behaviors = manifest.plugins.iter().filter(|plugin| plugin.behavior.is_some());
        let parameters = behaviors.map(|plugin| BehaviorParameters {
            behavior: plugin.name.clone(),
            parameters: plugin.parameters.clone(),
        });
        Setup {
            robot: manifest.robot.clone(),
            radius_m: manifest.radius_m,
            topics: manifest.topics.iter().map(|topic| [topic.name.clone(), topic.message.clone()]).collect(),
            parameters: parameters.collect(),
            map: read_maps(manifest),
            walls: Vec::new(),
        }
    }

    /// Takes in a file that a recording has attached: a map, or the task file with the parameters that it sets.
    pub(super) fn add_file(&mut self, text: &str) {
        let Ok(file) = text.parse::<toml::Table>() else { return };
        self.map.extend(map_lines(&file));
        let behaviors = file.get("behaviors").and_then(toml::Value::as_table).into_iter().flatten();
        let written = behaviors.filter_map(|(name, table)| {
            let parameters = table.as_table()?.iter().map(|(key, value)| ParameterEntry {
                key: key.clone(),
                takes: value.type_str().to_owned(),
                unit: None,
                range: None,
                value: serde_json::to_value(value).ok(),
                summary: String::new(),
            });
            Some(BehaviorParameters { behavior: name.clone(), parameters: parameters.collect() })
        });
        self.parameters.extend(written);
    }

    /// Takes in new parameters of a behavior.
    pub(super) fn retune(&mut self, header: &RetuneHeader, text: &[u8]) -> bool {
        let table = std::str::from_utf8(text).ok().and_then(|text| text.parse::<toml::Table>().ok());
        let (Some(table), Some(RetuneStep::Apply)) = (table, header.step()) else { return false };
        let name = header.behavior.as_str();
        let Some(behavior) = self.parameters.iter_mut().find(|known| known.behavior == name) else {
            return false;
        };
        for parameter in &mut behavior.parameters {
            let mut keys = parameter.key.split('.');
            let first = keys.next().and_then(|key| table.get(key));
            let value = first.and_then(|first| keys.try_fold(first, |value, key| value.get(key)));
            if let Some(value) = value.and_then(|value| serde_json::to_value(value).ok()) {
                parameter.value = Some(value);
            }
        }
        true
    }
}

/// Lines of the maps of a robot.
pub(crate) fn read_maps(manifest: &RobotManifest) -> Vec<[[f64; 2]; 2]> {
    let files = map_files(manifest).into_iter();
    files.filter_map(|(_, text)| text.parse().ok()).flat_map(|file| map_lines(&file)).collect()
}

/// Name and text of the distinct files that parameters called `map` or `plan` name.
pub(crate) fn map_files(manifest: &RobotManifest) -> Vec<(String, String)> {
    let parameters = manifest
        .plugins
        .iter()
        .flat_map(|plugin| plugin.parameters.iter().map(move |parameter| (plugin, parameter)));
    let maps = parameters.filter(|(_, parameter)| matches!(parameter.key.as_str(), "map" | "plan"));
    let files: BTreeSet<_> = maps
        .filter_map(|(plugin, parameter)| Some(plugin.folder.join(parameter.value.as_ref()?.as_str()?)))
        .collect();
    let name = |file: &Path| file.file_name().map(|name| name.to_string_lossy().into_owned());
    files.iter().filter_map(|file| Some((name(file)?, read(file)?))).collect()
}

fn read(file: &Path) -> Option<String> {
    let size = std::fs::metadata(file).ok()?.len();
    (size <= MAX_MAP_BYTES).then(|| std::fs::read_to_string(file).ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::Name;

    #[test]
    fn applied_parameters_replace_their_values() {
        let parameter = |key: &str| ParameterEntry {
            key: key.to_owned(),
            takes: "number".to_owned(),
            unit: None,
            range: None,
            value: Some(1.into()),
            summary: String::new(),
        };
        let parameters = vec![parameter("speed_mps"), parameter("gate.min_m"), parameter("other")];
        let behavior = BehaviorParameters { behavior: "wall".to_owned(), parameters };
        let mut setup = Setup { parameters: vec![behavior], ..Setup::default() };
        let header = |step: RetuneStep| RetuneHeader {
            behavior: Name::new("wall"),
            step: step.code(),
            ..RetuneHeader::default()
        };
        let text = b"speed_mps = 0.25\ngate = { min_m = 0.5 }";
        assert!(!setup.retune(&header(RetuneStep::Prepare), text));
        assert!(!setup.retune(&header(RetuneStep::Apply), b"[["));
        assert!(setup.retune(&header(RetuneStep::Apply), text));
        let values: Vec<_> = setup.parameters[0].parameters.iter().map(|entry| entry.value.clone()).collect();
        assert_eq!(values, [Some(0.25.into()), Some(0.5.into()), Some(1.into())]);
    }
}
