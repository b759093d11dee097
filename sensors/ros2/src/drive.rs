//! Drive that sends velocity commands.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use yamabico_core::drive::{Commanded, Drive};
use yamabico_core::geometry::Hypotenuse;
use yamabico_core::geometry::Twist as BodyTwist;
use yamabico_core::message::Command;
use yamabico_core::sensor::DeviceError;
use yamabico_core::time::Time;

use crate::config::{DriveConfig, TwistType};
use crate::message::{Header, RosMessage, Twist, TwistStamped};
use crate::network::{Network, Publisher};
use crate::ros_clock::calendar_now_ns;

/// Time between two looks at who subscribes.
const LOOK_PERIOD: Duration = Duration::from_millis(100);
/// Time after which the log says that the topic has no subscriber.
const PATIENCE: Duration = Duration::from_secs(5);
/// Longest wait at the end until the last command, zero, has arrived.
const FLUSH: Duration = Duration::from_millis(200);

/// The drive.
pub(crate) struct TwistDrive {
    network: Arc<Network>,
    config: DriveConfig,
    commanded: Commanded,
    plain: Option<Publisher>,
    stamped: Option<Publisher>,
    sent: Option<(Time, BodyTwist)>,
    looked: Time,
    opened: Time,
    has_told: bool,
    /// Set when the process is asked to end.
    ending: Arc<AtomicBool>,
}

impl TwistDrive {
    pub fn new(network: Arc<Network>, config: DriveConfig, ending: Arc<AtomicBool>) -> TwistDrive {
        let watchdog = Duration::from_secs_f64(1e-3 * config.watchdog_ms);
        TwistDrive {
            network,
            config,
            commanded: Commanded::new(watchdog),
            plain: None,
            stamped: None,
            sent: None,
            looked: Time::ZERO,
            opened: Time::monotonic_now(),
            has_told: false,
            ending,
        }
    }

    /// Publishes with the types that the topic is subscribed with, or with the configured one.
    fn follow_subscribers(&mut self, now: Time) {
        if now.since(self.looked) < LOOK_PERIOD {
            return;
        }
        self.looked = now;
        let topic = self.config.topic.as_str();
        let types: BTreeSet<String> = self
            .network
            .with_graph(|graph| graph.types_on(topic, false).into_iter().map(str::to_owned).collect());
        let wants = |name: &str, configured| match self.config.message {
            TwistType::Auto => types.contains(name),
            only => only == configured,
        };
        let (wants_plain, wants_stamped) =
            (wants(Twist::TYPE, TwistType::Twist), wants(TwistStamped::TYPE, TwistType::TwistStamped));
        if wants_plain {
            open::<Twist>(&self.network, topic, &mut self.plain);
        }
        if wants_stamped {
            open::<TwistStamped>(&self.network, topic, &mut self.stamped);
        }
        let has_right_subscriber = (wants_plain && types.contains(Twist::TYPE))
            || (wants_stamped && types.contains(TwistStamped::TYPE));
        if !has_right_subscriber && !self.has_told && now.since(self.opened) > PATIENCE {
            self.has_told = true;
            let domain = self.network.domain;
            match types.first() {
                None => tracing::warn!(
                    "`{topic}` has no subscriber in domain {domain}: the robot gets no commands"
                ),
                Some(other) => tracing::warn!(
                    "`{topic}` is subscribed as {other}, but this drive sends {}: set `message` of the drive",
                    if self.config.message == TwistType::TwistStamped { "TwistStamped" } else { "Twist" }
                ),
            }
        }
    }

    fn send(&mut self, twist: &BodyTwist, now: Time) {
        self.sent = Some((now, *twist));
        if let Some(publisher) = &self.plain {
            publisher.publish(&Twist::from(twist));
        }
        if let Some(publisher) = &self.stamped {
            let header = Header::new(calendar_now_ns(), &self.config.frame_id);
            publisher.publish(&TwistStamped { header, twist: twist.into() });
        }
    }
}

impl Drive for TwistDrive {
    fn apply(&mut self, command: Option<&Command>, now: Time) -> Result<(), DeviceError> {
        if let Some(command) = command {
            self.commanded.set(command, now);
        }
        self.follow_subscribers(now);
        if self.ending.load(Ordering::Relaxed) {
            self.send(&BodyTwist::ZERO, now);
            [&self.plain, &self.stamped].into_iter().flatten().for_each(|publisher| publisher.flush(FLUSH));
            return Ok(());
        }
        let twist = slowed(&self.commanded.twist(now), self.config.max_mps.unwrap_or(f64::INFINITY));
        let period = Duration::from_secs_f64(1.0 / self.config.rate_hz);
        let is_due = self.sent.is_none_or(|(at, last)| {
            let stops = twist == BodyTwist::ZERO && last != BodyTwist::ZERO;
            // A little early, so that commands of the same rate are not thinned to half of it.
            stops || now.since(at) >= period.mul_f64(0.9)
        });
        if is_due {
            self.send(&twist, now);
        }
        Ok(())
    }
}

/// Returns the same curve at a speed of at most `max_mps`.
fn slowed(twist: &BodyTwist, max_mps: f64) -> BodyTwist {
    let speed_mps = twist.linear.hypotenuse(twist.lateral);
    let share = if speed_mps > max_mps { max_mps / speed_mps } else { 1.0 };
    BodyTwist::new(share * twist.linear, share * twist.lateral, share * twist.angular)
}

/// Opens a publisher unless it is open.
fn open<M: RosMessage>(network: &Network, topic: &str, publisher: &mut Option<Publisher>) {
    if publisher.is_some() {
        return;
    }
    match network.publisher::<M>(topic) {
        Ok(opened) => {
            tracing::info!("`{topic}` gets {}", M::TYPE);
            *publisher = Some(opened);
        }
        Err(error) => tracing::warn!("{error}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fast_motion_keeps_its_curve() {
        let twist = BodyTwist::planar(0.4, 0.8);
        let slow = slowed(&twist, 0.3);
        assert!((slow.linear - 0.3).abs() < 1e-12 && (slow.angular / slow.linear - 2.0).abs() < 1e-12);
        assert_eq!(slowed(&twist, 0.4), twist);
        assert_eq!(slowed(&BodyTwist::ZERO, 0.3), BodyTwist::ZERO);
    }
}
