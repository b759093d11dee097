//! Tasks from configuration files of twist_mux: its topics become behaviors, and so do its locks.
//!
//! twist_mux forwards the velocity of the topic with the highest priority that is fresh and not locked; a lock with the priority p
//! keeps topics below p away. Where nothing is left it publishes nothing, and the robot relies on the timeout of its base; here a
//! stop is commanded.

use std::fmt::Write;
use std::path::Path;

use yaml_rust2::{Yaml, YamlLoader};

/// Maximum size of a file, bytes.
const MAX_BYTES: u64 = 1 << 20;
/// Timeout for a topic without one, s.
const DEFAULT_TIMEOUT_S: f64 = 0.5;
/// Maximum age of data in the arbiter without a key, s.
const DEFAULT_MAX_AGE_S: f64 = 1.0;
/// Priority of the lowest input, and step from one to the next.
const STEP: i64 = 10;

/// A topic or a lock.
#[derive(Clone, Debug, PartialEq)]
struct Input {
    name: String,
    topic: String,
    timeout_s: f64,
    priority: i64,
    is_lock: bool,
}

/// Reads the configuration file `path` of twist_mux. Returns a task that does the same, for the robot file `robot`.
///
/// # Errors
/// The description of what cannot be read.
pub fn task(path: &Path, robot: &str) -> Result<String, String> {
    let size = std::fs::metadata(path).map_err(|error| error.to_string())?.len();
    if size > MAX_BYTES {
        return Err(format!("has {size} bytes, more than a configuration file"));
    }
    let text = std::fs::read_to_string(path).map_err(|error| error.to_string())?;
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    task_of(&text, &name, robot)
}

/// Returns the task for the contents `text` of the file `name`.
fn task_of(text: &str, name: &str, robot: &str) -> Result<String, String> {
    let documents = YamlLoader::load_from_str(text).map_err(|error| format!("is no valid YAML: {error}"))?;
    let parameters = documents.iter().find_map(|document| parameters(document, 0));
    let parameters = parameters.ok_or(
        "has no `topics`: a file of twist_mux has the keys NODE: ros__parameters: topics: NAME: {topic, timeout, priority}",
    )?;
    let mut inputs = inputs(&parameters["topics"], false)?;
    inputs.extend(inputs_of_locks(parameters)?);
    if inputs.iter().all(|input| input.is_lock) {
        return Err("has no topic with a velocity".to_owned());
    }
    Ok(write(inputs, name, robot))
}

/// Finds the table with `topics`, under any node name.
fn parameters(node: &Yaml, depth: usize) -> Option<&Yaml> {
    let table = node.as_hash()?;
    if !node["topics"].is_badvalue() {
        return Some(node);
    }
    table.values().filter(|_| depth < 4).find_map(|inner| parameters(inner, depth + 1))
}

fn inputs_of_locks(parameters: &Yaml) -> Result<Vec<Input>, String> {
    if parameters["locks"].is_badvalue() { Ok(Vec::new()) } else { inputs(&parameters["locks"], true) }
}

fn inputs(tables: &Yaml, is_lock: bool) -> Result<Vec<Input>, String> {
    let group = if is_lock { "locks" } else { "topics" };
    let tables = tables.as_hash().ok_or_else(|| format!("`{group}` is no table of names"))?;
    tables.iter().map(|(name, table)| input(name, table, group, is_lock)).collect()
}

fn input(name: &Yaml, table: &Yaml, group: &str, is_lock: bool) -> Result<Input, String> {
    let name = name.as_str().ok_or_else(|| format!("`{group}` has a name that is no text"))?;
    let wrong = |key: &str, what: &str| format!("`{group}.{name}.{key}` {what}");
    let topic = table["topic"].as_str().ok_or_else(|| wrong("topic", "is missing"))?;
    let number = |key: &str| table[key].as_f64().or_else(|| table[key].as_i64().map(|number| number as f64));
    let timeout_s = match number("timeout") {
        Some(timeout_s) if (0.0..=60.0).contains(&timeout_s) => timeout_s,
        Some(_) => return Err(wrong("timeout", "must be 0 to 60 seconds")),
        None => 0.0,
    };
    let priority = table["priority"].as_i64().ok_or_else(|| wrong("priority", "is missing"))?;
    if !(0..=255).contains(&priority) {
        return Err(wrong("priority", "must be 0 to 255"));
    }
    Ok(Input { name: identifier(name), topic: topic.to_owned(), timeout_s, priority, is_lock })
}

/// Name of a behavior: letters, digits, `-` and `_`, at most 32.
fn identifier(name: &str) -> String {
    let allowed = |c: char| if c.is_ascii_alphanumeric() || c == '_' { c } else { '-' };
    name.chars().map(allowed).take(28).collect()
}

fn write(mut inputs: Vec<Input>, name: &str, robot: &str) -> String {
    // A lock keeps away what is below it, and not its equals; of equal topics, the first by name wins.
    inputs.sort_by(|a, b| {
        b.priority.cmp(&a.priority).then(a.is_lock.cmp(&b.is_lock)).then_with(|| a.name.cmp(&b.name))
    });
    let keeps_numbers = inputs.windows(2).all(|pair| pair[0].priority > pair[1].priority);
    let count = i64::try_from(inputs.len()).unwrap_or(0);
    let mut text = format!(
        "# From {name} of twist_mux: topics of velocities, and locks, by priority.\n\
         # A stop is commanded where twist_mux falls silent. The arbiter's limits and ramps replace a velocity smoother; add\n\
         # sonar-halt, with a higher priority, in place of a collision monitor.\n\n\
         robot = {}\n",
        toml::Value::from(robot)
    );
    for (place, input) in inputs.iter().enumerate() {
        let place = i64::try_from(place).unwrap_or(0);
        let priority = if keeps_numbers { input.priority } else { STEP * (count - place) };
        let comment = if keeps_numbers { String::new() } else { format!(" # {} in {name}", input.priority) };
        let same = |other: &&Input| other.name == input.name && other.is_lock != input.is_lock;
        let suffix = if input.is_lock && inputs.iter().any(|other| same(&other)) { "-lock" } else { "" };
        let (behavior, topic) = (&input.name, toml::Value::from(absolute(&input.topic)));
        let key = if input.is_lock { "ros2_lock" } else { "ros2_twist" };
        let _ = write!(
            text,
            "\n[behaviors.{behavior}{suffix}]\n{key} = {topic}\npriority = {priority}{comment}\nperiod_ms = 10\n"
        );
        text += &if input.is_lock { lock_keys(input) } else { topic_keys(input) };
    }
    text
}

fn lock_keys(input: &Input) -> String {
    // Its silence must not open it.
    let timeout_ms = 1e3 * input.timeout_s;
    format!("critical = true\ntimeout_ms = {timeout_ms:?}\n")
}

fn topic_keys(input: &Input) -> String {
    if input.timeout_s == 0.0 {
        return format!(
            "# Without a timeout in twist_mux: a dead publisher would keep its priority for ever.\ntimeout_ms = {:?}\n",
            1e3 * DEFAULT_TIMEOUT_S
        );
    }
    let timeout_ms = 1e3 * input.timeout_s;
    let mut keys = format!("timeout_ms = {timeout_ms:?}\n");
    if input.timeout_s > 0.9 * DEFAULT_MAX_AGE_S {
        let _ = writeln!(keys, "max_evidence_age_ms = {:?}", timeout_ms + 100.0);
    }
    keys
}

/// A name without `/` is relative to the namespace of the node, which is not in the file.
fn absolute(topic: &str) -> String {
    format!("/{}", topic.trim_start_matches('/'))
}

#[cfg(test)]
mod tests {
    use super::*;

    const EXAMPLE: &str = "\
# Comment
/**:
  ros__parameters:
    topics:
      navigation:
        topic   : nav_vel
        timeout : 0.5
        priority: 10
      joystick: {topic: /joy_vel, timeout: 1.5, priority: 100}
    locks:
      pause:
        topic   : pause_navigation
        timeout : 0.0
        # Same priority as joystick control, so it'll not block it.
        priority: 100
";

    fn behaviors(text: &str) -> Vec<(String, toml::Table)> {
        let task: toml::Table = toml::from_str(text).unwrap();
        let behaviors = task["behaviors"].as_table().unwrap().clone();
        behaviors.into_iter().map(|(name, table)| (name, table.as_table().unwrap().clone())).collect()
    }

    #[test]
    fn the_example_becomes_a_task() {
        let text = task_of(EXAMPLE, "twist_mux.yaml", "robot.toml").unwrap();
        let behaviors = behaviors(&text);
        let of =
            |name: &str| behaviors.iter().find(|(found, _)| found == name).map(|(_, table)| table).unwrap();
        assert_eq!(of("navigation")["ros2_twist"].as_str(), Some("/nav_vel"));
        let priority = |name: &str| of(name)["priority"].as_integer().unwrap();
        // The lock does not hold the joystick of the same priority.
        assert!(priority("joystick") > priority("pause") && priority("pause") > priority("navigation"));
        assert_eq!(of("pause")["critical"].as_bool(), Some(true));
        assert_eq!(of("joystick")["timeout_ms"].as_float(), Some(1500.0));
        assert_eq!(of("joystick")["max_evidence_age_ms"].as_float(), Some(1600.0));
        assert!(!of("navigation").contains_key("max_evidence_age_ms"));
    }

    #[test]
    fn different_priorities_are_kept() {
        let text = EXAMPLE.replace("priority: 100}", "priority: 255}");
        let behaviors = behaviors(&task_of(&text, "mux.yaml", "robot.toml").unwrap());
        let priorities: Vec<i64> =
            behaviors.iter().map(|(_, table)| table["priority"].as_integer().unwrap()).collect();
        assert_eq!(priorities.iter().sum::<i64>(), 255 + 100 + 10);
    }

    #[test]
    fn errors_say_what_is_missing() {
        let error = |text: &str| task_of(text, "mux.yaml", "robot.toml").unwrap_err();
        assert!(error("").contains("ros__parameters"));
        assert!(error("a: [").contains("YAML"));
        assert!(
            error(&EXAMPLE.replace("topic   : nav_vel", "")).contains("`topics.navigation.topic` is missing")
        );
        assert!(error(&EXAMPLE.replace("priority: 10\n", "priority: 300\n")).contains("0 to 255"));
        assert!(error("n:\n  ros__parameters:\n    topics: 7\n").contains("`topics`"));
    }
}
