//! All message types by name, for code that handles messages without knowing their Rust types: the recorder, the bus
//! and the command-line tools.

use super::*;

/// Description of a message type at run time.
#[derive(Clone, Copy)]
pub struct MessageType {
    /// Versioned name, such as `yamabico.Odometry.v1`.
    pub name: &'static str,
    /// Delivery policy of its channels.
    pub channel: Channel,
    /// Size of the header, bytes.
    pub header_size: usize,
    /// Alignment of the header, bytes.
    pub header_align: usize,
    /// Size of one item, bytes.
    pub item_size: usize,
    /// Layout of the header.
    pub header: Layout,
    /// Layout of an item; [`Layout::U8`] for pixels, text, and messages without a list.
    pub item: Layout,
    /// Reads the stamps (validity, evidence) from the bytes of a header; zero if their size is wrong.
    pub stamps: fn(header: &[u8]) -> (Time, Time),
    /// Reads the sequence number from the bytes of a header; zero if their size is wrong.
    pub sequence: fn(header: &[u8]) -> u64,
    /// Converts header and items to JSON; see [`MessageType::to_json`].
    pub(super) json: fn(&MessageType, header: &[u8], items: &[u8]) -> serde_json::Value,
}

impl MessageType {
    /// Description of message type `M`.
    pub const fn of<M: Message>() -> MessageType {
        MessageType {
            name: M::NAME,
            channel: M::CHANNEL,
            header_size: size_of::<M>(),
            header_align: align_of::<M>(),
            item_size: size_of::<M::Item>(),
            header: M::LAYOUT,
            item: <M::Item as HasLayout>::LAYOUT,
            stamps: stamps::<M>,
            sequence: sequence::<M>,
            json: to_json::<M>,
        }
    }

    /// Returns an error text for the unknown type `name`, with the known version of it if there is one.
    pub fn unknown(name: &str) -> String {
        let family =
            |name: &str| name.rsplit_once(".v").map_or_else(|| name.to_owned(), |(f, _)| f.to_owned());
        match ALL.iter().find(|message| family(message.name) == family(name)) {
            Some(known) => format!(
                "`{name}` is another version of a message that this program knows as `{}`: install matching versions",
                known.name
            ),
            None => {
                format!(
                    "message type `{name}` is unknown: it is not a message of this version of Yamabico, and no plugin declares it"
                )
            }
        }
    }
}

impl PartialEq for MessageType {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Eq for MessageType {}

impl std::fmt::Debug for MessageType {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

/// All message types.
pub static ALL: &[MessageType] = &[
    MessageType::of::<FrameHeader>(),
    MessageType::of::<RangeScanHeader>(),
    MessageType::of::<Odometry>(),
    MessageType::of::<Imu>(),
    MessageType::of::<Bumper>(),
    MessageType::of::<Clock>(),
    MessageType::of::<StepSignal>(),
    MessageType::of::<Truth>(),
    MessageType::of::<Goal>(),
    MessageType::of::<PathHeader>(),
    MessageType::of::<Pose>(),
    MessageType::of::<ObstaclesHeader>(),
    MessageType::of::<FreeSpaceHeader>(),
    MessageType::of::<LandmarksHeader>(),
    MessageType::of::<Intersection>(),
    MessageType::of::<Corridor>(),
    MessageType::of::<OverlayHeader>(),
    MessageType::of::<Proposal>(),
    MessageType::of::<Command>(),
    MessageType::of::<DecisionHeader>(),
    MessageType::of::<Heartbeat>(),
    MessageType::of::<FailureHeader>(),
    MessageType::of::<CallsHeader>(),
    MessageType::of::<SavedStateHeader>(),
    MessageType::of::<WallsHeader>(),
    MessageType::of::<ProcessesHeader>(),
    MessageType::of::<RobotManifestHeader>(),
    MessageType::of::<Control>(),
    MessageType::of::<RetuneHeader>(),
    MessageType::of::<RetunedHeader>(),
    MessageType::of::<Stick>(),
    MessageType::of::<CallHeader>(),
    MessageType::of::<HeardHeader>(),
];

fn stamps<M: Message>(header: &[u8]) -> (Time, Time) {
    match bytemuck::try_pod_read_unaligned::<M>(header) {
        Ok(header) => (header.stamp(), header.evidence()),
        Err(_) => (Time::ZERO, Time::ZERO),
    }
}

fn sequence<M: Message>(header: &[u8]) -> u64 {
    bytemuck::try_pod_read_unaligned::<M>(header).map_or(0, |header| header.sequence())
}

fn to_json<M: Message>(_: &MessageType, header: &[u8], items: &[u8]) -> serde_json::Value {
    let Ok(header) = bytemuck::try_pod_read_unaligned::<M>(header) else { return serde_json::Value::Null };
    let mut json = serde_json::to_value(header).unwrap_or_default();
    let size = size_of::<M::Item>();
    if size > 1
        && let Some(object) = json.as_object_mut()
    {
        let items: Vec<M::Item> = items.chunks_exact(size).map(bytemuck::pod_read_unaligned).collect();
        object.insert("items".into(), serde_json::to_value(items).unwrap_or_default());
    }
    if M::IS_TEXT
        && let Some(object) = json.as_object_mut()
    {
        let text = String::from_utf8_lossy(items);
        object.insert("text".into(), text.trim_end_matches('\0').into());
    }
    json
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_versioned_and_unique() {
        for (i, message) in ALL.iter().enumerate() {
            let (family, version) = message.name.rsplit_once(".v").unwrap();
            assert!(family.starts_with("yamabico.") && version.parse::<u32>().is_ok(), "{}", message.name);
            assert!(ALL[..i].iter().all(|other| other.name != message.name));
            assert_eq!(MessageType::find(message.name), Some(message));
        }
    }

    /// A changed layout needs a new version in the name of its header.
    #[test]
    fn layouts_belong_to_their_versions() {
        let mut layouts = String::new();
        for message in ALL {
            let header = vec![0; message.header_size];
            let items = vec![0; if message.item_size > 1 { message.item_size } else { 0 }];
            let json = message.to_json(&header, &items);
            let keys = |json: &serde_json::Value| {
                json.as_object().map_or_else(String::new, |o| o.keys().cloned().collect::<Vec<_>>().join(" "))
            };
            layouts += &format!("{}: {} + {}\n", message.name, message.header_size, message.item_size);
            layouts += &format!("  {}\n", keys(&json));
            if let Some(item) = json.get("items").and_then(|items| items.get(0)) {
                layouts += &format!("  items: {}\n", keys(item));
            }
        }
        insta::assert_snapshot!(layouts);
    }

    #[test]
    fn a_list_becomes_json_with_its_items() {
        let scan = RangeScanHeader { stamp_ns: 7, max_m: 3.0, ..Default::default() };
        let beams =
            [Beam { range_m: 0.4, ..Default::default() }, Beam { flags: NO_ECHO, ..Default::default() }];
        let json = MessageType::of::<RangeScanHeader>()
            .to_json(bytemuck::bytes_of(&scan), bytemuck::cast_slice(&beams));
        assert_eq!(json["stamp_ns"], 7);
        assert_eq!(json["items"][0]["range_m"], 0.4);
        assert_eq!(json["items"].as_array().unwrap().len(), 2);
    }

    #[test]
    fn an_unknown_version_is_reported_with_the_known_one() {
        let problem = MessageType::unknown("yamabico.Odometry.v9");
        assert!(
            problem.contains("yamabico.Odometry.v9") && problem.contains("yamabico.Odometry.v1"),
            "{problem}"
        );
        assert!(MessageType::unknown("yamabico.Smell.v1").contains("is unknown"));
    }

    #[test]
    fn wrong_sizes_are_null_and_not_a_panic() {
        let odometry = MessageType::of::<Odometry>();
        assert!(odometry.to_json(&[1, 2, 3], &[]).is_null());
        assert_eq!((odometry.stamps)(&[]), (Time::ZERO, Time::ZERO));
        assert_eq!((odometry.sequence)(&[1]), 0);
    }

    #[test]
    fn a_sequence_is_read_from_bytes() {
        let clock = Clock { step: 9, ..Default::default() };
        assert_eq!((MessageType::of::<Clock>().sequence)(bytemuck::bytes_of(&clock)), 9);
    }
}
