//! Another user of the machine can neither read from nor write to a robot's bus. The child processes run this test
//! again as that user.

use std::fs::OpenOptions;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use yamabico_core::message::{Command as MotorCommand, Proposal};
use yamabico_host::bus::{Bus, Notification, TopicSpec};

/// User id of `nobody`.
const NOBODY: u32 = 65534;
const TIMEOUT: Duration = Duration::from_secs(20);
const COMMAND: &str = "command";
const PROPOSAL: &str = "behaviors/wall/proposal";

/// Plays the role given in the environment of a child process; passes at once otherwise.
#[test]
fn child() {
    let variable = |key: &str| std::env::var(key).ok();
    let (Some(role), Some(robot), Some(folder)) =
        (variable("USERS_TEST_ROLE"), variable("USERS_TEST_ROBOT"), variable("USERS_TEST_FOLDER"))
    else {
        return;
    };
    match role.as_str() {
        "owner" => own(&robot, Path::new(&folder)),
        _ => std::fs::write(Path::new(&folder).join(&role), intrude(&robot, Path::new(&folder))).unwrap(),
    }
}

/// Runs a robot until the folder is removed.
fn own(robot: &str, folder: &Path) {
    let bus = Bus::ipc(robot).unwrap();
    let spec = TopicSpec { publishers: 4, notification: Notification::On, ..TopicSpec::default() };
    bus.create::<MotorCommand>(COMMAND, &spec).unwrap();
    bus.create::<Proposal>(PROPOSAL, &spec).unwrap();
    let commands = bus.publisher::<MotorCommand>(COMMAND).unwrap();
    let _proposals = bus.subscriber::<Proposal>(PROPOSAL).unwrap();
    let _wait_set = bus.wait_set(&[PROPOSAL]).unwrap();
    commands.publish(&MotorCommand::default(), &[]).unwrap();
    let (root, prefix) = bus.files().unwrap();
    std::fs::write(folder.join("files.part"), format!("{}\n{prefix}", root.display())).unwrap();
    std::fs::rename(folder.join("files.part"), folder.join("files")).unwrap();
    let begun = Instant::now();
    while folder.exists() && begun.elapsed() < TIMEOUT {
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Attempts every access. Returns those that succeeded, one per line.
fn intrude(robot: &str, folder: &Path) -> String {
    let files = std::fs::read_to_string(folder.join("files")).unwrap();
    let (root, prefix) = files.split_once('\n').unwrap();
    let mut successes = Vec::new();
    let mut note = |success: bool, access: String| successes.extend(success.then_some(access));
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
    // Like a plugin of the same robot.
    match Bus::join(robot) {
        Ok(bus) => {
            note(bus.subscriber::<MotorCommand>(COMMAND).is_ok(), "subscribed to commands".into());
            let proposals = bus.publisher::<Proposal>(PROPOSAL);
            let published = proposals.is_ok_and(|port| port.publish(&Proposal::default(), &[]).is_ok());
            note(published, "published a proposal".into());
        }
        Err(error) => note(false, error.to_string()),
    }
    successes.join("\n")
}

/// Runtime folder of both users, with a copy of this test that both may run.
struct SharedFolder(PathBuf);

impl SharedFolder {
    fn new() -> SharedFolder {
        let folder = std::env::temp_dir().join(format!("yb-users-{}", std::process::id()));
        std::fs::create_dir_all(folder.join("results")).unwrap();
        let open = |path: &Path, mode| {
            std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
        };
        open(&folder, 0o755);
        open(&folder.join("results"), 0o777);
        std::fs::copy(std::env::current_exe().unwrap(), folder.join("test")).unwrap();
        open(&folder.join("test"), 0o755);
        SharedFolder(folder)
    }

    fn results(&self) -> PathBuf {
        self.0.join("results")
    }

    fn child(&self, role: &str, user: Option<u32>) -> Command {
        let mut command = Command::new(self.0.join("test"));
        command.args(["bus_users::child", "--exact"]).stdout(Stdio::null()).current_dir("/");
        command.env("USERS_TEST_ROLE", role).env("USERS_TEST_FOLDER", self.results());
        command.env("USERS_TEST_ROBOT", "users").env("XDG_RUNTIME_DIR", &self.0);
        if let Some(user) = user {
            command.uid(user).gid(user).env("HOME", "/nonexistent");
        }
        command
    }

    /// Returns the successful accesses of an intruder.
    fn intrude(&self, role: &str, user: Option<u32>) -> String {
        assert!(self.child(role, user).status().unwrap().success());
        std::fs::read_to_string(self.results().join(role)).unwrap()
    }
}

impl Drop for SharedFolder {
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
    let shared = SharedFolder::new();
    let mut owner = shared.child("owner", None).spawn().unwrap();
    let begun = Instant::now();
    while !shared.results().join("files").exists() {
        assert!(begun.elapsed() < TIMEOUT && owner.try_wait().unwrap().is_none(), "no robot");
        std::thread::sleep(Duration::from_millis(20));
    }
    // Every attempt succeeds for the same user, so the attempts are valid.
    let own = shared.intrude("same-user", None);
    for access in ["listed", "planted", "read", "wrote", "subscribed to commands", "published a proposal"] {
        assert!(own.contains(access), "successes of the same user: {own}");
    }
    let successes = shared.intrude("nobody", Some(NOBODY));
    assert_eq!(successes, "", "accesses of user {NOBODY}");
    std::fs::remove_dir_all(shared.results()).unwrap();
    assert!(owner.wait().unwrap().success());
}
