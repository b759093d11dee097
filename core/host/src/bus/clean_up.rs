//! Clean-up after dead processes of a running robot, by its supervisor alone.
//!
//! A killed process leaves its node, its ports and their segments. The [`Cleaner`] removes them through the transport
//! and then removes the files that the transport overlooks. It may block on a segment whose creator died half-way, and
//! for ever if it runs as root; the [`Janitor`] unlinks such segments, which unblocks every process that waits for
//! one. So the cleaner runs on a thread of its own that is waited for with a timeout, and the janitor on another.

use std::fs::Metadata;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use super::node::Node;
use super::retry::Retry;
use super::robot_files::{RobotFiles, SEGMENTS};
use super::service::IpcService;
use super::{Bus, BusError};

/// Age from which a segment that is still empty or unreadable counts as unfinished.
const UNFINISHED_AGE: Duration = Duration::from_millis(100);
/// Age from which a file of a dead process counts as overlooked by the transport.
const OVERLOOKED_AGE: Duration = Duration::from_secs(1);
/// Mode of a segment under construction.
const WRITE_ONLY: u32 = 0o200;
/// Mode of a finished tag: its port or service is still registered, and the transport will clean it up.
const FINISHED: u32 = 0o400;
/// Ending of the name of a segment that connects a publisher with a subscriber.
const CONNECTION: &str = ".connection";
/// An id has more digits than this.
const MIN_ID_DIGITS: usize = 20;

/// Removes the resources of dead processes. May block.
pub struct Cleaner {
    node: Node<IpcService>,
    files: RobotFiles,
}

/// Result of one clean-up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CleanUpReport {
    /// Number of dead nodes whose resources were removed.
    pub nodes: u64,
    /// Number of dead nodes whose resources could not be removed.
    pub failed: u64,
    /// Number of files of dead processes that the transport had overlooked.
    pub overlooked: u64,
}

/// Unlinks segments that a dead process left unfinished. Uses the file system only and never blocks.
pub struct Janitor {
    files: RobotFiles,
}

impl Bus {
    /// Makes a cleaner for this robot, with a node of its own.
    ///
    /// # Errors
    /// [`BusError::NotRunning`] if this is not the supervisor's bus; the transport failed.
    pub fn cleaner(&self) -> Result<Cleaner, BusError> {
        let files = self.supervised_files()?;
        let node = Node::new(self.name(), &files.root.to_string_lossy(), &files.prefix, Retry::Bounded)?;
        Ok(Cleaner { node, files })
    }

    /// Makes a janitor for this robot.
    ///
    /// # Errors
    /// [`BusError::NotRunning`] if this is not the supervisor's bus.
    pub fn janitor(&self) -> Result<Janitor, BusError> {
        Ok(Janitor { files: self.supervised_files()? })
    }
}

impl Cleaner {
    /// Removes the resources of processes that have died and been waited for.
    pub fn clean(&mut self) -> CleanUpReport {
        let (nodes, failed) = self.node.clean_dead_nodes();
        CleanUpReport { nodes, failed, overlooked: self.remove_overlooked(SystemTime::now()) }
    }

    /// Removes files that the transport overlooks: those that name dead processes only, and connections between a dead
    /// and a live process. The transport never removes a connection whose creator was killed before it opened its own
    /// end.
    fn remove_overlooked(&self, now: SystemTime) -> u64 {
        let RobotFiles { root, prefix, .. } = &self.files;
        let nodes = root.join("nodes");
        let (mut removals, mut in_use) = (0, Vec::new());
        for (path, name, data) in entries(&nodes) {
            let id = if data.is_dir() {
                name.as_str()
            } else {
                name.strip_prefix(prefix.as_str()).unwrap_or("").split('.').next().unwrap_or("")
            };
            if age(&data, now) > OVERLOOKED_AGE && is_dead(id) && !is_registered(&nodes.join(id)) {
                let removed =
                    if data.is_dir() { std::fs::remove_dir_all(path) } else { std::fs::remove_file(path) };
                removals += u64::from(removed.is_ok());
            } else {
                in_use.extend(process_of(id));
            }
        }
        let is_gone = |id: &&str| is_dead(id) && process_of(id).is_none_or(|pid| !in_use.contains(&pid));
        let files = [root.as_path(), Path::new(SEGMENTS)].into_iter().flat_map(entries);
        for (path, name, _) in files.filter(|(.., data)| !data.is_dir() && age(data, now) > OVERLOOKED_AGE) {
            let Some(ids) = name.strip_prefix(prefix.as_str()).map(ids) else { continue };
            let all_are_dead = !ids.is_empty() && ids.iter().all(|id| is_dead(id));
            // A live process that has the connection open can still read it: only its name is removed.
            let is_half_dead = name.ends_with(CONNECTION) && ids.iter().any(is_gone);
            if all_are_dead || is_half_dead {
                removals += u64::from(std::fs::remove_file(path).is_ok());
            }
        }
        removals
    }
}

impl Janitor {
    /// Unlinks every unfinished segment of a dead process. Returns the number unlinked.
    pub fn unlink_unfinished(&self) -> u64 {
        self.unlink_unfinished_at(SystemTime::now())
    }

    fn unlink_unfinished_at(&self, now: SystemTime) -> u64 {
        let unfinished = |data: &Metadata| data.len() == 0 || data.mode() & 0o777 == WRITE_ONLY;
        let segments = entries(Path::new(SEGMENTS));
        let unlinked = segments.filter(|(path, name, data)| {
            let Some(rest) = name.strip_prefix(self.files.prefix.as_str()) else { return false };
            unfinished(data)
                && age(data, now) > UNFINISHED_AGE
                && ids(rest).iter().any(|id| is_dead(id))
                && std::fs::remove_file(path).is_ok()
        });
        unlinked.count() as u64
    }
}

/// Returns path, name and metadata of every entry of a folder.
fn entries(folder: &Path) -> impl Iterator<Item = (PathBuf, String, Metadata)> + use<> {
    std::fs::read_dir(folder).into_iter().flatten().flatten().filter_map(|entry| {
        Some((entry.path(), entry.file_name().into_string().ok()?, entry.metadata().ok()?))
    })
}

/// Time since the last change of the file's status; writing into a mapped segment does not count.
fn age(data: &Metadata, now: SystemTime) -> Duration {
    now.duration_since(changed(data)).unwrap_or_default()
}

fn changed(data: &Metadata) -> SystemTime {
    SystemTime::UNIX_EPOCH
        + Duration::new(data.ctime().unsigned_abs(), u32::try_from(data.ctime_nsec()).unwrap_or(0))
}

/// Returns the ids in a file name without its prefix.
fn ids(name: &str) -> Vec<&str> {
    let stem = name.split('.').next().unwrap_or("");
    let is_id = |part: &&str| part.len() > MIN_ID_DIGITS && part.bytes().all(|byte| byte.is_ascii_digit());
    stem.split('_').filter(is_id).collect()
}

/// Returns true if `id` belongs to a process that no longer exists.
fn is_dead(id: &str) -> bool {
    process_of(id).is_some_and(|pid| !Path::new("/proc").join(pid.to_string()).exists())
}

/// Returns the process that made an id: bits 64 to 95 in iceoryx2 0.10.0, a private detail.
fn process_of(id: &str) -> Option<u32> {
    Some((id.parse::<u128>().ok()? >> 64) as u32)
}

/// Returns true if the node with this folder still has registered ports or services, which the transport will clean up.
fn is_registered(node: &Path) -> bool {
    entries(node).any(|(_, name, data)| {
        (name.ends_with(".service_tag") || name.ends_with(".port_tag")) && data.mode() & 0o777 == FINISHED
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::TopicSpec;
    use yamabico_core::message::Odometry;

    /// An id whose process cannot exist: process ids end at 2^22.
    const DEAD: u128 = 0x7fff_fff0 << 64 | 12_345;

    #[test]
    fn ids_contain_their_process_id() {
        let bus = Bus::ipc(&format!("ids-{}", std::process::id())).unwrap();
        bus.create::<Odometry>("odometry", &TopicSpec::default()).unwrap();
        let _publisher = bus.publisher::<Odometry>("odometry").unwrap();
        let files = bus.supervised_files().unwrap();
        let nodes: Vec<String> = entries(&files.root.join("nodes"))
            .filter(|(.., data)| data.is_dir())
            .map(|(_, name, _)| name)
            .collect();
        assert!(!nodes.is_empty());
        for node in &nodes {
            assert_eq!(process_of(node), Some(std::process::id()), "{node}");
            assert!(!is_dead(node));
        }
        let segments = files.segments();
        let named = segments.iter().filter_map(|path| path.file_name()?.to_str());
        let named = named.filter(|name| !ids(&name[files.prefix.len()..]).is_empty());
        assert!(named.count() > 0, "no segment names its process: {segments:?}");
    }

    #[test]
    fn files_of_dead_processes_go_and_those_of_live_ones_stay() {
        let bus = Bus::ipc(&format!("sweep-{}", std::process::id())).unwrap();
        bus.create::<Odometry>("odometry", &TopicSpec::default()).unwrap();
        let (_publisher, _subscriber) =
            (bus.publisher::<Odometry>("odometry").unwrap(), bus.subscriber::<Odometry>("odometry").unwrap());
        let files = bus.supervised_files().unwrap();
        let before = files.segments().len();
        let mut cleaner = bus.cleaner().unwrap();
        assert_eq!(cleaner.clean(), CleanUpReport::default());
        let dead_node = files.root.join("nodes").join(DEAD.to_string());
        std::fs::create_dir_all(&dead_node).unwrap();
        let named = |ids: &str| Path::new(SEGMENTS).join(format!("{}{ids}.connection", files.prefix));
        let dead_segment = named(&format!("abc_{DEAD}"));
        std::fs::write(&dead_segment, "").unwrap();
        // Like that of a subscriber which was killed after it created its connection to a live publisher, and before
        // it opened it.
        let living = u128::from(std::process::id()) << 64 | 12_345;
        let half_dead = named(&format!("{living}_{DEAD}"));
        std::fs::write(&half_dead, "made").unwrap();
        let times = |paths: &[&PathBuf]| {
            let mut times: Vec<_> =
                paths.iter().map(|path| changed(&std::fs::metadata(path).unwrap())).collect();
            times.sort();
            (times[0], times[times.len() - 1] + Duration::from_millis(1))
        };
        let (first, _) = times(&[&dead_node, &dead_segment, &half_dead]);
        assert_eq!(cleaner.remove_overlooked(first + OVERLOOKED_AGE), 0, "too young");
        let janitor = bus.janitor().unwrap();
        let (made, after) = times(&[&dead_segment]);
        assert_eq!(janitor.unlink_unfinished_at(made + UNFINISHED_AGE), 0);
        assert_eq!(janitor.unlink_unfinished_at(after + UNFINISHED_AGE), 1);
        let tag = dead_node.join("1.port_tag");
        std::fs::write(&tag, "").unwrap();
        std::fs::set_permissions(&tag, std::os::unix::fs::PermissionsExt::from_mode(FINISHED)).unwrap();
        let (_, last) = times(&[&dead_node, &half_dead]);
        assert_eq!(cleaner.remove_overlooked(last + OVERLOOKED_AGE), 0, "the transport will clean it up");
        std::fs::remove_file(&tag).unwrap();
        let (_, last) = times(&[&dead_node, &half_dead]);
        assert_eq!(cleaner.remove_overlooked(last + OVERLOOKED_AGE), 2);
        assert!(!dead_node.exists() && !dead_segment.exists() && !half_dead.exists());
        assert_eq!((cleaner.clean(), janitor.unlink_unfinished()), (CleanUpReport::default(), 0));
        assert_eq!(files.segments().len(), before);
    }
}
