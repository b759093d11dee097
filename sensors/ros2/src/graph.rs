//! Publishers and subscribers on the network, and why two of them do not match.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use yamabico_core::parameters::nearest;

/// Maximum number of endpoints that are kept; further ones are not seen.
const MAX_ENDPOINTS: usize = 10_000;

/// Identity of an endpoint; the first 12 bytes are that of its participant.
pub type EndpointId = [u8; 16];

/// A publisher or subscriber of another program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Endpoint {
    /// Topic, such as `/scan`.
    pub topic: String,
    /// Type of its messages, such as `sensor_msgs/msg/LaserScan`.
    pub message_type: String,
    /// True for a publisher, false for a subscriber.
    pub publishes: bool,
    /// Quality of service that it offers or asks for.
    pub qos: Qos,
}

/// Quality of service, as far as it keeps publishers and subscribers apart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Qos {
    /// Lost messages are sent again.
    pub reliable: bool,
    /// Subscribers that come later get the last messages.
    pub transient_local: bool,
}

impl fmt::Display for Qos {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let reliability = if self.reliable { "reliable" } else { "best effort" };
        let durability = if self.transient_local { "transient local" } else { "volatile" };
        write!(f, "{reliability}, {durability}")
    }
}

/// All endpoints of other programs.
#[derive(Clone, Debug, Default)]
pub struct Graph {
    endpoints: BTreeMap<EndpointId, Endpoint>,
}

impl Graph {
    /// Adds an endpoint, or replaces it.
    pub fn add(&mut self, id: EndpointId, endpoint: Endpoint) {
        if self.endpoints.len() < MAX_ENDPOINTS || self.endpoints.contains_key(&id) {
            self.endpoints.insert(id, endpoint);
        }
    }

    /// Removes an endpoint.
    pub fn remove(&mut self, id: &EndpointId) {
        self.endpoints.remove(id);
    }

    /// Removes all endpoints of a participant, whose identity begins with `prefix`.
    pub fn remove_participant(&mut self, prefix: &[u8]) {
        self.endpoints.retain(|id, _| !id.starts_with(prefix));
    }

    /// All endpoints in the order of their identities.
    pub fn endpoints(&self) -> impl Iterator<Item = &Endpoint> {
        self.endpoints.values()
    }

    /// Types of the messages that are published on a topic (`publishes`), or that are subscribed there.
    #[must_use]
    pub fn types_on(&self, topic: &str, publishes: bool) -> BTreeSet<&str> {
        let there = self.endpoints().filter(|end| end.topic == topic && end.publishes == publishes);
        there.map(|end| end.message_type.as_str()).collect()
    }

    /// Names of all topics with a publisher.
    #[must_use]
    pub fn published(&self) -> BTreeSet<&str> {
        self.endpoints().filter(|end| end.publishes).map(|end| end.topic.as_str()).collect()
    }

    /// Explains why `topic` has no publisher in `domain`.
    #[must_use]
    pub fn why_silent(&self, topic: &str, domain: u16) -> String {
        let published = self.published();
        // What every node publishes says nothing.
        let own = ["/rosout", "/parameter_events"];
        let published: Vec<&str> = published.into_iter().filter(|name| !own.contains(name)).collect();
        if published.is_empty() {
            return format!(
                "`{topic}` has no publisher, and nothing else is seen in domain {domain}: is the other side on, in the \
                 same network, and its ROS_DOMAIN_ID {domain}?"
            );
        }
        match nearest(topic, published.iter().copied()) {
            Some(near) => format!("`{topic}` has no publisher in domain {domain}: did you mean `{near}`?"),
            None => {
                let some = published[..published.len().min(12)].join(", ");
                format!("`{topic}` has no publisher in domain {domain}, but {some}")
            }
        }
    }
}

/// Explains why a subscriber that asks for `requested` gets nothing from a publisher on `topic` that offers `offered`; `we`
/// subscribe, or else publish.
#[must_use]
pub fn mismatch(topic: &str, requested: Qos, offered: Qos, we_subscribe: bool) -> String {
    let (what, asked) = if requested.reliable && !offered.reliable {
        ("reliability", "reliable")
    } else if requested.transient_local && !offered.transient_local {
        ("durability", "transient local")
    } else {
        ("deadline, liveliness or another policy", "more than is offered")
    };
    let remedy = match (we_subscribe, what) {
        (true, "reliability") => "remove `reliability = \"reliable\"` here, or make the publisher reliable",
        (true, _) => "change the publisher's",
        (false, _) => "change the subscriber's: this publisher is reliable and volatile",
    };
    let who = if we_subscribe { "this program asks for" } else { "a subscriber asks for" };
    format!(
        "the QoS on `{topic}` does not match in {what}: {who} {asked} ({requested}), the publisher offers {offered}; {remedy}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn publisher(topic: &str, message_type: &str) -> Endpoint {
        let (topic, message_type) = (topic.to_owned(), message_type.to_owned());
        Endpoint { topic, message_type, publishes: true, qos: Qos::default() }
    }

    #[test]
    fn participants_take_their_endpoints_along() {
        let mut graph = Graph::default();
        graph.add([1; 16], publisher("/scan", "sensor_msgs/msg/LaserScan"));
        graph.add([2; 16], publisher("/scan", "sensor_msgs/msg/PointCloud2"));
        assert_eq!(graph.types_on("/scan", true).len(), 2);
        assert!(graph.types_on("/scan", false).is_empty());
        graph.remove_participant(&[2; 12]);
        assert_eq!(
            graph.types_on("/scan", true).into_iter().collect::<Vec<_>>(),
            ["sensor_msgs/msg/LaserScan"]
        );
        graph.remove(&[1; 16]);
        assert!(graph.published().is_empty());
    }

    #[test]
    fn silence_is_explained() {
        let mut graph = Graph::default();
        assert!(graph.why_silent("/scan", 42).contains("ROS_DOMAIN_ID 42"));
        graph.add([1; 16], publisher("/rosout", "rcl_interfaces/msg/Log"));
        assert!(graph.why_silent("/scan", 42).contains("nothing else"));
        graph.add([2; 16], publisher("/scan_raw", "sensor_msgs/msg/LaserScan"));
        graph.add([3; 16], publisher("/odom", "nav_msgs/msg/Odometry"));
        assert!(graph.why_silent("/scan_rav", 0).contains("did you mean `/scan_raw`"));
        let text = graph.why_silent("/camera/image", 0);
        assert!(text.contains("/odom, /scan_raw"), "{text}");
    }

    #[test]
    fn mismatches_name_topic_policy_and_remedy() {
        let reliable = Qos { reliable: true, ..Qos::default() };
        let text = mismatch("/scan", reliable, Qos::default(), true);
        assert!(
            text.contains("`/scan`") && text.contains("reliability") && text.contains("remove"),
            "{text}"
        );
        let latched = Qos { reliable: true, transient_local: true };
        let text = mismatch("/cmd_vel", latched, reliable, false);
        assert!(
            text.contains("`/cmd_vel`") && text.contains("durability") && text.contains("subscriber's"),
            "{text}"
        );
    }
}
