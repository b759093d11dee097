//! The client side of a running robot: what every live command uses.
//!
//! [`RobotClient`] joins a running robot by its name. It reads the manifest, plugin statuses and decisions, subscribes to
//! topics, and sends requests: enable or disable a behavior, emergency stop and reset, goals, new parameters.

mod decisions;
mod error;
mod feed;
mod goal;
mod parameters;
mod plugin_status;
mod request;
mod statistics;
mod topic;

use std::time::{Duration, Instant};

use yamabico_core::message::{Control, ControlKind, DecisionHeader, MessageType, RobotManifestHeader, Stick};
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, BusError, Publisher, Subscriber};

pub use error::ClientError;
pub use feed::RobotFeed;
pub use goal::{GoalProgress, GoalRequest};
pub use plugin_status::{CallSummary, PluginStatus, TimedText};
pub use request::{Request, RequestResult};
pub use statistics::{RollingWindow, Statistics};
pub use topic::{ReceivedMessage, TopicSubscriber};

use crate::execution::{RobotManifest, topics};
use decisions::DecisionObserver;

/// Time within which a robot publishes its manifest.
const MANIFEST_TIMEOUT: Duration = Duration::from_secs(3);
/// Pause between two attempts to receive.
const PAUSE: Duration = Duration::from_millis(5);

/// A connection to a running robot.
///
/// Joining opens only what an emergency stop needs; everything else is opened when it is first used.
pub struct RobotClient {
    bus: Bus,
    controls: Publisher<Control>,
    decisions: Subscriber<DecisionHeader>,
    sequence: u64,
    manifest: Option<RobotManifest>,
    observer: Option<DecisionObserver>,
}

impl RobotClient {
    /// Names of the robots that are running on this machine.
    pub fn running() -> Vec<String> {
        Bus::running()
    }

    /// Joins the running robot of this name.
    ///
    /// # Errors
    /// No such robot is running.
    pub fn join(robot: &str) -> Result<RobotClient, ClientError> {
        let bus = Bus::join(robot)?;
        Ok(RobotClient {
            controls: bus.publisher(topics::CONTROL)?,
            decisions: bus.subscriber(topics::DECISION)?,
            bus,
            sequence: 0,
            manifest: None,
            observer: None,
        })
    }

    /// Name of the robot.
    pub fn robot(&self) -> &str {
        self.bus.name()
    }

    /// Returns true if the robot is still running.
    pub fn is_running(&self) -> bool {
        Bus::running().iter().any(|name| name == self.robot())
    }

    /// Plugins and topics of the robot.
    ///
    /// # Errors
    /// The robot does not publish its manifest in time.
    pub fn manifest(&mut self) -> Result<&RobotManifest, ClientError> {
        if self.manifest.is_none() {
            let manifest = receive_manifest(&self.bus)?;
            for declaration in manifest.topics.iter().filter_map(|topic| topic.declares.as_ref()) {
                if let Err(problem) = MessageType::declare(declaration) {
                    tracing::warn!("{problem}");
                }
            }
            self.manifest = Some(manifest);
        }
        self.manifest.as_ref().ok_or(ClientError::NoManifest)
    }

    /// Opens a publisher for an operator's stick.
    ///
    /// # Errors
    /// The bus fails, or too many operators publish already.
    pub fn stick(&self) -> Result<Publisher<Stick>, ClientError> {
        Ok(self.bus.publisher(topics::STICK)?)
    }

    /// Publishes a request, stamped with `stamp` and the next sequence number.
    fn send(&mut self, control: Control, stamp: Time, items: &[u8]) -> Result<(), BusError> {
        self.sequence += 1;
        self.controls.publish(&Control { stamp_ns: stamp.0, sequence: self.sequence, ..control }, items)
    }
}

/// A request of this kind without target or goal.
fn control(kind: ControlKind) -> Control {
    Control { kind: kind.code(), ..Control::default() }
}

fn receive_manifest(bus: &Bus) -> Result<RobotManifest, ClientError> {
    let subscriber = bus.subscriber::<RobotManifestHeader>(topics::MANIFEST)?;
    let began = Instant::now();
    loop {
        if let Some(manifest) = subscriber.newest()? {
            return Ok(serde_json::from_slice(manifest.items())?);
        }
        if began.elapsed() > MANIFEST_TIMEOUT {
            return Err(ClientError::NoManifest);
        }
        std::thread::sleep(PAUSE);
    }
}
