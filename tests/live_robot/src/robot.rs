//! A live run of a task in processes of its own, observed from outside.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use yamabico_core::message::{Command as MotorCommand, Heartbeat, MessageType, Truth};
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, RawSubscriber, Subscriber};
use yamabico_host::topics;

/// Timeout of any wait, for a busy machine.
pub const TIMEOUT: Duration = Duration::from_secs(60);

/// A live run of a task, under a unique robot name.
pub struct LiveRobot {
    run: Option<Child>,
    /// Folder of its recording and plots; removed at the end.
    pub folder: PathBuf,
    /// If set, the folder is kept.
    pub keep: bool,
    bus: Bus,
    heartbeat_subscriber: Subscriber<Heartbeat>,
    command_subscriber: RawSubscriber,
    truth_subscriber: RawSubscriber,
    /// Latest heartbeat of each plugin.
    pub heartbeats: BTreeMap<String, Heartbeat>,
    /// All commands since the start.
    pub commands: Vec<MotorCommand>,
    /// All ground truth since the start.
    pub truth: Vec<Truth>,
}

/// System resources of a running robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Resources {
    /// Number of shared memory segments.
    pub segments: usize,
    /// Number of files of the transport.
    pub files: usize,
    /// Number of file descriptors of the supervisor.
    pub descriptors: usize,
}

/// Number of shared memory segments by kind (extension of the name), size in bytes, and owners (plugins, or process ids of dead
/// processes, decoded from the name).
pub type Segments = BTreeMap<(String, u64, Vec<String>), usize>;

impl LiveRobot {
    /// Starts `program run TASK --live` and waits for a heartbeat of each of `plugins` plugins.
    ///
    /// # Panics
    /// If it does not start in time.
    pub fn start(program: &Path, task: &str, name: &str, plugins: usize, set: &[&str]) -> LiveRobot {
        let folder = std::env::temp_dir().join(format!("yamabico-{name}"));
        let mut command = Command::new(program);
        command
            .arg("run")
            .arg(yamabico_testkit::config(task))
            .args(["--live", "--json", "--out"])
            .arg(&folder);
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
                Err(error) => assert!(begun.elapsed() < TIMEOUT, "the robot did not start in time: {error}"),
            }
            std::thread::sleep(Duration::from_millis(5));
        };
        let tap = |topic, message| bus.tap(topic, &message).expect("a free subscriber slot");
        let mut robot = LiveRobot {
            heartbeat_subscriber: bus.subscriber(topics::HEARTBEATS).expect("a free subscriber slot"),
            command_subscriber: tap(topics::COMMAND, MessageType::of::<MotorCommand>()),
            truth_subscriber: tap(topics::TRUTH, MessageType::of::<Truth>()),
            run: Some(run),
            folder,
            keep: false,
            bus,
            heartbeats: BTreeMap::new(),
            commands: Vec::new(),
            truth: Vec::new(),
        };
        while robot.heartbeats.len() < plugins || robot.commands.is_empty() {
            assert!(begun.elapsed() < TIMEOUT, "only {:?} started in time", robot.heartbeats.keys());
            robot.observe(Duration::from_millis(5));
        }
        robot
    }

    /// Observes the robot for a duration.
    pub fn observe(&mut self, time: Duration) {
        let begun = Instant::now();
        loop {
            self.receive();
            let left = time.saturating_sub(begun.elapsed());
            if left.is_zero() {
                return;
            }
            std::thread::sleep(left.min(Duration::from_millis(1)));
        }
    }

    /// Observes the robot until `done` returns true; returns false after the timeout `time`.
    pub fn wait_until(&mut self, time: Duration, mut done: impl FnMut(&LiveRobot) -> bool) -> bool {
        let begun = Instant::now();
        while begun.elapsed() < time {
            self.receive();
            if done(self) {
                return true;
            }
            std::thread::sleep(Duration::from_micros(500));
        }
        false
    }

    fn receive(&mut self) {
        while let Ok(Some(beat)) = self.heartbeat_subscriber.receive() {
            let beat = *beat.header();
            let newest = self.heartbeats.entry(beat.plugin.as_str().to_owned()).or_insert(beat);
            if beat.stamp_ns >= newest.stamp_ns {
                *newest = beat;
            }
        }
        while let Ok(Some(command)) = self.command_subscriber.receive() {
            self.commands.push(bytemuck::pod_read_unaligned(command.header()));
        }
        while let Ok(Some(truth)) = self.truth_subscriber.receive() {
            self.truth.push(bytemuck::pod_read_unaligned(truth.header()));
        }
    }

    /// Returns the process id of the supervisor.
    pub fn supervisor(&self) -> u32 {
        self.run.as_ref().map_or(0, Child::id)
    }

    /// Returns the process id of a plugin, if it runs. A program in Python is recognized by the name of its module.
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

    /// Returns the robot's bus.
    pub fn bus(&self) -> &Bus {
        &self.bus
    }

    /// Returns true while the run continues.
    pub fn is_running(&mut self) -> bool {
        self.run.as_mut().is_some_and(|run| matches!(run.try_wait(), Ok(None)))
    }

    /// Returns the system resources of the robot.
    pub fn resources(&self) -> Resources {
        let (root, prefix) = self.bus.files().expect("a bus in shared memory");
        let named = |entry: &std::fs::DirEntry| entry.file_name().to_string_lossy().starts_with(&prefix);
        Resources {
            segments: entries(Path::new("/dev/shm")).filter(named).count(),
            files: count_files(&root),
            descriptors: entries(&PathBuf::from(format!("/proc/{}/fd", self.supervisor()))).count(),
        }
    }

    /// Returns the shared memory segments of the robot.
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

    /// Returns the folder of the transport's files and the prefix of its segment names.
    pub fn files(&self) -> (PathBuf, String) {
        self.bus.files().expect("a bus in shared memory")
    }

    /// Interrupts the run like Ctrl-C and waits for its end.
    pub fn interrupt(mut self) -> Output {
        signal(self.supervisor(), "INT");
        self.run.take().expect("a run").wait_with_output().expect("its end")
    }

    /// Waits for the end of a killed run.
    pub fn wait(&mut self) {
        let _ = self.run.as_mut().map(Child::wait);
    }

    /// Returns the lateness of the commands since `from`: intervals between them that exceed `period`.
    pub fn lateness(&self, from: Time, period: Duration) -> Lateness {
        let stamps =
            self.commands.iter().map(|command| Time(command.stamp_ns)).filter(|stamp| *stamp >= from);
        let stamps: Vec<Time> = stamps.collect();
        let mut lateness = Lateness::default();
        for pair in stamps.windows(2) {
            lateness.add(pair[1].since(pair[0]).saturating_sub(period), period);
        }
        lateness
    }
}

impl Drop for LiveRobot {
    /// Ends the run and removes its folder.
    fn drop(&mut self) {
        if let Some(mut run) = self.run.take() {
            let _ = run.kill().and_then(|()| run.wait());
        }
        if !self.keep {
            let _ = std::fs::remove_dir_all(&self.folder);
        }
    }
}

/// A process of the system.
pub struct Process {
    /// Process id.
    pub pid: u32,
    /// Process id of the parent.
    pub parent: u32,
    /// Command line.
    pub arguments: Vec<String>,
}

/// Returns all processes that are not zombies.
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

/// Sends a signal, such as `KILL`, to a process of the test.
pub fn signal(pid: u32, name: &str) {
    assert!(pid > 1, "{pid} is not a process of the test");
    let _ = Command::new("kill").args([&format!("-{name}"), &pid.to_string()]).status();
}

/// Lateness of a periodic event.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lateness {
    /// Maximum lateness.
    pub max: Duration,
    /// Number of events that were late by more than a period.
    pub missed_periods: usize,
}

impl Lateness {
    fn add(&mut self, late: Duration, period: Duration) {
        self.max = self.max.max(late);
        self.missed_periods += usize::from(late > period);
    }

    /// Combines the lateness of two intervals.
    #[must_use]
    pub fn merge(self, other: Lateness) -> Lateness {
        Lateness { max: self.max.max(other.max), missed_periods: self.missed_periods + other.missed_periods }
    }
}

/// A thread that only sleeps from tick to tick: the lateness that the machine itself causes.
pub struct BareTimer {
    over: std::sync::Arc<std::sync::atomic::AtomicBool>,
    thread: std::thread::JoinHandle<Lateness>,
}

impl BareTimer {
    /// Starts the thread.
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

    /// Stops the thread and returns its lateness.
    pub fn stop(self) -> Lateness {
        self.over.store(true, std::sync::atomic::Ordering::Relaxed);
        self.thread.join().expect("the timer thread")
    }
}

fn entries(folder: &Path) -> impl Iterator<Item = std::fs::DirEntry> + use<> {
    std::fs::read_dir(folder).into_iter().flatten().flatten()
}

fn count_files(folder: &Path) -> usize {
    entries(folder).map(|entry| if entry.path().is_dir() { count_files(&entry.path()) } else { 1 }).sum()
}
