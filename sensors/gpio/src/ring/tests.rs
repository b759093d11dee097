//! Rings before walls, on lines that fail in every way, in simulated time.

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
    assert_eq!(fake.fired.iter().map(|(sonar, _)| *sonar).collect::<Vec<_>>(), [0, 1, 2, 0, 1, 2, 0, 1, 2]);
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
