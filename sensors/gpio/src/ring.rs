//! Ring of sonars that fire one at a time.

use std::io;
use std::time::Duration;

use yamabico_core::message::{Beam, NO_ECHO, RangeScanHeader};
use yamabico_core::time::Time;

use crate::echo::{Echo, Edge, Fault, MAX_START, Shot};

/// Lines of a ring of sonars. A test plays them.
pub trait Lines {
    /// Now, on the clock of the edges.
    fn now(&self) -> Time;

    /// Waits until `time`; later on a busy machine.
    fn wait_until(&mut self, time: Time);

    /// Sends the trigger pulse of a sonar. Returns its begin and its end.
    ///
    /// # Errors
    /// The lines are lost.
    fn fire(&mut self, sonar: usize) -> io::Result<(Time, Time)>;

    /// Appends the edges of a sonar's echo line that arrived since the last call.
    ///
    /// # Errors
    /// The lines are lost.
    fn edges(&mut self, sonar: usize, edges: &mut Vec<Edge>) -> io::Result<()>;

    /// Returns true if the echo line of a sonar is high.
    ///
    /// # Errors
    /// The lines are lost.
    fn is_high(&mut self, sonar: usize) -> io::Result<bool>;
}

/// Geometry and times of a ring.
#[derive(Clone, Debug)]
pub struct RingConfig {
    /// Beam of each sonar without its range.
    pub beams: Vec<Beam>,
    /// Minimum and maximum range, m.
    pub range_m: [f64; 2],
    /// Speed of sound, m/s.
    pub sound_mps: f64,
    /// Time from one shot to the next, in which the echoes of the first die away.
    pub turn: Duration,
}

/// Ring of sonars that fire one at a time, each in its turn.
pub struct Ring {
    config: RingConfig,
    sonars: Vec<Sonar>,
    next: usize,
    sequence: u64,
    edges: Vec<Edge>,
}

/// State of one sonar.
#[derive(Clone, Debug, Default)]
struct Sonar {
    /// Instant of its measurement since the last scan.
    measured: Option<Time>,
    /// Number of its last edge.
    last: Option<u32>,
    /// Faults in a row.
    faults: u32,
}

/// Outcome of one turn.
#[derive(Clone, Debug, Default)]
pub struct Turn {
    /// Scan that this turn completed.
    pub scan: Option<(RangeScanHeader, Vec<Beam>)>,
    /// Sonar and fault to report: at the first, and at each power of two in a row.
    pub fault: Option<(usize, Fault, u32)>,
    /// Sonar that measures again after faults, and the number of them.
    pub recovered: Option<(usize, u32)>,
}

impl RingConfig {
    /// Time of the sound to the maximum range and back.
    #[must_use]
    pub fn max_time(&self) -> Duration {
        Duration::from_secs_f64(2.0 * self.range_m[1] / self.sound_mps)
    }

    /// Time for which a shot is watched. It is shorter than the shortest turn.
    #[must_use]
    pub fn watch(&self) -> Duration {
        self.max_time() + MAX_START + Duration::from_millis(1)
    }
}

impl Ring {
    /// Returns a ring that begins with the first sonar.
    #[must_use]
    pub fn new(config: RingConfig) -> Ring {
        let sonars = vec![Sonar::default(); config.beams.len()];
        Ring { config, sonars, next: 0, sequence: 0, edges: Vec::new() }
    }

    /// Forgets edges and measurements, after the lines were opened again.
    pub fn begin(&mut self) {
        let faults = self.sonars.iter().map(|sonar| sonar.faults);
        self.sonars = faults.map(|faults| Sonar { faults, ..Sonar::default() }).collect();
    }

    /// Lets the next sonar take its turn, and waits until the turn is over. A scan is complete once every sonar has measured since
    /// the last one: a sonar that fails delays it, and does not look like free space.
    ///
    /// # Errors
    /// The lines are lost.
    pub fn turn(&mut self, lines: &mut impl Lines) -> io::Result<Turn> {
        let begun = lines.now();
        let index = self.next;
        self.next = (index + 1) % self.sonars.len().max(1);
        let outcome = self.shoot(index, lines)?;
        let turn = self.take(index, outcome);
        lines.wait_until(begun + self.config.turn);
        Ok(turn)
    }

    fn shoot(&mut self, index: usize, lines: &mut impl Lines) -> io::Result<Result<Echo, Fault>> {
        // The end of a long pulse of the turn before.
        self.read(index, lines)?;
        if lines.is_high(index)? {
            return Ok(Err(Fault::StuckHigh));
        }
        let last = self.sonars.get(index).and_then(|sonar| sonar.last);
        let (begun, fired) = lines.fire(index)?;
        lines.wait_until(fired + self.config.watch());
        // The level first: an edge between the two is one too many, and no measurement.
        let (is_high, watched) = (lines.is_high(index)?, lines.now());
        self.read(index, lines)?;
        let shot = Shot { begun, fired, watched, is_high };
        Ok(shot.echo(&self.edges, last, self.config.max_time()))
    }

    /// Reads the edges that arrived.
    fn read(&mut self, index: usize, lines: &mut impl Lines) -> io::Result<()> {
        self.edges.clear();
        lines.edges(index, &mut self.edges)?;
        if let (Some(edge), Some(sonar)) = (self.edges.last(), self.sonars.get_mut(index)) {
            sonar.last = Some(edge.number);
        }
        Ok(())
    }

    fn take(&mut self, index: usize, outcome: Result<Echo, Fault>) -> Turn {
        let [min_m, max_m] = self.config.range_m;
        let (Some(sonar), Some(beam)) = (self.sonars.get_mut(index), self.config.beams.get_mut(index)) else {
            return Turn::default();
        };
        let echo = match outcome {
            Err(fault) => {
                sonar.faults = sonar.faults.saturating_add(1);
                let is_reported = sonar.faults.is_power_of_two();
                let fault = is_reported.then_some((index, fault, sonar.faults));
                return Turn { fault, ..Turn::default() };
            }
            Ok(echo) => echo,
        };
        let faults = std::mem::take(&mut sonar.faults);
        let recovered = (faults > 0).then_some((index, faults));
        sonar.measured = Some(echo.at);
        let range_m = echo.time.map(|time| 0.5 * self.config.sound_mps * time.as_secs_f64());
        let flags = if range_m.is_some() { 0 } else { NO_ECHO };
        (beam.range_m, beam.flags) = (range_m.unwrap_or(max_m).min(max_m), flags);
        let measured = self.sonars.iter().map(|sonar| sonar.measured).collect::<Option<Vec<Time>>>();
        let scan = measured.and_then(|measured| measured.into_iter().min()).map(|oldest| {
            self.sonars.iter_mut().for_each(|sonar| sonar.measured = None);
            self.sequence += 1;
            let header = RangeScanHeader { stamp_ns: oldest.0, sequence: self.sequence, min_m, max_m };
            (header, self.config.beams.clone())
        });
        Turn { scan, fault: None, recovered }
    }
}

#[cfg(test)]
mod tests;
