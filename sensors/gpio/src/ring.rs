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
mod tests {
    use super::*;

    const TURN: Duration = Duration::from_millis(60);

    /// Damage to a line, from one turn on.
    #[derive(Clone, Copy, Debug, PartialEq)]
    enum Line {
        Good,
        /// The rise or the fall gets lost in hardware: no edge, and no number for it.
        NoRise,
        NoFall,
        /// The kernel drops the fall, and counts it.
        DroppedFall,
        /// Each edge comes twice, 3 us apart.
        Doubled,
        /// The stamps run backward.
        Reversed,
        StuckHigh,
        /// A wire is broken.
        Dead,
        /// A clone that stays high for 200 ms without an echo.
        Slow,
        Lost,
    }

    /// Sonars before walls, in simulated time.
    struct Fake {
        now: Time,
        walls_m: Vec<Option<f64>>,
        lines: Vec<Line>,
        waiting: Vec<Vec<Edge>>,
        high_until: Vec<Time>,
        numbers: Vec<u32>,
        fired: Vec<(usize, Time)>,
        /// Additional wait of each sleep: a busy machine.
        late: Duration,
    }

    impl Fake {
        fn new(walls_m: &[Option<f64>]) -> Fake {
            let count = walls_m.len();
            Fake {
                now: Time::from_secs_f64(100.0),
                walls_m: walls_m.to_vec(),
                lines: vec![Line::Good; count],
                waiting: vec![Vec::new(); count],
                high_until: vec![Time::ZERO; count],
                numbers: vec![0; count],
                fired: Vec::new(),
                late: Duration::ZERO,
            }
        }

        fn edge(&mut self, sonar: usize, at: Time) {
            self.numbers[sonar] += 1;
            self.waiting[sonar].push(Edge { at, number: self.numbers[sonar] });
        }
    }

    impl Lines for Fake {
        fn now(&self) -> Time {
            self.now
        }

        fn wait_until(&mut self, time: Time) {
            self.now = self.now.max(time) + self.late;
        }

        fn fire(&mut self, sonar: usize) -> io::Result<(Time, Time)> {
            let begun = self.now;
            self.now = begun + Duration::from_micros(20);
            self.fired.push((sonar, begun));
            let line = self.lines[sonar];
            let length = self.walls_m[sonar].map(|range_m| Duration::from_secs_f64(2.0 * range_m / 343.0));
            let longest = Duration::from_millis(if line == Line::Slow { 200 } else { 38 });
            let rise = self.now + Duration::from_micros(450);
            let fall = rise + length.unwrap_or(longest);
            match line {
                Line::Lost => return Err(io::Error::from(io::ErrorKind::NotConnected)),
                Line::Dead | Line::StuckHigh => return Ok((begun, self.now)),
                Line::NoRise => self.edge(sonar, fall),
                Line::NoFall => self.edge(sonar, rise),
                Line::DroppedFall => {
                    self.edge(sonar, rise);
                    self.numbers[sonar] += 1;
                }
                Line::Doubled => {
                    for at in [rise, fall] {
                        (0..3).for_each(|i| self.edge(sonar, at + Duration::from_micros(3 * i)));
                    }
                }
                Line::Reversed => {
                    self.edge(sonar, fall);
                    self.edge(sonar, rise);
                }
                Line::Good | Line::Slow => {
                    self.edge(sonar, rise);
                    self.edge(sonar, fall);
                }
            }
            self.high_until[sonar] = fall;
            Ok((begun, self.now))
        }

        fn edges(&mut self, sonar: usize, edges: &mut Vec<Edge>) -> io::Result<()> {
            let now = self.now;
            // Only edges of the past.
            let count = self.waiting[sonar].iter().take_while(|edge| edge.at <= now).count();
            edges.extend(self.waiting[sonar].drain(..count));
            Ok(())
        }

        fn is_high(&mut self, sonar: usize) -> io::Result<bool> {
            Ok(self.lines[sonar] == Line::StuckHigh || self.now < self.high_until[sonar])
        }
    }

    fn ring(count: usize) -> Ring {
        let beams = vec![Beam::default(); count];
        Ring::new(RingConfig { beams, range_m: [0.02, 3.0], sound_mps: 343.0, turn: TURN })
    }

    /// Scans and faults of this many turns.
    fn turns(ring: &mut Ring, fake: &mut Fake, count: usize) -> (Vec<Vec<Beam>>, Vec<Fault>) {
        let (mut scans, mut faults) = (Vec::new(), Vec::new());
        for _ in 0..count {
            let turn = ring.turn(fake).unwrap();
            scans.extend(turn.scan.map(|(_, beams)| beams));
            faults.extend(turn.fault.map(|(_, fault, _)| fault));
        }
        (scans, faults)
    }

    #[test]
    fn sonars_fire_one_at_a_time() {
        let (mut ring, mut fake) = (ring(3), Fake::new(&[Some(1.0), None, Some(0.05)]));
        let (scans, faults) = turns(&mut ring, &mut fake, 9);
        assert_eq!((scans.len(), faults.len()), (3, 0));
        for beams in scans {
            let ranges = beams.iter().map(|beam| (1000.0 * beam.range_m).round()).collect::<Vec<_>>();
            assert_eq!(ranges, [1000.0, 3000.0, 50.0]);
            assert_eq!(beams.iter().map(|beam| beam.flags).collect::<Vec<_>>(), [0, NO_ECHO, 0]);
        }
        assert_eq!(
            fake.fired.iter().map(|(sonar, _)| *sonar).collect::<Vec<_>>(),
            [0, 1, 2, 0, 1, 2, 0, 1, 2]
        );
        assert!(fake.fired.windows(2).all(|pair| pair[1].1.since(pair[0].1) >= TURN));
    }

    #[test]
    fn a_scan_is_stamped_by_its_oldest_measurement() {
        let (mut ring, mut fake) = (ring(2), Fake::new(&[Some(1.0), Some(2.0)]));
        assert!(ring.turn(&mut fake).unwrap().scan.is_none());
        let (header, _) = ring.turn(&mut fake).unwrap().scan.unwrap();
        assert_eq!(Time(header.stamp_ns), fake.fired[0].1 + Duration::from_micros(470));
        assert_eq!(header.sequence, 1);
    }

    #[test]
    fn a_damaged_line_delays_the_scan_and_is_no_free_space() {
        let damages = [
            (Line::NoRise, Fault::WrongLevel),
            (Line::NoFall, Fault::WrongLevel),
            (Line::DroppedFall, Fault::WrongLevel),
            (Line::Reversed, Fault::WrongTimes),
            (Line::StuckHigh, Fault::StuckHigh),
            (Line::Dead, Fault::Silent),
        ];
        for (damage, fault) in damages {
            let (mut ring, mut fake) = (ring(2), Fake::new(&[Some(1.0), Some(0.3)]));
            turns(&mut ring, &mut fake, 2);
            fake.lines[1] = damage;
            let (scans, faults) = turns(&mut ring, &mut fake, 16);
            assert!(scans.is_empty(), "{damage:?}");
            assert_eq!(faults[0], fault, "{damage:?}");
            assert_eq!(faults.len(), 4, "reported after 1, 2, 4 and 8 faults");
            fake.lines[1] = Line::Good;
            let mut recovered = Vec::new();
            for _ in 0..4 {
                recovered.extend(ring.turn(&mut fake).unwrap().recovered);
            }
            let (scans, faults) = turns(&mut ring, &mut fake, 4);
            assert_eq!((scans.len(), faults.len()), (2, 0), "{damage:?}");
            assert_eq!(
                scans[0].iter().map(|beam| (10.0 * beam.range_m).round()).collect::<Vec<_>>(),
                [10.0, 3.0]
            );
            assert!(matches!(recovered[..], [(1, 8 | 9)]), "{damage:?} {recovered:?}");
        }
    }

    #[test]
    fn doubled_edges_are_one() {
        let (mut ring, mut fake) = (ring(1), Fake::new(&[Some(1.5)]));
        fake.lines[0] = Line::Doubled;
        let (scans, faults) = turns(&mut ring, &mut fake, 5);
        assert_eq!((scans.len(), faults.len()), (5, 0));
        assert!((scans[4][0].range_m - 1.5).abs() < 0.002, "{:?}", scans[4]);
    }

    #[test]
    fn a_slow_clone_is_not_fired_while_its_line_is_high() {
        let (mut ring, mut fake) = (ring(1), Fake::new(&[None]));
        fake.lines[0] = Line::Slow;
        let (scans, _) = turns(&mut ring, &mut fake, 12);
        assert_eq!(scans.len(), 3, "every fourth turn");
        assert!(scans.iter().all(|beams| beams[0].flags == NO_ECHO));
        assert!(fake.fired.windows(2).all(|pair| pair[1].1.since(pair[0].1) >= Duration::from_millis(200)));
    }

    #[test]
    fn a_busy_machine_measures_as_precisely() {
        let (mut ring, mut fake) = (ring(2), Fake::new(&[Some(0.4), Some(2.0)]));
        fake.late = Duration::from_millis(90);
        let (scans, faults) = turns(&mut ring, &mut fake, 6);
        assert_eq!((scans.len(), faults.len()), (3, 0));
        assert!((scans[2][0].range_m - 0.4).abs() < 1e-3 && (scans[2][1].range_m - 2.0).abs() < 1e-3);
    }

    #[test]
    fn lost_lines_are_an_error_and_begin_anew() {
        let (mut ring, mut fake) = (ring(2), Fake::new(&[Some(1.0), Some(1.0)]));
        turns(&mut ring, &mut fake, 1);
        fake.lines[1] = Line::Lost;
        assert!(ring.turn(&mut fake).is_err());
        let mut fake = Fake::new(&[Some(1.0), Some(1.0)]);
        ring.begin();
        let (scans, faults) = turns(&mut ring, &mut fake, 3);
        assert_eq!(
            (scans.len(), faults.len()),
            (1, 0),
            "numbers of edges begin anew, old measurements do not count"
        );
    }
}
