//! What a task asks of the system's scheduler reaches every process, and what the system refuses is told.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

#[allow(dead_code, reason = "shared with the tests of chaos, which ask for more")]
#[path = "chaos/robot.rs"]
mod robot;

use std::path::Path;

use robot::{PATIENCE, Robot};

/// Of a thread: its policy, real-time priority, niceness, and the processors that it may run on.
#[derive(Debug, PartialEq)]
struct Scheduled {
    policy: u32,
    priority: u32,
    nice: i32,
    processors: String,
}

const SCHED_OTHER: u32 = 0;
const SCHED_FIFO: u32 = 1;

fn scheduled(folder: &Path) -> Scheduled {
    let stat = std::fs::read_to_string(folder.join("stat")).unwrap();
    // Behind the name in brackets, from the third field on.
    let fields: Vec<&str> = stat[stat.rfind(')').unwrap() + 2..].split_whitespace().collect();
    let status = std::fs::read_to_string(folder.join("status")).unwrap();
    let processors = status.lines().find_map(|line| line.strip_prefix("Cpus_allowed_list:")).unwrap();
    Scheduled {
        policy: fields[41 - 3].parse().unwrap(),
        priority: fields[40 - 3].parse().unwrap(),
        nice: fields[19 - 3].parse().unwrap(),
        processors: processors.trim().to_owned(),
    }
}

fn process(pid: u32) -> std::path::PathBuf {
    Path::new("/proc").join(pid.to_string())
}

/// The thread of this name in a process.
fn thread(pid: u32, name: &str) -> std::path::PathBuf {
    let mut threads =
        std::fs::read_dir(process(pid).join("task")).unwrap().map(|entry| entry.unwrap().path());
    threads.find(|path| std::fs::read_to_string(path.join("comm")).unwrap().trim() == name).unwrap()
}

/// Whether the system lets this user have real-time priorities.
fn may_be_real_time() -> bool {
    let tried = std::thread::spawn(|| {
        yamabico_host::Scheduling { fifo: Some(20), ..Default::default() }.apply().is_empty()
    });
    tried.join().unwrap()
}

#[test]
fn what_a_task_asks_for_is_what_its_processes_get() {
    let own = scheduled(&process(std::process::id()));
    // Lowering it may be forbidden, so each asks for more than it has by itself.
    let more = |by: i32| (own.nice + by).min(19);
    let first = own.processors.split(['-', ',']).next().unwrap();
    let name = format!("scheduling-{}", std::process::id());
    let set = [
        &format!("arbiter.scheduling={{ fifo = 20, nice = {} }}", more(1)),
        "behaviors.sonar-halt.scheduling={ fifo = 10 }",
        &format!("behaviors.map-localizer.scheduling={{ nice = {}, affinity = [{first}] }}", more(7)),
        "behaviors.wall-follower.scheduling={ affinity = [127] }",
        &format!("robot.devices.sim.scheduling={{ nice = {} }}", more(3)),
    ];
    let program = Path::new(env!("CARGO_BIN_EXE_yamabico"));
    let mut robot = Robot::start(program, "hallway.toml", &name, 5, &set);
    let is_up = |robot: &Robot, plugin: &&str| robot.process_of(plugin).is_some();
    let plugins = ["map-localizer", "sim", "wall-follower", "sonar-halt"];
    assert!(robot.watch_until(PATIENCE, |robot| plugins.iter().all(|plugin| is_up(robot, plugin))));
    let of = |plugin: &str| scheduled(&process(robot.process_of(plugin).unwrap()));
    let localizer = of("map-localizer");
    assert_eq!((localizer.nice, localizer.processors.as_str()), (more(7), first));
    assert_eq!((of("sim").nice, of("wall-follower").nice), (more(3), own.nice));
    let arbiter = scheduled(&thread(robot.supervisor(), "arbiter"));
    assert_eq!(arbiter.nice, more(1));
    assert_eq!(
        scheduled(&process(robot.supervisor())).nice,
        own.nice,
        "only the arbiter's thread is the arbiter"
    );
    let real_time = |told: Scheduled| (told.policy, told.priority);
    let halt = of("sonar-halt");
    let said = String::from_utf8(robot.interrupt().stderr).unwrap();
    assert!(
        said.contains("`wall-follower` runs on although the system refuses the processors 127"),
        "{said}"
    );
    if may_be_real_time() {
        assert_eq!((real_time(arbiter), real_time(halt)), ((SCHED_FIFO, 20), (SCHED_FIFO, 10)));
    } else {
        println!("this user may have no real-time priority: only the refusal was tested");
        assert_eq!((real_time(arbiter), real_time(halt)), ((SCHED_OTHER, 0), (SCHED_OTHER, 0)));
        assert!(said.contains("`arbiter` runs on although the system refuses SCHED_FIFO 20"), "{said}");
        assert!(said.contains("`sonar-halt` runs on") && said.contains("RLIMIT_RTPRIO"), "{said}");
    }
}
