//! Runs as a service of systemd: what the service manager is notified of.

use std::os::unix::net::UnixDatagram;
use std::process::Stdio;

use rustix::process::{Pid, Signal, kill_process};
use yamabico_testkit::config;

use crate::program::{TIMEOUT, TestFolder, yamabico};

#[test]
fn a_service_is_ready_alive_and_stopping() {
    let folder = TestFolder::new("service");
    let socket = UnixDatagram::bind(folder.file("notify")).unwrap();
    socket.set_read_timeout(Some(TIMEOUT)).unwrap();
    let next = || {
        let mut state = [0; 256];
        let length = socket.recv(&mut state).expect("a notification in time");
        String::from_utf8_lossy(&state[..length]).trim().to_owned()
    };

    let mut command = yamabico();
    command
        .args(["run", "--live", "--no-report"])
        .arg(config("hallway.toml"))
        .arg("--out")
        .arg(folder.path());
    command.args(["--set", &format!("robot.name=service-{}", std::process::id())]);
    command.args(["--set", "run.goal.y_m=15", "--set", "run.duration_s=600"]);
    command.env("NOTIFY_SOCKET", folder.file("notify")).env("WATCHDOG_USEC", "300000");
    let mut run = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();

    assert_eq!(next(), "READY=1");
    for _ in 0..5 {
        assert_eq!(next(), "WATCHDOG=1");
    }
    kill_process(Pid::from_child(&run), Signal::TERM).unwrap();
    // The watchdog is fed until the robot stands.
    let after: Vec<String> = std::iter::repeat_with(next).take_while(|state| state != "STOPPING=1").collect();
    assert!(after.iter().all(|state| state == "WATCHDOG=1"), "{after:?}");
    run.wait().unwrap();
}
