//! Liveliness tokens, by which the endpoints of rmw_zenoh find each other.
//!
//! A token is a key of 13 parts; in names in it, `%` stands for `/`:
//! `@ros2_lv/DOMAIN/SESSION/NODE/ENTITY/KIND/ENCLAVE/NAMESPACE/NODE_NAME/TOPIC/TYPE/HASH/QOS`. That of a node ends after its name.
//! Source: the design document of rmw_zenoh.

use std::fmt;

use xxhash_rust::xxh3::xxh3_128;

use crate::graph::{Endpoint, EndpointId, Qos};
use crate::names::{dds_type, ros_type};

/// Beginning of all tokens.
const SPACE: &str = "@ros2_lv";
/// Codes of the policies of a quality of service that differ from the default: reliable and volatile.
const BEST_EFFORT: &str = "2";
const TRANSIENT_LOCAL: &str = "1";

/// The node of this program in a domain.
pub(super) struct Node {
    /// Number of the domain.
    pub domain: u16,
    /// Identity of the session.
    pub session: String,
    /// Name.
    pub name: String,
}

/// An endpoint as its token announces it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Announced {
    /// Identity of the session that it is in.
    pub session: String,
    /// Topic, type, role and quality of service.
    pub endpoint: Endpoint,
    /// Hash of the definition of its messages.
    pub hash: String,
}

/// Quality of service in a token, with the depth of its history.
pub(super) struct Offer(pub Qos, pub usize);

impl fmt::Display for Offer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Offer(qos, depth) = self;
        let reliability = if qos.reliable { "" } else { BEST_EFFORT };
        let durability = if qos.transient_local { TRANSIENT_LOCAL } else { "" };
        // History, deadline, lifespan and liveliness are the default ones.
        write!(f, "{reliability}:{durability}:,{depth}:,:,:,,")
    }
}

impl Node {
    /// Key of the token of the node itself.
    pub fn token(&self) -> String {
        let Node { domain, session, name } = self;
        format!("{SPACE}/{domain}/{session}/0/0/NN/%/%/{name}")
    }

    /// Key of the token of the endpoint number `entity` of this node.
    pub fn endpoint_token(&self, entity: u32, endpoint: &Endpoint, hash: &str, depth: usize) -> String {
        let Node { domain, session, name } = self;
        let kind = if endpoint.publishes { "MP" } else { "MS" };
        let topic = endpoint.topic.replace('/', "%");
        let (message_type, offer) = (dds_type(&endpoint.message_type), Offer(endpoint.qos, depth));
        format!(
            "{SPACE}/{domain}/{session}/0/{entity}/{kind}/%/%/{name}/{topic}/{message_type}/{hash}/{offer}"
        )
    }
}

/// Returns the key of all tokens in `domain`.
pub(super) fn all_tokens(domain: u16) -> String {
    format!("{SPACE}/{domain}/**")
}

/// Returns the identity of the endpoint with the token `key`.
pub(super) fn id_of(key: &str) -> EndpointId {
    xxh3_128(key.as_bytes()).to_le_bytes()
}

/// Reads a token; `None` for that of a node or of a service, and for one of an unknown form. Further parts may follow.
pub(super) fn announced(key: &str) -> Option<Announced> {
    let parts: Vec<&str> = key.split('/').collect();
    let [SPACE, _, session, _, _, kind, _, _, _, topic, message_type, hash, qos, ..] = parts[..] else {
        return None;
    };
    let publishes = match kind {
        "MP" => true,
        "MS" => false,
        _ => return None,
    };
    let mut policies = qos.split(':');
    let (reliability, durability) = (policies.next()?, policies.next()?);
    let endpoint = Endpoint {
        topic: topic.replace('%', "/"),
        message_type: ros_type(message_type),
        publishes,
        qos: Qos { reliable: reliability != BEST_EFFORT, transient_local: durability == TRANSIENT_LOCAL },
    };
    Some(Announced { session: session.to_owned(), endpoint, hash: hash.to_owned() })
}

/// Returns the key of the messages on a topic with a definition of a type; `*` as the hash stands for all definitions.
pub(super) fn data_key(domain: u16, topic: &str, message_type: &str, hash: &str) -> String {
    format!("{domain}/{}/{}/{hash}", topic.trim_matches('/'), dds_type(message_type))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HASH: &str = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18";

    fn listener() -> Announced {
        let endpoint = Endpoint {
            topic: "/chatter".into(),
            message_type: "std_msgs/msg/String".into(),
            publishes: false,
            qos: Qos { reliable: true, transient_local: false },
        };
        Announced { session: "aac3178e146ba6f1fc6e6a4085e77f21".into(), endpoint, hash: HASH.into() }
    }

    /// The examples of the design document of rmw_zenoh.
    #[test]
    fn tokens_and_keys_are_those_of_rmw_zenoh() {
        let node =
            Node { domain: 2, session: "aac3178e146ba6f1fc6e6a4085e77f21".into(), name: "listener".into() };
        assert_eq!(node.token(), "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/listener");
        let token = format!(
            "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/10/MS/%/%/listener/%chatter/std_msgs::msg::dds_::String_/{HASH}/::,10:,:,:,,"
        );
        assert_eq!(node.endpoint_token(10, &listener().endpoint, HASH, 10), token);
        assert_eq!(announced(&token), Some(listener()));
        assert_eq!(
            data_key(0, "/robot1/chatter", "std_msgs/msg/String", HASH),
            format!("0/robot1/chatter/std_msgs::msg::dds_::String_/{HASH}")
        );
    }

    #[test]
    fn qualities_of_service_survive() {
        let node = Node { domain: 0, session: "1f".into(), name: "yamabico_7".into() };
        for (reliable, transient_local) in [(false, false), (false, true), (true, false), (true, true)] {
            let endpoint = Endpoint { qos: Qos { reliable, transient_local }, ..listener().endpoint };
            let token = node.endpoint_token(1, &endpoint, HASH, 16);
            assert_eq!(announced(&token).map(|announced| announced.endpoint), Some(endpoint), "{token}");
        }
    }

    #[test]
    fn other_and_broken_tokens_are_left_out() {
        let node = Node { domain: 0, session: "1f".into(), name: "n".into() };
        let token = node.endpoint_token(1, &listener().endpoint, HASH, 1);
        assert!(announced(&node.token()).is_none() && announced("").is_none());
        assert!(announced(&token.replace("/MS/", "/SS/")).is_none());
        assert!(announced(&token.replace(SPACE, "@other")).is_none());
        // Later distributions append parts.
        assert!(announced(&format!("{token}/cpu:")).is_some());
        for end in 0..token.len() {
            let _ = announced(&token[..end]);
        }
    }
}
