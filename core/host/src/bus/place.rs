//! Where a running robot keeps its files, and the lock that lets only one process run it.

use std::fs::{DirBuilder, File, OpenOptions, Permissions, TryLockError};
use std::io::{Read, Seek, Write};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::PathBuf;
use std::time::Duration;

use super::BusError;

/// The folder and the segments of one robot of one user.
#[derive(Clone, Debug)]
pub(super) struct Place {
    robot: String,
    /// Private to the user; holds what the transport keeps in files.
    pub(super) root: PathBuf,
    /// Starts the name of every segment and socket; no robot's prefix starts another's.
    pub(super) prefix: String,
}

/// Held as long as the robot runs; released by the kernel when the process dies.
#[derive(Debug)]
pub(super) struct Lock {
    file: File,
    path: PathBuf,
}

pub(super) const SEGMENTS: &str = "/dev/shm";
/// How often a start gives way to those who look.
const MAX_LOOKS: u32 = 2000;
/// What it waits each time.
const A_LOOK: Duration = Duration::from_millis(1);
/// `sun_path` of a Unix socket without its closing zero.
const LONGEST_SOCKET_PATH: usize = 107;
/// Prefix, port id of at most 39 digits, and `.event`, behind a slash.
const LONGEST_SOCKET_NAME: usize = 1 + PREFIX_LEN + 39 + 6;
/// `y`, ten digits of base 36, `_`.
const PREFIX_LEN: usize = 12;

impl Place {
    /// That of `robot` for this user.
    pub(super) fn of(robot: &str) -> Result<Place, BusError> {
        let bad = |problem: String| BusError::BadName { what: "robot", name: robot.into(), problem };
        let fits = |c: u8| c.is_ascii_alphanumeric() || c == b'-' || c == b'_';
        if robot.is_empty() || !robot.bytes().all(fits) {
            return Err(bad("use letters, digits, `-` and `_`".into()));
        }
        let root = base()?.join(robot);
        let room = LONGEST_SOCKET_PATH - LONGEST_SOCKET_NAME;
        let len = root.as_os_str().len();
        if len > room {
            return Err(bad(format!("its folder {} is {} bytes too long", root.display(), len - room)));
        }
        let prefix = prefix(fnv1a(root.as_os_str().as_encoded_bytes()));
        Ok(Place { robot: robot.into(), root, prefix })
    }

    /// The names of this user's robots whose process holds the lock, in alphabetical order.
    pub(super) fn running() -> Vec<String> {
        let Some(folder) = base().ok().and_then(|base| std::fs::read_dir(base).ok()) else {
            return Vec::new();
        };
        let locks = folder.flatten().map(|entry| entry.path());
        let locks = locks.filter(|path| path.extension().is_some_and(|extension| extension == "lock"));
        let names = locks.filter_map(|path| Some(path.file_stem()?.to_str()?.to_owned()));
        let mut running: Vec<String> =
            names.filter(|name| Place::of(name).is_ok_and(|place| place.owner().is_some())).collect();
        running.sort();
        running
    }

    /// Takes the robot's name; refused while another process has it.
    pub(super) fn lock(&self) -> Result<Lock, BusError> {
        let path = self.lock_path();
        let failed = |doing, source| BusError::Files { doing, path: path.clone(), source };
        if let Some(folder) = path.parent() {
            DirBuilder::new()
                .recursive(true)
                .mode(0o700)
                .create(folder)
                .map_err(|e| failed("create the folder of", e))?;
        }
        let mut looks = 0;
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
                // Who only looks whether the robot runs shares the lock for an instant, and whatever it starts meanwhile.
                Err(TryLockError::WouldBlock) if looks < MAX_LOOKS && file.try_lock_shared().is_ok() => {
                    looks += 1;
                    drop(file);
                    std::thread::sleep(A_LOOK);
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
            // Its last owner may have removed the file between the opening and the locking.
            let inode = |metadata: std::fs::Metadata| (metadata.dev(), metadata.ino());
            if std::fs::metadata(&path).ok().map(inode) != file.metadata().ok().map(inode) {
                continue;
            }
            file.set_len(0)
                .and_then(|()| write!(file, "{}", std::process::id()))
                .map_err(|e| failed("write", e))?;
            return Ok(Lock { file, path });
        }
    }

    /// The process that runs the robot; `None` where none holds the lock, whatever the file of a dead one says.
    pub(super) fn owner(&self) -> Option<u32> {
        let mut file = File::open(self.lock_path()).ok()?;
        match file.try_lock_shared() {
            Err(TryLockError::WouldBlock) => Some(pid_in(&mut file)),
            _ => None,
        }
    }

    /// Refuses to go on without a running robot.
    pub(super) fn check_running(&self) -> Result<(), BusError> {
        self.owner().map(|_| ()).ok_or_else(|| BusError::NotRunning { robot: self.robot.clone() })
    }

    /// Removes the root and every segment together: only under the lock, before the first node and after the last.
    pub(super) fn wipe(&self) -> Result<(), BusError> {
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

    /// Takes the segments from other users that the transport makes for everybody: its counter of nodes.
    pub(super) fn close_to_others(&self) -> Result<(), BusError> {
        for segment in self.segments() {
            let failed = |source| BusError::Files { doing: "close", path: segment.clone(), source };
            let mode = std::fs::metadata(&segment).map_err(failed)?.mode();
            if mode & 0o077 != 0 {
                std::fs::set_permissions(&segment, Permissions::from_mode(mode & 0o700)).map_err(failed)?;
            }
        }
        Ok(())
    }

    /// Every shared-memory segment of this robot.
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

impl Lock {
    /// Gives the name back and leaves nothing behind.
    pub(super) fn release(self) {
        // Removed while still locked, so that no successor's file can be hit.
        let _ = std::fs::remove_file(&self.path);
        let _ = self.file.unlock();
    }
}

/// Lets this process, and those that it starts, open as many files as the system allows them: every connection is one.
pub(super) fn allow_many_files() {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let Rlimit { maximum, .. } = getrlimit(Resource::Nofile);
    // Where it is refused, the old limit is the one that is told when it is met.
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
    in_memory().or_else(|| absolute("HOME").map(|home| home.join(".yamabico"))).ok_or(BusError::NoPlace)
}

/// A folder beside the segments, private to the user: the transport waits for each of its files to reach the disk, which
/// takes no time there. `None` where it is not to be had, or somebody else has it.
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
    use crate::bus::{Bell, Bus, Spec};
    use yamabico_core::message::Odometry;

    #[test]
    fn a_clean_end_leaves_nothing() {
        let robot = format!("clean-{}", std::process::id());
        let place = Place::of(&robot).unwrap();
        let bus = Bus::ipc(&robot).unwrap();
        bus.create::<Odometry>("odometry", &Spec { bell: Bell::Rings, ..Spec::default() }).unwrap();
        let publisher = bus.publisher::<Odometry>("odometry").unwrap();
        let subscriber = bus.subscriber::<Odometry>("odometry").unwrap();
        publisher.publish(&Odometry::default(), &[]).unwrap();
        drop((bus, subscriber));
        assert!(!place.segments().is_empty() && place.root.exists() && place.lock_path().exists());
        drop(publisher);
        assert!(place.segments().is_empty() && !place.root.exists() && !place.lock_path().exists());
    }

    #[test]
    fn a_start_clears_what_was_left() {
        let robot = format!("left-{}", std::process::id());
        let place = Place::of(&robot).unwrap();
        let stale =
            [place.root.join("nodes/stale"), Path::new(SEGMENTS).join(format!("{}stale.data", place.prefix))];
        std::fs::create_dir_all(place.root.join("nodes")).unwrap();
        for file in &stale {
            std::fs::write(file, "left").unwrap();
        }
        let _bus = Bus::ipc(&robot).unwrap();
        assert!(stale.iter().all(|file| !file.exists()));
    }

    #[test]
    fn places_of_robots_never_overlap() {
        let places: Vec<_> = ["a", "ab", "a_b", "a-b", "b"].map(|robot| Place::of(robot).unwrap()).into();
        for (i, a) in places.iter().enumerate() {
            assert_eq!(a.prefix.len(), PREFIX_LEN);
            assert!(places[..i].iter().all(|b| a.prefix != b.prefix && a.root != b.root));
        }
    }

    #[test]
    fn who_looks_keeps_nobody_from_starting() {
        let robot = format!("looked-at-{}", std::process::id());
        let place = Place::of(&robot).unwrap();
        place.lock().unwrap().release();
        std::fs::write(place.lock_path(), "").unwrap();
        let looker = File::open(place.lock_path()).unwrap();
        looker.try_lock_shared().unwrap();
        let looking = std::thread::spawn(move || {
            std::thread::sleep(50 * A_LOOK);
            drop(looker);
        });
        let lock = place.lock().unwrap();
        looking.join().unwrap();
        assert!(matches!(place.lock(), Err(BusError::AlreadyRunning { .. })), "the owner does");
        lock.release();
    }

    #[test]
    fn the_file_of_a_dead_robot_is_no_running_robot() {
        let robot = format!("dead-{}", std::process::id());
        let place = Place::of(&robot).unwrap();
        let lock = place.lock().unwrap();
        assert_eq!(place.owner(), Some(std::process::id()));
        assert!(Place::running().contains(&robot));
        // As after kill -9: the lock is gone, the file stays, and its number belongs to a process that runs.
        let path = place.lock_path();
        drop(lock);
        std::fs::write(&path, std::process::id().to_string()).unwrap();
        assert_eq!(place.owner(), None);
        assert!(!Place::running().contains(&robot));
        std::fs::remove_file(path).unwrap();
    }
}
