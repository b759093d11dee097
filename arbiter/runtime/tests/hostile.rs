//! A hostile plugin on its own proposal topic can neither crash, nor stall, nor speed up the arbiter.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use crate::stand_ins::stand_in;
use yamabico_core::behavior::{Behavior, Inputs, Outputs, ParameterError, Plugin, Setup, SlotInfo, factory};
use yamabico_core::drive::Drive;
use yamabico_core::driver::Device;
use yamabico_core::message::{
    Axes, Command, Control, Message, MessageType, Name, Odometry, Proposal, Reason, Sector, Twist,
};
use yamabico_core::plugins::Plugins;
use yamabico_core::sensor::DeviceError;
use yamabico_core::testing::NoParameters;
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, BusError, Publisher};
use yamabico_host::config::{Overrides, load};
use yamabico_runtime::execution::{DurationHistogram, Live, Plan, RunStats, topics};
use yamabico_runtime::record::Tap;

/// Speed of the honest behavior, m/s.
const HONEST_MPS: f64 = 0.3;
/// Period of the arbiter's tick.
const PERIOD: Duration = Duration::from_millis(20);
/// Decisions that proposals may trigger, a second: 64 a tick of 20 ms at once, then one a millisecond.
const MAX_DECISIONS_HZ: f64 = 64.0 / 0.02 + 1000.0;

/// Drives straight ahead.
struct Honest;

impl Plugin for Honest {
    type Config = NoParameters;
    const NAME: &'static str = "honest";
    const SUMMARY: &'static str = "Drives straight ahead.";
    const INPUTS: &'static [SlotInfo] = &[];
    const CLAIMS: Axes = Axes::LINEAR;

    fn new(_: NoParameters, _: &Setup) -> Result<Self, ParameterError> {
        Ok(Honest)
    }
}

impl Behavior for Honest {
    fn propose(&mut self, _: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        Proposal::drive(Axes::LINEAR, Twist::planar(HONEST_MPS, 0.0))
    }
}

struct Motor;

impl Drive for Motor {
    fn apply(&mut self, _: Option<&Command>, _: Time) -> Result<(), DeviceError> {
        Ok(())
    }
}

fn plugins() -> Plugins {
    let open = |_| {
        Ok(Device {
            sensors: Vec::new(),
            drive: Some(Box::new(Motor)),
            ground_truth: None,
            walls: Vec::new(),
        })
    };
    Plugins { behaviors: vec![factory::<Honest>()], drivers: vec![stand_in(&[], &["motor"], open).shared()] }
}

const TASK: &str = "robot = \"robot.toml\"\n[run]\nduration_s = 3\n[behaviors.honest]\npriority = 10\n\
    max_age_ms = 60000\nmax_evidence_age_ms = 60000\n\
    [behaviors.evil]\ntype = \"honest\"\npriority = 20\n[behaviors.lesser]\ntype = \"honest\"\npriority = 5\n";

/// Commands of a run.
#[derive(Default)]
struct Commands {
    commands: u64,
    fastest: f64,
    honest: u64,
    first: Option<Time>,
    last: Time,
}

impl Tap for Commands {
    fn message(&mut self, _: &str, message: &MessageType, _: Time, header: &[u8], _: &[u8]) {
        if message.name != Command::NAME {
            return;
        }
        let command: Command = bytemuck::pod_read_unaligned(header);
        let twist = command.twist;
        assert!(twist.is_finite());
        // The sequence, because a tap that lags loses messages.
        self.commands = command.sequence;
        self.honest += u64::from(command.source[0] == Name::new("honest"));
        self.fastest = twist.linear.abs().max(twist.lateral.abs()).max(twist.angular.abs()).max(self.fastest);
        self.first.get_or_insert(Time(command.stamp_ns));
        self.last = Time(command.stamp_ns);
    }
}

/// Runs the robot while `attack` publishes as "evil", of a higher priority than the honest behavior, and as "lesser", until
/// its flag is set.
fn under(
    name: &str,
    attack: impl Fn(&Bus, &Publisher<Proposal>, &Publisher<Proposal>, &AtomicBool) + Send + 'static,
) -> (Commands, RunStats, DurationHistogram) {
    let robot = format!("hostile-{}-{name}", std::process::id());
    let folder = std::env::temp_dir().join(format!("yamabico-{robot}"));
    std::fs::create_dir_all(&folder).unwrap();
    let body = "footprint = { radius_m = 0.2 }\ndevices.body = { driver = \"stand-in\" }\n\
                drive = { device = \"body\", kind = \"motor\" }\n";
    std::fs::write(folder.join("robot.toml"), format!("name = \"{robot}\"\n{body}")).unwrap();
    std::fs::write(folder.join("task.toml"), TASK).unwrap();
    let task = load(&folder.join("task.toml"), &Overrides::default(), &plugins());
    let task = task.unwrap_or_else(|problems| panic!("{problems}"));
    std::fs::remove_dir_all(&folder).unwrap();
    let mut plan = Plan::new(&task, 1);
    // The attacker publishes for the others.
    plan.behaviors.retain(|behavior| behavior.setup.name == "honest");
    let mut live = Live::open(plan, &robot, None).unwrap();
    let over: &'static AtomicBool = Box::leak(Box::new(AtomicBool::new(false)));
    let attacker = std::thread::spawn(move || {
        let bus = Bus::join(&robot).unwrap();
        let evil = bus.publisher(&topics::proposal("evil")).unwrap();
        let lesser = bus.publisher(&topics::proposal("lesser")).unwrap();
        attack(&bus, &evil, &lesser, over);
    });
    let bare = std::thread::spawn(move || bare_timer(over));
    let mut driven = Commands::default();
    live.run(&task.run, &AtomicBool::new(false), &mut driven, &mut |_| {}).unwrap();
    over.store(true, Ordering::Relaxed);
    attacker.join().unwrap();
    (driven, live.finish(), bare.join().unwrap())
}

/// Delay with which a thread that only sleeps wakes at its ticks.
fn bare_timer(over: &AtomicBool) -> DurationHistogram {
    let mut late = DurationHistogram::default();
    let mut next = Instant::now() + PERIOD;
    while !over.load(Ordering::Relaxed) {
        std::thread::sleep(next.saturating_duration_since(Instant::now()));
        late.add(next.elapsed());
        while next <= Instant::now() {
            next += PERIOD;
        }
    }
    late
}

fn drive_at(mps: f64) -> Proposal {
    let now = Time::monotonic_now().0;
    Proposal {
        stamp_ns: now,
        evidence_ns: now,
        behavior: Name::new("evil"),
        ..Proposal::drive(Axes::LINEAR, Twist::planar(mps, 0.0))
    }
}

/// Asserts that ticks are at most one period later than those of a bare timer in the same run.
fn assert_on_time(driven: &Commands, stats: &RunStats, bare: &DurationHistogram) {
    let seconds = |late: &DurationHistogram| late.count() as f64 * PERIOD.as_secs_f64();
    let lasted = driven.last.since(driven.first.unwrap()).as_secs_f64();
    let shares = |late: &DurationHistogram| [0.5, 0.95, 0.99, 1.0].map(|share| late.quantile(share));
    let (arbiter, timer) = (shares(&stats.lateness), shares(bare));
    let ratio = arbiter[2].as_secs_f64() / timer[2].as_secs_f64();
    println!(
        "ticks late by {arbiter:?}, a bare timer by {timer:?}: p50, p95, p99, max; ratio of p99 {ratio:.2}; \
         {} commands in {lasted:.2} s",
        driven.commands
    );
    // A machine that stalls skips ticks of both.
    let (ticks, possible) = (seconds(&stats.lateness), lasted.min(seconds(bare)));
    assert!(ticks > 0.9 * possible, "{ticks} s of ticks in {lasted} s, of which a bare timer had {possible}");
    // No bound on the 99th percentile: the machine may stall one thread and not the other.
    assert!(arbiter[0] <= timer[0] + PERIOD / 2 && arbiter[1] <= timer[1] + PERIOD);
}

#[test]
fn malformed_drives_move_nothing_and_block_no_other_behavior() {
    let (driven, stats, bare) = under("malformed", |_, evil, _, over| {
        let now = || Time::monotonic_now().0;
        let malformed: [fn(Proposal, u64) -> Proposal; 12] = [
            |p, _| Proposal { twist: Twist::planar(f64::NAN, 0.0), ..p },
            |p, _| Proposal { twist: Twist::planar(f64::INFINITY, f64::NEG_INFINITY), ..p },
            |p, _| Proposal { twist: Twist::planar(1e38, 1e38), ..p },
            |p, _| Proposal { twist: Twist::planar(-1e308, 0.0), ..p },
            |p, now| Proposal { stamp_ns: now + 3_600_000_000_000, ..p },
            |p, _| Proposal { stamp_ns: u64::MAX, evidence_ns: u64::MAX, ..p },
            |p, _| Proposal { stamp_ns: 0, evidence_ns: 0, received_ns: u64::MAX, proposed_ns: 1, ..p },
            |p, _| Proposal { kind: 77, ..p },
            |p, _| Proposal { confidence: f64::NAN, ..p },
            |p, _| Proposal { axes: bytemuck::cast(u32::MAX), ..p },
            |p, _| Proposal {
                kind: yamabico_core::message::Kind::Abstain.code(),
                reason: u32::MAX,
                note: bytemuck::pod_read_unaligned(&[0xff; 64]),
                ..p
            },
            |p, _| Proposal { behavior: bytemuck::pod_read_unaligned(&[0xff; 32]), kind: u32::MAX, ..p },
        ];
        for round in 0.. {
            if over.load(Ordering::Relaxed) {
                return;
            }
            let spoil = malformed[round % malformed.len()];
            evil.publish(&Proposal { sequence: round as u64, ..spoil(drive_at(0.4), now()) }, &[]).unwrap();
            std::thread::sleep(Duration::from_millis(1));
        }
    });
    assert_on_time(&driven, &stats, &bare);
    assert!((driven.fastest - HONEST_MPS).abs() < 1e-6, "{} m/s", driven.fastest);
    assert!(driven.honest > 100, "the honest behavior drove in {} commands", driven.honest);
}

#[test]
fn malformed_limits_and_halts_only_slow_the_robot() {
    let (driven, stats, bare) = under("limits", |_, evil, _, over| {
        for round in 0.. {
            if over.load(Ordering::Relaxed) {
                return;
            }
            let limit = Proposal::limit(Axes::ALL, Twist::planar(f64::INFINITY, -1.0), Reason::None);
            let sector = Sector { center_rad: f64::NAN, half_width_rad: f64::NEG_INFINITY };
            let halt = Proposal::halt(bytemuck::cast(u32::MAX), Reason::None);
            let proposal = if round % 2 == 0 { limit.in_sector(sector) } else { halt };
            evil.publish(&Proposal { sequence: round, stamp_ns: u64::MAX, ..proposal }, &[]).unwrap();
            std::thread::sleep(Duration::from_millis(1));
        }
    });
    assert_on_time(&driven, &stats, &bare);
    assert!(driven.fastest <= HONEST_MPS + 1e-9, "{} m/s", driven.fastest);
}

#[test]
fn a_flood_neither_stalls_nor_speeds_up() {
    static SENT: AtomicU64 = AtomicU64::new(0);
    let (driven, stats, bare) = under("flood", |_, _, lesser, over| {
        let begun = Instant::now();
        while !over.load(Ordering::Relaxed) {
            // 100,000 per second, if the machine is fast enough.
            let due = (begun.elapsed().as_secs_f64() * 1e5) as u64;
            while SENT.load(Ordering::Relaxed) < due && !over.load(Ordering::Relaxed) {
                let sequence = SENT.fetch_add(1, Ordering::Relaxed);
                lesser.publish(&Proposal { sequence, ..drive_at(0.4) }, &[]).unwrap();
            }
        }
    });
    assert_on_time(&driven, &stats, &bare);
    let lasted = driven.last.since(driven.first.unwrap()).as_secs_f64();
    let sent_hz = SENT.load(Ordering::Relaxed) as f64 / lasted;
    println!("{sent_hz:.0} proposals a second, {:.0} commands a second", driven.commands as f64 / lasted);
    assert!(sent_hz > 2.0 * MAX_DECISIONS_HZ, "no flood");
    assert!((driven.commands as f64) < MAX_DECISIONS_HZ * lasted * 1.05, "{} commands", driven.commands);
    assert!((driven.fastest - HONEST_MPS).abs() < 1e-6, "{} m/s", driven.fastest);
}

#[test]
fn no_plugin_can_publish_under_another_name_or_priority() {
    let (driven, stats, bare) = under("name", |bus, _, lesser, over| {
        let refused =
            |error: BusError| assert!(matches!(error, BusError::TooManyPublishers { .. }), "{error}");
        refused(bus.publisher::<Command>(topics::COMMAND).err().unwrap());
        refused(bus.publisher::<Proposal>(&topics::proposal("honest")).err().unwrap());
        refused(bus.publisher::<Proposal>(&topics::proposal("lesser")).err().unwrap());
        let other = bus.publisher::<Odometry>(&topics::proposal("honest")).err().unwrap();
        assert!(matches!(other, BusError::WrongType { .. }), "{other}");
        let raw = bus.publisher_raw(topics::CONTROL, &MessageType::of::<Control>()).unwrap();
        for (header, items) in [(0, 0), (size_of::<Control>() - 1, 0), (size_of::<Control>() + 8, 0)] {
            assert!(raw.publish(&vec![0; header], &vec![0; items]).is_err(), "{header} bytes");
        }
        assert!(matches!(lesser.publish(&drive_at(0.4), &[0; 4096]), Err(BusError::TooLong { .. })));
        while !over.load(Ordering::Relaxed) {
            let claimed = Proposal { behavior: Name::new("honest"), priority: i32::MAX, ..drive_at(0.45) };
            lesser.publish(&claimed, &[]).unwrap();
            std::thread::sleep(Duration::from_millis(5));
        }
    });
    assert_on_time(&driven, &stats, &bare);
    assert!((driven.fastest - HONEST_MPS).abs() < 1e-6, "{} m/s", driven.fastest);
}
