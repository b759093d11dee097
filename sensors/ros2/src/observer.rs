//! An observer as a behavior: publishes odometry, pose, path and decisions on ROS 2, and always abstains.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Duration;

use yamabico_core::behavior::{Behavior, Inputs, Outputs, ParameterError, Plugin, Setup, Slot, SlotInfo};
use yamabico_core::message::{
    Axes, DecisionHeader, Odometry, PathHeader, PathPoint, Pose, Proposal, Reason, Verdict,
};
use yamabico_core::time::Time;

use crate::config::ObserverConfig;
use crate::message::{self, Header};
use crate::names::checked_topic;
use crate::network::{Network, Publisher};
use crate::ros_clock::calendar_now_ns;
use crate::ros_decision;

/// Input: odometry of the robot.
pub const ODOMETRY: Slot<Odometry> = Slot::preferred("odometry", "odometry, published as nav_msgs/Odometry");
/// Input: pose on the map.
pub const POSE: Slot<Pose> = Slot::preferred("pose", "pose, published as PoseWithCovarianceStamped");
/// Input: planned path.
pub const PATH: Slot<PathHeader> = Slot::preferred("path", "path, published as nav_msgs/Path");
/// Input: decisions of the arbiter.
pub const DECISION: Slot<DecisionHeader> =
    Slot::preferred("decision", "decisions, published as diagnostics and as JSON");

/// Number of messages that wait to be sent; further ones are dropped.
const MAX_WAITING: usize = 64;

/// Something to publish.
enum Observed {
    Odometry(Odometry),
    Pose(Pose),
    Path(PathHeader, Vec<PathPoint>),
    Decision(Box<DecisionHeader>, Vec<Verdict>),
}

/// The behavior.
pub struct Observer {
    sender: SyncSender<Observed>,
    period: Duration,
    /// Time, mode and drivers of the last decision that was sent.
    last: Option<(Time, u32, [yamabico_core::message::Name; 3])>,
    dropped: u64,
}

impl Plugin for Observer {
    type Config = ObserverConfig;
    const NAME: &'static str = "ros2-publish";
    const SUMMARY: &'static str = "Publishes odometry, pose, path and decisions on ROS 2; never drives.";
    const INPUTS: &'static [SlotInfo] = &[ODOMETRY.info(), POSE.info(), PATH.info(), DECISION.info()];
    const CLAIMS: Axes = Axes::NONE;

    fn new(config: ObserverConfig, setup: &Setup) -> Result<Self, ParameterError> {
        let prefix = checked_topic("ros2_publish", &config.ros2_publish)?;
        let network = Network::join(&config.network())?;
        let (sender, receiver) = sync_channel(MAX_WAITING);
        let period = Duration::from_secs_f64(1.0 / config.rate_hz);
        let bridge = Bridge {
            odometry: network.publisher::<message::Odometry>(&format!("{prefix}/odometry"))?,
            pose: network.publisher::<message::PoseWithCovarianceStamped>(&format!("{prefix}/pose"))?,
            path: network.publisher::<message::Path>(&format!("{prefix}/path"))?,
            decision: network.publisher::<message::Text>(&format!("{prefix}/decision"))?,
            diagnostics: network.publisher::<message::DiagnosticArray>("/diagnostics")?,
            robot: setup.robot.name.clone(),
            config,
            _network: network,
        };
        let thread = std::thread::Builder::new().name("ros2-publish".into());
        let spawned = thread.spawn(move || bridge.run(&receiver));
        spawned.map_err(|error| ParameterError::new("", format!("cannot start a thread: {error}")))?;
        Ok(Observer { sender, period, last: None, dropped: 0 })
    }
}

impl Behavior for Observer {
    fn propose(&mut self, inputs: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        let mut send = |observed| self.dropped += u64::from(self.sender.try_send(observed).is_err());
        for reading in inputs.fresh(&ODOMETRY) {
            send(Observed::Odometry(*reading.header));
        }
        for pose in inputs.fresh(&POSE) {
            send(Observed::Pose(*pose.header));
        }
        for path in inputs.fresh(&PATH) {
            send(Observed::Path(*path.header, path.items.to_vec()));
        }
        if let Some(decision) = inputs.latest(&DECISION) {
            let (header, now) = (decision.header, inputs.now());
            let is_due = self.last.is_none_or(|(at, mode, source)| {
                mode != header.mode || source != header.source || now.since(at) >= self.period
            });
            if is_due {
                self.last = Some((now, header.mode, header.source));
                send(Observed::Decision(Box::new(*header), decision.items.to_vec()));
            }
        }
        Proposal::abstain(Reason::Nominal)
            .with_evidence(inputs.now())
            .with_note(format_args!("observing, {} messages dropped", self.dropped))
    }
}

/// The thread that sends.
struct Bridge {
    odometry: Publisher,
    pose: Publisher,
    path: Publisher,
    decision: Publisher,
    diagnostics: Publisher,
    robot: String,
    config: ObserverConfig,
    _network: std::sync::Arc<Network>,
}

impl Bridge {
    fn run(&self, receiver: &Receiver<Observed>) {
        while let Ok(observed) = receiver.recv() {
            self.publish(observed);
        }
    }

    fn publish(&self, observed: Observed) {
        let ObserverConfig { odom_frame, base_frame, map_frame, .. } = &self.config;
        match observed {
            Observed::Odometry(reading) => {
                let header = header(reading.stamp_ns, odom_frame);
                self.odometry.publish(&message::Odometry::of(&reading, header, base_frame));
            }
            Observed::Pose(pose) => {
                let header = header(pose.stamp_ns, map_frame);
                self.pose.publish(&message::PoseWithCovarianceStamped::of(&pose, header));
            }
            Observed::Path(path, corners) => {
                self.path.publish(&message::Path::of(&corners, header(path.stamp_ns, map_frame)));
            }
            Observed::Decision(decision, verdicts) => {
                let header = header(decision.stamp_ns, "");
                self.diagnostics.publish(&ros_decision::diagnostics(
                    &decision,
                    &verdicts,
                    &self.robot,
                    header,
                ));
                self.decision.publish(&message::Text { data: ros_decision::json(&decision, &verdicts) });
            }
        }
    }
}

/// Header of data with a stamp on the clock of this run.
fn header(stamp_ns: u64, frame: &str) -> Header {
    let age_ns = Time::monotonic_now().0.saturating_sub(stamp_ns);
    Header::new(calendar_now_ns().saturating_sub(age_ns), frame)
}
