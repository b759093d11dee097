//! Device files of the operating system, such as `/dev/ttyUSB0`, and the remedies for their errors.

use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// File with udev rules that give devices to their groups.
const RULES: &str = "configs/udev/60-yamabico.rules";

/// Describes the failure to open the device file `path`: cause and remedy.
#[must_use]
pub fn refusal(path: &Path, error: &io::Error) -> String {
    let name = path.display();
    match error.kind() {
        io::ErrorKind::NotFound => {
            let found = siblings(path);
            let found = if found.is_empty() { "nothing similar".to_owned() } else { found.join(", ") };
            format!(
                "{name} does not exist: connect and switch on the device, or name another; connected: {found}"
            )
        }
        io::ErrorKind::PermissionDenied => format!("{name}: permission denied; {}", membership(path)),
        io::ErrorKind::ResourceBusy => {
            format!("{name} is in use by another program (`fuser -v {name}` names it): end that program")
        }
        _ => format!("{name} cannot be opened: {error}"),
    }
}

/// Tells how a user gets access to a device file that belongs to a group.
fn membership(path: &Path) -> String {
    let groups = std::fs::read_to_string("/etc/group").unwrap_or_default();
    let group = std::fs::metadata(path).ok().and_then(|file| group_name(&groups, file.gid()));
    match group.as_deref() {
        None | Some("root") => format!("install the udev rules {RULES}, which give it to its group"),
        Some(group) => format!(
            "it belongs to the group `{group}`: run `sudo usermod -aG {group} $USER` and log in again, or install the udev \
             rules {RULES}"
        ),
    }
}

/// Returns the name of the group with the number `gid` in the text of `/etc/group`.
fn group_name(groups: &str, gid: u32) -> Option<String> {
    groups.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        let number: u32 = fields.nth(1)?.parse().ok()?;
        (number == gid).then(|| name.to_owned())
    })
}

/// Returns the paths of existing devices of the same kind: names that differ in their number, and stable names of USB devices.
fn siblings(path: &Path) -> Vec<String> {
    let kind = |name: &str| name.trim_end_matches(|c: char| c.is_ascii_digit()).to_owned();
    let wanted = path.file_name().map(|name| kind(&name.to_string_lossy()));
    let is_serial = path.starts_with("/dev/serial")
        || wanted.as_deref().is_some_and(|kind| ["ttyUSB", "ttyACM"].contains(&kind));
    let is_kind = |name: &str| {
        let kind = kind(name);
        wanted.as_deref() == Some(kind.as_str())
            || (is_serial && ["ttyUSB", "ttyACM"].contains(&kind.as_str()))
    };
    let mut found = list("/dev", &is_kind);
    if is_serial {
        found.extend(list("/dev/serial/by-id", &|_| true));
    }
    found
}

fn list(folder: &str, is_wanted: &dyn Fn(&str) -> bool) -> Vec<String> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let names = entries.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned());
    let mut found: Vec<String> =
        names.filter(|name| is_wanted(name)).map(|name| format!("{folder}/{name}")).collect();
    found.sort();
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_are_found_by_their_number() {
        let groups = "root:x:0:\ndialout:x:20:ann,bob\nbroken\nvideo:x:44:";
        assert_eq!(group_name(groups, 20).as_deref(), Some("dialout"));
        assert_eq!(group_name(groups, 44).as_deref(), Some("video"));
        assert_eq!(group_name(groups, 7), None);
    }

    #[test]
    fn errors_name_the_remedy() {
        let path = Path::new("/dev/null");
        let text = |kind| refusal(path, &io::Error::from(kind));
        assert!(text(io::ErrorKind::PermissionDenied).contains(RULES));
        assert!(text(io::ErrorKind::ResourceBusy).contains("another program"));
        let missing = refusal(Path::new("/dev/tty999"), &io::Error::from(io::ErrorKind::NotFound));
        assert!(missing.contains("/dev/tty999 does not exist"), "{missing}");
    }
}
