//! Goals for a running robot, sent by a client.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use crate::stand_ins::{PERIOD, stand_in};
use yamabico_core::behavior::{
    Behavior, Inputs, Outputs, ParameterError, Plugin, Setup, Slot, SlotInfo, factory,
};
use yamabico_core::drive::Drive;
use yamabico_core::driver::{Device, DeviceSpec};
use yamabico_core::message::{Axes, Command, Goal, Odometry, PathHeader, PathPoint, Proposal, Reason, Twist};
use yamabico_core::plugins::Plugins;
use yamabico_core::sensor::{DeviceError, Due, Sensor};
use yamabico_core::testing::NoParameters;
use yamabico_core::time::Time;
use yamabico_host::config::{Overrides, load};
use yamabico_runtime::client::{ClientError, GoalRequest, RobotClient};
use yamabico_runtime::record::{Pace, Tee};
use yamabico_runtime::run::{Options, run};

const GOAL: Slot<Goal> = Slot::optional("goal", "Goal.");
const ODOMETRY: Slot<Odometry> = Slot::required("odometry", "Odometry.");
const PATH: Slot<PathHeader> = Slot::required("path", "Path to the goal.");

/// Drives along the x axis to a goal; it cannot reach one beside the axis.
struct Tram {
    goal: Option<Goal>,
}

impl Plugin for Tram {
    type Config = NoParameters;
    const NAME: &'static str = "tram";
    const SUMMARY: &'static str = "Rolls along the x axis.";
    const INPUTS: &'static [SlotInfo] = &[GOAL.info(), ODOMETRY.info()];
    const OUTPUTS: &'static [SlotInfo] = &[PATH.info()];
    const CLAIMS: Axes = Axes::LINEAR;

    fn new(_: NoParameters, _: &Setup) -> Result<Self, ParameterError> {
        Ok(Tram { goal: None })
    }
}

impl Behavior for Tram {
    fn propose(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) -> Proposal {
        self.goal = inputs.latest(&GOAL).map(|goal| *goal.header).filter(|goal| goal.y == 0.0);
        let (Some(goal), Some(odometry)) = (self.goal, inputs.latest(&ODOMETRY)) else {
            return Proposal::abstain(Reason::NoInput);
        };
        let x = odometry.header.x;
        let path = PathHeader { stamp_ns: inputs.now().0, progress_m: x, ..PathHeader::default() };
        outputs
            .publish(PATH.name, &path, &[PathPoint { x: 0.0, y: 0.0 }, PathPoint { x: goal.x, y: 0.0 }])
            .unwrap();
        Proposal::drive(Axes::LINEAR, Twist::planar(2.0 * (goal.x - x), 0.0))
    }
}

/// Odometry of a body that moves as commanded.
struct Wheels(Arc<Mutex<f64>>, f64, u64);

impl Sensor for Wheels {
    fn poll(&mut self, now: Time, outputs: &mut Outputs<'_>) -> Result<Due, DeviceError> {
        self.1 += *self.0.lock().unwrap() * PERIOD.as_secs_f64();
        self.2 += 1;
        let odometry = Odometry { stamp_ns: now.0, sequence: self.2, x: self.1, ..Odometry::default() };
        outputs.publish("wheels", &odometry, &[])?;
        Ok(Due::At(now + PERIOD))
    }
}

struct Motor(Arc<Mutex<f64>>);

impl Drive for Motor {
    fn apply(&mut self, command: Option<&Command>, _: Time) -> Result<(), DeviceError> {
        *self.0.lock().unwrap() = command.map_or(0.0, |command| command.twist.linear);
        Ok(())
    }
}

fn open(spec: DeviceSpec) -> Result<Device, ParameterError> {
    let speed = Arc::default();
    Ok(Device {
        sensors: vec![(spec.sensors[0].name.clone(), Box::new(Wheels(Arc::clone(&speed), 0.0, 0)) as _)],
        drive: Some(Box::new(Motor(speed))),
        ground_truth: None,
        walls: Vec::new(),
    })
}

fn plugins() -> Plugins {
    Plugins {
        behaviors: vec![factory::<Tram>()],
        drivers: vec![stand_in(&["lasting"], &["motor"], open).shared()],
    }
}

const ROBOT: &str = "footprint = { radius_m = 0.2 }\n\
    devices.body = { driver = \"stand-in\" }\n\
    drive = { device = \"body\", kind = \"motor\" }\n\
    sensors.wheels = { device = \"body\", kind = \"lasting\" }\n";
const TASK: &str = "robot = \"robot.toml\"\n[behaviors.tram]\npriority = 1\n\
    inputs = { odometry = \"wheels\", goal = \"operator\" }\n";

/// Sets its flag when dropped, also by a failing test.
struct Raise<'a>(&'a AtomicBool);

impl Drop for Raise<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

fn goal(x_m: f64, y_m: f64) -> GoalRequest {
    GoalRequest { x_m, y_m, heading_rad: None, tolerance_m: 0.05 }
}

#[test]
fn a_goal_is_accepted_reached_or_refused() {
    let robot = format!("operator-{}", std::process::id());
    let missing = RobotClient::join(&robot).err().map(|error| error.to_string());
    assert!(missing.is_some_and(|error| error.contains(&robot)), "no such robot is running yet");

    let folder = std::env::temp_dir().join(format!("yamabico-{robot}"));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("robot.toml"), format!("name = \"{robot}\"\n{ROBOT}")).unwrap();
    std::fs::write(folder.join("task.toml"), TASK).unwrap();
    let task = load(&folder.join("task.toml"), &Overrides::default(), &plugins());
    let task = task.unwrap_or_else(|problems| panic!("{problems}"));

    let flag = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let ends_the_run = Raise(&flag);
        let live = scope.spawn(|| {
            let options = Options { pace: Pace::Live, ..Options::default() };
            run(&task, &options, &flag, &mut Tee::default(), &mut |_| {}).map(drop)
        });
        let began = Instant::now();
        let joined = || {
            let mut client = RobotClient::join(&robot)?;
            let progress = client.goal_progress(Some("tram"))?;
            Ok::<_, ClientError>((client, progress))
        };
        let (mut client, progress) = loop {
            match joined() {
                Ok(joined) => break joined,
                Err(error) => assert!(began.elapsed() < Duration::from_secs(60), "{error}"),
            }
            std::thread::sleep(Duration::from_millis(50));
        };
        assert!(client.is_running() && RobotClient::running().contains(&robot));

        let near = goal(0.4, 0.0);
        let mut to_go_m = client.send_goal(&near, &progress).unwrap();
        assert!((to_go_m - 0.4).abs() < 0.2, "{to_go_m} m to go at first");
        let began = Instant::now();
        while to_go_m > near.tolerance_m {
            assert!(began.elapsed() < Duration::from_secs(60), "still {to_go_m} m to go");
            std::thread::sleep(Duration::from_millis(20));
            to_go_m = progress.to_go_m(&near).unwrap().unwrap_or(to_go_m);
        }

        let beside = client.send_goal(&goal(0.0, 3.0), &progress);
        assert!(matches!(beside, Err(ClientError::NoPath { .. })), "{beside:?}");
        let nowhere = client.send_goal(&goal(f64::NAN, 0.0), &progress);
        assert!(matches!(nowhere, Err(ClientError::GoalNotAccepted)), "{nowhere:?}");

        drop(ends_the_run);
        live.join().unwrap().unwrap();
    });
    assert!(!RobotClient::running().contains(&robot));
    std::fs::remove_dir_all(folder).unwrap();
}
