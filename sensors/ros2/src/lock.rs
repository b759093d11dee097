//! A lock as a behavior: while its topic says true, every behavior of lower priority stands.

use std::sync::Arc;
use std::time::Duration;

use yamabico_core::behavior::{Behavior, Inputs, Outputs, ParameterError, Plugin, Setup, SlotInfo};
use yamabico_core::message::{Axes, Proposal};
use yamabico_recording::ros2::flag;

use crate::config::LockConfig;
use crate::names::checked_topic;
use crate::network::{Network, Subscription};
use crate::reception::{Heard, Reception, lock};

/// The behavior: proposes to stand while the lock is closed.
pub struct Lock {
    reception: Arc<Reception<bool>>,
    timeout: Option<Duration>,
    axes: Axes,
    /// Receives as long as the behavior lives.
    _network: Arc<Network>,
}

impl Plugin for Lock {
    type Config = LockConfig;
    const NAME: &'static str = "ros2-lock";
    const SUMMARY: &'static str = "Stops all behaviors of lower priority while a topic of ROS 2 says so.";
    const INPUTS: &'static [SlotInfo] = &[];
    const CLAIMS: Axes = Axes::ALL;

    fn new(config: LockConfig, setup: &Setup) -> Result<Self, ParameterError> {
        let topic = checked_topic("ros2_lock", &config.ros2_lock)?;
        let network = Network::join(&config.network())?;
        let reception = Arc::new(Reception::new(&topic));
        let (for_messages, for_link) = (Arc::clone(&reception), Arc::clone(&reception));
        network.subscribe(Subscription {
            topic,
            types: vec!["std_msgs/msg/Bool"],
            reliability: config.reliability,
            transient_local: false,
            needed_by: Some(format!("behavior `{}`", setup.name)),
            receive: Box::new(move |_, data, arrival| {
                if let Ok(value) = flag(data) {
                    for_messages.hear(Heard { value, captured: arrival, arrival });
                }
            }),
            on_link: Box::new(move |link| for_link.set_link(link)),
        });
        let timeout = (config.timeout_ms > 0.0).then(|| Duration::from_secs_f64(1e-3 * config.timeout_ms));
        Ok(Lock { reception, timeout, axes: setup.robot.axes, _network: network })
    }
}

impl Behavior for Lock {
    fn propose(&mut self, inputs: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        lock(&self.reception, self.timeout, self.axes, inputs.now())
    }
}
