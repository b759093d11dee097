//! Identity of a run: everything that it takes to repeat it.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Read as _;
use std::path::{Component, Path, PathBuf};
use std::sync::OnceLock;
use std::time::Duration;

use sha2::{Digest as _, Sha256};
use yamabico_core::time::Time;
use yamabico_host::config::{Clock, Overrides, Task, absolute};

use super::Pace;

/// Time of a run: its owner, and with it the order of the calls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Execution {
    /// In lockstep: every call follows from the inputs.
    Lockstep,
    /// Live with a driver's clock: every call follows from the inputs, except for the requests of operators.
    DriverClock,
    /// Live: calls follow from the machine's clock.
    Live,
}

impl Execution {
    const ALL: [Execution; 3] = [Execution::Lockstep, Execution::DriverClock, Execution::Live];

    /// Name in recordings.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Execution::Lockstep => "lockstep",
            Execution::DriverClock => "driver-clock",
            Execution::Live => "live",
        }
    }
}

/// Identity of a run, as it is written to the record `run` of its recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Identity {
    /// Name of the task.
    pub name: String,
    /// Task file, by its name among the attached files.
    pub task: String,
    /// Robot file that replaced the task's, likewise; none if it was the task's.
    pub robot: Option<String>,
    /// Assignments `key=value` that changed the task.
    pub set: Vec<String>,
    /// Folder that the names of the attached files are relative to.
    pub root: PathBuf,
    /// Working directory of the run, for the paths in `set`.
    pub folder: PathBuf,
    /// Seed of every random number.
    pub seed: u64,
    /// Owner of the clock.
    pub execution: Execution,
    /// Duration of one step in lockstep.
    pub step: Duration,
    /// SHA-256 of the attached files and of the changes.
    pub configuration: String,
    /// Version of the program.
    pub version: String,
}

/// Identity of a run together with what only its recording knows.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedIdentity {
    /// The run.
    pub run: Identity,
    /// SHA-256 of the program.
    pub program: String,
    /// Wall-clock time of the first message, UTC.
    pub started: String,
    /// Stamp on the clock of the run at time zero of the recording.
    pub origin: Time,
}

impl Identity {
    /// Identity of a run of `task`, and the files to attach to its recording: name and text.
    ///
    /// # Errors
    /// The working directory is unknown.
    pub fn of(
        task: &Task,
        overrides: &Overrides,
        seed: u64,
        pace: Pace,
    ) -> std::io::Result<(Identity, Vec<(String, String)>)> {
        let files = task.files()?;
        let root = common_folder(files.iter().map(|(path, _)| path.as_path()));
        let named = |path: &Path| {
            path.strip_prefix(&root).map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
        };
        let name_of = |path: &Path| absolute(path).map(|path| named(&path));
        let attached: Vec<(String, String)> =
            files.iter().map(|(path, text)| (named(path), (*text).to_owned())).collect();
        let identity = Identity {
            name: task.name.clone(),
            task: name_of(&task.path)?,
            robot: overrides.robot.as_ref().map(|_| name_of(&task.robot.path)).transpose()?,
            set: overrides.set.clone(),
            folder: std::env::current_dir()?,
            seed,
            execution: match (pace, task.robot.clock) {
                (Pace::Lockstep, _) => Execution::Lockstep,
                (Pace::Live, Clock::Driver) => Execution::DriverClock,
                (Pace::Live, Clock::Machine) => Execution::Live,
            },
            step: task.run.step,
            configuration: digest_of_configuration(&attached, &overrides.set),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            root,
        };
        Ok((identity, attached))
    }

    /// Facts for the record `run` of a recording.
    #[must_use]
    pub fn facts(&self) -> BTreeMap<String, String> {
        let path = |path: &Path| path.to_string_lossy().into_owned();
        let facts = [
            ("name", self.name.clone()),
            ("task", self.task.clone()),
            ("robot", self.robot.clone().unwrap_or_default()),
            ("overrides", serde_json::Value::from(self.set.as_slice()).to_string()),
            ("root", path(&self.root)),
            ("folder", path(&self.folder)),
            ("seed", self.seed.to_string()),
            ("execution", self.execution.as_str().to_owned()),
            ("step_ns", self.step.as_nanos().to_string()),
            ("configuration_sha256", self.configuration.clone()),
            ("version", self.version.clone()),
        ];
        facts.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
    }
}

impl RecordedIdentity {
    /// Identity from the facts of a recording.
    ///
    /// # Errors
    /// The name of a fact that is missing or malformed: the recording is of an earlier version, or of another program.
    pub fn from_facts(facts: &BTreeMap<String, String>) -> Result<RecordedIdentity, String> {
        let text = |key: &str| facts.get(key).cloned().ok_or_else(|| key.to_owned());
        let number = |key: &str| text(key)?.parse::<u64>().map_err(|_| key.to_owned());
        let execution = text("execution")?;
        let execution = Execution::ALL.into_iter().find(|known| known.as_str() == execution);
        Ok(RecordedIdentity {
            run: Identity {
                name: text("name")?,
                task: text("task")?,
                robot: Some(text("robot")?).filter(|name| !name.is_empty()),
                set: serde_json::from_str(&text("overrides")?).map_err(|_| "overrides")?,
                root: text("root")?.into(),
                folder: text("folder")?.into(),
                seed: number("seed")?,
                execution: execution.ok_or("execution")?,
                step: Duration::from_nanos(number("step_ns")?),
                configuration: text("configuration_sha256")?,
                version: text("version")?,
            },
            program: text("program_sha256")?,
            started: text("started")?,
            origin: Time(number("origin_ns")?),
        })
    }
}

/// SHA-256 of this program, computed once; empty if it cannot be read.
pub(crate) fn digest_of_program() -> &'static str {
    static DIGEST: OnceLock<String> = OnceLock::new();
    DIGEST.get_or_init(|| {
        let digest = || {
            let mut file = std::fs::File::open("/proc/self/exe")?;
            let (mut hash, mut buffer) = (Sha256::new(), vec![0; 1 << 16]);
            loop {
                match file.read(&mut buffer)? {
                    0 => return std::io::Result::Ok(hexadecimal(hash)),
                    read => hash.update(&buffer[..read]),
                }
            }
        };
        digest().unwrap_or_default()
    })
}

/// SHA-256 of the names and texts of the files, in the order of their names, and of the changes.
fn digest_of_configuration(files: &[(String, String)], set: &[String]) -> String {
    let mut files: Vec<_> = files.iter().collect();
    files.sort();
    let mut hash = Sha256::new();
    let texts = files.iter().flat_map(|(name, text)| [name, text]).chain(set);
    for text in texts {
        hash.update((text.len() as u64).to_le_bytes());
        hash.update(text.as_bytes());
    }
    hexadecimal(hash)
}

fn hexadecimal(hash: Sha256) -> String {
    let mut text = String::with_capacity(64);
    for byte in hash.finalize() {
        // Writing to a `String` cannot fail.
        let _ = write!(text, "{byte:02x}");
    }
    text
}

/// Deepest folder that contains all `files`; absolute paths.
fn common_folder<'a>(mut files: impl Iterator<Item = &'a Path>) -> PathBuf {
    let Some(mut folder) = files.next().and_then(Path::parent) else { return PathBuf::from("/") };
    for file in files {
        while !file.starts_with(folder) {
            folder = folder.parent().unwrap_or(Path::new("/"));
        }
    }
    folder.to_owned()
}

/// Returns true for a relative path that stays in its folder.
pub(super) fn stays_inside(name: &str) -> bool {
    let mut parts = Path::new(name).components();
    !name.is_empty() && parts.all(|part| matches!(part, Component::Normal(_)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_relative_to_the_common_folder() {
        let files = ["/a/b/configs/t.toml", "/a/b/configs/robots/r.toml", "/a/b/maps/m.toml"];
        assert_eq!(common_folder(files.iter().map(Path::new)), Path::new("/a/b"));
        assert_eq!(common_folder([Path::new("/a/t.toml")].into_iter()), Path::new("/a"));
        assert_eq!(
            common_folder([Path::new("/a/t.toml"), Path::new("/b/r.toml")].into_iter()),
            Path::new("/")
        );
        let cases = [
            ("maps/m.toml", true),
            ("../m.toml", false),
            ("/etc/m.toml", false),
            ("", false),
            ("a/../b", false),
        ];
        for (name, inside) in cases {
            assert_eq!(stays_inside(name), inside, "{name}");
        }
    }

    #[test]
    fn an_identity_survives_its_recording() {
        let run = Identity {
            name: "hallway".into(),
            task: "hallway.toml".into(),
            robot: None,
            set: vec!["run.duration_s=1".into(), "behaviors.a.b=\"c\"".into()],
            root: "/r".into(),
            folder: "/f".into(),
            seed: u64::MAX,
            execution: Execution::DriverClock,
            step: Duration::from_millis(20),
            configuration: digest_of_configuration(&[("a".into(), "b".into())], &[]),
            version: "0.1.0".into(),
        };
        let mut facts = run.facts();
        assert_eq!(RecordedIdentity::from_facts(&facts).unwrap_err(), "program_sha256");
        let more = [("program_sha256", "00"), ("started", "2026"), ("origin_ns", "17")];
        facts.extend(more.map(|(key, value)| (key.to_owned(), value.to_owned())));
        let recorded = RecordedIdentity::from_facts(&facts).unwrap();
        assert_eq!((recorded.run, recorded.origin), (run, Time(17)));
        facts.insert("seed".into(), "-1".into());
        assert_eq!(RecordedIdentity::from_facts(&facts).unwrap_err(), "seed");
        assert_eq!(digest_of_program().len(), 64);
    }
}
