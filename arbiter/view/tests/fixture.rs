//! A short recording: a robot that two behaviors drive, a halt, a contact, pictures.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

use bytemuck::bytes_of;
use yamabico_core::message::{
    Axes, DecisionHeader, FrameHeader, Kind, MessageType, Mode, Name, Odometry, Outcome, Pose, Proposal,
    Reason, Truth, Twist, Verdict,
};
use yamabico_core::time::Time;
use yamabico_runtime::record::{McapRecorder, Pace, Recording, Tap};

/// Duration, s.
pub const DURATION_S: f64 = 20.0;
/// Time of the contact, s.
pub const CONTACT_S: f64 = 12.0;
/// Begin and end of the halt, s.
pub const HALT_S: (f64, f64) = (5.0, 7.0);
/// Time at which the avoider takes over, s.
pub const HAND_OVER_S: f64 = 9.0;

/// Held by each test for its duration: a test that measures the memory of the process runs alone.
static TESTS: RwLock<()> = RwLock::new(());

/// A folder of a test, removed when it is dropped.
pub struct Folder(pub PathBuf, #[expect(dead_code, reason = "held until the end of the test")] Turn);

/// The time of a test.
#[expect(dead_code, reason = "held until the end of the test")]
enum Turn {
    Beside(RwLockReadGuard<'static, ()>),
    Alone(RwLockWriteGuard<'static, ()>),
}

impl Folder {
    /// Makes an empty folder for a test that runs beside others.
    pub fn new(name: &str) -> Folder {
        let turn = Turn::Beside(TESTS.read().unwrap_or_else(PoisonError::into_inner));
        Folder::make(name, turn)
    }

    /// Makes an empty folder for a test that runs alone.
    pub fn alone(name: &str) -> Folder {
        let turn = Turn::Alone(TESTS.write().unwrap_or_else(PoisonError::into_inner));
        Folder::make(name, turn)
    }

    fn make(name: &str, turn: Turn) -> Folder {
        let path = std::env::temp_dir().join(format!("yamabico-view-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Folder(path, turn)
    }

    /// Records the run to a file in the folder.
    pub fn record(&self) -> PathBuf {
        let path = self.0.join("run.mcap");
        record(&path);
        path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Source of the two driven axes, and the halting behavior if there is one, at a time.
fn owners(at_s: f64) -> (&'static str, &'static str) {
    let halter = if (HALT_S.0..HALT_S.1).contains(&at_s) { "sonar-halt" } else { "" };
    (if at_s < HAND_OVER_S { "wall-follower" } else { "avoider" }, halter)
}

fn record(path: &Path) {
    let recording = Recording {
        files: vec![("maps/hall.toml".to_owned(), "wall = [{ from_m = [0, 1], to_m = [9, 1] }]".to_owned())],
        ..Recording::new(path, Pace::Lockstep)
    };
    let mut recorder = McapRecorder::create(recording).unwrap();
    for tick in 1..=(DURATION_S * 50.0) as u64 {
        step(&mut recorder, tick);
    }
    let result = recorder.finish(BTreeMap::new());
    assert!(result.error.is_none());
}

/// Messages of one tick of 20 ms.
fn step(tap: &mut dyn Tap, tick: u64) {
    let stamp_ns = tick * 20_000_000;
    let (time, at_s) = (Time(stamp_ns), stamp_ns as f64 * 1e-9);
    let (source, halter) = owners(at_s);
    let mut send = |topic: &str, message: MessageType, header: &[u8], items: &[u8]| {
        tap.message(topic, &message, time, header, items);
    };
    if tick.is_multiple_of(10) {
        let frame = FrameHeader { sequence: tick, ..FrameHeader::gray(32, 24, stamp_ns) };
        send("sensors/front", MessageType::of::<FrameHeader>(), bytes_of(&frame), &[tick as u8; 32 * 24]);
    }
    let odometry = Odometry { stamp_ns, sequence: tick, x: 0.4 * at_s, ..Odometry::default() };
    send("sensors/wheels", MessageType::of::<Odometry>(), bytes_of(&odometry), &[]);
    let contacts = u32::from(at_s >= CONTACT_S);
    let truth = Truth { stamp_ns, sequence: tick, x: 0.4 * at_s, contacts, ..Truth::default() };
    send("truth", MessageType::of::<Truth>(), bytes_of(&truth), &[]);
    let pose = Pose { stamp_ns, evidence_ns: stamp_ns, x: 0.4 * at_s + 0.01, status: 1, ..Pose::default() };
    send("behaviors/localizer/pose", MessageType::of::<Pose>(), bytes_of(&pose), &[]);
    let verdicts = ["sonar-halt", "avoider", "wall-follower"].map(|behavior| {
        let proposal = match behavior {
            "sonar-halt" if halter.is_empty() => Proposal::abstain(Reason::Clear),
            "sonar-halt" => Proposal::halt(Axes::ALL, Reason::Echo).with_note(format_args!("0.41 m ahead")),
            "avoider" if source != "avoider" => Proposal::abstain(Reason::Clear),
            _ => Proposal::drive(Axes::PLANAR, Twist::planar(0.4, 0.1)),
        };
        let proposal = Proposal {
            behavior: Name::new(behavior),
            sequence: tick,
            stamp_ns,
            evidence_ns: stamp_ns,
            proposed_ns: stamp_ns,
            ..proposal
        };
        let topic = format!("behaviors/{behavior}/proposal");
        send(&topic, MessageType::of::<Proposal>(), bytes_of(&proposal), &[]);
        let is_source = behavior == source && halter.is_empty();
        let outcome = match proposal.kind() {
            Some(Kind::Abstain) => Outcome::Abstained,
            Some(Kind::Halt) => Outcome::Halting,
            _ if is_source => Outcome::Won,
            _ => Outcome::Stopped,
        };
        Verdict {
            behavior: Name::new(behavior),
            outcome: outcome.code(),
            claimed: proposal.axes,
            won: if is_source { Axes::PLANAR } else { Axes::NONE },
            kind: proposal.kind,
            reason: proposal.reason,
            ..Verdict::default()
        }
    });
    let names = |name: &str| [Name::new(name), Name::default(), Name::new(name)];
    let commanded = if halter.is_empty() { Twist::planar(0.4, 0.1) } else { Twist::ZERO };
    let mode = if halter.is_empty() { Mode::Driving } else { Mode::Halted };
    let decision = DecisionHeader {
        stamp_ns,
        evidence_ns: stamp_ns,
        sequence: tick,
        wanted: Twist::planar(0.4, 0.1),
        wished: Twist::planar(0.4, 0.1),
        feasible: commanded,
        allowed: commanded,
        commanded,
        axes: Axes::PLANAR,
        halted: if halter.is_empty() { Axes::NONE } else { Axes::ALL },
        source: names(source),
        halter: names(halter),
        mode: mode.code(),
        ..DecisionHeader::default()
    };
    let items = bytemuck::cast_slice(&verdicts);
    send("decision", MessageType::of::<DecisionHeader>(), bytes_of(&decision), items);
}
