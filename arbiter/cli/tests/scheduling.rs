//! Scheduling settings of a task reach every process, and refused ones are reported.

use std::path::Path;

use yamabico_live_robot::robot::{LiveRobot, TIMEOUT};

/// Scheduling of a thread: policy, real-time priority, niceness, and the processors it may run on.
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
    // The third field is the first one after the name in brackets.
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

/// Returns true if this user may use real-time priorities.
fn may_be_real_time() -> bool {
    let tried = std::thread::spawn(|| {
        yamabico_host::Scheduling { fifo: Some(20), ..Default::default() }.apply().is_empty()
    });
    tried.join().unwrap()
}

#[test]
fn processes_get_the_scheduling_of_the_task() {
    let own = scheduled(&process(std::process::id()));
    // Only raising the niceness is always allowed.
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
    let program = crate::program::binary();
    let mut robot = LiveRobot::start(program, "hallway.toml", &name, 5, &set);
    let is_up = |robot: &LiveRobot, plugin: &&str| robot.process_of(plugin).is_some();
    let plugins = ["map-localizer", "sim", "wall-follower", "sonar-halt"];
    assert!(robot.wait_until(TIMEOUT, |robot| plugins.iter().all(|plugin| is_up(robot, plugin))));
    let of = |plugin: &str| scheduled(&process(robot.process_of(plugin).unwrap()));
    let localizer = of("map-localizer");
    assert_eq!((localizer.nice, localizer.processors.as_str()), (more(7), first));
    assert_eq!((of("sim").nice, of("wall-follower").nice), (more(3), own.nice));
    let arbiter = scheduled(&thread(robot.supervisor(), "arbiter"));
    assert_eq!(arbiter.nice, more(1));
    assert_eq!(
        scheduled(&process(robot.supervisor())).nice,
        own.nice,
        "only the thread of the arbiter is changed"
    );
    let real_time = |thread: Scheduled| (thread.policy, thread.priority);
    let halt = of("sonar-halt");
    let log = String::from_utf8(robot.interrupt().stderr).unwrap();
    assert!(log.contains("`wall-follower` runs on although the system refuses the CPUs 127"), "{log}");
    if may_be_real_time() {
        assert_eq!((real_time(arbiter), real_time(halt)), ((SCHED_FIFO, 20), (SCHED_FIFO, 10)));
    } else {
        println!("real-time priorities are not permitted here: only the refusal was tested");
        assert_eq!((real_time(arbiter), real_time(halt)), ((SCHED_OTHER, 0), (SCHED_OTHER, 0)));
        assert!(log.contains("`arbiter` runs on although the system refuses SCHED_FIFO 20"), "{log}");
        assert!(log.contains("`sonar-halt` runs on") && log.contains("RLIMIT_RTPRIO"), "{log}");
    }
}
