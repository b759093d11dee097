//! Folder of one run: never that of another run.

use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use super::utc::utc;

/// Name of the link to the newest run.
const LATEST: &str = "latest";

/// Folder of one run, named after its start, such as `out/hallway/2026-11-22T18-04-05Z`.
#[derive(Debug)]
pub struct RunFolder {
    path: PathBuf,
}

impl RunFolder {
    /// Creates the folder of a run that starts now in `parent`, which is created if it is missing. Of several runs that
    /// start within a second, each gets a folder of its own.
    ///
    /// # Errors
    /// A folder cannot be created.
    pub fn create(parent: &Path) -> io::Result<RunFolder> {
        std::fs::create_dir_all(parent)?;
        let started = utc(SystemTime::now());
        let second = started.split('.').next().unwrap_or_default().replace(':', "-");
        let mut name = format!("{second}Z");
        for next in 2.. {
            let path = parent.join(&name);
            match std::fs::create_dir(&path) {
                Err(error) if error.kind() == ErrorKind::AlreadyExists => name = format!("{second}Z-{next}"),
                created => return created.map(|()| RunFolder { path }),
            }
        }
        Err(ErrorKind::AlreadyExists.into())
    }

    /// Folder of the run.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Makes the link `latest` beside the folder point to it. A file or folder of that name stays; a file system without
    /// links has none.
    pub fn link(&self) {
        let (Some(parent), Some(name)) = (self.path.parent(), self.path.file_name()) else { return };
        let link = parent.join(LATEST);
        if link.symlink_metadata().is_ok_and(|data| !data.is_symlink()) {
            return;
        }
        // Renamed over the old link, so that there is always one.
        let new = parent.join(format!(".{LATEST}-{}", std::process::id()));
        let _ = std::os::unix::fs::symlink(name, &new).and_then(|()| std::fs::rename(&new, &link));
    }

    /// Removes the folder of a run that did not start, if nothing was written to it.
    pub fn remove_if_empty(&self) {
        let _ = std::fs::remove_dir(&self.path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_run_has_its_folder_and_the_link_names_the_newest() {
        let parent = std::env::temp_dir().join(format!("yamabico-run-folder-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&parent);
        let runs: Vec<RunFolder> = (0..3).map(|_| RunFolder::create(&parent).unwrap()).collect();
        for (i, run) in runs.iter().enumerate() {
            std::fs::write(run.path().join("run.mcap"), i.to_string()).unwrap();
            run.link();
        }
        let read = |folder: &Path| std::fs::read_to_string(folder.join("run.mcap")).unwrap();
        assert_eq!(runs.iter().map(|run| read(run.path())).collect::<Vec<_>>(), ["0", "1", "2"]);
        assert_eq!(read(&parent.join(LATEST)), "2");
        let unused = RunFolder::create(&parent).unwrap();
        unused.remove_if_empty();
        runs[0].remove_if_empty();
        assert!(!unused.path().exists() && runs[0].path().exists());
        std::fs::remove_dir_all(&parent).unwrap();
    }
}
