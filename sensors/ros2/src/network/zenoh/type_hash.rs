//! Hashes of the definitions of messages (REP-2016), which stand in keys and tokens.

/// Hash of a publisher or subscriber whose distribution has none: Humble.
pub(super) const UNSUPPORTED: &str = "TypeHashNotSupported";

/// Types of messages with the hashes of the definitions that this program knows: all that it sends, and the usual ones that it
/// receives. They are those in the packages of Jazzy.
const KNOWN: [(&str, &str); 15] = [
    (
        "diagnostic_msgs/msg/DiagnosticArray",
        "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    ),
    (
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        "RIHS01_26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e",
    ),
    ("geometry_msgs/msg/Twist", "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a"),
    (
        "geometry_msgs/msg/TwistStamped",
        "RIHS01_5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64",
    ),
    ("nav_msgs/msg/Odometry", "RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"),
    ("nav_msgs/msg/Path", "RIHS01_1957a5bb3cee5da65c4e52e52b65a93df227efce4c20f8458b36e73066ca334b"),
    ("rosgraph_msgs/msg/Clock", "RIHS01_692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564"),
    ("sensor_msgs/msg/CameraInfo", "RIHS01_b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275"),
    (
        "sensor_msgs/msg/CompressedImage",
        "RIHS01_15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a",
    ),
    ("sensor_msgs/msg/Image", "RIHS01_d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47"),
    ("sensor_msgs/msg/Imu", "RIHS01_7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b"),
    ("sensor_msgs/msg/LaserScan", "RIHS01_64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828"),
    ("sensor_msgs/msg/Range", "RIHS01_b42b62562e93cbfe9d42b82fe5994dfa3d63d7d5c90a317981703f7388adff3a"),
    ("std_msgs/msg/Bool", "RIHS01_feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9"),
    ("std_msgs/msg/String", "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"),
];

/// Returns the hash of the definition of `message_type` that this program knows.
pub(super) fn known(message_type: &str) -> Option<&'static str> {
    KNOWN.iter().find(|(name, _)| *name == message_type).map(|(_, hash)| *hash)
}

/// Explains that the endpoint `who` has another definition of its messages than this program; `None` if it has not, or if that is
/// unknown.
pub(super) fn foreign(topic: &str, message_type: &str, hash: &str, who: &str) -> Option<String> {
    let known = known(message_type).filter(|known| *known != hash && hash != UNSUPPORTED)?;
    Some(format!(
        "the {who} of `{topic}` has another definition of {message_type} than this program ({hash}, not {known}): its values may be \
         wrong; take the definition of Jazzy there"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::{
        DiagnosticArray, Odometry, Path, PoseWithCovarianceStamped, RosMessage, Text, Twist, TwistStamped,
    };

    #[test]
    fn all_messages_that_are_sent_are_known() {
        let sent = [
            DiagnosticArray::TYPE,
            Odometry::TYPE,
            Path::TYPE,
            PoseWithCovarianceStamped::TYPE,
            Text::TYPE,
            Twist::TYPE,
            TwistStamped::TYPE,
        ];
        for message_type in sent {
            assert!(known(message_type).is_some_and(|hash| hash.len() == 71), "{message_type}");
        }
    }

    #[test]
    fn another_definition_is_told() {
        let text = foreign("/cmd_vel", Twist::TYPE, "RIHS01_00", "subscriber").unwrap();
        assert!(text.contains("`/cmd_vel`") && text.contains("RIHS01_00"), "{text}");
        assert_eq!(foreign("/cmd_vel", Twist::TYPE, UNSUPPORTED, "subscriber"), None);
        assert_eq!(foreign("/cmd_vel", Twist::TYPE, known(Twist::TYPE).unwrap(), "subscriber"), None);
        assert_eq!(foreign("/bump", "neato2_interfaces/msg/Bump", "RIHS01_00", "publisher"), None);
    }
}
