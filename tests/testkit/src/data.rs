//! Recorded data sets, which are not part of the repository.

use std::path::{Path, PathBuf};

/// Environment variable that names the folder of all data sets.
pub const VARIABLE: &str = "YAMABICO_DATA";

/// Returns the folder of all data sets: `YAMABICO_DATA`, else `../shared/data` beside the workspace.
#[must_use]
pub fn root() -> PathBuf {
    let default = || crate::workspace().join("../shared/data");
    std::env::var_os(VARIABLE).map_or_else(default, |folder| crate::workspace().join(folder))
}

/// Returns the folder of the data set `name`, such as `york_urban`; prints that it is skipped and returns `None` if it is missing.
#[must_use]
pub fn data_set(name: &str) -> Option<PathBuf> {
    data_set_in(&root(), name)
}

/// Like [`data_set`], but looks in `folder`, which may also be the data set's own folder.
#[must_use]
pub fn data_set_in(folder: &Path, name: &str) -> Option<PathBuf> {
    let own = folder.ends_with(name).then(|| folder.to_owned());
    let found = own.into_iter().chain([folder.join(name)]).find(|folder| folder.is_dir());
    if found.is_none() {
        eprintln!("skipped: {} does not exist (set {VARIABLE})", folder.join(name).display());
    }
    found
}
