//! A process that hangs is killed; one that computes for long or waits for a processor is not.

use std::time::Duration;

use yamabico_core::message::PluginState;
use yamabico_core::time::Time;
use yamabico_host::Scheduling;
use yamabico_live_robot::campaign::PERIOD;
use yamabico_live_robot::laggard::{Hang, LAGGARD, LaggardRobot, write_task};
use yamabico_live_robot::load::{Load, Probe};
use yamabico_live_robot::robot::{BareTimer, TIMEOUT};

use crate::program::{assert_exit, binary, example, text, yamabico};

const DEADLINE: Duration = Duration::from_millis(400);

fn start(test: &str, keys: &str) -> LaggardRobot {
    let name = format!("{test}-{}", std::process::id());
    LaggardRobot::start(binary(), &example("laggard_program"), &name, keys)
}

#[test]
fn a_process_that_sleeps_or_loops_for_ever_is_killed_within_its_deadline_and_half() {
    let mut robot = start("laggard-hangs", &format!("deadline_ms = {}", DEADLINE.as_millis()));
    for hang in [Hang::Sleep, Hang::Loop] {
        // A short life would count as a crash loop.
        robot.robot.observe(Duration::from_secs(1));
        let (timer, probe) = (BareTimer::start(PERIOD), Probe::start());
        let end = robot.hang(hang).expect("a restart");
        let (late, share) = (timer.stop().max, probe.stop());
        println!(
            "{hang:?}: {end:?}; a bare timer was {late:?} late, a busy thread got {share:.2} of a processor"
        );
        let (earliest, expected) = match hang {
            Hang::Sleep => (DEADLINE * 7 / 8, "without a heartbeat"),
            Hang::Loop => (DEADLINE * 5 / 4, "without a heartbeat, computing"),
        };
        // Only a loop that has to share its processor has longer.
        let latest = match hang {
            Hang::Sleep => DEADLINE * 3 / 2,
            Hang::Loop => (DEADLINE * 3 / 2).div_f64(share.max(0.1)),
        };
        // The supervisor counts from the arrival of the heartbeat.
        assert!(end.silent >= earliest && end.silent < latest + 4 * late, "{end:?}, {share:.2}, {late:?}");
        assert!(end.cause.starts_with("was killed after") && end.cause.ends_with(expected), "{end:?}");
    }
    let ended = robot.interrupt();
    assert!(text(&ended).contains("computing, "), "{}", text(&ended));
}

#[test]
fn a_process_that_waits_for_a_processor_is_not_killed() {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let processors = status.lines().find_map(|line| line.strip_prefix("Cpus_allowed_list:")).unwrap();
    let processor: u8 = processors.trim().rsplit(['-', ',']).next().unwrap().parse().unwrap();
    if std::fs::read_to_string("/proc/self/schedstat").is_err() {
        println!("skipped: this kernel does not account for threads in /proc");
        return;
    }
    // Beside the load it gets about a tenth of the processor: 150 ms of computing take 1.5 s, or more on a busy machine.
    let nice = (rustix::process::getpriority_process(None).unwrap() + 10).min(19);
    let load = Load::start(1, Scheduling { affinity: 1 << processor, ..Scheduling::default() });
    let keys = format!(
        "deadline_ms = 1000\nperiod_ms = 20\ncompute_ms = 150\nscheduling = {{ nice = {nice}, affinity = [{processor}] }}"
    );
    let mut robot = start("laggard-waits", &keys);
    let (mut last, mut longest, mut silences) = (None, Duration::ZERO, 0);
    let has_been_late = robot.robot.wait_until(TIMEOUT, |robot| {
        let beat = &robot.heartbeats[LAGGARD];
        if beat.state() == Some(PluginState::Running) && last != Some(beat.stamp_ns) {
            let silent = last
                .replace(beat.stamp_ns)
                .map_or(Duration::ZERO, |last| Time(beat.stamp_ns).since(Time(last)));
            longest = longest.max(silent);
            silences += u32::from(silent > Duration::from_millis(1000));
        }
        silences >= 2 || beat.restarts > 0
    });
    let process = robot.process().unwrap();
    println!("{silences} silences above the deadline of 1 s, the longest {longest:?}");
    drop(load);
    let log = text(&robot.interrupt());
    assert!(has_been_late, "it is never late: longest silence {longest:?}");
    assert_eq!((process.restarts, process.ended.as_str()), (0, ""), "{log}");
    assert!(log.contains("`laggard` is late, but not killed yet"), "{log}");
}

#[test]
fn check_measures_calls_and_proposes_deadlines() {
    let name = format!("laggard-measured-{}", std::process::id());
    // The default deadline is 250 ms: such a call exceeds it together with a heartbeat period on a busy machine.
    let task = write_task(&example("laggard_program"), &name, "period_ms = 50\ncompute_ms = 200");
    let check = |arguments: &[&str]| {
        let robot = format!("robot.name={name}");
        yamabico().arg("check").arg(&task).args(["--set", &robot]).args(arguments).output().unwrap()
    };
    let measured = check(&["--measure=3"]);
    assert_exit(&measured, 0, &["has no errors", "sim", "[behaviors.laggard]"]);
    let text = text(&measured);
    let proposed = text.lines().skip_while(|line| !line.contains("[behaviors.laggard]")).nth(1).unwrap();
    let proposed_ms: f64 = proposed.strip_prefix("deadline_ms = ").unwrap().trim().parse().unwrap();
    assert!(proposed_ms >= 1600.0, "{text}");
    assert_exit(
        &check(&["--set", &format!("behaviors.laggard.deadline_ms={proposed_ms}")]),
        0,
        &["has no errors"],
    );
    assert_exit(&check(&["--measure=0"]), 2, &["must be from 1 to 3600 s"]);
    std::fs::remove_file(task).unwrap();
}
