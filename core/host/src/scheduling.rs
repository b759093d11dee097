//! What the system's scheduler is asked for: real-time priority, niceness, processors.

use std::fmt;

use rustix::process::{Resource, getrlimit, setpriority_process};
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

use crate::bus::run_first_come_first_served;

/// What a plugin or the arbiter asks of the system's scheduler; nothing by default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Scheduling {
    /// SCHED_FIFO with this priority, 1 to 99: it goes before everything that is not real-time.
    pub fifo: Option<u8>,
    /// Niceness, -20 to 19: lower gets more.
    pub nice: Option<i8>,
    /// The processors that it may run on, a bit each, the first lowest; zero for all.
    pub processors: u128,
}

/// What the system does not allow, and the remedy. The robot runs on without it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotScheduled {
    /// No real-time priority.
    #[error(
        "the system refuses SCHED_FIFO {asked} ({problem}; RLIMIT_RTPRIO is {limit}): raise the limit (`ulimit -r`, or \
         `rtprio` in /etc/security/limits.conf) or give the program CAP_SYS_NICE (`setcap cap_sys_nice+ep`)"
    )]
    Fifo {
        /// The priority.
        asked: u8,
        /// The limit in force.
        limit: u64,
        /// What the system said.
        problem: String,
    },
    /// Not so low a niceness.
    #[error(
        "the system refuses nice {asked} ({problem}; RLIMIT_NICE is {limit}, which allows down to {}): raise the limit \
         (`ulimit -e`, or `nice` in /etc/security/limits.conf) or give the program CAP_SYS_NICE (`setcap cap_sys_nice+ep`)",
        20_i64.saturating_sub_unsigned(*.limit)
    )]
    Nice {
        /// The niceness.
        asked: i8,
        /// The limit in force: 20 less the lowest niceness.
        limit: u64,
        /// What the system said.
        problem: String,
    },
    /// Not these processors.
    #[error("the system refuses the processors {asked} ({problem}): this process may run on {there}")]
    Processors {
        /// Those asked for.
        asked: Processors,
        /// Those that may be had.
        there: Processors,
        /// What the system said.
        problem: String,
    },
}

/// A set of processors, as a list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Processors(pub u128);

impl Scheduling {
    /// Asks the system for all of it, for the calling thread and those that it starts from now on; what it refused.
    pub fn apply(&self) -> Vec<NotScheduled> {
        let asked = [self.take_processors(), self.take_niceness(), self.take_priority()];
        asked.into_iter().filter_map(Result::err).collect()
    }

    fn take_processors(&self) -> Result<(), NotScheduled> {
        if self.processors == 0 {
            return Ok(());
        }
        let mut set = CpuSet::new();
        numbers(self.processors).for_each(|number| set.set(number));
        sched_setaffinity(None, &set).map_err(|error| NotScheduled::Processors {
            asked: Processors(self.processors),
            there: available(),
            problem: error.to_string(),
        })
    }

    fn take_niceness(&self) -> Result<(), NotScheduled> {
        let Some(asked) = self.nice else { return Ok(()) };
        let limit = getrlimit(Resource::Nice).current.unwrap_or(u64::MAX);
        setpriority_process(None, i32::from(asked)).map_err(|error| NotScheduled::Nice {
            asked,
            limit,
            problem: error.to_string(),
        })
    }

    fn take_priority(&self) -> Result<(), NotScheduled> {
        let Some(asked) = self.fifo else { return Ok(()) };
        let limit = getrlimit(Resource::Rtprio).current.unwrap_or(u64::MAX);
        run_first_come_first_served(asked).map_err(|error| NotScheduled::Fifo {
            asked,
            limit,
            problem: error.to_string(),
        })
    }
}

/// As arguments of a program that [`parse`](str::parse) understands again: `fifo=50,nice=-5,processors=3`; empty where
/// nothing is asked for.
impl fmt::Display for Scheduling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let fifo = self.fifo.map(|fifo| format!("fifo={fifo}"));
        let nice = self.nice.map(|nice| format!("nice={nice}"));
        let processors = (self.processors != 0).then(|| format!("processors={}", self.processors));
        let all: Vec<String> = [fifo, nice, processors].into_iter().flatten().collect();
        f.write_str(&all.join(","))
    }
}

impl std::str::FromStr for Scheduling {
    type Err = String;

    fn from_str(text: &str) -> Result<Scheduling, String> {
        let mut scheduling = Scheduling::default();
        for part in text.split(',').filter(|part| !part.is_empty()) {
            let (key, value) = part.split_once('=').ok_or_else(|| format!("`{part}` is no key=value"))?;
            let wrong = |_| format!("`{value}` is no {key}");
            match key {
                "fifo" => scheduling.fifo = Some(value.parse().map_err(wrong)?),
                "nice" => scheduling.nice = Some(value.parse().map_err(wrong)?),
                "processors" => scheduling.processors = value.parse().map_err(wrong)?,
                _ => return Err(format!("there is no `{key}`: fifo, nice, processors")),
            }
        }
        Ok(scheduling)
    }
}

impl fmt::Display for Processors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let all: Vec<String> = numbers(self.0).map(|number| number.to_string()).collect();
        f.write_str(&all.join(", "))
    }
}

fn available() -> Processors {
    let set = sched_getaffinity(None).unwrap_or_else(|_| CpuSet::new());
    Processors((0..u128::BITS as usize).filter(|&number| set.is_set(number)).fold(0, |all, n| all | 1 << n))
}

fn numbers(set: u128) -> impl Iterator<Item = usize> {
    (0..u128::BITS as usize).filter(move |number| set & (1 << number) != 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_asked_for_crosses_as_text() {
        for scheduling in [
            Scheduling::default(),
            Scheduling { fifo: Some(50), nice: Some(-5), processors: 0b101 },
            Scheduling { processors: u128::MAX, ..Scheduling::default() },
        ] {
            assert_eq!(scheduling.to_string().parse(), Ok(scheduling));
        }
        assert!("fifo=many".parse::<Scheduling>().is_err() && "high=1".parse::<Scheduling>().is_err());
    }

    #[test]
    fn processors_and_niceness_are_those_of_the_thread_that_asks() {
        let before = available();
        let one = 1 << before.0.trailing_zeros();
        let asked = Scheduling { nice: Some(7), processors: one, ..Scheduling::default() };
        let seen = std::thread::spawn(move || {
            let refused = asked.apply();
            (refused, available(), rustix::process::getpriority_process(None).ok())
        });
        assert_eq!(seen.join().unwrap(), (Vec::new(), Processors(one), Some(7)));
        assert_eq!(available(), before, "another thread goes on as before");
    }

    #[test]
    fn what_the_system_refuses_is_told_with_the_remedy() {
        let missing = 1 << 127;
        let refused =
            std::thread::spawn(move || Scheduling { processors: missing, ..Scheduling::default() }.apply());
        let words = refused.join().unwrap()[0].to_string();
        assert!(words.contains("processors 127") && words.contains(&available().to_string()), "{words}");
        let fifo = NotScheduled::Fifo { asked: 50, limit: 0, problem: "no".into() }.to_string();
        assert!(["RLIMIT_RTPRIO is 0", "CAP_SYS_NICE", "ulimit -r"].iter().all(|word| fifo.contains(word)));
        let nice = NotScheduled::Nice { asked: -5, limit: 15, problem: "no".into() }.to_string();
        assert!(nice.contains("allows down to 5"), "{nice}");
    }
}
