//! Kills and hangs at random times, and how the robot takes them.

use std::time::{Duration, Instant};

use yamabico_core::time::Time;

use crate::robot::{BareTimer, Holdings, Lateness, Robot, signal};

/// From one decision of the hallway's task to the next.
pub const PERIOD: Duration = Duration::from_millis(20);
/// The behaviors of the hallway: whoever is killed is one of them.
pub const VICTIMS: [&str; 4] =
    ["sonar-halt", "stationary-obstacle-avoider", "map-localizer", "wall-follower"];
/// After the last death the transport's forgotten files go within this time.
const SETTLING: Duration = Duration::from_secs(3);
/// Longest wait for a plugin that was killed.
const BACK: Duration = Duration::from_secs(20);

/// What came out.
#[derive(Debug, Default)]
pub struct Figures {
    /// Processes that were killed.
    pub kills: usize,
    /// Of them, those that were still coming up.
    pub kills_at_start: usize,
    /// Who died: from each death, or the last one of a row, to the first sign of life after it.
    pub back: Vec<(&'static str, Duration)>,
    /// Plugins that did not come back.
    pub lost: Vec<String>,
    /// From each stop of a process to its death.
    pub noticed: Vec<Duration>,
    /// How much later than their ticks commands came.
    pub late: Lateness,
    /// How much later than its ticks a thread that only sleeps woke, in the same time.
    pub late_bare: Lateness,
}

/// Numbers by chance; xorshift.
pub struct Chance(pub u64);

impl Chance {
    /// From 0 to 1.
    pub fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn millis(&mut self, from: f64, to: f64) -> Duration {
        Duration::from_secs_f64((from + (to - from) * self.next()) * 1e-3)
    }
}

impl Figures {
    /// Kills `kills` processes of a running robot at random times, one in five of them while it comes up.
    pub fn kill(&mut self, robot: &mut Robot, kills: usize, chance: &mut Chance) {
        let (from, timer) = (Time::monotonic_now(), BareTimer::start(PERIOD));
        let end = self.kills + kills;
        while self.kills < end && robot.runs() {
            robot.watch(chance.millis(150.0, 900.0));
            let victim = VICTIMS[(chance.next() * 4.0) as usize % 4];
            let Some(pid) = robot.process_of(victim) else { continue };
            let starts = robot.newest.get(victim).map_or(0, |beat| beat.restarts);
            let mut died = Time::monotonic_now();
            signal(pid, "KILL");
            self.kills += 1;
            while self.kills < end && chance.next() < 0.2 {
                let wait = chance.millis(0.0, 40.0);
                let Some(successor) = new_process(robot, victim, pid) else { break };
                robot.watch(wait);
                died = Time::monotonic_now();
                signal(successor, "KILL");
                (self.kills, self.kills_at_start) = (self.kills + 1, self.kills_at_start + 1);
                robot.watch(Duration::from_millis(5));
            }
            let is_back = |robot: &Robot| {
                robot.newest.get(victim).is_some_and(|beat| beat.restarts > starts && beat.stamp_ns > died.0)
            };
            if robot.watch_until(BACK, is_back) {
                self.back.push((victim, Time(robot.newest[victim].stamp_ns).since(died)));
            } else {
                self.lost.push(victim.to_owned());
            }
        }
        self.late = self.late.and(robot.lateness(from, PERIOD));
        self.late_bare = self.late_bare.and(timer.stop());
    }

    /// Kills every behavior once, and lets the robot settle; what it holds then is what it should hold ever after. A
    /// process that was there from the start holds a little more, for it has waited for the first command.
    pub fn kill_each_once(&mut self, robot: &mut Robot) -> Holdings {
        for victim in VICTIMS {
            signal(robot.process_of(victim).expect("it runs"), "KILL");
            self.kills += 1;
            if !robot.watch_until(BACK, |robot| robot.newest[victim].restarts > 0) {
                self.lost.push(victim.to_owned());
            }
        }
        let mut holdings = robot.holdings();
        loop {
            robot.watch(SETTLING);
            let before = std::mem::replace(&mut holdings, robot.holdings());
            if before == holdings || !robot.runs() {
                return holdings;
            }
        }
    }

    /// Stops a process of a running robot as if it hung, and waits until it has been noticed and replaced; how long it
    /// lived from its last sign of life on, at least.
    pub fn hang(&mut self, robot: &mut Robot, victim: &str) -> Duration {
        let pid = robot.process_of(victim).expect("it runs");
        let starts = robot.newest[victim].restarts;
        let begun = Instant::now();
        signal(pid, "STOP");
        let (mut last_sign, mut lived) = (Time::ZERO, Duration::ZERO);
        let is_gone = |robot: &Robot| {
            let newest = &robot.newest[victim];
            if newest.restarts == starts {
                last_sign = Time(newest.stamp_ns);
            }
            lived = Time::monotonic_now().since(last_sign);
            robot.process_of(victim).is_none_or(|now| now != pid)
        };
        if robot.watch_until(BACK, is_gone) {
            self.noticed.push(begun.elapsed());
        } else {
            self.lost.push(victim.to_owned());
        }
        if !robot.watch_until(BACK, |robot| robot.newest[victim].restarts > starts) {
            self.lost.push(victim.to_owned());
        }
        lived
    }
}

impl Figures {
    /// How soon those of whom `is_meant` were back.
    pub fn back_of(&self, is_meant: impl Fn(&str) -> bool) -> Vec<Duration> {
        self.back.iter().filter(|(victim, _)| is_meant(victim)).map(|(_, back)| *back).collect()
    }
}

/// The process that followed `old`, as soon as it is there.
fn new_process(robot: &mut Robot, victim: &str, old: u32) -> Option<u32> {
    let mut found = None;
    robot.watch_until(Duration::from_secs(2), |robot| {
        found = robot.process_of(victim).filter(|&pid| pid != old);
        found.is_some()
    });
    found
}

/// The time that the share `quantile` of `times` does not exceed; zero of none.
pub fn quantile(times: &[Duration], quantile: f64) -> Duration {
    let mut sorted = times.to_vec();
    sorted.sort_unstable();
    let rank = (quantile * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.max(1) - 1).copied().unwrap_or_default()
}
