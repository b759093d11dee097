//! Driving by the teleop panel of a viewer, into the teleop behavior alone.

use std::sync::mpsc::Receiver;

use serde::Deserialize;
use yamabico_core::message::Stick;
use yamabico_core::time::Time;
use yamabico_host::bus::Publisher;
use yamabico_runtime::client::{ClientError, RobotClient};
use yamabico_runtime::execution::RobotManifest;

use super::parameters::Parameter;

/// Type of the behavior that turns stick messages into proposals.
const PLUGIN: &str = "teleop";

/// Deflection of the stick forward, left and round, -1 to 1, for one start of the robot.
pub(in crate::server) struct Deflection {
    /// Number of the start.
    pub session: u64,
    pub shares: [f64; 3],
}

/// Velocity as the teleop panel sends it: `geometry_msgs/Twist`.
#[derive(Debug, Deserialize)]
pub(super) struct Twist {
    linear: Vector,
    angular: Vector,
}

#[derive(Debug, Deserialize)]
struct Vector {
    #[serde(default)]
    x: f64,
    #[serde(default)]
    y: f64,
    #[serde(default)]
    z: f64,
}

/// Name of the robot's teleop behavior; `None` if it has none.
pub(super) fn behavior(manifest: &RobotManifest) -> Option<String> {
    manifest.plugins.iter().find(|plugin| plugin.plugin == PLUGIN).map(|plugin| plugin.name.clone())
}

impl Twist {
    /// Deflection that makes `behavior` drive like this, at most at its speeds; `None` without them.
    pub fn shares(&self, behavior: &str, parameters: &[Parameter]) -> Option<[f64; 3]> {
        let speed = |key: &str| {
            let name = format!("{behavior}.{key}");
            let parameter = parameters.iter().find(|parameter| parameter.name == name)?;
            parameter.value.as_f64().filter(|speed| *speed > 0.0)
        };
        let (speed_mps, turn_radps) = (speed("speed_mps")?, speed("turn_radps")?);
        let shares = [self.linear.x / speed_mps, self.linear.y / speed_mps, self.angular.z / turn_radps];
        Some(shares.map(|share| if share.is_finite() { share.clamp(-1.0, 1.0) } else { 0.0 }))
    }
}

/// Publishes deflections of the stick of the robot, until their senders are gone. A stick that is no longer moved expires by its age.
pub(in crate::server) fn drive(robot: &str, deflections: &Receiver<Deflection>) {
    let mut stick: Option<(u64, Publisher<Stick>)> = None;
    let mut sequence = 0;
    while let Ok(Deflection { session, shares: [forward, left, turn] }) = deflections.recv() {
        if stick.as_ref().is_none_or(|(known, _)| *known != session) {
            stick = open(robot)
                .inspect_err(|error| tracing::warn!("teleop: {error}"))
                .ok()
                .map(|open| (session, open));
        }
        let Some((_, publisher)) = &stick else { continue };
        sequence += 1;
        let message = Stick { stamp_ns: Time::monotonic_now().0, sequence, forward, left, turn };
        if let Err(error) = publisher.publish(&message, &[]) {
            tracing::warn!("teleop: {error}");
            stick = None;
        }
    }
}

fn open(robot: &str) -> Result<Publisher<Stick>, ClientError> {
    RobotClient::join(robot)?.stick()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::BehaviorParameters;
    use yamabico_runtime::execution::ParameterEntry;

    #[test]
    fn speeds_become_shares_of_the_behaviors_speeds() {
        let entry = |key: &str, value: f64| ParameterEntry {
            key: key.to_owned(),
            takes: "number".to_owned(),
            unit: None,
            range: None,
            value: Some(value.into()),
            summary: String::new(),
        };
        let parameters = vec![entry("speed_mps", 0.4), entry("turn_radps", 0.8)];
        let behavior = BehaviorParameters { behavior: "teleop".to_owned(), parameters };
        let parameters = super::super::parameters::of(&[behavior]);
        let twist = r#"{"linear":{"x":0.2,"y":0,"z":0},"angular":{"x":0,"y":0,"z":-5}}"#;
        let twist: Twist = serde_json::from_str(twist).unwrap();
        assert_eq!(twist.shares("teleop", &parameters), Some([0.5, 0.0, -1.0]));
        assert_eq!(twist.shares("other", &parameters), None);
        assert!(serde_json::from_str::<Twist>(r#"{"linear":1}"#).is_err());
    }
}
