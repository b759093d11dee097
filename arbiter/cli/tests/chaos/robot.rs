//! A robot that runs live in a process of its own, watched from outside and maltreated.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use yamabico_core::message::{Command as MotorCommand, Heartbeat, MessageType, Truth};
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, RawSubscriber, Subscriber};
use yamabico_runtime::execution::topics;

/// Longest wait for anything on a busy machine.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// A live run of a task, whose robot goes by a name of its own.
pub struct Robot {
    run: Option<Child>,
    /// Its recording and pictures; removed in the end.
    pub folder: PathBuf,
    /// Whether the folder stays.
    pub keep: bool,
    bus: Bus,
    heartbeats: Subscriber<Heartbeat>,
    commands: RawSubscriber,
    truths: RawSubscriber,
    /// The newest sign of life of each plugin.
    pub newest: BTreeMap<String, Heartbeat>,
    /// Every command since the start.
    pub told: Vec<MotorCommand>,
    /// Every truth since the start.
    pub truth: Vec<Truth>,
}

/// What a running robot holds of the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Holdings {
    /// Segments of shared memory.
    pub segments: usize,
    /// Files of the transport.
    pub files: usize,
    /// File descriptors of the supervisor.
    pub descriptors: usize,
}

/// How many segments of shared memory there are of each kind (the ending of their names), size in bytes, and owners: the
/// plugins, or the numbers of the dead, that the ids in the name tell of.
pub type Segments = BTreeMap<(String, u64, Vec<String>), usize>;

impl Robot {
    /// Starts `program run TASK --live`, and returns when every one of `plugins` has given a sign of life.
    pub fn start(program: &Path, task: &str, name: &str, plugins: usize, set: &[&str]) -> Robot {
        let folder = std::env::temp_dir().join(format!("yamabico-{name}"));
        let mut command = Command::new(program);
        command.arg("run").arg(config(task)).args(["--live", "--json", "--out"]).arg(&folder);
        command.arg("--set").arg(format!("robot.name={name}"));
        for set in set {
            command.args(["--set", set]);
        }
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let run = command.spawn().expect("the program starts");
        let begun = Instant::now();
        let bus = loop {
            let joined = Bus::join(name).and_then(|bus| {
                bus.subscriber::<MotorCommand>(topics::COMMAND)?;
                bus.subscriber::<Heartbeat>(topics::HEARTBEATS)?;
                Ok(bus)
            });
            match joined {
                Ok(bus) => break bus,
                Err(error) => assert!(begun.elapsed() < PATIENCE, "the robot does not come up: {error}"),
            }
            std::thread::sleep(Duration::from_millis(5));
        };
        let tap = |topic, message| bus.tap(topic, &message).expect("a place for a reader");
        let mut robot = Robot {
            heartbeats: bus.subscriber(topics::HEARTBEATS).expect("a place for a reader"),
            commands: tap(topics::COMMAND, MessageType::of::<MotorCommand>()),
            truths: tap(topics::TRUTH, MessageType::of::<Truth>()),
            run: Some(run),
            folder,
            keep: false,
            bus,
            newest: BTreeMap::new(),
            told: Vec::new(),
            truth: Vec::new(),
        };
        while robot.newest.len() < plugins || robot.told.is_empty() {
            assert!(begun.elapsed() < PATIENCE, "only {:?} are up", robot.newest.keys());
            robot.watch(Duration::from_millis(5));
        }
        robot
    }

    /// Watches the robot for so long.
    pub fn watch(&mut self, time: Duration) {
        let begun = Instant::now();
        loop {
            self.look();
            let left = time.saturating_sub(begun.elapsed());
            if left.is_zero() {
                return;
            }
            std::thread::sleep(left.min(Duration::from_millis(1)));
        }
    }

    /// Watches until `done` says so; whether it did within the time.
    pub fn watch_until(&mut self, time: Duration, mut done: impl FnMut(&Robot) -> bool) -> bool {
        let begun = Instant::now();
        while begun.elapsed() < time {
            self.look();
            if done(self) {
                return true;
            }
            std::thread::sleep(Duration::from_micros(500));
        }
        false
    }

    fn look(&mut self) {
        while let Ok(Some(beat)) = self.heartbeats.receive() {
            let beat = *beat.header();
            let newest = self.newest.entry(beat.plugin.as_str().to_owned()).or_insert(beat);
            if beat.stamp_ns >= newest.stamp_ns {
                *newest = beat;
            }
        }
        while let Ok(Some(command)) = self.commands.receive() {
            self.told.push(bytemuck::pod_read_unaligned(command.header()));
        }
        while let Ok(Some(truth)) = self.truths.receive() {
            self.truth.push(bytemuck::pod_read_unaligned(truth.header()));
        }
    }

    /// The supervisor's process.
    pub fn supervisor(&self) -> u32 {
        self.run.as_ref().map_or(0, Child::id)
    }

    /// The process of a plugin; `None` while it has none. One that is a program in Python goes by the name of its module.
    pub fn process_of(&self, plugin: &str) -> Option<u32> {
        let module = plugin.replace('-', "_");
        let is_module = |argument: &String| {
            let stem = argument.trim_end_matches(".py").rsplit(['.', '/']).next();
            argument.contains("python") && stem == Some(&module)
                || argument == &format!("yamabico.examples.{module}")
        };
        let is_it = |process: &Process| match process.arguments.get(2) {
            Some(name) if name == plugin => true,
            _ => process.arguments.iter().skip(1).any(is_module),
        };
        let own = |process: &Process| process.parent == self.supervisor() && is_it(process);
        processes().into_iter().find(own).map(|process| process.pid)
    }

    /// The robot's bus.
    #[allow(dead_code, reason = "not all that share this file ask")]
    pub fn bus(&self) -> &Bus {
        &self.bus
    }

    /// Whether the run still goes on.
    pub fn runs(&mut self) -> bool {
        self.run.as_mut().is_some_and(|run| matches!(run.try_wait(), Ok(None)))
    }

    /// What the robot holds of the machine.
    pub fn holdings(&self) -> Holdings {
        let (root, prefix) = self.bus.files().expect("a bus in shared memory");
        let named = |entry: &std::fs::DirEntry| entry.file_name().to_string_lossy().starts_with(&prefix);
        Holdings {
            segments: entries(Path::new("/dev/shm")).filter(named).count(),
            files: count_files(&root),
            descriptors: entries(&PathBuf::from(format!("/proc/{}/fd", self.supervisor()))).count(),
        }
    }

    /// The segments of shared memory.
    #[allow(dead_code, reason = "not all that share this file ask")]
    pub fn segments(&self) -> Segments {
        let (_, prefix) = self.bus.files().expect("a bus in shared memory");
        let living: BTreeMap<u32, Process> = processes().into_iter().map(|it| (it.pid, it)).collect();
        let owner = |id: &str| {
            let pid = (id.parse::<u128>().ok()? >> 64) as u32;
            let name = living.get(&pid).map(|process| process.arguments.get(2).cloned().unwrap_or_default());
            (pid > 0).then(|| name.unwrap_or_else(|| format!("dead {pid}")))
        };
        let mut kinds = BTreeMap::new();
        for entry in entries(Path::new("/dev/shm")) {
            let name = entry.file_name().to_string_lossy().into_owned();
            if let (Some(name), Ok(about)) = (name.strip_prefix(&prefix), entry.metadata()) {
                let (ids, kind) = name.rsplit_once('.').unwrap_or((name, ""));
                let owners = ids.split('_').filter_map(owner).collect();
                *kinds.entry((kind.to_owned(), about.len(), owners)).or_default() += 1;
            }
        }
        kinds
    }

    /// The folder of the transport's files, and the start of the names of its segments.
    #[allow(dead_code, reason = "not all that share this file ask")]
    pub fn files(&self) -> (PathBuf, String) {
        self.bus.files().expect("a bus in shared memory")
    }

    /// Presses Ctrl-C and waits for the end.
    pub fn interrupt(mut self) -> Output {
        signal(self.supervisor(), "INT");
        self.run.take().expect("a run").wait_with_output().expect("its end")
    }

    /// Waits for the end of a run that was killed.
    #[allow(dead_code, reason = "not all that share this file wait")]
    pub fn wait(&mut self) {
        let _ = self.run.as_mut().map(Child::wait);
    }

    /// How late commands came since `from`, by the time from one to the next beyond `period`.
    pub fn lateness(&self, from: Time, period: Duration) -> Lateness {
        let stamps = self.told.iter().map(|command| Time(command.stamp_ns)).filter(|stamp| *stamp >= from);
        let stamps: Vec<Time> = stamps.collect();
        let mut lateness = Lateness::default();
        for pair in stamps.windows(2) {
            lateness.add(pair[1].since(pair[0]).saturating_sub(period), period);
        }
        lateness
    }
}

impl Drop for Robot {
    /// No run is left behind, and no recording that nobody asked for.
    fn drop(&mut self) {
        if let Some(mut run) = self.run.take() {
            let _ = run.kill().and_then(|()| run.wait());
        }
        if !self.keep {
            let _ = std::fs::remove_dir_all(&self.folder);
        }
    }
}

/// A process as the system lists it.
pub struct Process {
    pub pid: u32,
    pub parent: u32,
    pub arguments: Vec<String>,
}

/// Every process that is not a zombie.
pub fn processes() -> Vec<Process> {
    let process = |entry: std::fs::DirEntry| {
        let pid: u32 = entry.file_name().to_str()?.parse().ok()?;
        let status = std::fs::read_to_string(entry.path().join("stat")).ok()?;
        let mut rest = status[status.rfind(')')? + 2..].split(' ');
        let (state, parent) = (rest.next()?, rest.next()?.parse().ok()?);
        let line = std::fs::read(entry.path().join("cmdline")).ok()?;
        let arguments = line.split(|&byte| byte == 0).map(|part| String::from_utf8_lossy(part).into_owned());
        (state != "Z").then(|| Process { pid, parent, arguments: arguments.collect() })
    };
    entries(Path::new("/proc")).filter_map(process).collect()
}

/// Sends a signal, such as `KILL`, to a process of ours.
pub fn signal(pid: u32, name: &str) {
    assert!(pid > 1, "no such process");
    let _ = Command::new("kill").args([&format!("-{name}"), &pid.to_string()]).status();
}

/// How late something came that is due once in a period.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lateness {
    /// At most.
    pub most: Duration,
    /// How often by more than a whole period.
    pub often: usize,
}

impl Lateness {
    fn add(&mut self, late: Duration, period: Duration) {
        self.most = self.most.max(late);
        self.often += usize::from(late > period);
    }

    /// Of both together.
    #[allow(dead_code, reason = "not all that share this file ask")]
    pub fn and(self, other: Lateness) -> Lateness {
        Lateness { most: self.most.max(other.most), often: self.often + other.often }
    }
}

/// A thread that only sleeps from tick to tick, and how late it woke.
pub struct BareTimer {
    over: std::sync::Arc<std::sync::atomic::AtomicBool>,
    thread: std::thread::JoinHandle<Lateness>,
}

impl BareTimer {
    /// Starts one.
    pub fn start(period: Duration) -> BareTimer {
        let over = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(false));
        let is_over = std::sync::Arc::clone(&over);
        let thread = std::thread::spawn(move || {
            let (mut next, mut lateness) = (Instant::now() + period, Lateness::default());
            while !is_over.load(std::sync::atomic::Ordering::Relaxed) {
                std::thread::sleep(next.saturating_duration_since(Instant::now()));
                let now = Instant::now();
                lateness.add(now.saturating_duration_since(next), period);
                while next <= now {
                    next += period;
                }
            }
            lateness
        });
        BareTimer { over, thread }
    }

    /// How late it woke.
    pub fn stop(self) -> Lateness {
        self.over.store(true, std::sync::atomic::Ordering::Relaxed);
        self.thread.join().expect("a thread that sleeps")
    }
}

/// A file under `configs/`.
pub fn config(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs").join(name)
}

fn entries(folder: &Path) -> impl Iterator<Item = std::fs::DirEntry> + use<> {
    std::fs::read_dir(folder).into_iter().flatten().flatten()
}

fn count_files(folder: &Path) -> usize {
    entries(folder).map(|entry| if entry.path().is_dir() { count_files(&entry.path()) } else { 1 }).sum()
}
