//! Requests to the operating system's scheduler: real-time priority, niceness, CPU affinity.

use std::fmt;

use rustix::process::{Resource, getrlimit, setpriority_process};
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

use crate::bus::set_fifo_priority;

/// Scheduling that a plugin or the arbiter requests; by default that of its parent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Scheduling {
    /// Priority under SCHED_FIFO, 1 to 99: preempts every thread that is not real-time.
    pub fifo: Option<u8>,
    /// Niceness, -20 to 19; a lower one gets more computing time.
    pub nice: Option<i8>,
    /// CPUs that it may run on, one bit each, CPU 0 the lowest; zero for all.
    pub affinity: u128,
}

/// Refusal of a scheduling request by the operating system. The robot runs without it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SchedulingError {
    /// Real-time priority is not permitted.
    #[error(
        "the system refuses SCHED_FIFO {requested} ({problem}; RLIMIT_RTPRIO is {limit}): raise the limit \
         (`ulimit -r`, or `rtprio` in /etc/security/limits.conf) or give the program CAP_SYS_NICE \
         (`setcap cap_sys_nice+ep`)"
    )]
    Fifo {
        /// Requested priority.
        requested: u8,
        /// Current RLIMIT_RTPRIO.
        limit: u64,
        /// Reason given by the operating system.
        problem: String,
    },
    /// The niceness is not permitted.
    #[error(
        "the system refuses nice {requested} ({problem}; RLIMIT_NICE is {limit}, which allows down to {}): \
         raise the limit (`ulimit -e`, or `nice` in /etc/security/limits.conf) or give the program CAP_SYS_NICE \
         (`setcap cap_sys_nice+ep`)",
        20_i64.saturating_sub_unsigned(*.limit)
    )]
    Nice {
        /// Requested niceness.
        requested: i8,
        /// Current RLIMIT_NICE: 20 less the lowest niceness allowed.
        limit: u64,
        /// Reason given by the operating system.
        problem: String,
    },
    /// The CPUs are not available.
    #[error("the system refuses the CPUs {requested} ({problem}): this process may run on {available}")]
    Affinity {
        /// Requested CPUs.
        requested: CpuList,
        /// Available CPUs.
        available: CpuList,
        /// Reason given by the operating system.
        problem: String,
    },
}

/// Set of CPUs, one bit each; shown as a list of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CpuList(pub u128);

impl Scheduling {
    /// Scheduling of a program that must not slow a robot on the same machine: niceness 10.
    pub const BACKGROUND: Scheduling = Scheduling { fifo: None, nice: Some(10), affinity: 0 };

    /// Applies every request to the calling thread, and to threads that it starts from now on. Returns those that the
    /// system refused.
    pub fn apply(&self) -> Vec<SchedulingError> {
        let applied = [self.apply_affinity(), self.apply_niceness(), self.apply_priority()];
        applied.into_iter().filter_map(Result::err).collect()
    }

    fn apply_affinity(&self) -> Result<(), SchedulingError> {
        if self.affinity == 0 {
            return Ok(());
        }
        let mut set = CpuSet::new();
        numbers(self.affinity).for_each(|number| set.set(number));
        sched_setaffinity(None, &set).map_err(|error| SchedulingError::Affinity {
            requested: CpuList(self.affinity),
            available: available(),
            problem: error.to_string(),
        })
    }

    fn apply_niceness(&self) -> Result<(), SchedulingError> {
        let Some(requested) = self.nice else { return Ok(()) };
        let limit = getrlimit(Resource::Nice).current.unwrap_or(u64::MAX);
        setpriority_process(None, i32::from(requested)).map_err(|error| SchedulingError::Nice {
            requested,
            limit,
            problem: error.to_string(),
        })
    }

    fn apply_priority(&self) -> Result<(), SchedulingError> {
        let Some(requested) = self.fifo else { return Ok(()) };
        let limit = getrlimit(Resource::Rtprio).current.unwrap_or(u64::MAX);
        set_fifo_priority(requested).map_err(|error| SchedulingError::Fifo {
            requested,
            limit,
            problem: error.to_string(),
        })
    }
}

/// Command-line argument that [`parse`](str::parse) reads, such as `fifo=50,nice=-5,affinity=3`; empty without a
/// request.
impl fmt::Display for Scheduling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let fifo = self.fifo.map(|fifo| format!("fifo={fifo}"));
        let nice = self.nice.map(|nice| format!("nice={nice}"));
        let affinity = (self.affinity != 0).then(|| format!("affinity={}", self.affinity));
        let all: Vec<String> = [fifo, nice, affinity].into_iter().flatten().collect();
        f.write_str(&all.join(","))
    }
}

impl std::str::FromStr for Scheduling {
    type Err = String;

    fn from_str(text: &str) -> Result<Scheduling, String> {
        let mut scheduling = Scheduling::default();
        for part in text.split(',').filter(|part| !part.is_empty()) {
            let (key, value) =
                part.split_once('=').ok_or_else(|| format!("`{part}` must have the form key=value"))?;
            let wrong = |_| format!("`{value}` is not a valid {key}");
            match key {
                "fifo" => scheduling.fifo = Some(value.parse().map_err(wrong)?),
                "nice" => scheduling.nice = Some(value.parse().map_err(wrong)?),
                "affinity" => scheduling.affinity = value.parse().map_err(wrong)?,
                _ => return Err(format!("unknown key `{key}`: use fifo, nice or affinity")),
            }
        }
        Ok(scheduling)
    }
}

impl fmt::Display for CpuList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let all: Vec<String> = numbers(self.0).map(|number| number.to_string()).collect();
        f.write_str(&all.join(", "))
    }
}

fn available() -> CpuList {
    let set = sched_getaffinity(None).unwrap_or_else(|_| CpuSet::new());
    CpuList((0..u128::BITS as usize).filter(|&number| set.is_set(number)).fold(0, |all, n| all | 1 << n))
}

fn numbers(set: u128) -> impl Iterator<Item = usize> {
    (0..u128::BITS as usize).filter(move |number| set & (1 << number) != 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_survives_as_text() {
        for scheduling in [
            Scheduling::default(),
            Scheduling { fifo: Some(50), nice: Some(-5), affinity: 0b101 },
            Scheduling { affinity: u128::MAX, ..Scheduling::default() },
        ] {
            assert_eq!(scheduling.to_string().parse(), Ok(scheduling));
        }
        assert!("fifo=many".parse::<Scheduling>().is_err() && "high=1".parse::<Scheduling>().is_err());
    }

    #[test]
    fn affinity_and_niceness_apply_to_the_calling_thread_only() {
        let before = available();
        let one = 1 << before.0.trailing_zeros();
        let request = Scheduling { nice: Some(7), affinity: one, ..Scheduling::default() };
        let seen = std::thread::spawn(move || {
            let refused = request.apply();
            (refused, available(), rustix::process::getpriority_process(None).ok())
        });
        assert_eq!(seen.join().unwrap(), (Vec::new(), CpuList(one), Some(7)));
        assert_eq!(available(), before, "another thread is not affected");
    }

    #[test]
    fn a_refusal_names_the_remedy() {
        let missing = 1 << 127;
        let refused =
            std::thread::spawn(move || Scheduling { affinity: missing, ..Scheduling::default() }.apply());
        let text = refused.join().unwrap()[0].to_string();
        assert!(text.contains("CPUs 127") && text.contains(&available().to_string()), "{text}");
        let fifo = SchedulingError::Fifo { requested: 50, limit: 0, problem: "no".into() }.to_string();
        assert!(["RLIMIT_RTPRIO is 0", "CAP_SYS_NICE", "ulimit -r"].iter().all(|part| fifo.contains(part)));
        let nice = SchedulingError::Nice { requested: -5, limit: 15, problem: "no".into() }.to_string();
        assert!(nice.contains("allows down to 5"), "{nice}");
    }
}
