//! Files of a running robot, and the lock that lets only one process run it.

use std::fs::{DirBuilder, File, OpenOptions, Permissions, TryLockError};
use std::io::{Read, Seek, Write};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::PathBuf;
use std::time::Duration;

use super::BusError;

/// Folder and shared-memory segments of one robot of one user.
#[derive(Clone, Debug)]
pub(super) struct RobotFiles {
    robot: String,
    /// Folder of the transport's files, private to the user.
    pub(super) root: PathBuf,
    /// Start of the name of every segment and socket; no robot's prefix is the start of another's.
    pub(super) prefix: String,
}

/// Exclusive right to run a robot; released by the kernel when the process dies.
#[derive(Debug)]
pub(super) struct RobotLock {
    file: File,
    path: PathBuf,
}

/// Start of the names of buses that are no robots.
pub(super) const PRIVATE: &str = "_";
/// Folder in which the operating system shows shared-memory segments.
pub(super) const SEGMENTS: &str = "/dev/shm";
/// Attempts to lock while another process only checks whether the robot runs.
const MAX_ATTEMPTS: u32 = 2000;
/// Pause between two attempts to lock.
const PAUSE: Duration = Duration::from_millis(1);
/// Maximum length of a Unix socket's path: `sun_path` without its closing zero.
const MAX_SOCKET_PATH: usize = 107;
/// Maximum length of a socket's name: a slash, the prefix, a port id of at most 39 digits, and `.event`.
const MAX_SOCKET_NAME: usize = 1 + PREFIX_LEN + 39 + 6;
/// Length of a prefix: `y`, ten digits of base 36, `_`.
const PREFIX_LEN: usize = 12;

impl RobotFiles {
    /// Returns the files of `robot` for this user.
    pub(super) fn of(robot: &str) -> Result<RobotFiles, BusError> {
        let bad = |problem: String| BusError::BadName { what: "robot", name: robot.into(), problem };
        let is_allowed = |c: u8| c.is_ascii_alphanumeric() || c == b'-' || c == b'_';
        if robot.is_empty() || !robot.bytes().all(is_allowed) {
            return Err(bad("use letters, digits, `-` and `_` only".into()));
        }
        let root = base()?.join(robot);
        let max_len = MAX_SOCKET_PATH - MAX_SOCKET_NAME;
        let len = root.as_os_str().len();
        if len > max_len {
            return Err(bad(format!(
                "the path of its folder {} must have at most {max_len} bytes, but has {len}: shorten the name",
                root.display()
            )));
        }
        let prefix = prefix(fnv1a(root.as_os_str().as_encoded_bytes()));
        Ok(RobotFiles { robot: robot.into(), root, prefix })
    }

    /// Returns the names of this user's robots whose lock is held, in alphabetical order.
    pub(super) fn running() -> Vec<String> {
        let Some(folder) = base().ok().and_then(|base| std::fs::read_dir(base).ok()) else {
            return Vec::new();
        };
        let locks = folder.flatten().map(|entry| entry.path());
        let locks = locks.filter(|path| path.extension().is_some_and(|extension| extension == "lock"));
        let names = locks.filter_map(|path| Some(path.file_stem()?.to_str()?.to_owned()));
        let names = names.filter(|name| !name.starts_with(PRIVATE));
        let mut running: Vec<String> =
            names.filter(|name| RobotFiles::of(name).is_ok_and(|files| files.owner().is_some())).collect();
        running.sort();
        running
    }

    /// Takes the lock; fails while another process holds it.
    pub(super) fn lock(&self) -> Result<RobotLock, BusError> {
        let path = self.lock_path();
        let failed = |doing, source| BusError::Files { doing, path: path.clone(), source };
        if let Some(folder) = path.parent() {
            DirBuilder::new()
                .recursive(true)
                .mode(0o700)
                .create(folder)
                .map_err(|e| failed("create the folder of", e))?;
        }
        let mut attempts = 0;
        loop {
            let mut file = OpenOptions::new()
                .read(true)
                .write(true)
                .create(true)
                .truncate(false)
                .mode(0o600)
                .open(&path)
                .map_err(|e| failed("open", e))?;
            match file.try_lock() {
                Ok(()) => {}
                // A process that checks whether the robot runs, and any child that it starts meanwhile, shares the
                // lock for an instant.
                Err(TryLockError::WouldBlock)
                    if attempts < MAX_ATTEMPTS && file.try_lock_shared().is_ok() =>
                {
                    attempts += 1;
                    drop(file);
                    std::thread::sleep(PAUSE);
                    continue;
                }
                Err(TryLockError::WouldBlock) => {
                    return Err(BusError::AlreadyRunning {
                        robot: self.robot.clone(),
                        pid: pid_in(&mut file),
                    });
                }
                Err(TryLockError::Error(e)) => return Err(failed("lock", e)),
            }
            // The last owner may have removed the file between open and lock.
            let inode = |metadata: std::fs::Metadata| (metadata.dev(), metadata.ino());
            if std::fs::metadata(&path).ok().map(inode) != file.metadata().ok().map(inode) {
                continue;
            }
            file.set_len(0)
                .and_then(|()| write!(file, "{}", std::process::id()))
                .map_err(|e| failed("write", e))?;
            return Ok(RobotLock { file, path });
        }
    }

    /// Returns the id of the process that runs the robot; none if the lock is free, even if a dead process left its
    /// file.
    pub(super) fn owner(&self) -> Option<u32> {
        let mut file = File::open(self.lock_path()).ok()?;
        match file.try_lock_shared() {
            Err(TryLockError::WouldBlock) => Some(pid_in(&mut file)),
            _ => None,
        }
    }

    /// Fails if the robot is not running.
    pub(super) fn check_running(&self) -> Result<(), BusError> {
        self.owner().map(|_| ()).ok_or_else(|| BusError::NotRunning { robot: self.robot.clone() })
    }

    /// Removes the folder and every segment. Call it only under the lock, before the first node or after the last.
    pub(super) fn remove_all(&self) -> Result<(), BusError> {
        match std::fs::remove_dir_all(&self.root) {
            Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
                return Err(BusError::Files { doing: "clear", path: self.root.clone(), source });
            }
            _ => {}
        }
        for segment in self.segments() {
            match std::fs::remove_file(&segment) {
                Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
                    return Err(BusError::Files { doing: "remove", path: segment, source });
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Takes away other users' access to segments that the transport makes for everyone, such as its counter of nodes.
    pub(super) fn make_private(&self) -> Result<(), BusError> {
        for segment in self.segments() {
            let failed = |source| BusError::Files { doing: "make private", path: segment.clone(), source };
            let mode = std::fs::metadata(&segment).map_err(failed)?.mode();
            if mode & 0o077 != 0 {
                std::fs::set_permissions(&segment, Permissions::from_mode(mode & 0o700)).map_err(failed)?;
            }
        }
        Ok(())
    }

    /// Returns every shared-memory segment of this robot.
    pub(super) fn segments(&self) -> Vec<PathBuf> {
        let Ok(folder) = std::fs::read_dir(SEGMENTS) else { return Vec::new() };
        folder
            .flatten()
            .filter(|entry| entry.file_name().as_encoded_bytes().starts_with(self.prefix.as_bytes()))
            .map(|entry| entry.path())
            .collect()
    }

    fn lock_path(&self) -> PathBuf {
        self.root.with_extension("lock")
    }
}

impl RobotLock {
    /// Releases the robot's name and removes the lock file.
    pub(super) fn release(self) {
        // Removed while still locked, so that it cannot be the file of the next owner.
        let _ = std::fs::remove_file(&self.path);
        let _ = self.file.unlock();
    }
}

/// Raises this process's limit of open files to the maximum, for itself and its children: every connection takes one.
pub(super) fn raise_file_limit() {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let Rlimit { maximum, .. } = getrlimit(Resource::Nofile);
    // If this is refused, the error on reaching the old limit says so.
    let _ = setrlimit(Resource::Nofile, Rlimit { current: maximum, maximum });
}

fn pid_in(file: &mut File) -> u32 {
    let mut text = String::new();
    let _ = file.rewind();
    let _ = file.read_to_string(&mut text);
    text.trim().parse().unwrap_or(0)
}

fn base() -> Result<PathBuf, BusError> {
    let absolute = |key| std::env::var_os(key).map(PathBuf::from).filter(|path| path.is_absolute());
    if let Some(runtime) = absolute("XDG_RUNTIME_DIR") {
        return Ok(runtime.join("yamabico"));
    }
    in_memory().or_else(|| absolute("HOME").map(|home| home.join(".yamabico"))).ok_or(BusError::NoFolder)
}

/// Returns a folder beside the segments, private to the user; none if it cannot be created or belongs to another user.
/// The transport syncs each of its files, which takes no time in memory.
fn in_memory() -> Option<PathBuf> {
    let user = rustix::process::getuid().as_raw();
    let folder = PathBuf::from(SEGMENTS).join(format!("yamabico-{user}"));
    let _ = DirBuilder::new().mode(0o700).create(&folder);
    let data = std::fs::symlink_metadata(&folder).ok()?;
    (data.is_dir() && data.uid() == user && data.mode() & 0o077 == 0).then_some(folder)
}

fn prefix(mut hash: u64) -> String {
    let mut prefix = String::from("y");
    for _ in 0..PREFIX_LEN - 2 {
        prefix.push(char::from(b"0123456789abcdefghijklmnopqrstuvwxyz"[(hash % 36) as usize]));
        hash /= 36;
    }
    prefix + "_"
}

fn fnv1a(bytes: &[u8]) -> u64 {
    bytes
        .iter()
        .fold(0xcbf2_9ce4_8422_2325, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::bus::{Bus, Notification, TopicSpec};
    use yamabico_core::message::Odometry;

    #[test]
    fn a_clean_end_leaves_no_file() {
        let robot = format!("clean-{}", std::process::id());
        let files = RobotFiles::of(&robot).unwrap();
        let bus = Bus::ipc(&robot).unwrap();
        bus.create::<Odometry>(
            "odometry",
            &TopicSpec { notification: Notification::On, ..TopicSpec::default() },
        )
        .unwrap();
        let publisher = bus.publisher::<Odometry>("odometry").unwrap();
        let subscriber = bus.subscriber::<Odometry>("odometry").unwrap();
        publisher.publish(&Odometry::default(), &[]).unwrap();
        drop((bus, subscriber));
        assert!(!files.segments().is_empty() && files.root.exists() && files.lock_path().exists());
        drop(publisher);
        assert!(files.segments().is_empty() && !files.root.exists() && !files.lock_path().exists());
    }

    #[test]
    fn a_start_removes_stale_files() {
        let robot = format!("left-{}", std::process::id());
        let files = RobotFiles::of(&robot).unwrap();
        let stale =
            [files.root.join("nodes/stale"), Path::new(SEGMENTS).join(format!("{}stale.data", files.prefix))];
        std::fs::create_dir_all(files.root.join("nodes")).unwrap();
        for file in &stale {
            std::fs::write(file, "left").unwrap();
        }
        let _bus = Bus::ipc(&robot).unwrap();
        assert!(stale.iter().all(|file| !file.exists()));
    }

    #[test]
    fn files_of_two_robots_never_overlap() {
        let robots: Vec<_> =
            ["a", "ab", "a_b", "a-b", "b"].map(|robot| RobotFiles::of(robot).unwrap()).into();
        for (i, a) in robots.iter().enumerate() {
            assert_eq!(a.prefix.len(), PREFIX_LEN);
            assert!(robots[..i].iter().all(|b| a.prefix != b.prefix && a.root != b.root));
        }
    }

    #[test]
    fn a_check_for_running_robots_does_not_prevent_a_start() {
        let robot = format!("checked-{}", std::process::id());
        let files = RobotFiles::of(&robot).unwrap();
        files.lock().unwrap().release();
        std::fs::write(files.lock_path(), "").unwrap();
        let checker = File::open(files.lock_path()).unwrap();
        checker.try_lock_shared().unwrap();
        let checking = std::thread::spawn(move || {
            std::thread::sleep(50 * PAUSE);
            drop(checker);
        });
        let lock = files.lock().unwrap();
        checking.join().unwrap();
        assert!(matches!(files.lock(), Err(BusError::AlreadyRunning { .. })), "the owner prevents one");
        lock.release();
    }

    #[test]
    fn the_lock_file_of_a_dead_robot_counts_as_not_running() {
        let robot = format!("dead-{}", std::process::id());
        let files = RobotFiles::of(&robot).unwrap();
        let lock = files.lock().unwrap();
        assert_eq!(files.owner(), Some(std::process::id()));
        assert!(RobotFiles::running().contains(&robot));
        // Like after kill -9: the lock is gone, the file stays, and its id belongs to a running process.
        let path = files.lock_path();
        drop(lock);
        std::fs::write(&path, std::process::id().to_string()).unwrap();
        assert_eq!(files.owner(), None);
        assert!(!RobotFiles::running().contains(&robot));
        std::fs::remove_file(path).unwrap();
    }
}
