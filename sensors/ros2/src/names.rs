//! Names of topics and of message types: `/scan` and `sensor_msgs/msg/LaserScan` in ROS, `rt/scan` and
//! `sensor_msgs::msg::dds_::LaserScan_` in DDS.

use yamabico_core::behavior::ParameterError;

/// Returns the name in DDS of the topic `name` of ROS; a missing `/` at its beginning is added.
#[must_use]
pub fn dds_topic(name: &str) -> String {
    format!("rt/{}", name.trim_start_matches('/'))
}

/// Returns the name in ROS of the topic `name` of DDS; `None` for a service, and for a topic of other programs.
#[must_use]
pub fn ros_topic(name: &str) -> Option<String> {
    name.strip_prefix("rt/").map(|rest| format!("/{rest}"))
}

/// Returns the name in DDS of the type `name` of ROS.
#[must_use]
pub fn dds_type(name: &str) -> String {
    match name.rsplit_once('/') {
        Some((package, own)) => format!("{}::dds_::{own}_", package.replace('/', "::")),
        None => name.to_owned(),
    }
}

/// Returns the name in ROS of the type `name` of DDS; that of another program stays as it is.
#[must_use]
pub fn ros_type(name: &str) -> String {
    let parts =
        name.split_once("::dds_::").and_then(|(package, own)| Some((package, own.strip_suffix('_')?)));
    parts.map_or_else(|| name.to_owned(), |(package, own)| format!("{}/{own}", package.replace("::", "/")))
}

/// Checks that `topic` is a name of a topic, and adds a missing `/` at its beginning.
///
/// # Errors
/// The key `key` with an invalid name.
pub fn checked_topic(key: &str, topic: &str) -> Result<String, ParameterError> {
    let parts = topic.strip_prefix('/').unwrap_or(topic);
    let is_part = |part: &str| {
        part.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
            && part.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
    };
    if !parts.split('/').all(is_part) {
        let problem =
            format!("`{topic}` is no name of a topic: use letters, digits, `_` and `/`, such as /cmd_vel");
        return Err(ParameterError::new(key, problem));
    }
    Ok(format!("/{parts}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_ros() {
        assert_eq!(dds_topic("/robot1/cmd_vel"), "rt/robot1/cmd_vel");
        assert_eq!(ros_topic("rt/scan").as_deref(), Some("/scan"));
        assert_eq!(ros_topic("rr/add_two_intsReply"), None);
        let types = [
            ("sensor_msgs/msg/LaserScan", "sensor_msgs::msg::dds_::LaserScan_"),
            ("rosgraph_msgs/msg/Clock", "rosgraph_msgs::msg::dds_::Clock_"),
        ];
        for (ros, dds) in types {
            assert_eq!((dds_type(ros).as_str(), ros_type(dds).as_str()), (dds, ros));
        }
        assert_eq!(ros_type("ShapeType"), "ShapeType");
    }

    #[test]
    fn invalid_topics_are_refused() {
        assert_eq!(checked_topic("topic", "scan").as_deref(), Ok("/scan"));
        assert_eq!(checked_topic("topic", "/a/b_2").as_deref(), Ok("/a/b_2"));
        for wrong in ["", "/", "/a//b", "/2d", "/a b", "~/scan", "/é"] {
            let error = checked_topic("topic", wrong).unwrap_err();
            assert!(error.key == "topic" && error.problem.contains("/cmd_vel"), "{wrong}: {error:?}");
        }
    }
}
