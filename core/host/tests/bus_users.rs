//! Another user of the machine can neither read nor write what is on a robot's bus. The child processes are this test, started
//! again as that user.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fs::OpenOptions;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use yamabico_core::message::{Command as MotorCommand, Proposal};
use yamabico_host::bus::{Bell, Bus, Spec};

/// The user that owns nothing.
const NOBODY: u32 = 65534;
const PATIENCE: Duration = Duration::from_secs(20);
const COMMAND: &str = "command";
const PROPOSAL: &str = "behaviors/wall/proposal";

/// Plays its part where this test was started as a child, nothing otherwise.
#[test]
fn child() {
    let told = |key: &str| std::env::var(key).ok();
    let (Some(role), Some(robot), Some(folder)) =
        (told("USERS_TEST_ROLE"), told("USERS_TEST_ROBOT"), told("USERS_TEST_FOLDER"))
    else {
        return;
    };
    match role.as_str() {
        "owner" => own(&robot, Path::new(&folder)),
        _ => std::fs::write(Path::new(&folder).join(&role), intrude(&robot, Path::new(&folder))).unwrap(),
    }
}

/// Runs a robot until the folder is gone.
fn own(robot: &str, folder: &Path) {
    let bus = Bus::ipc(robot).unwrap();
    let spec = Spec { publishers: 4, bell: Bell::Rings, ..Spec::default() };
    bus.create::<MotorCommand>(COMMAND, &spec).unwrap();
    bus.create::<Proposal>(PROPOSAL, &spec).unwrap();
    let commands = bus.publisher::<MotorCommand>(COMMAND).unwrap();
    let _proposals = bus.subscriber::<Proposal>(PROPOSAL).unwrap();
    let _waiter = bus.waiter(&[PROPOSAL]).unwrap();
    commands.publish(&MotorCommand::default(), &[]).unwrap();
    let (root, prefix) = bus.files().unwrap();
    std::fs::write(folder.join("files.part"), format!("{}\n{prefix}", root.display())).unwrap();
    std::fs::rename(folder.join("files.part"), folder.join("files")).unwrap();
    let begun = Instant::now();
    while folder.exists() && begun.elapsed() < PATIENCE {
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Tries everything; what it managed, a line each.
fn intrude(robot: &str, folder: &Path) -> String {
    let files = std::fs::read_to_string(folder.join("files")).unwrap();
    let (root, prefix) = files.split_once('\n').unwrap();
    let mut managed = Vec::new();
    let mut note = |done: bool, what: String| managed.extend(done.then_some(what));
    note(std::fs::read_dir(root).is_ok(), format!("listed {root}"));
    note(std::fs::write(Path::new(root).join("planted"), "").is_ok(), format!("planted a file in {root}"));
    let segments = std::fs::read_dir("/dev/shm").unwrap().flatten().map(|entry| entry.path());
    let segments: Vec<PathBuf> = segments
        .filter(|path| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(prefix)))
        .collect();
    assert!(segments.len() > 3, "{} segments", segments.len());
    for segment in &segments {
        note(std::fs::File::open(segment).is_ok(), format!("read {}", segment.display()));
        note(OpenOptions::new().write(true).open(segment).is_ok(), format!("wrote {}", segment.display()));
        let mode = std::fs::metadata(segment).unwrap().mode();
        note(mode & 0o077 != 0, format!("found {} with mode {mode:o}", segment.display()));
    }
    // As a plugin of the same robot would.
    match Bus::join(robot) {
        Ok(bus) => {
            note(bus.subscriber::<MotorCommand>(COMMAND).is_ok(), "subscribed to commands".into());
            let proposals = bus.publisher::<Proposal>(PROPOSAL);
            let published = proposals.is_ok_and(|port| port.publish(&Proposal::default(), &[]).is_ok());
            note(published, "published a proposal".into());
        }
        Err(error) => note(false, error.to_string()),
    }
    managed.join("\n")
}

/// The place where both users look for robots, and this very program where both may run it.
struct Place(PathBuf);

impl Place {
    fn new() -> Place {
        let folder = std::env::temp_dir().join(format!("yb-users-{}", std::process::id()));
        std::fs::create_dir_all(folder.join("said")).unwrap();
        let open = |path: &Path, mode| {
            std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
        };
        open(&folder, 0o755);
        open(&folder.join("said"), 0o777);
        std::fs::copy(std::env::current_exe().unwrap(), folder.join("test")).unwrap();
        open(&folder.join("test"), 0o755);
        Place(folder)
    }

    fn said(&self) -> PathBuf {
        self.0.join("said")
    }

    fn child(&self, role: &str, user: Option<u32>) -> Command {
        let mut command = Command::new(self.0.join("test"));
        command.args(["child", "--exact"]).stdout(Stdio::null()).current_dir("/");
        command.env("USERS_TEST_ROLE", role).env("USERS_TEST_FOLDER", self.said());
        command.env("USERS_TEST_ROBOT", "users").env("XDG_RUNTIME_DIR", &self.0);
        if let Some(user) = user {
            command.uid(user).gid(user).env("HOME", "/nonexistent");
        }
        command
    }

    /// What an intruder managed.
    fn intrude(&self, role: &str, user: Option<u32>) -> String {
        assert!(self.child(role, user).status().unwrap().success());
        std::fs::read_to_string(self.said().join(role)).unwrap()
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[test]
fn another_user_can_neither_read_nor_write() {
    if !rustix::process::geteuid().is_root() {
        println!("skipped: only root can become another user");
        return;
    }
    let place = Place::new();
    let mut owner = place.child("owner", None).spawn().unwrap();
    let begun = Instant::now();
    while !place.said().join("files").exists() {
        assert!(begun.elapsed() < PATIENCE && owner.try_wait().unwrap().is_none(), "no robot");
        std::thread::sleep(Duration::from_millis(20));
    }
    // The same user manages all of it: the attempts are sound.
    let own = place.intrude("same-user", None);
    for what in ["listed", "planted", "read", "wrote", "subscribed to commands", "published a proposal"] {
        assert!(own.contains(what), "the owner's own user: {own}");
    }
    let managed = place.intrude("nobody", Some(NOBODY));
    assert_eq!(managed, "", "user {NOBODY} managed this");
    std::fs::remove_dir_all(place.said()).unwrap();
    assert!(owner.wait().unwrap().success());
}
