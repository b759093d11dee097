//! What dead processes of a running robot leave behind, and how it goes: the supervisor's part alone.
//!
//! A process that is killed leaves its node, its ports and their segments. [`Cleaner`] removes them through the transport and
//! then sweeps away what the transport forgets. It may block on a segment that its creator died over, for ever where the
//! process has the rights of root; the [`Janitor`] unlinks such segments, which lets everybody who waits for one go on.
//! So: the cleaner on a thread of its own that nobody waits for without a limit, the janitor on another.

use std::fs::Metadata;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use iceoryx2::prelude::ipc;

use super::place::{Place, SEGMENTS};
use super::world::{Patience, World};
use super::{Bus, BusError};

/// A segment is unfinished when it is still empty, or not to be read, after so long.
const UNFINISHED: Duration = Duration::from_millis(100);
/// What a dead process owned is left to the transport for so long.
const FORGOTTEN: Duration = Duration::from_secs(1);
/// Mode of a segment that is being made.
const WRITE_ONLY: u32 = 0o200;
/// Mode of a tag that says that a port or service is in use: work for the transport.
const FINISHED: u32 = 0o400;
/// Ends the name of a segment that connects a publisher with a subscriber.
const CONNECTION: &str = ".connection";
/// Fewer digits are no id.
const SHORTEST_ID: usize = 20;

/// Removes what dead processes leave behind. May block.
pub struct Cleaner {
    world: World<ipc::Service>,
    place: Place,
}

/// What one clean-up did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CleanedUp {
    /// Dead nodes whose resources were removed.
    pub nodes: u64,
    /// Dead nodes whose resources could not be removed.
    pub failed: u64,
    /// Files of dead processes that the transport had forgotten.
    pub forgotten: u64,
}

/// Unlinks segments that a dead process left unfinished. Never blocks: it looks at files only.
pub struct Janitor {
    place: Place,
}

impl Bus {
    /// A cleaner of this robot, on a node of its own.
    ///
    /// # Errors
    /// [`BusError::NotRunning`] where this is not the supervisor's bus; the transport failed.
    pub fn cleaner(&self) -> Result<Cleaner, BusError> {
        let place = self.place()?;
        let world = World::new(self.name(), &place.root.to_string_lossy(), &place.prefix, Patience::Bounded)?;
        Ok(Cleaner { world, place })
    }

    /// A janitor of this robot.
    ///
    /// # Errors
    /// [`BusError::NotRunning`] where this is not the supervisor's bus.
    pub fn janitor(&self) -> Result<Janitor, BusError> {
        Ok(Janitor { place: self.place()? })
    }
}

impl Cleaner {
    /// Removes what processes that are dead, and waited for, left behind.
    pub fn clean(&mut self) -> CleanedUp {
        let (nodes, failed) = self.world.clean_dead_nodes();
        CleanedUp { nodes, failed, forgotten: self.sweep(SystemTime::now()) }
    }

    /// Removes what the transport has no work with any more: files that name dead processes only, and connections of the dead with
    /// the living. The transport keeps for ever a connection whose maker was killed before it took its end of it.
    fn sweep(&self, now: SystemTime) -> u64 {
        let Place { root, prefix, .. } = &self.place;
        let nodes = root.join("nodes");
        let (mut swept, mut at_work) = (0, Vec::new());
        for (path, name, data) in entries(&nodes) {
            let id = if data.is_dir() {
                name.as_str()
            } else {
                name.strip_prefix(prefix.as_str()).unwrap_or("").split('.').next().unwrap_or("")
            };
            if age(&data, now) > FORGOTTEN && is_dead(id) && !has_work(&nodes.join(id)) {
                let removed =
                    if data.is_dir() { std::fs::remove_dir_all(path) } else { std::fs::remove_file(path) };
                swept += u64::from(removed.is_ok());
            } else {
                at_work.extend(process_of(id));
            }
        }
        let is_over = |id: &&str| is_dead(id) && process_of(id).is_none_or(|pid| !at_work.contains(&pid));
        let files = [root.as_path(), Path::new(SEGMENTS)].into_iter().flat_map(entries);
        for (path, name, _) in files.filter(|(.., data)| !data.is_dir() && age(data, now) > FORGOTTEN) {
            let Some(ids) = name.strip_prefix(prefix.as_str()).map(ids) else { continue };
            let all_are_dead = !ids.is_empty() && ids.iter().all(|id| is_dead(id));
            // Who lives and holds the connection goes on reading it: only its name goes.
            let is_left_connection = name.ends_with(CONNECTION) && ids.iter().any(is_over);
            if all_are_dead || is_left_connection {
                swept += u64::from(std::fs::remove_file(path).is_ok());
            }
        }
        swept
    }
}

impl Janitor {
    /// Unlinks every unfinished segment of a dead process; how many.
    pub fn unlink_unfinished(&self) -> u64 {
        self.unlink_unfinished_at(SystemTime::now())
    }

    fn unlink_unfinished_at(&self, now: SystemTime) -> u64 {
        let unfinished = |data: &Metadata| data.len() == 0 || data.mode() & 0o777 == WRITE_ONLY;
        let segments = entries(Path::new(SEGMENTS));
        let unlinked = segments.filter(|(path, name, data)| {
            let Some(rest) = name.strip_prefix(self.place.prefix.as_str()) else { return false };
            unfinished(data)
                && age(data, now) > UNFINISHED
                && ids(rest).iter().any(|id| is_dead(id))
                && std::fs::remove_file(path).is_ok()
        });
        unlinked.count() as u64
    }
}

/// Path, name and data of everything in a folder.
fn entries(folder: &Path) -> impl Iterator<Item = (PathBuf, String, Metadata)> + use<> {
    std::fs::read_dir(folder).into_iter().flatten().flatten().filter_map(|entry| {
        Some((entry.path(), entry.file_name().into_string().ok()?, entry.metadata().ok()?))
    })
}

/// Since the last change of the file's own data: what was written into a segment does not count.
fn age(data: &Metadata, now: SystemTime) -> Duration {
    now.duration_since(changed(data)).unwrap_or_default()
}

fn changed(data: &Metadata) -> SystemTime {
    SystemTime::UNIX_EPOCH
        + Duration::new(data.ctime().unsigned_abs(), u32::try_from(data.ctime_nsec()).unwrap_or(0))
}

/// The ids in the name of a file, its prefix taken away.
fn ids(name: &str) -> Vec<&str> {
    let stem = name.split('.').next().unwrap_or("");
    let is_id = |part: &&str| part.len() > SHORTEST_ID && part.bytes().all(|byte| byte.is_ascii_digit());
    stem.split('_').filter(is_id).collect()
}

/// Whether `id` names a process that is gone.
fn is_dead(id: &str) -> bool {
    process_of(id).is_some_and(|pid| !Path::new("/proc").join(pid.to_string()).exists())
}

/// The process that made an id: bits 64 to 95, in this version of the transport.
fn process_of(id: &str) -> Option<u32> {
    Some((id.parse::<u128>().ok()? >> 64) as u32)
}

/// Whether the transport still has something to do for the node whose folder this is.
fn has_work(node: &Path) -> bool {
    entries(node).any(|(_, name, data)| {
        (name.ends_with(".service_tag") || name.ends_with(".port_tag")) && data.mode() & 0o777 == FINISHED
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::Spec;
    use yamabico_core::message::Odometry;

    /// No process has this number: they end at 2^22.
    const GONE: u128 = 0x7fff_fff0 << 64 | 12_345;

    #[test]
    fn ids_name_their_process() {
        let bus = Bus::ipc(&format!("ids-{}", std::process::id())).unwrap();
        bus.create::<Odometry>("odometry", &Spec::default()).unwrap();
        let _publisher = bus.publisher::<Odometry>("odometry").unwrap();
        let place = bus.place().unwrap();
        let nodes: Vec<String> = entries(&place.root.join("nodes"))
            .filter(|(.., data)| data.is_dir())
            .map(|(_, name, _)| name)
            .collect();
        assert!(!nodes.is_empty());
        for node in &nodes {
            assert_eq!(process_of(node), Some(std::process::id()), "{node}");
            assert!(!is_dead(node));
        }
        let segments = place.segments();
        let named = segments.iter().filter_map(|path| path.file_name()?.to_str());
        let named = named.filter(|name| !ids(&name[place.prefix.len()..]).is_empty());
        assert!(named.count() > 0, "no segment names its process: {segments:?}");
    }

    #[test]
    fn what_the_dead_left_goes_and_what_the_living_use_stays() {
        let bus = Bus::ipc(&format!("sweep-{}", std::process::id())).unwrap();
        bus.create::<Odometry>("odometry", &Spec::default()).unwrap();
        let (_publisher, _subscriber) =
            (bus.publisher::<Odometry>("odometry").unwrap(), bus.subscriber::<Odometry>("odometry").unwrap());
        let place = bus.place().unwrap();
        let before = place.segments().len();
        let mut cleaner = bus.cleaner().unwrap();
        assert_eq!(cleaner.clean(), CleanedUp::default());
        let dead_node = place.root.join("nodes").join(GONE.to_string());
        std::fs::create_dir_all(&dead_node).unwrap();
        let named = |ids: &str| Path::new(SEGMENTS).join(format!("{}{ids}.connection", place.prefix));
        let dead_segment = named(&format!("abc_{GONE}"));
        std::fs::write(&dead_segment, "").unwrap();
        // As of a subscriber that was killed when its connection to a publisher that lives was made, and not yet taken.
        let living = u128::from(std::process::id()) << 64 | 12_345;
        let half_dead = named(&format!("{living}_{GONE}"));
        std::fs::write(&half_dead, "made").unwrap();
        let times = |paths: &[&PathBuf]| {
            let mut times: Vec<_> =
                paths.iter().map(|path| changed(&std::fs::metadata(path).unwrap())).collect();
            times.sort();
            (times[0], times[times.len() - 1] + Duration::from_millis(1))
        };
        let (first, _) = times(&[&dead_node, &dead_segment, &half_dead]);
        assert_eq!(cleaner.sweep(first + FORGOTTEN), 0, "too early to tell");
        let janitor = bus.janitor().unwrap();
        let (made, after) = times(&[&dead_segment]);
        assert_eq!(janitor.unlink_unfinished_at(made + UNFINISHED), 0);
        assert_eq!(janitor.unlink_unfinished_at(after + UNFINISHED), 1);
        let tag = dead_node.join("1.port_tag");
        std::fs::write(&tag, "").unwrap();
        std::fs::set_permissions(&tag, std::os::unix::fs::PermissionsExt::from_mode(FINISHED)).unwrap();
        let (_, last) = times(&[&dead_node, &half_dead]);
        assert_eq!(cleaner.sweep(last + FORGOTTEN), 0, "the transport is still at work");
        std::fs::remove_file(&tag).unwrap();
        let (_, last) = times(&[&dead_node, &half_dead]);
        assert_eq!(cleaner.sweep(last + FORGOTTEN), 2);
        assert!(!dead_node.exists() && !dead_segment.exists() && !half_dead.exists());
        assert_eq!((cleaner.clean(), janitor.unlink_unfinished()), (CleanedUp::default(), 0));
        assert_eq!(place.segments().len(), before);
    }
}
