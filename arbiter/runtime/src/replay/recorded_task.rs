//! Task of a recording, from its attached files.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use yamabico_arbiter::policy::Policy;
use yamabico_core::behavior::ParameterError;
use yamabico_core::driver::{Device, DeviceSpec, Driver, DriverInfo, PartSpec, SensorDescription};
use yamabico_core::plugins::Plugins;
use yamabico_core::sensor::DeviceError;
use yamabico_host::HostError;
use yamabico_host::config::{InputSource, Overrides, Task, absolute, load};
use yamabico_parameters::Problems;

use super::recorded_programs::{absolute_word, programs_of, words_of};
use crate::execution::Plan;
use crate::record::{Contents, Execution, PlaybackError, RecordError, RecordedIdentity, digest_of_program};

/// Failure of a replay.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The file cannot be read or is no recording.
    #[error(transparent)]
    Recording(#[from] PlaybackError),
    /// The recording does not hold what a replay needs.
    #[error(
        "{} cannot be replayed: the fact `{fact}` of its run is missing or malformed; \
         it was not recorded by `run` of this version",
        path.display()
    )]
    NoIdentity {
        /// File.
        path: PathBuf,
        /// Missing or malformed fact.
        fact: String,
    },
    /// The task names external programs.
    #[error(
        "{} names {count} external program(s), such as `{program}`: read them, and add --programs if they may be started", path.display()
    )]
    Programs {
        /// File.
        path: PathBuf,
        /// The first program, with its arguments.
        program: String,
        /// Number of programs.
        count: usize,
    },
    /// The recorded run cannot be repeated.
    #[error("{} cannot be replayed: {reason}", path.display())]
    Unsupported {
        /// File.
        path: PathBuf,
        /// Cause.
        reason: String,
    },
    /// The attached files cannot be unpacked.
    #[error("the files of the recording cannot be unpacked to {}: {source}", folder.display())]
    Unpack {
        /// Folder.
        folder: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// The recorded task, or its changes, are refused.
    #[error("{0}")]
    Task(Problems),
    /// A behavior that is to be left out does not exist.
    #[error("the task has no behavior `{0}` to leave out: {1}")]
    NoBehavior(String, String),
    /// A part does not open.
    #[error(transparent)]
    Open(#[from] HostError),
    /// The bus failed during the replay.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// The what-if cannot be recorded.
    #[error(transparent)]
    Record(#[from] RecordError),
}

/// Changes of a recorded task: none for a replay, some for a what-if.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Changes {
    /// Assignments `key=value`; those to a behavior may leave out `behaviors.`.
    pub set: Vec<String>,
    /// Task file that replaces the recorded one.
    pub task: Option<PathBuf>,
    /// Behaviors that are left out.
    pub without: Vec<String>,
    /// Files with tables of further behaviors.
    pub with: Vec<PathBuf>,
}

impl Changes {
    /// Returns true if nothing is changed.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        *self == Changes::default()
    }
}

/// Devices of a recorded task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Devices {
    /// Described only: a replay has their messages, and not the images or the hardware that they came from.
    Closed,
    /// As in a run: the simulator, for a closed loop.
    Open,
}

/// External programs that a recorded task names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Programs {
    /// Refused: a recording may come from anybody.
    Refused,
    /// Started.
    Started,
}

/// Task of a recording, with the files that it names in a temporary folder.
#[derive(Debug)]
pub struct RecordedTask {
    /// The task, with its changes.
    pub task: Task,
    /// Identity of the recorded run.
    pub identity: RecordedIdentity,
    /// Arbitration policy of the recorded run.
    pub(super) policy: Policy,
    /// Attached files: name and text.
    pub files: Vec<(String, String)>,
    /// Facts of the run.
    pub facts: BTreeMap<String, String>,
    /// Changes of the configuration as they apply to the unpacked files.
    pub overrides: Overrides,
    _files: TemporaryFolder,
}

impl RecordedTask {
    /// Opens the task of the recording `path` with `changes`. Loading a task starts the external programs in it.
    ///
    /// # Errors
    /// The file is no recording of a run, its task is refused, or it names programs that are not to be started.
    pub fn open(
        path: &Path,
        changes: &Changes,
        plugins: &Plugins,
        devices: Devices,
        programs: Programs,
    ) -> Result<RecordedTask, ReplayError> {
        let contents = Contents::read(path)?;
        let no_identity = |fact: String| ReplayError::NoIdentity { path: path.to_owned(), fact };
        let identity = contents.identity().map_err(no_identity)?;
        let named = programs_of(&contents.files, &identity.run.set);
        if let (Programs::Refused, Some(first)) = (programs, named.first()) {
            let (path, program) = (path.to_owned(), first.words.join(" "));
            return Err(ReplayError::Programs { path, program, count: named.len() });
        }
        let files = TemporaryFolder::create()?;
        let unpacking = |source| ReplayError::Unpack { folder: files.0.clone(), source };
        contents.unpack(&files.0).map_err(unpacking)?;
        for program in &named {
            program.link(&identity.run.root, &files.0).map_err(unpacking)?;
        }
        let task_file = match &changes.task {
            Some(file) => file.clone(),
            None => files.0.join(&identity.run.task),
        };
        for extension in &changes.with {
            append(extension, &task_file).map_err(unpacking)?;
        }
        let overrides = match &changes.task {
            Some(_) => Overrides::default(),
            None => Overrides {
                robot: identity.run.robot.as_ref().map(|name| files.0.join(name)),
                set: identity.run.set.iter().map(|set| unpacked(set, &identity, &files.0)).collect(),
            },
        };
        let closed = |driver: &Arc<dyn Driver>| Arc::new(Closed(driver.clone())) as Arc<dyn Driver>;
        let plugins = match devices {
            Devices::Closed => {
                Plugins { drivers: plugins.drivers.iter().map(closed).collect(), ..plugins.clone() }
            }
            Devices::Open => plugins.clone(),
        };
        let load_with = |set: &[String]| {
            let set = [&overrides.set[..], set].concat();
            load(&task_file, &Overrides { set, ..overrides.clone() }, &plugins).map_err(ReplayError::Task)
        };
        let recorded = load_with(&[])?;
        let policy = Plan::new(&recorded, identity.run.seed).policy;
        let set: Vec<String> = changes.set.iter().map(|set| in_full(set, &recorded)).collect();
        let mut task = if set.is_empty() { recorded } else { load_with(&set)? };
        for name in &changes.without {
            leave_out(name, &mut task)?;
        }
        let Contents { facts, files: attached } = contents;
        let overrides = Overrides { set: [overrides.set, set].concat(), ..overrides };
        Ok(RecordedTask { task, identity, policy, files: attached, facts, overrides, _files: files })
    }

    /// Circumstances that may explain differences from the recorded run: another version, and, if something differs, another build.
    #[must_use]
    pub fn notes(&self, differs: bool) -> Vec<String> {
        let RecordedIdentity { run, program, .. } = &self.identity;
        let version = env!("CARGO_PKG_VERSION");
        let mut notes = Vec::new();
        if run.version != version {
            notes.push(format!("recorded by version {}, replayed by {version}", run.version));
        } else if differs && program != digest_of_program() {
            notes.push("recorded by another build of this version".to_owned());
        }
        notes
    }

    /// Returns true if the run was recorded in lockstep: every call follows from its inputs.
    #[must_use]
    pub fn is_lockstep(&self) -> bool {
        self.identity.run.execution == Execution::Lockstep
    }
}

/// Assignment with the path in it, if it names an attached file, replaced by that of the unpacked one; the paths of a program are
/// those of the recorded run.
fn unpacked(set: &str, identity: &RecordedIdentity, folder: &Path) -> String {
    let Some((key, value)) = set.split_once('=') else { return set.to_owned() };
    if let Some(words) = words_of(set) {
        let words: Vec<String> = words.iter().map(|word| absolute_word(word, &identity.run.folder)).collect();
        return format!("{key}={}", toml::Value::from(words));
    }
    let value = value.trim().trim_matches(['"', '\'']);
    let path = absolute(&identity.run.folder.join(value)).ok();
    let name = path.as_deref().and_then(|path| path.strip_prefix(&identity.run.root).ok());
    match name.map(|name| folder.join(name)).filter(|path| path.is_file()) {
        Some(path) => format!("{key}={:?}", path.to_string_lossy()),
        None => set.to_owned(),
    }
}

/// Assignment with `behaviors.` before the name of a behavior of the task.
fn in_full(set: &str, task: &Task) -> String {
    let name = set.split(['.', '=']).next().unwrap_or_default().trim();
    if task.behavior(name).is_some() { format!("behaviors.{set}") } else { set.to_owned() }
}

/// Appends the tables of one file to another.
fn append(extension: &Path, file: &Path) -> std::io::Result<()> {
    let text = format!("{}\n{}", std::fs::read_to_string(file)?, std::fs::read_to_string(extension)?);
    std::fs::write(file, text)
}

/// Removes a behavior with its wires and the inputs that others get from it.
fn leave_out(name: &str, task: &mut Task) -> Result<(), ReplayError> {
    if task.behavior(name).is_none() {
        let names = task.behaviors.iter().map(|behavior| behavior.name.as_str());
        let instead = yamabico_parameters::instead(name, names, "behavior");
        return Err(ReplayError::NoBehavior(name.to_owned(), instead));
    }
    task.behaviors.retain(|behavior| behavior.name != name);
    for behavior in &mut task.behaviors {
        behavior.inputs.retain(
            |input| !matches!(&input.source, InputSource::Output { behavior, .. } if behavior == name),
        );
    }
    for wires in [&mut task.inhibit, &mut task.suppress] {
        wires.retain(|wire| wire.by != name && wire.what != name);
    }
    Ok(())
}

/// Driver of a recorded robot: describes its devices, and opens none.
struct Closed(Arc<dyn Driver>);

impl Driver for Closed {
    fn info(&self) -> &DriverInfo {
        self.0.info()
    }

    fn describe_sensor(&self, sensor: &PartSpec, folder: &Path) -> Result<SensorDescription, ParameterError> {
        self.0.describe_sensor(sensor, folder)
    }

    fn open(&self, _: DeviceSpec) -> Result<Device, ParameterError> {
        Err(ParameterError::new("", "a replay opens no device"))
    }
}

/// Folder that is removed when dropped.
#[derive(Debug)]
pub(super) struct TemporaryFolder(PathBuf);

impl TemporaryFolder {
    /// The folder.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// Creates a new folder in the system's folder for temporary files.
    ///
    /// # Errors
    /// It cannot be created.
    pub fn create() -> Result<TemporaryFolder, ReplayError> {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        loop {
            let next = NEXT.fetch_add(1, Ordering::Relaxed);
            let name = format!("yamabico-replay-{}-{next}", std::process::id());
            let folder = std::env::temp_dir().join(name);
            match std::fs::create_dir(&folder) {
                Ok(()) => return Ok(TemporaryFolder(folder)),
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(source) => return Err(ReplayError::Unpack { folder, source }),
            }
        }
    }
}

impl Drop for TemporaryFolder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
