//! Lockstep with small test doubles for devices and behaviors: order, panics, dead sensors, threads.

use crate::stand_ins::{PERIOD, stand_in};
use yamabico_core::behavior::{
    Behavior, Inputs, Outputs, ParameterError, Plugin, Setup, Slot, SlotInfo, factory,
};
use yamabico_core::drive::Drive;
use yamabico_core::driver::{Device, DeviceSpec};
use yamabico_core::message::{
    Axes, Command, DecisionHeader, Intersection, Message, MessageType, Mode, Odometry, Proposal, Reason,
    Twist, View,
};
use yamabico_core::plugins::Plugins;
use yamabico_core::sensor::{DeviceError, Due, Sensor};
use yamabico_core::testing::NoParameters;
use yamabico_core::time::Time;
use yamabico_host::config::{Overrides, load};
use yamabico_runtime::execution::{Lockstep, Plan, SensorSupply};
use yamabico_runtime::record::{Digest, Tap, Tee};

/// Odometry that counts up every 20 ms, is silent from 1.5 s on and ends after 3 s.
struct Counter(u64);

impl Sensor for Counter {
    fn poll(&mut self, now: Time, outputs: &mut Outputs<'_>) -> Result<Due, DeviceError> {
        if now >= Time::from_secs_f64(3.0) {
            return Ok(Due::Ended);
        }
        if now < Time::from_secs_f64(1.5) {
            self.0 += 1;
            let odometry =
                Odometry { stamp_ns: now.0, sequence: self.0, x: self.0 as f64, ..Default::default() };
            outputs.publish("wheels", &odometry, &[])?;
        }
        Ok(Due::At(now + PERIOD))
    }
}

struct Motor;

impl Drive for Motor {
    fn apply(&mut self, command: Option<&Command>, _: Time) -> Result<(), DeviceError> {
        command.map(|_| ()).ok_or_else(|| DeviceError::failed("motor", "a tick without a command"))
    }
}

fn open(spec: DeviceSpec) -> Result<Device, ParameterError> {
    let sensors =
        spec.sensors.iter().map(|sensor| (sensor.name.clone(), Box::new(Counter(0)) as Box<dyn Sensor>));
    Ok(Device {
        sensors: sensors.collect(),
        drive: Some(Box::new(Motor)),
        ground_truth: None,
        walls: Vec::new(),
    })
}

const WHEELS: Slot<Odometry> = Slot::required("wheels", "Odometry that counts.");
const AHEAD: Slot<Intersection> = Slot::required("ahead", "Output of the leader.");
const SEEN: Slot<Intersection> = Slot::required("seen", "Count of the leader.");

/// Drives at a hundredth of the count and publishes the count.
struct Leader;

impl Plugin for Leader {
    type Config = NoParameters;
    const NAME: &'static str = "leader";
    const SUMMARY: &'static str = "Drives and publishes.";
    const INPUTS: &'static [SlotInfo] = &[WHEELS.info()];
    const OUTPUTS: &'static [SlotInfo] = &[SEEN.info()];
    const CLAIMS: Axes = Axes::LINEAR;

    fn new(_: NoParameters, _: &Setup) -> Result<Self, ParameterError> {
        Ok(Leader)
    }
}

impl Behavior for Leader {
    fn propose(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) -> Proposal {
        let Some(wheels) = inputs.latest(&WHEELS) else { return Proposal::abstain(Reason::NoInput) };
        let seen = Intersection {
            stamp_ns: inputs.now().0,
            evidence_ns: wheels.header.stamp_ns,
            distance_m: wheels.header.x,
            ..Default::default()
        };
        if outputs.publish(SEEN.name, &seen, &[]).is_err() {
            return Proposal::abstain(Reason::Overflow);
        }
        Proposal::drive(Axes::LINEAR, Twist::planar(wheels.header.x * 0.01, 0.0))
    }
}

/// Turns by the output of the leader.
struct Follower;

impl Plugin for Follower {
    type Config = NoParameters;
    const NAME: &'static str = "follower";
    const SUMMARY: &'static str = "Turns by the output of the leader.";
    const INPUTS: &'static [SlotInfo] = &[AHEAD.info()];
    const CLAIMS: Axes = Axes::ANGULAR;

    fn new(_: NoParameters, _: &Setup) -> Result<Self, ParameterError> {
        Ok(Follower)
    }
}

impl Behavior for Follower {
    fn propose(&mut self, inputs: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        let Some(seen) = inputs.latest(&AHEAD) else { return Proposal::abstain(Reason::NoInput) };
        let age = inputs.now().since(seen.header.stamp());
        assert_eq!(age, PERIOD, "a message published in one step is received in the next");
        Proposal::drive(Axes::ANGULAR, Twist::planar(0.0, seen.header.distance_m * 0.001))
    }
}

/// Panics at every call.
struct Broken;

impl Plugin for Broken {
    type Config = NoParameters;
    const NAME: &'static str = "broken";
    const SUMMARY: &'static str = "Panics.";
    const INPUTS: &'static [SlotInfo] = &[WHEELS.info()];
    const CLAIMS: Axes = Axes::LINEAR;

    fn new(_: NoParameters, _: &Setup) -> Result<Self, ParameterError> {
        Ok(Broken)
    }
}

impl Behavior for Broken {
    fn propose(&mut self, _: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        panic!("a test panic")
    }
}

fn plugins() -> Plugins {
    Plugins {
        behaviors: vec![factory::<Leader>(), factory::<Follower>(), factory::<Broken>()],
        drivers: vec![stand_in(&["counter"], &["motor"], open).shared()],
    }
}

const ROBOT: &str = r#"
name = "stand-in"
footprint = { radius_m = 0.2 }
devices.body = { driver = "stand-in" }
sensors.wheels = { device = "body", kind = "counter" }
drive = { device = "body", kind = "motor" }
"#;

const TASK: &str = r#"
robot = "robot.toml"
[behaviors.leader]
priority = 10
inputs = { wheels = "wheels" }
[behaviors.follower]
priority = 5
inputs = { ahead = "leader.seen" }
"#;

fn plan(test: &str, task: &str) -> Plan {
    let folder = std::env::temp_dir().join(format!("yamabico-lockstep-{}-{test}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("robot.toml"), ROBOT).unwrap();
    std::fs::write(folder.join("task.toml"), task).unwrap();
    let task = load(&folder.join("task.toml"), &Overrides::default(), &plugins());
    std::fs::remove_dir_all(&folder).unwrap();
    Plan::new(&task.unwrap_or_else(|problems| panic!("{problems}")), 1)
}

/// The decisions of a run.
#[derive(Default)]
struct Decisions(Vec<DecisionHeader>);

impl Tap for Decisions {
    fn message(&mut self, _: &str, message: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        if message.name == DecisionHeader::NAME {
            let raw = yamabico_core::message::RawMessage { header, items };
            self.0.extend(View::<DecisionHeader>::of(raw).map(|view| *view.header));
        }
    }
}

fn run(test: &str, task: &str, threads: usize) -> (Vec<DecisionHeader>, Digest) {
    let mut lockstep = Lockstep::open(plan(test, task), PERIOD, threads, None).unwrap();
    let (mut decisions, mut digest) = (Decisions::default(), Digest::new());
    while lockstep.step(&mut Tee(vec![&mut decisions, &mut digest])).unwrap() == SensorSupply::Active {}
    (decisions.0, digest)
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let (decisions, one) = run("one", TASK, 1);
    let (_, two) = run("two", TASK, 2);
    assert_eq!(one.hex(), two.hex());
    assert_eq!(one.counts()["command"], 151, "one command a step over three seconds");
    let turning = decisions.iter().filter(|decision| decision.commanded.angular > 0.05).count();
    assert!(turning > 20, "the follower turned the robot in {turning} of {} steps", decisions.len());
}

#[test]
fn silent_sensors_end_in_a_stop_command() {
    let (decisions, _) = run("silent", TASK, 1);
    let at = |seconds: f64| &decisions[(seconds / PERIOD.as_secs_f64()) as usize];
    assert!(at(1.4).commanded.linear > 0.3, "{:?}", at(1.4));
    assert_eq!((at(2.9).commanded, at(2.9).mode()), (Twist::ZERO, Some(Mode::Idle)));
}

#[test]
fn a_behavior_that_panics_abstains_and_the_others_continue() {
    let task = format!("{TASK}[behaviors.broken]\npriority = 20\ninputs = {{ wheels = \"wheels\" }}\n");
    let (decisions, digest) = run("broken", &task, 1);
    assert!(decisions[70].commanded.linear > 0.3);
    assert!(!digest.counts().contains_key("behaviors/broken/proposal"));
}

#[test]
fn a_behavior_that_sleeps_while_inhibited_is_not_called() {
    let task = |sleeps: bool| {
        format!(
            "{TASK}[behaviors.second]\ntype = \"leader\"\npriority = 3\ninputs = {{ wheels = \"wheels\" }}\n\
             sleeps_while_inhibited = {sleeps}\n[[inhibit]]\nby = \"leader\"\nwhat = \"second\"\n"
        )
    };
    let proposals = |digest: &Digest| digest.counts()["behaviors/second/proposal"];
    let (_, awake) = run("awake", &task(false), 1);
    let (_, asleep) = run("asleep", &task(true), 1);
    assert_eq!(
        (proposals(&awake), proposals(&asleep)),
        (75, 2),
        "once before it is inhibited, once when it is free"
    );
    let (_, two) = run("asleep-two", &task(true), 2);
    assert_eq!(asleep.hex(), two.hex());
}
