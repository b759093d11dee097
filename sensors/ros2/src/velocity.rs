//! A topic of velocity commands as a behavior, such as the output of Nav2 or of a joystick.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use yamabico_core::behavior::{Behavior, Inputs, Outputs, ParameterError, Plugin, Setup, SlotInfo};
use yamabico_core::message::{Axes, Proposal, Twist};
use yamabico_core::time::Time;
use yamabico_recording::Refusal;
use yamabico_recording::ros2::{twist, twist_stamped};

use crate::config::VelocityConfig;
use crate::message::{self, RosMessage};
use crate::names::checked_topic;
use crate::network::{Network, Subscription};
use crate::reception::{Heard, Reception, velocity};
use crate::ros_clock::{RosClock, calendar_now_ns};

/// The behavior: proposes the newest velocity of the topic.
pub struct VelocityTopic {
    reception: Arc<Reception<Twist>>,
    timeout: Duration,
    axes: Axes,
    /// Receives as long as the behavior lives.
    _network: Arc<Network>,
}

impl Plugin for VelocityTopic {
    type Config = VelocityConfig;
    const NAME: &'static str = "ros2-twist";
    const SUMMARY: &'static str = "Drives as a topic of ROS 2 says, while its messages are fresh.";
    const INPUTS: &'static [SlotInfo] = &[];
    const CLAIMS: Axes = Axes::ALL;

    fn new(config: VelocityConfig, setup: &Setup) -> Result<Self, ParameterError> {
        let topic = checked_topic("ros2_twist", &config.ros2_twist)?;
        let network = Network::join(&config.network())?;
        let reception = Arc::new(Reception::new(&topic));
        let (for_messages, for_link) = (Arc::clone(&reception), Arc::clone(&reception));
        let clock = Mutex::new(RosClock::default());
        let mut is_told = false;
        let receive = move |message_type: &str, data: &[u8], arrival: Time| match read(message_type, data) {
            Ok((stamp_ns, value)) => {
                let clock = clock.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                let (captured, _) = clock.capture(stamp_ns, calendar_now_ns(), arrival);
                for_messages.hear(Heard { value, captured, arrival });
            }
            Err(refusal) => {
                if !std::mem::replace(&mut is_told, true) {
                    tracing::warn!("a message on `{}` is left out: {refusal}", for_messages.topic);
                }
            }
        };
        network.subscribe(Subscription {
            topic,
            types: vec![message::Twist::TYPE, message::TwistStamped::TYPE],
            reliability: config.reliability,
            transient_local: false,
            needed_by: Some(format!("behavior `{}`", setup.name)),
            receive: Box::new(receive),
            on_link: Box::new(move |link| for_link.set_link(link)),
        });
        let timeout = Duration::from_secs_f64(1e-3 * config.timeout_ms);
        Ok(VelocityTopic { reception, timeout, axes: setup.robot.axes, _network: network })
    }
}

/// Reads a command and its stamp, ns; 0 for one without.
fn read(message_type: &str, data: &[u8]) -> Result<(u64, Twist), Refusal> {
    match message_type {
        message::TwistStamped::TYPE => twist_stamped(data),
        _ => twist(data).map(|twist| (0, twist)),
    }
}

impl Behavior for VelocityTopic {
    fn propose(&mut self, inputs: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        velocity(&self.reception, self.timeout, self.axes, inputs.now())
    }
}
