//! Processes killed and stopped at random times, and the recovery of the robot.

use std::time::{Duration, Instant};

use yamabico_core::time::Time;

use crate::robot::{BareTimer, Lateness, LiveRobot, Resources, signal};

/// Period of the decisions of the hallway task.
pub const PERIOD: Duration = Duration::from_millis(20);
/// Behaviors of the hallway task that are killed.
pub const VICTIMS: [&str; 4] =
    ["sonar-halt", "stationary-obstacle-avoider", "map-localizer", "wall-follower"];
/// Time after the last death within which stale files of the transport are removed.
const SETTLING: Duration = Duration::from_secs(3);
/// Timeout for the restart of a killed plugin.
const RESTART_TIMEOUT: Duration = Duration::from_secs(20);

/// Statistics of a campaign.
#[derive(Debug, Default)]
pub struct Campaign {
    /// Number of killed processes.
    pub kills: usize,
    /// Number of processes killed during their startup.
    pub kills_during_startup: usize,
    /// Killed plugin, and time from its (last) death to the first heartbeat after it.
    pub recoveries: Vec<(&'static str, Duration)>,
    /// Plugins that were not restarted in time.
    pub not_recovered: Vec<String>,
    /// Time from each stop of a process to its replacement.
    pub hang_durations: Vec<Duration>,
    /// Lateness of the commands.
    pub lateness: Lateness,
    /// Lateness of a thread that only sleeps, in the same time.
    pub timer_lateness: Lateness,
}

/// Random numbers (xorshift) with their state.
pub struct Random(pub u64);

impl Random {
    /// Draws a number from 0 to 1.
    pub fn fraction(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn millis(&mut self, from: f64, to: f64) -> Duration {
        Duration::from_secs_f64((from + (to - from) * self.fraction()) * 1e-3)
    }
}

impl Campaign {
    /// Kills `kills` processes of a running robot at random times, one in five of them during startup.
    pub fn kill(&mut self, robot: &mut LiveRobot, kills: usize, random: &mut Random) {
        let (from, timer) = (Time::monotonic_now(), BareTimer::start(PERIOD));
        let end = self.kills + kills;
        while self.kills < end && robot.is_running() {
            robot.observe(random.millis(150.0, 900.0));
            let victim = VICTIMS[(random.fraction() * 4.0) as usize % 4];
            let Some(pid) = robot.process_of(victim) else { continue };
            let starts = robot.heartbeats.get(victim).map_or(0, |beat| beat.restarts);
            let mut died = Time::monotonic_now();
            signal(pid, "KILL");
            self.kills += 1;
            while self.kills < end && random.fraction() < 0.2 {
                let wait = random.millis(0.0, 40.0);
                let Some(successor) = new_process(robot, victim, pid) else { break };
                robot.observe(wait);
                died = Time::monotonic_now();
                signal(successor, "KILL");
                (self.kills, self.kills_during_startup) = (self.kills + 1, self.kills_during_startup + 1);
                robot.observe(Duration::from_millis(5));
            }
            let is_back = |robot: &LiveRobot| {
                robot
                    .heartbeats
                    .get(victim)
                    .is_some_and(|beat| beat.restarts > starts && beat.stamp_ns > died.0)
            };
            if robot.wait_until(RESTART_TIMEOUT, is_back) {
                self.recoveries.push((victim, Time(robot.heartbeats[victim].stamp_ns).since(died)));
            } else {
                self.not_recovered.push(victim.to_owned());
            }
        }
        self.lateness = self.lateness.merge(robot.lateness(from, PERIOD));
        self.timer_lateness = self.timer_lateness.merge(timer.stop());
    }

    /// Kills each behavior once, waits, and returns the resources of the robot, which must not change from then on. A process that ran
    /// from the start holds slightly more, since it waited for the first command.
    pub fn kill_each_once(&mut self, robot: &mut LiveRobot) -> Resources {
        for victim in VICTIMS {
            signal(robot.process_of(victim).expect("the plugin runs"), "KILL");
            self.kills += 1;
            if !robot.wait_until(RESTART_TIMEOUT, |robot| robot.heartbeats[victim].restarts > 0) {
                self.not_recovered.push(victim.to_owned());
            }
        }
        let mut holdings = robot.resources();
        loop {
            robot.observe(SETTLING);
            let before = std::mem::replace(&mut holdings, robot.resources());
            if before == holdings || !robot.is_running() {
                return holdings;
            }
        }
    }

    /// Stops a process as if it hung and waits for its replacement; returns the time from its last heartbeat until it was seen dead.
    pub fn hang(&mut self, robot: &mut LiveRobot, victim: &str) -> Duration {
        let pid = robot.process_of(victim).expect("the plugin runs");
        let starts = robot.heartbeats[victim].restarts;
        let begun = Instant::now();
        signal(pid, "STOP");
        let (mut last_heartbeat, mut lived) = (Time::ZERO, Duration::ZERO);
        let has_ended = |robot: &LiveRobot| {
            let newest = &robot.heartbeats[victim];
            if newest.restarts == starts {
                last_heartbeat = Time(newest.stamp_ns);
            }
            let is_gone = robot.process_of(victim).is_none_or(|now| now != pid);
            // Read afterwards: a time from before the look would be too short by the wait for a processor.
            lived = Time::monotonic_now().since(last_heartbeat);
            is_gone
        };
        if robot.wait_until(RESTART_TIMEOUT, has_ended) {
            self.hang_durations.push(begun.elapsed());
        } else {
            self.not_recovered.push(victim.to_owned());
        }
        if !robot.wait_until(RESTART_TIMEOUT, |robot| robot.heartbeats[victim].restarts > starts) {
            self.not_recovered.push(victim.to_owned());
        }
        lived
    }
}

impl Campaign {
    /// Returns the recovery times of the selected plugins.
    pub fn recovery_times(&self, is_selected: impl Fn(&str) -> bool) -> Vec<Duration> {
        self.recoveries.iter().filter(|(victim, _)| is_selected(victim)).map(|(_, back)| *back).collect()
    }
}

/// Waits for the process that replaces `old`.
fn new_process(robot: &mut LiveRobot, victim: &str, old: u32) -> Option<u32> {
    let mut found = None;
    robot.wait_until(Duration::from_secs(2), |robot| {
        found = robot.process_of(victim).filter(|&pid| pid != old);
        found.is_some()
    });
    found
}

/// Returns the smallest time that is not exceeded by `share`, 0 to 1, of the times; zero without times.
pub fn quantile(times: &[Duration], share: f64) -> Duration {
    let mut sorted = times.to_vec();
    sorted.sort_unstable();
    let rank = (share * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.max(1) - 1).copied().unwrap_or_default()
}
